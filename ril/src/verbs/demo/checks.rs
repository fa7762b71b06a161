//! The judgement of a demonstration: from what a consumer saw to a list of findings with figures. Pure.

use ipc_types::code::{Functionality, ModuleStatus};
use runtime::finding::{Finding, Severity};

use super::seen::{LossCounts, Seen};

/// How near a consumer must have seen the helicopter to each waypoint, m: the acceptance radius that the DSP is given
/// (1 m), and what the noise of a simulated GPS and the time between two samples add.
const TOLERANCE_M: f64 = 1.5;

/// Everything that is judged.
pub(super) struct Evidence<'a> {
    /// How many commands there are to give.
    pub orders: usize,
    /// How many of them ended with 0.
    pub orders_done: usize,
    /// The command that did not, and what it said.
    pub order_failed: Option<&'a str>,
    /// What the consumer saw.
    pub seen: &'a Seen,
    /// Rows of the log, the line of names not counted; `None` if it could not be read.
    pub log_rows: Option<u64>,
    /// What `ril log check` says of the flight record; `None` if there is none that can be read.
    pub record: Option<RecordEvidence>,
    /// Exit codes of the processes, by name.
    pub exits: &'a [(&'static str, Option<i32>)],
    /// How many processes were started.
    pub processes: usize,
    /// What is left in shared memory.
    pub residue: usize,
}

/// What a flight record has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct RecordEvidence {
    /// Whether it is complete, and says of each missing message that it is missing.
    pub is_in_order: bool,
    /// Messages of raw telemetry, of the robot's telemetry, and states of the bridge.
    pub messages: [u64; 3],
    /// How many of these three the record says that it does not have, because it joined late or could not keep up.
    pub reported_missing: u64,
}

/// The states that a mission goes through: waiting, started, and one pair of running and ended for each movement.
const EXPECTED_STATES: [(ModuleStatus, Functionality); 14] = {
    use Functionality::{AtRest, FollowingPath, Landing, ReceivingPath, Stopping, TakingOff};
    use ModuleStatus::{Ended, Running, WaitingDataToStart};
    [
        (WaitingDataToStart, AtRest),
        (Running, AtRest),
        (Running, TakingOff),
        (Ended, AtRest),
        (Ended, ReceivingPath),
        (Running, FollowingPath),
        (Ended, AtRest),
        (Ended, ReceivingPath),
        (Running, FollowingPath),
        (Ended, AtRest),
        (Running, Landing),
        (Ended, AtRest),
        (Ended, Stopping),
        (Ended, AtRest),
    ]
};

/// Judges the evidence.
pub(super) fn judge(evidence: &Evidence<'_>) -> Vec<Finding> {
    let residue = evidence.residue;
    vec![
        orders(evidence),
        waypoints(evidence.seen),
        states(evidence.seen),
        losses(evidence.seen.counts),
        line(evidence.seen),
        log(evidence),
        record(evidence),
        landed(evidence.seen),
        exits(evidence),
        check(
            "nothing left in shared memory",
            residue == 0,
            format!("{residue} files and segments left"),
        ),
    ]
}

/// A finding that passed or failed.
pub(super) fn check(id: &'static str, passed: bool, figures: String) -> Finding {
    let severity = match passed {
        true => Severity::Note,
        false => Severity::Error,
    };
    Finding::new(severity, id, figures)
}

fn orders(evidence: &Evidence<'_>) -> Finding {
    let (done, all) = (evidence.orders_done, evidence.orders);
    let figures = match evidence.order_failed {
        None => format!("{done} of {all} done"),
        Some(failed) => failed.to_owned(),
    };
    let passed = done == all && evidence.order_failed.is_none();
    check("every order done", passed, figures)
}

fn waypoints(seen: &Seen) -> Finding {
    let (reached, expected) = (seen.approaches_m.len(), seen.waypoints.len());
    let worst = seen.approaches_m.iter().copied().fold(0.0, f64::max);
    check(
        "waypoints reached in order",
        expected > 0 && reached == expected && worst <= TOLERANCE_M,
        format!("{reached} of {expected}, each within {worst:.2} m (tolerance {TOLERANCE_M} m)"),
    )
}

/// States are published at every change, but a consumer that comes late or a state that lasts for one call of the core
/// may miss some of the short ones. So those seen must be a part of the expected, in order, with all that last.
fn states(seen: &Seen) -> Finding {
    use Functionality::{FollowingPath, Landing, TakingOff};
    let mut expected = EXPECTED_STATES.iter();
    let mut states = seen.states.iter();
    let in_order = states.all(|state| expected.any(|next| next == state));
    let movements = seen
        .states
        .iter()
        .filter(|(_, functionality)| matches!(functionality, TakingOff | FollowingPath | Landing));
    let movements = movements.count();
    let ended = seen.states.last() == EXPECTED_STATES.last();
    check(
        "states in the right order",
        in_order && movements == 4 && ended,
        format!("{} states, {movements} movements", seen.states.len()),
    )
}

