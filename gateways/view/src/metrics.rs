//! [`text`]: the robots as metrics, for Prometheus and what else reads OpenMetrics 1.0. Pure: models in, text out.
//!
//! A value that is not known is left out, never 0. Rates are those of the counters.

use std::fmt::Write;

use ipc_types::MonotonicNs;
use ipc_types::code::LinkState;
use ipc_types::payload::ModuleState;
use operator::robot::model::{Process, WatchedRobot};

/// Where they are.
pub(crate) const PATH: &str = "/metrics";

/// What the answer is.
pub(crate) const CONTENT_TYPE: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Gauge,
    Counter,
}

/// A family: its name, which ends with its unit if it has one, and its value of a robot.
struct Family {
    name: &'static str,
    unit: &'static str,
    kind: Kind,
    help: &'static str,
    value: fn(&WatchedRobot, MonotonicNs) -> Option<f64>,
}

/// One row a family: name, unit, kind, value, help.
macro_rules! families {
    ($($name:literal $unit:literal $kind:ident $value:expr, $help:literal;)*) => {
        &[$(Family { name: $name, unit: $unit, kind: Kind::$kind, help: $help, value: $value }),*]
    };
}

fn flag(is_so: bool) -> f64 {
    f64::from(u8::from(is_so))
}

/// Seconds since a moment of the host; `None` when that is never, or in the future.
fn age(at_ns: u64, now: MonotonicNs) -> Option<f64> {
    (at_ns > 0 && at_ns <= now.0).then(|| now.since(MonotonicNs(at_ns)).as_secs_f64())
}

fn of_state(robot: &WatchedRobot, value: impl Fn(&ModuleState) -> f64) -> Option<f64> {
    robot.state.as_ref().map(value)
}

const FAMILIES: &[Family] = families! {
    "hero_bridge_up" "" Gauge |robot, now| Some(flag(robot.process(Process::Bridge, now).is_fresh())),
        "Whether the bridge says how it is.";
    "hero_bridge_age_seconds" "seconds" Gauge |robot, now| age(robot.state?.published_ns, now),
        "Age of the newest state of the bridge.";
    "hero_telemetry_age_seconds" "seconds" Gauge |robot, now| age(robot.pilot.received?.0, now),
        "Age of the newest telemetry.";
    "hero_telemetry_lost" "" Counter |robot, _| Some(robot.lost as f64),
        "Samples of telemetry that this view lost.";
    "hero_telemetry_published" "" Counter |robot, _| of_state(robot, |state| state.link.telemetry_published.into()),
        "Samples of raw telemetry that the bridge published.";
    "hero_telemetry_incoherent" "" Counter |robot, _| of_state(robot, |state| state.link.telemetry_incoherent.into()),
        "Status messages that coherence in time dropped.";
    "hero_link_up" "" Gauge |robot, _| of_state(robot, |state| flag(state.link.state() == Some(LinkState::Up))),
        "Whether the link to the DSP is up.";
    "hero_link_message_age_seconds" "seconds" Gauge |robot, now| age(robot.state?.link.last_message_ns, now),
        "Age of the newest message of the DSP.";
    "hero_link_received_bytes" "bytes" Counter |robot, _| of_state(robot, |state| state.link.bytes_received as f64),
        "Bytes that came from the DSP.";
    "hero_link_messages" "" Counter |robot, _| of_state(robot, |state| state.link.messages_received as f64),
        "Valid messages that came from the DSP.";
    "hero_link_refused" "" Counter |robot, _| of_state(robot, |state| {
            let refused = &state.refused;
            [refused.stray, refused.unknown_header, refused.truncated, refused.checksum, refused.padding, refused.value]
                .into_iter().map(f64::from).sum()
        }),
        "What came from the DSP and was discarded.";
    "hero_link_commands_acknowledged" "" Counter |robot, _| of_state(robot, |state| state.link.commands_acknowledged.into()),
        "Commands that the DSP acknowledged.";
    "hero_link_commands_repeated" "" Counter |robot, _| of_state(robot, |state| state.link.commands_repeated.into()),
        "Commands that were sent again.";
    "hero_link_commands_failed" "" Counter |robot, _| of_state(robot, |state| state.link.commands_failed.into()),
        "Commands that were given up.";
    "hero_link_port_openings" "" Counter |robot, _| of_state(robot, |state| state.link.port_openings.into()),
        "How often the serial port was opened.";
    "hero_link_dsp_boots" "" Counter |robot, _| of_state(robot, |state| state.link.dsp_boots.into()),
        "How often the DSP was seen to boot.";
    "hero_safety_violated" "" Gauge |robot, _| of_state(robot, |state| flag(state.safety.rule != 0)),
        "Whether a rule of flight safety is violated.";
    "hero_safety_rule" "" Gauge |robot, _| of_state(robot, |state| state.safety.rule.into()),
        "Number of the most severe rule that is violated, 0 when none is.";
    "hero_alarms" "" Gauge |robot, _| Some(robot.alarms.lasting().count() as f64),
        "Alarms that last.";
    "hero_waypoints_queued" "" Gauge |robot, _| of_state(robot, |state| {
            f64::from(state.movement.waypoints_total.saturating_sub(state.movement.waypoints_reached))
        }),
        "Waypoints of the path under way that are not reached.";
    "hero_flying" "" Gauge |robot, _| robot.pilot.flying.map(flag),
        "Whether the helicopter flies, as of the newest telemetry.";
    "hero_battery_volts" "volts" Gauge |robot, _| robot.pilot.battery_v,
        "Voltage of the battery.";
};

