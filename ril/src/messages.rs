//! Reports as messages: a line for people, an object for programs, an exit code for scripts.
//!
//! Pure functions over values; nothing is printed here. [`mod@details`] says which rule, waypoint, amount or DSP error a report
//! is about, [`object`] is the form for programs.

pub mod details;
pub mod object;

use ipc_types::code::{PortKind, Reason, Stage};
use ipc_types::payload::RequestReport;
use runtime::exit::ExitCode;

use details::{details, port_label, port_range, port_value};
pub use object::ReportObject;

/// Which command a report answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verb {
    /// `ril start`
    Start,
    /// `ril stop`
    Stop,
    /// `ril fence reload`
    ReloadFence,
    /// `ril takeoff`
    TakeOff,
    /// `ril land`
    Land,
    /// `ril hold`
    Hold,
    /// `ril goto`
    GoTo,
    /// `ril param list`
    ListParameters,
    /// `ril param get`
    GetParameter,
    /// `ril param set`
    SetParameter,
}

impl Verb {
    /// All commands that send requests.
    pub const ALL: [Verb; 10] = [
        Verb::Start,
        Verb::Stop,
        Verb::ReloadFence,
        Verb::TakeOff,
        Verb::Land,
        Verb::Hold,
        Verb::GoTo,
        Verb::ListParameters,
        Verb::GetParameter,
        Verb::SetParameter,
    ];

    /// The command's name.
    pub const fn name(self) -> &'static str {
        match self {
            Verb::Start => "start",
            Verb::Stop => "stop",
            Verb::ReloadFence => "fence reload",
            Verb::TakeOff => "takeoff",
            Verb::Land => "land",
            Verb::Hold => "hold",
            Verb::GoTo => "goto",
            Verb::ListParameters => "param list",
            Verb::GetParameter => "param get",
            Verb::SetParameter => "param set",
        }
    }

    /// What happens to an accepted request when the command that sent it ends.
    pub const fn goes_on(self) -> &'static str {
        match self {
            Verb::Start | Verb::Stop | Verb::ReloadFence => {
                "the bridge goes on with it; `ril state` shows how it ends"
            }
            Verb::TakeOff => {
                "the take-off goes on and cannot be aborted; `ril state` shows how it ends"
            }
            Verb::Land => {
                "the landing goes on and cannot be aborted; `ril state` shows how it ends"
            }
            Verb::Hold => {
                "the bridge goes on stopping the helicopter; `ril state` shows how it ends"
            }
            Verb::GoTo => {
                "the path is flown to its end; `ril hold` makes the helicopter hover at once"
            }
            Verb::ListParameters | Verb::GetParameter => "nothing was changed",
            Verb::SetParameter => {
                "the bridge may still write the port; `ril param get` shows the value that the DSP has"
            }
        }
    }

    const fn is_about_a_port(self) -> bool {
        matches!(
            self,
            Verb::ListParameters | Verb::GetParameter | Verb::SetParameter
        )
    }
}

/// A final report, whose stage is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FinalReport {
    /// One of the final stages.
    pub stage: Stage,
    /// Why; [`Reason::None`] also for a number that is not in the contract.
    pub reason: Reason,
    /// The whole report, for its details.
    pub report: RequestReport,
}

impl FinalReport {
    /// `report` if it is final; nothing when more follows.
    pub fn of(report: &RequestReport) -> Option<FinalReport> {
        let stage = report.stage().filter(|stage| stage.is_final())?;
        let reason = report.reason().unwrap_or(Reason::None);
        Some(FinalReport {
            stage,
            reason,
            report: *report,
        })
    }

    /// The exit code of a command whose request ended so.
    pub const fn exit_code(&self) -> ExitCode {
        exit_code(self.stage, self.reason)
    }
}

/// The exit code for a final report. After a stage that is not final the outcome is unknown.
pub const fn exit_code(stage: Stage, reason: Reason) -> ExitCode {
    match (stage, reason) {
        (Stage::Done, _) => ExitCode::Ok,
        (Stage::Refused | Stage::Aborted, Reason::LinkDown | Reason::LinkLost) => {
            ExitCode::LinkDown
        }
        (
            Stage::Aborted,
            Reason::DeadlineExpired
            | Reason::MovementTimeout
            | Reason::CommunicationFatalError
            | Reason::DeliveryFailed,
        ) => ExitCode::Timeout,
        (Stage::Refused | Stage::Aborted, _) => ExitCode::Refused,
        (Stage::Unknown | Stage::Accepted | Stage::Progress, _) => ExitCode::OutcomeUnknown,
    }
}