fn losses(LossCounts { dsp, hero, state }: LossCounts) -> Finding {
    let lost = dsp.lost + hero.lost + state.lost;
    check(
        "no sample lost",
        lost == 0 && dsp.received > 0 && hero.received > 0 && state.received > 0,
        format!(
            "{} raw, {} robot, {} states received, {lost} lost",
            dsp.received, hero.received, state.received
        ),
    )
}

fn line(seen: &Seen) -> Finding {
    const ID: &str = "line without faults";
    let Some(state) = &seen.state else {
        return check(ID, false, "no state was published".to_owned());
    };
    let (link, refused) = (&state.link, &state.refused);
    let faults = refused.stray
        + refused.unknown_header
        + refused.truncated
        + refused.checksum
        + refused.padding
        + refused.value
        + refused.implausible_groups
        + link.telemetry_incoherent;
    check(
        ID,
        faults == 0 && link.commands_failed == 0,
        format!(
            "{} messages, {} commands acknowledged, {} repeated, {faults} refused",
            link.messages_received, link.commands_acknowledged, link.commands_repeated
        ),
    )
}

fn log(evidence: &Evidence<'_>) -> Finding {
    let last = evidence.seen.hero.unwrap_or_default();
    let (published, received) = (last.sequence, last.source_sequence);
    check(
        "log rows equal samples published",
        published > 0 && evidence.log_rows == Some(published) && received == published,
        match evidence.log_rows {
            Some(rows) => {
                format!("{rows} rows, {published} samples by status, {received} by the bridge")
            }
            None => "there is no log".to_owned(),
        },
    )
}

fn record(evidence: &Evidence<'_>) -> Finding {
    const ID: &str = "every sample is in the record";
    let Some(record) = evidence.record else {
        return check(ID, false, "there is no record".to_owned());
    };
    let LossCounts { dsp, hero, state } = evidence.seen.counts;
    let received = [dsp, hero, state].map(|losses| losses.received);
    let missing = received.into_iter().zip(record.messages);
    let missing: u64 = missing
        .map(|(received, recorded)| received.saturating_sub(recorded))
        .sum();
    let reported = match record.reported_missing {
        0 => String::new(),
        number => format!(", {number} reported as missing"),
    };
    let state_of_file = match record.is_in_order {
        true => "complete",
        false => "not complete",
    };
    let [dsp, hero, states] = record.messages;
    check(
        ID,
        record.is_in_order && missing <= record.reported_missing,
        format!("{dsp} raw, {hero} robot, {states} states{reported}, {state_of_file}"),
    )
}

fn landed(seen: &Seen) -> Finding {
    let is_on_ground = seen.hero.is_some_and(|sample| !sample.is_flying());
    check(
        "flew and landed",
        seen.ever_flew && is_on_ground,
        format!("{:.1} m at the highest", seen.highest_m),
    )
}

fn exits(evidence: &Evidence<'_>) -> Finding {
    let exits = evidence.exits.iter();
    let texts: Vec<String> = exits
        .clone()
        .map(|(name, code)| match code {
            Some(code) => format!("{name} {code}"),
            None => format!("{name} killed"),
        })
        .collect();
    check(
        "every process ended with 0",
        exits.len() == evidence.processes && exits.clone().all(|(_, code)| *code == Some(0)),
        texts.join(", "),
    )
}

#[cfg(test)]
mod tests {
    use dsp_protocol::Waypoint;
    use ipc_types::payload::{HeroTelemetry, ModuleState};
    use ipc_types::{Losses, MonotonicNs, TelemetryGroup};

    use super::super::script::waypoints_of;
    use super::*;

    const HOME: Waypoint = Waypoint {
        latitude_deg: 37.0,
        longitude_deg: -6.0,
        altitude_m: 10.0,
    };

    /// What a consumer sees of a flight through the mission's waypoints, changed by `change`.
    fn flight(change: impl FnOnce(&mut Vec<Waypoint>)) -> Seen {
        let mut points = waypoints_of(&HOME).concat();
        let received = |received| Losses {
            received,
            ..Losses::default()
        };
        let mut seen = Seen {
            home: Some(HOME),
            waypoints: points.clone(),
            counts: LossCounts {
                dsp: received(7),
                hero: received(7),
                state: received(9),
            },
            ..Seen::default()
        };
        change(&mut points);
        for (status, functionality) in EXPECTED_STATES {
            seen.state(&state(status, functionality));
        }
        let on_ground = (points[points.len() - 1], 0);
        let points = points.into_iter().map(|point| (point, 1));
        for (sequence, (point, flying)) in (1..).zip(points.chain([on_ground])) {
            let mut sample = HeroTelemetry {
                sequence,
                source_sequence: sequence,
                flying,
                valid_groups: u32::from(TelemetryGroup::Geographic.bit()),
                ..HeroTelemetry::default()
            };
            sample.geodetic.latitude_rad = point.latitude_deg.to_radians();
            sample.geodetic.longitude_rad = point.longitude_deg.to_radians();
            sample.geodetic.altitude_m = point.altitude_m;
            seen.hero(&sample, MonotonicNs(0));
        }
        seen
    }