/// All robots.
pub(crate) fn text(robots: &[&WatchedRobot], now: MonotonicNs) -> String {
    let mut text = String::new();
    for family in FAMILIES {
        let (name, kind, suffix) = match family.kind {
            Kind::Gauge => (family.name, "gauge", ""),
            Kind::Counter => (family.name, "counter", "_total"),
        };
        // Writing to a string cannot fail.
        let _ = writeln!(text, "# TYPE {name} {kind}");
        if !family.unit.is_empty() {
            let _ = writeln!(text, "# UNIT {name} {}", family.unit);
        }
        let _ = writeln!(text, "# HELP {name} {}", family.help);
        for robot in robots {
            if let Some(value) = (family.value)(robot, now).filter(|value| value.is_finite()) {
                let _ = writeln!(
                    text,
                    "{name}{suffix}{{robot=\"{}\"}} {value}",
                    robot.id.get()
                );
            }
        }
    }
    text + "# EOF\n"
}

#[cfg(test)]
mod tests {
    use ipc_types::RobotId;

    use super::*;

    #[test]
    fn what_is_not_known_is_left_out_and_each_robot_has_its_line() {
        let now = MonotonicNs(10_000_000_000);
        let mut known = WatchedRobot::new(RobotId::new(2).unwrap());
        let mut state = ModuleState {
            published_ns: 9_500_000_000,
            ..ModuleState::default()
        };
        state.link.state = LinkState::Up.code();
        state.link.bytes_received = 1 << 40;
        state.refused.checksum = 3;
        known.state = Some(state);
        let unknown = WatchedRobot::new(RobotId::DEFAULT);
        let text = text(&[&unknown, &known], now);
        for line in [
            "# TYPE hero_bridge_age_seconds gauge\n# UNIT hero_bridge_age_seconds seconds\n",
            "\nhero_bridge_age_seconds{robot=\"2\"} 0.5\n",
            "\nhero_link_received_bytes_total{robot=\"2\"} 1099511627776\n",
            "\nhero_link_refused_total{robot=\"2\"} 3\n",
            "\nhero_link_up{robot=\"2\"} 1\n",
            "\nhero_bridge_up{robot=\"1\"} 0\n",
        ] {
            assert!(text.contains(line), "{line}{text}");
        }
        for missing in ["hero_link_up{robot=\"1\"}", "hero_battery_volts{", "NaN"] {
            assert!(!text.contains(missing), "{missing}: {text}");
        }
        assert!(text.ends_with("\n# EOF\n"));
    }

    #[test]
    fn names_are_by_the_conventions() {
        for family in FAMILIES {
            assert!(family.name.starts_with("hero_"), "{}", family.name);
            assert!(family.name.ends_with(family.unit), "{}", family.name);
            assert!(!family.name.ends_with("_total"), "{}", family.name);
        }
    }
}