/// What the reason means, and what the operator can do.
pub const fn explain(reason: Reason) -> &'static str {
    match reason {
        Reason::None => "no reason was given",
        Reason::InvalidRequest => {
            "the request holds a number that the bridge does not know: install the same version of all programs"
        }
        Reason::NotFinite => "a coordinate or altitude is not finite",
        Reason::OutOfRange => {
            "a coordinate or altitude is out of range; the limits are in `[movement]` of bridge.toml"
        }
        Reason::TooFar => {
            "the waypoint is farther from the helicopter than `max_distance_m` in bridge.toml"
        }
        Reason::NotStarted => "the module has not been started, or was stopped: `ril start`",
        Reason::AlreadyRunning => {
            "the module is running: `ril stop` comes first if a restart is meant"
        }
        Reason::UnableToAbort => "a take-off or landing cannot be aborted: wait for its end",
        Reason::Busy => {
            "another movement or stop is under way: wait for its end, or replace a path with --preempt or `ril hold`"
        }
        Reason::LinkDown => {
            "the DSP cannot be reached: `ril state` shows the link, the bridge's log says why"
        }
        Reason::NotFlying => "the helicopter is on the ground: `ril takeoff` comes first",
        Reason::AlreadyFlying => "the helicopter is in the air already",
        Reason::NoPosition => {
            "the position is not known: `ril echo dsp --field geographic` shows it once the DSP sends it"
        }
        Reason::PathWithoutHead => "the waypoint belongs to a path that was never opened",
        Reason::PathReplaced => "another movement was begun before the path was complete",
        Reason::PathTooLong => "the path has too many waypoints: split it",
        Reason::PathBroken => "another waypoint of the path was refused, or its sender vanished",
        Reason::TooManyRequests => "the bridge has too many open requests: try again later",
        Reason::DeadlineExpired => "it did not begin on the DSP before its deadline",
        Reason::MovementTimeout => {
            "the movement took longer than `time_limit_s` in bridge.toml allows"
        }
        Reason::Stopped => "the module was stopped",
        Reason::DspFatalError => "the DSP reported a fatal error: `ril state` shows which",
        Reason::CommunicationFatalError => {
            "the DSP did not acknowledge, or the link broke: `ril state` shows the link"
        }
        Reason::DspRebooted => "the DSP rebooted",
        Reason::BridgeEnding => "the bridge was ended meanwhile",
        Reason::BridgeGone => "the bridge vanished: start it again and look at `ril state`",
        Reason::DeliveryFailed => {
            "waypoints did not reach the DSP although they were sent again: `ril state` shows the link"
        }
        Reason::RefusedByDsp => {
            "the DSP received the request and does not carry it out: `ril state` shows its errors"
        }
        Reason::Replaced => "another movement or `ril hold` took its place",
        Reason::PilotHasControl => {
            "the pilot's switch is on manual, so the pilot flies: movements are taken again when it is on auto"
        }
        Reason::FenceBreach => {
            "the geofence forbids it: see `[fence]` of bridge.toml, and `ril fence reload` after a change"
        }
        Reason::SupplyLow => {
            "battery or fuel is below its limit in `[safety]` of bridge.toml: land; `ril land` is always taken"
        }
        Reason::LinkLost => {
            "the link to the DSP was lost in flight: `ril state` shows whether the DSP stops by itself"
        }
        Reason::NoSuchPort => {
            "the port does not exist, or may not be written by request: `ril param list` shows all ports"
        }
        Reason::NotInFlight => "the port may not be written while the helicopter flies: land first",
        Reason::InvalidFence => {
            "the geofence in bridge.toml is not valid, so the one in force stays: the bridge's log says why"
        }
        Reason::NotRemembered => {
            "another bridge may have carried it out: look at the helicopter, then send a new request"
        }
    }
}

