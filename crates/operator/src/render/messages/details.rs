//! What a report is about: rule, leg or waypoint, amount, DSP error, port.
//!
//! Any bit pattern may lie in shared memory: a number that is not in the contract is shown as that number, and a name
//! that could harm a terminal is not shown.

use dsp_protocol::DspErrorCode;
use ipc_types::code::{PortKind, Reason, SafetyAction, SafetyRule};
use ipc_types::payload::{PortInfo, RequestReport, SafetyState};
use runtime::finding::Severity;

use crate::render::words::distance;

/// Unit of the amount by which a rule is broken; `None` for a rule without an amount.
pub const fn unit(rule: SafetyRule) -> Option<&'static str> {
    match rule {
        SafetyRule::PilotSwitch | SafetyRule::FenceUnjudgeable => None,
        SafetyRule::FenceInclusion
        | SafetyRule::FenceExclusion
        | SafetyRule::FenceFloor
        | SafetyRule::FenceCeiling
        | SafetyRule::FenceAhead
        | SafetyRule::BelowTakeOff => Some("m"),
        SafetyRule::Battery => Some("V"),
        SafetyRule::Fuel => Some("%"),
        SafetyRule::LinkLoss | SafetyRule::PositionLost => Some("s"),
    }
}

/// By how much `rule` is broken, such as `by 4.2 m`; `None` if it has no amount.
pub fn amount(rule: SafetyRule, amount: f64) -> Option<String> {
    let unit = unit(rule)?;
    // A breach of centimetres must not look like none.
    let decimals = if amount.abs() < 0.1 { 3 } else { 1 };
    amount
        .is_finite()
        .then(|| format!("by {amount:.decimals$} {unit}"))
}

/// A safety rule that is broken now.
#[derive(Clone, Debug, PartialEq)]
pub struct BrokenRule {
    /// Its name, or a number that is not in the contract.
    pub name: String,
    /// By how much, with a space in front; empty if it has no amount.
    pub by: String,
    /// What the bridge does about it.
    pub action: &'static str,
    /// How bad that is.
    pub severity: Severity,
    /// All of it in plain words, with the rule's name at the end.
    pub words: String,
    /// The words without the amount, which changes at every look.
    pub words_without_amount: String,
}

/// What it is to break a rule.
const fn meaning(rule: SafetyRule) -> &'static str {
    match rule {
        SafetyRule::PilotSwitch => "the pilot's switch is on manual",
        SafetyRule::FenceInclusion => "outside the fence",
        SafetyRule::FenceExclusion => "inside an exclusion area",
        SafetyRule::FenceFloor => "below the floor of the fence",
        SafetyRule::FenceCeiling => "above the ceiling of the fence",
        SafetyRule::FenceUnjudgeable => "where the fence cannot judge",
        SafetyRule::Battery => "battery below its limit",
        SafetyRule::Fuel => "fuel below its limit",
        SafetyRule::LinkLoss => "the link to the DSP was lost",
        SafetyRule::PositionLost => "the position is lost",
        SafetyRule::FenceAhead => "too near to the fence to stop before it",
        SafetyRule::BelowTakeOff => "below the ground of the take-off",
    }
}

/// What the bridge does.
const fn doing(action: SafetyAction) -> &'static str {
    match action {
        SafetyAction::Warn => "the bridge warns only",
        SafetyAction::Refuse => "no new movement is taken but a landing",
        SafetyAction::Hold => "the path is ended and the helicopter hovers",
        SafetyAction::Land => "the helicopter is landed",
    }
}

/// The rule that is broken now; `None` if none is.
pub fn broken_rule(safety: &SafetyState) -> Option<BrokenRule> {
    let rule = safety.rule();
    let by = rule.and_then(|rule| amount(rule, safety.amount));
    let name = rule.map_or_else(|| format!("rule {}", safety.rule), |rule| rule.to_string());
    let by = by.map_or_else(String::new, |by| format!(" {by}"));
    let meaning = rule.map_or("a rule that is not known here is broken", meaning);
    let doing = safety
        .action()
        .map_or("the bridge's action is not known here", doing);
    (safety.rule != 0).then(|| BrokenRule {
        words: format!("{meaning}{by}: {doing} ({name})"),
        words_without_amount: format!("{meaning}: {doing} ({name})"),
        name,
        by,
        action: safety.action().map_or("unknown action", SafetyAction::name),
        severity: match safety.action() {
            Some(SafetyAction::Warn) => Severity::Warning,
            _ => Severity::Error,
        },
    })
}

/// A DSP error as the DSP sent it, with its meaning: `dsp-error-30 (invalid command)`, `dsp-error-777 (unknown)`.
pub fn dsp_error(code: u32) -> String {
    let known = u16::try_from(code).map(DspErrorCode);
    match known {
        Ok(known) if known.counter_index().is_some() => {
            format!("dsp-error-{code} ({})", known.text())
        }
        _ => format!("dsp-error-{code} (unknown)"),
    }
}