    fn state(status: ModuleStatus, functionality: Functionality) -> ModuleState {
        ModuleState {
            status: status.code(),
            functionality: functionality.code(),
            ..ModuleState::default()
        }
    }

    /// Judges the flight `seen` after `spoil` has changed the other evidence; returns the names of the failed checks.
    fn failed(seen: Seen, spoil: fn(&mut Evidence<'_>)) -> Vec<&'static str> {
        let exits = ["bridge", "status", "sim", "record"].map(|name| (name, Some(0)));
        let mut evidence = Evidence {
            orders: 6,
            orders_done: 6,
            order_failed: None,
            seen: &seen,
            log_rows: Some(7),
            record: Some(RecordEvidence {
                is_in_order: true,
                messages: [7, 8, 9],
                reported_missing: 0,
            }),
            exits: &exits,
            processes: 4,
            residue: 0,
        };
        spoil(&mut evidence);
        let findings = judge(&evidence).into_iter();
        let failed = findings.filter(|finding| finding.severity > Severity::Note);
        failed.map(|finding| finding.id).collect()
    }

    #[test]
    fn a_good_flight_passes_and_each_fault_fails_its_own_check() {
        type Change = fn(&mut Evidence<'_>);
        #[rustfmt::skip]
        let cases: [(Change, &[&str]); 13] = [
            (|_| (), &[]),
            (|evidence| evidence.orders_done = 5, &["every order done"]),
            (|evidence| evidence.order_failed = Some("takeoff: refused"), &["every order done"]),
            (|evidence| evidence.log_rows = Some(6), &["log rows equal samples published"]),
            (|evidence| evidence.log_rows = None, &["log rows equal samples published"]),
            (|evidence| evidence.record = None, &["every sample is in the record"]),
            (|evidence| evidence.record.as_mut().unwrap().is_in_order = false, &["every sample is in the record"]),
            (|evidence| evidence.record.as_mut().unwrap().messages[0] = 6, &["every sample is in the record"]),
            (|evidence| evidence.record.as_mut().unwrap().messages[2] = 8, &["every sample is in the record"]),
            (
                |evidence| {
                    evidence.record = Some(RecordEvidence {
                        is_in_order: true,
                        messages: [6, 8, 8],
                        reported_missing: 2,
                    });
                },
                &[],
            ),
            (|evidence| evidence.residue = 1, &["nothing left in shared memory"]),
            (|evidence| evidence.exits = &[("bridge", None)], &["every process ended with 0"]),
            (
                |evidence| {
                    const CODES: [(&str, Option<i32>); 4] = [
                        ("bridge", Some(0)),
                        ("status", Some(0)),
                        ("sim", Some(1)),
                        ("record", Some(0)),
                    ];
                    evidence.exits = &CODES;
                },
                &["every process ended with 0"],
            ),
        ];
        for (index, (spoil, expected)) in cases.into_iter().enumerate() {
            assert_eq!(failed(flight(|_| ()), spoil), expected, "case {index}");
        }
    }

    #[test]
    fn each_fault_that_a_consumer_sees_fails_its_own_check() {
        type Change = fn(&mut Seen);
        let cases: [(Change, &[&str]); 4] = [
            (|seen| seen.counts.hero.lost = 1, &["no sample lost"]),
            (
                |seen| seen.state(&state(ModuleStatus::Aborted, Functionality::AtRest)),
                &["states in the right order"],
            ),
            (
                |seen| seen.state.as_mut().unwrap().refused.checksum = 1,
                &["line without faults"],
            ),
            (
                |seen| seen.hero.as_mut().unwrap().flying = 1,
                &["flew and landed"],
            ),
        ];
        for (spoil, expected) in cases {
            let mut seen = flight(|_| ());
            spoil(&mut seen);
            assert_eq!(failed(seen, |_| ()), expected);
        }
        let wrong_way_round = flight(|points| points.swap(0, 2));
        let one_missing = flight(|points| points[1] = points[0]);
        for seen in [wrong_way_round, one_missing] {
            assert_eq!(failed(seen, |_| ()), ["waypoints reached in order"]);
        }
    }
}