/// What the reason means for a request about a port, where that differs from [`explain`].
fn explain_for_port(report: &FinalReport) -> Option<String> {
    let text = match report.reason {
        Reason::OutOfRange => match report.report.port {
            port if port.kind().is_some() => {
                let whole = match port.kind() {
                    Some(PortKind::U16 | PortKind::I16) => "whole numbers from ",
                    _ => "",
                };
                format!("{} takes {whole}{}", port_label(&port), port_range(&port))
            }
            _ => "the value is outside the port's range, which `ril param list` shows".to_owned(),
        },
        Reason::NotFinite => "the value is not finite".to_owned(),
        Reason::InvalidRequest => {
            "the value does not suit the port: a 16-bit port takes whole numbers only".to_owned()
        }
        Reason::RefusedByDsp => {
            "the DSP did not take the value, or does not have the port".to_owned()
        }
        _ => return None,
    };
    Some(text)
}

/// How a request ended, as the end of an error: what happened, why, and what to do next.
pub fn ending(verb: Verb, end: &FinalReport) -> String {
    let what = match end.stage {
        Stage::Refused => "was refused",
        Stage::Aborted => "was begun and ended early",
        _ => "has an unknown outcome",
    };
    let of_port = verb
        .is_about_a_port()
        .then(|| explain_for_port(end))
        .flatten();
    let explanation = of_port.unwrap_or_else(|| explain(end.reason).to_owned());
    let why = with_details(end.reason.name(), &end.report);
    format!("{} {what} ({why}): {explanation}", verb.name())
}

/// One report as a line for people, or nothing when it only repeats what another one says better.
///
/// `index` and `total` are the place of its request among those of the command.
pub fn line(verb: Verb, index: usize, total: usize, report: &RequestReport) -> Option<String> {
    let name = verb.name();
    let stage = match report.stage() {
        Some(stage) => stage,
        None => return Some(format!("{name}: stage {}", report.stage)),
    };
    let is_last = index + 1 == total;
    let text = match (verb, stage) {
        // The waypoints before the last are done before the path is flown.
        (Verb::GoTo, Stage::Done) if !is_last => return None,
        (Verb::GoTo, Stage::Accepted) => {
            let end = if is_last {
                ", the path is complete"
            } else {
                ""
            };
            format!("waypoint {} of {total} accepted{end}", index + 1)
        }
        (Verb::GoTo, Stage::Progress | Stage::Done) => format!(
            "{stage}, {} of {} waypoints sent, {} reached",
            report.waypoints_sent, report.waypoints_total, report.waypoints_reached
        ),
        (Verb::GetParameter | Verb::SetParameter, Stage::Done) => {
            let value = report.value().map_or("-".to_owned(), |value| {
                port_value(&report.port, value).to_string()
            });
            return Some(format!("{} = {value}", port_label(&report.port)));
        }
        // The list is printed as a whole.
        (Verb::ListParameters, Stage::Done)
        | (
            Verb::ListParameters | Verb::GetParameter | Verb::SetParameter,
            Stage::Accepted | Stage::Progress,
        ) => return None,
        (Verb::TakeOff, Stage::Done) => match report.value().filter(|height| height.is_finite()) {
            Some(height) => format!("{stage}, {height:.1} m over the point of take-off"),
            None => stage.to_string(),
        },
        (_, Stage::Progress) => "begun on the DSP".to_owned(),
        (_, Stage::Accepted | Stage::Done) => stage.to_string(),
        (_, Stage::Refused | Stage::Aborted | Stage::Unknown) => {
            let reason = report
                .reason()
                .map_or_else(|| report.reason.to_string(), |reason| reason.to_string());
            format!("{stage} ({})", with_details(&reason, report))
        }
    };
    Some(format!("{name}: {text}"))
}