/// Everything that a report adds to its reason, separated by commas; `None` if it adds nothing.
pub fn details(report: &RequestReport) -> Option<String> {
    let rule = report.rule();
    let place = match (report.waypoint, report.rule) {
        (0, _) => None,
        (number, 0) => Some(format!("waypoint {number}")),
        (number, _) => Some(format!("leg {number}")),
    };
    let rule_name = match (rule, report.rule) {
        (Some(rule), _) => Some(rule.name().to_owned()),
        (None, 0) => None,
        (None, number) => Some(format!("rule {number}")),
    };
    let area = report.area().map(|area| format!("area `{area}`"));
    let by = rule
        .zip(report.value())
        .and_then(|(rule, value)| amount(rule, value));
    let value = report.value().filter(|value| value.is_finite());
    let excess = match report.reason() {
        Some(Reason::TooLate) => value.map(|late_s| format!("{late_s:.1} s late")),
        Some(Reason::TooFar) => value.map(|metres| match report.port.max {
            most_m if most_m > 0.0 && most_m.is_finite() => {
                format!("{} away (limit {})", distance(metres), distance(most_m))
            }
            _ => format!("{} away", distance(metres)),
        }),
        _ => None,
    };
    let error = report.dsp_error().map(dsp_error);
    let between = report.in_between();
    // It names the rule itself.
    let rule_name = rule_name.filter(|_| between.is_none());
    let between = between.map(|what| format!("before it came {what}"));
    let parts: Vec<String> = [rule_name, area, place, by, excess, error, between]
        .into_iter()
        .flatten()
        .collect();
    (!parts.is_empty()).then(|| parts.join(", "))
}

/// The port's name, if it is one that can be shown.
pub fn port_name(port: &PortInfo) -> Option<&str> {
    port.name()
        .filter(|name| !name.is_empty() && name.bytes().all(|byte| byte.is_ascii_graphic()))
}

/// What to call the port: its name, or else its number.
pub fn port_label(port: &PortInfo) -> String {
    port_name(port).map_or_else(|| format!("port {}", port.number), str::to_owned)
}

/// A value of the port with its own digits: 0.1 and not 0.10000000149011612, which a 32-bit float is in 64 bits.
pub fn port_value(port: &PortInfo, value: f64) -> f64 {
    match port.kind() {
        Some(PortKind::F32) => (value as f32).to_string().parse().unwrap_or(value),
        _ => value,
    }
}

/// From where to where the port's values go, such as `0.1 to 20`.
pub fn port_range(port: &PortInfo) -> String {
    let [min, max] = [port.min, port.max].map(|end| port_value(port, end));
    format!("{min} to {max}")
}

/// The line over the rows of [`port_row`].
pub fn port_header() -> String {
    row([
        "NUMBER", "NAME", "VALUE", "UNIT", "KIND", "RANGE", "WRITABLE",
    ])
}

/// One port of the list as a line for people, with the value that the DSP has.
pub fn port_row(port: &PortInfo, value: Option<f64>) -> String {
    let writable = port.access & PortInfo::WRITABLE != 0;
    let in_flight = port.access & PortInfo::WRITABLE_IN_FLIGHT != 0;
    let value = value.map_or_else(
        || "-".to_owned(),
        |value| port_value(port, value).to_string(),
    );
    row([
        &port.number.to_string(),
        port_name(port).unwrap_or("-"),
        &value,
        port_unit(port),
        port.kind().map_or("-", PortKind::name),
        &port_range(port),
        match (writable, in_flight) {
            (false, _) => "no",
            (true, false) => "on the ground",
            (true, true) => "yes",
        },
    ])
}

/// The unit that the name of a port ends with; a dash when there is none.
pub fn port_unit(port: &PortInfo) -> &'static str {
    const UNITS: [(&str, &str); 7] = [
        ("_mps", "m/s"),
        ("_rpm", "rpm"),
        ("_deg", "deg"),
        ("_ms", "ms"),
        ("_us", "µs"),
        ("_m", "m"),
        ("_s", "s"),
    ];
    let name = port_name(port).unwrap_or_default();
    let unit = UNITS.iter().find(|(end, _)| name.ends_with(end));
    unit.map_or("-", |(_, unit)| unit)
}

/// The longest name of a port has 32 bytes; those of today have up to 22. With those a line has 79 characters.
fn row([number, name, value, unit, kind, range, writable]: [&str; 7]) -> String {
    format!("{number:<6} {name:<22} {value:<9} {unit:<5} {kind:<4} {range:<14} {writable}")
}

#[cfg(test)]
mod tests {
    use ipc_types::code::Stage;

    use super::*;

    fn report() -> RequestReport {
        RequestReport::new(Stage::Refused, Reason::None)
    }

    fn breach(rule: SafetyRule, waypoint: u32, value: f64) -> RequestReport {
        RequestReport {
            rule: rule.code(),
            waypoint,
            value,
            value_valid: 1,
            ..report()
        }
    }

    #[test]
    fn a_breach_names_rule_leg_and_amount_with_its_unit() {
        for (report, expected) in [
            (
                breach(SafetyRule::FenceCeiling, 3, 4.2),
                "fence-ceiling, leg 3, by 4.2 m",
            ),
            (
                breach(SafetyRule::FenceInclusion, 1, 0.02),
                "fence-inclusion, leg 1, by 0.020 m",
            ),
            (breach(SafetyRule::Battery, 0, 0.3), "battery, by 0.3 V"),
            (breach(SafetyRule::Fuel, 0, 5.0), "fuel, by 5.0 %"),
            (breach(SafetyRule::LinkLoss, 0, 2.0), "link-loss, by 2.0 s"),
            (
                breach(SafetyRule::PositionLost, 0, 5.0),
                "position-lost, by 5.0 s",
            ),
            (breach(SafetyRule::PilotSwitch, 0, 1.0), "pilot-switch"),
            (
                breach(SafetyRule::FenceFloor, 2, f64::NAN),
                "fence-floor, leg 2",
            ),
        ] {
            assert_eq!(details(&report).as_deref(), Some(expected));
        }
        let mut of_area = breach(SafetyRule::FenceExclusion, 1, 3.0);
        of_area.port.name = PortInfo::name_bytes("north mast");
        let expected = "fence-exclusion, area `north mast`, leg 1, by 3.0 m";
        assert_eq!(details(&of_area).as_deref(), Some(expected));
        let later = RequestReport {
            rule: 99,
            waypoint: 1,
            ..report()
        };
        assert_eq!(details(&later).as_deref(), Some("rule 99, leg 1"));
    }

    #[test]
    fn a_refusal_by_the_dsp_names_waypoint_and_error() {
        let refused = |code| RequestReport {
            waypoint: 7,
            dsp_error_code: code,
            dsp_error_valid: 1,
            ..report()
        };
        for (code, expected) in [
            (30, "waypoint 7, dsp-error-30 (invalid command)"),
            (777, "waypoint 7, dsp-error-777 (unknown)"),
            (0, "waypoint 7, dsp-error-0 (unknown)"),
            (u32::MAX, "waypoint 7, dsp-error-4294967295 (unknown)"),
        ] {
            assert_eq!(details(&refused(code)).as_deref(), Some(expected));
        }
        assert_eq!(details(&report()), None);
    }

    #[test]
    fn a_port_whose_name_could_harm_a_terminal_is_called_by_its_number() {
        let port = |name: &str| {
            let mut port = PortInfo {
                number: 20_000,
                ..PortInfo::default()
            };
            port.name[..name.len()].copy_from_slice(name.as_bytes());
            port
        };
        assert_eq!(port_label(&port("cruise_speed_mps")), "cruise_speed_mps");
        for name in ["", "\u{1b}[2J", "two words", "señal"] {
            assert_eq!(port_label(&port(name)), "port 20000", "{name:?}");
        }
    }

    #[test]
    fn a_request_that_is_too_late_says_by_how_much() {
        let report = RequestReport {
            value: 7.04,
            value_valid: 1,
            ..RequestReport::new(Stage::Refused, Reason::TooLate)
        };
        assert_eq!(details(&report).as_deref(), Some("7.0 s late"));
    }

    #[test]
    fn a_waypoint_that_is_too_far_says_how_far() {
        let report = RequestReport {
            value: 4_810_400.0,
            value_valid: 1,
            waypoint: 1,
            ..RequestReport::new(Stage::Refused, Reason::TooFar)
        };
        assert_eq!(
            details(&report).as_deref(),
            Some("waypoint 1, 4810 km away")
        );
        let mut limited = report;
        limited.port.max = 2_000.0;
        assert_eq!(
            details(&limited).as_deref(),
            Some("waypoint 1, 4810 km away (limit 2000 m)")
        );
    }

    #[test]
    fn a_32_bit_value_keeps_its_own_digits() {
        let port = PortInfo {
            min: f64::from(0.05_f32),
            max: f64::from(10.0_f32),
            kind: PortKind::F32.code(),
            ..PortInfo::default()
        };
        assert_eq!(port_range(&port), "0.05 to 10");
        assert_eq!(port_value(&port, f64::from(0.8_f32)), 0.8);
        assert!(port_value(&port, f64::NAN).is_nan());
    }

    #[test]
    fn the_list_says_who_may_write_what_and_when() {
        let port = |access| PortInfo {
            min: -500.0,
            max: 500.0,
            number: 10_203,
            kind: PortKind::I16.code(),
            access,
            count: 1,
            name: PortInfo::name_bytes("trim_tail_us"),
        };
        for (access, expected) in [
            (0, "no"),
            (PortInfo::WRITABLE, "on the ground"),
            (PortInfo::WRITABLE | PortInfo::WRITABLE_IN_FLIGHT, "yes"),
            (PortInfo::WRITABLE_IN_FLIGHT, "no"),
        ] {
            let row = port_row(&port(access), Some(-40.0));
            let words: Vec<&str> = row.split_whitespace().collect();
            assert_eq!(
                words[..7],
                ["10203", "trim_tail_us", "-40", "µs", "i16", "-500", "to"]
            );
            assert!(row.chars().count() <= 80, "{row}");
            assert!(row.ends_with(&format!(" {expected}")), "{row}");
            let column = row.find(expected).map(|byte| row[..byte].chars().count());
            assert_eq!(column, port_header().find("WRITABLE"), "{row}");
        }
    }
}