/// The reason, with rule, place, amount and DSP error if the report has them.
fn with_details(reason: &str, report: &RequestReport) -> String {
    match details(report) {
        Some(details) => format!("{reason}: {details}"),
        None => reason.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use ipc_types::code::SafetyRule;
    use ipc_types::payload::PortInfo;

    use super::*;

    #[test]
    fn every_final_report_has_its_exit_code() {
        for stage in Stage::ALL {
            for reason in Reason::ALL {
                let expected = match stage {
                    Stage::Done => 0,
                    Stage::Refused => match reason {
                        Reason::LinkDown | Reason::LinkLost => 6,
                        _ => 5,
                    },
                    Stage::Aborted => match reason {
                        Reason::LinkDown | Reason::LinkLost => 6,
                        Reason::DeadlineExpired
                        | Reason::MovementTimeout
                        | Reason::CommunicationFatalError
                        | Reason::DeliveryFailed => 4,
                        _ => 5,
                    },
                    Stage::Unknown | Stage::Accepted | Stage::Progress => 7,
                };
                assert_eq!(
                    exit_code(*stage, *reason).code(),
                    expected,
                    "{stage} {reason}"
                );
                let report = RequestReport::new(*stage, *reason);
                let word = FinalReport::of(&report);
                assert_eq!(word.is_some(), stage.is_final());
                if let Some(word) = word {
                    assert_eq!(word.exit_code().code(), expected);
                }
            }
        }
    }

    #[test]
    fn a_reason_that_nobody_knows_changes_nothing_but_itself() {
        let report = RequestReport {
            reason: 999,
            ..RequestReport::new(Stage::Refused, Reason::None)
        };
        assert_eq!(
            FinalReport::of(&report).unwrap().exit_code(),
            ExitCode::Refused
        );
        assert_eq!(
            line(Verb::Land, 0, 1, &report).unwrap(),
            "land: refused (999)"
        );
        let report = RequestReport {
            stage: 99,
            ..report
        };
        assert_eq!(FinalReport::of(&report), None);
        assert_eq!(line(Verb::Land, 0, 1, &report).unwrap(), "land: stage 99");
        let json = serde_json::to_value(ReportObject::new(Verb::Land, &report)).unwrap();
        assert_eq!((&json["stage"], &json["reason"]), (&99.into(), &999.into()));
    }

    #[test]
    fn each_reason_is_explained_in_its_own_words() {
        for (index, reason) in Reason::ALL.iter().enumerate() {
            let text = explain(*reason);
            assert!(!text.is_empty() && !text.ends_with('.'), "{reason}");
            for other in &Reason::ALL[..index] {
                assert_ne!(text, explain(*other), "{reason} and {other}");
            }
        }
    }

    #[test]
    fn an_ending_says_what_why_and_what_to_do() {
        let word = |stage, reason| RequestReport::new(stage, reason);
        for (verb, report, expected) in [
            (
                Verb::TakeOff,
                word(Stage::Refused, Reason::NotStarted),
                "takeoff was refused (not-started): the module has not been started, or was stopped: `ril start`",
            ),
            (
                Verb::GoTo,
                word(Stage::Aborted, Reason::Stopped),
                "goto was begun and ended early (stopped): the module was stopped",
            ),
            (
                Verb::Land,
                word(Stage::Unknown, Reason::BridgeGone),
                "land has an unknown outcome (bridge-gone): the bridge vanished: start it again and look at `ril state`",
            ),
        ] {
            assert_eq!(end(verb, report), expected);
        }
    }

    fn end(verb: Verb, report: RequestReport) -> String {
        ending(verb, &FinalReport::of(&report).unwrap())
    }

    #[test]
    fn an_ending_names_rule_place_amount_and_dsp_error() {
        let breach = RequestReport {
            rule: SafetyRule::FenceCeiling.code(),
            waypoint: 3,
            value: 4.2,
            value_valid: 1,
            ..RequestReport::new(Stage::Refused, Reason::FenceBreach)
        };
        assert_eq!(
            line(Verb::GoTo, 0, 1, &breach).unwrap(),
            "goto: refused (fence-breach: fence-ceiling, leg 3, by 4.2 m)"
        );
        let text = end(Verb::GoTo, breach);
        let expected = "goto was refused (fence-breach: fence-ceiling, leg 3, by 4.2 m): the geofence forbids it";
        assert!(text.starts_with(expected), "{text}");

        let refused = RequestReport {
            waypoint: 2,
            dsp_error_code: 30,
            dsp_error_valid: 1,
            ..RequestReport::new(Stage::Aborted, Reason::RefusedByDsp)
        };
        let text = end(Verb::GoTo, refused);
        let expected = "goto was begun and ended early (refused-by-dsp: waypoint 2, dsp-error-30 (invalid command)): ";
        assert!(text.starts_with(expected), "{text}");
    }

    #[test]
    fn a_take_off_says_how_high_it_is() {
        let done = |value| RequestReport {
            value,
            value_valid: 1,
            ..RequestReport::new(Stage::Done, Reason::None)
        };
        for (value, expected) in [
            (9.84, "takeoff: done, 9.8 m over the point of take-off"),
            (f64::NAN, "takeoff: done"),
        ] {
            assert_eq!(line(Verb::TakeOff, 0, 1, &done(value)).unwrap(), expected);
        }
    }

    #[test]
    fn a_port_s_reports_say_its_value_or_its_limits() {
        let port = PortInfo {
            min: 0.1,
            max: 20.0,
            number: 20_000,
            kind: PortKind::F32.code(),
            name: PortInfo::name_bytes("cruise_speed_mps"),
            ..PortInfo::default()
        };
        let report = |stage, reason| RequestReport {
            port,
            value: 5.5,
            value_valid: 1,
            ..RequestReport::new(stage, reason)
        };
        let done = report(Stage::Done, Reason::None);
        for verb in [Verb::GetParameter, Verb::SetParameter] {
            assert_eq!(line(verb, 0, 1, &done).unwrap(), "cruise_speed_mps = 5.5");
            let accepted = report(Stage::Accepted, Reason::None);
            assert_eq!(line(verb, 0, 1, &accepted), None);
        }
        assert_eq!(
            end(
                Verb::SetParameter,
                report(Stage::Refused, Reason::OutOfRange)
            ),
            "param set was refused (out-of-range): cruise_speed_mps takes 0.1 to 20"
        );
        assert!(
            end(
                Verb::SetParameter,
                RequestReport::new(Stage::Refused, Reason::OutOfRange)
            )
            .contains("`ril param list`")
        );
    }

    #[test]
    fn people_read_what_goes_on() {
        let counted = |stage| RequestReport {
            waypoints_total: 3,
            waypoints_sent: 2,
            waypoints_reached: 1,
            ..RequestReport::new(stage, Reason::None)
        };
        let refused = RequestReport::new(Stage::Refused, Reason::TooFar);
        for (verb, index, report, expected) in [
            (Verb::Start, 0, counted(Stage::Done), Some("start: done")),
            (
                Verb::TakeOff,
                0,
                counted(Stage::Accepted),
                Some("takeoff: accepted"),
            ),
            (
                Verb::TakeOff,
                0,
                counted(Stage::Progress),
                Some("takeoff: begun on the DSP"),
            ),
            (
                Verb::GoTo,
                0,
                counted(Stage::Accepted),
                Some("goto: waypoint 1 of 3 accepted"),
            ),
            (Verb::GoTo, 0, counted(Stage::Done), None),
            (
                Verb::GoTo,
                2,
                counted(Stage::Accepted),
                Some("goto: waypoint 3 of 3 accepted, the path is complete"),
            ),
            (
                Verb::GoTo,
                2,
                counted(Stage::Progress),
                Some("goto: progress, 2 of 3 waypoints sent, 1 reached"),
            ),
            (
                Verb::GoTo,
                2,
                counted(Stage::Done),
                Some("goto: done, 2 of 3 waypoints sent, 1 reached"),
            ),
            (Verb::GoTo, 1, refused, Some("goto: refused (too-far)")),
        ] {
            let total = if verb == Verb::GoTo { 3 } else { 1 };
            assert_eq!(line(verb, index, total, &report).as_deref(), expected);
        }
    }

    #[test]
    fn programs_read_names_in_one_object() {
        let report = RequestReport {
            request_id: 5,
            path_id: 6,
            reported_ns: 7,
            imi_error: 2,
            ..RequestReport::new(Stage::Refused, Reason::UnableToAbort)
        };
        let json = serde_json::to_string(&ReportObject::new(Verb::Stop, &report)).unwrap();
        assert_eq!(
            json,
            r#"{"schema":"hero.RequestReport.v2","request":"stop","request_id":5,"path_id":6,"reported_ns":7,"stage":"refused","reason":"unable-to-abort","imi_error":"impossible-to-stop-module","waypoints_total":0,"waypoints_sent":0,"waypoints_reached":0}"#
        );
    }

    #[test]
    fn whoever_leaves_is_told_what_goes_on() {
        for verb in Verb::ALL {
            let can_be_stopped = verb == Verb::GoTo;
            assert_eq!(
                verb.goes_on().contains("`ril hold`"),
                can_be_stopped,
                "{}",
                verb.name()
            );
        }
    }
}
