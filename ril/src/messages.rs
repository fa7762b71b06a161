//! What a report says, in words: a line for people, an object for programs, an exit code for scripts.
//!
//! Pure functions over values; nothing is printed here.

use ipc_types::code::{Reason, SafetyRule, Stage};
use ipc_types::payload::{RequestReport, SharedStruct};
use runtime::exit::ExitCode;
use serde::Serialize;

/// Which command a report answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verb {
    /// `ril start`
    Start,
    /// `ril stop`
    Stop,
    /// `ril takeoff`
    TakeOff,
    /// `ril land`
    Land,
    /// `ril goto`
    GoTo,
}

impl Verb {
    /// The command's name.
    pub const fn name(self) -> &'static str {
        match self {
            Verb::Start => "start",
            Verb::Stop => "stop",
            Verb::TakeOff => "takeoff",
            Verb::Land => "land",
            Verb::GoTo => "goto",
        }
    }

    /// What happens to it when its sender goes after it was accepted.
    pub const fn goes_on(self) -> &'static str {
        match self {
            Verb::Start | Verb::Stop => "the bridge goes on with it; `ril state` shows how it ends",
            Verb::TakeOff => {
                "the take-off goes on and cannot be aborted; `ril state` shows how it ends"
            }
            Verb::Land => {
                "the landing goes on and cannot be aborted; `ril state` shows how it ends"
            }
            Verb::GoTo => {
                "the path is flown to its end; `ril stop` makes the helicopter hover at once"
            }
        }
    }
}

/// A final word and why it was said.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FinalReport {
    /// One of the final stages.
    pub stage: Stage,
    /// Why; [`Reason::None`] also for a number that nobody knows.
    pub reason: Reason,
}

impl FinalReport {
    /// The final word that `report` says; nothing when more follows.
    pub fn of(report: &RequestReport) -> Option<FinalReport> {
        let stage = report.stage().filter(|stage| stage.is_final())?;
        let reason = report.reason().unwrap_or(Reason::None);
        Some(FinalReport { stage, reason })
    }

    /// The exit code of a command whose request ended so.
    pub const fn exit_code(self) -> ExitCode {
        exit_code(self.stage, self.reason)
    }
}

/// The exit code for a final word. A stage that is not final says that nobody knows the end.
pub const fn exit_code(stage: Stage, reason: Reason) -> ExitCode {
    match (stage, reason) {
        (Stage::Done, _) => ExitCode::Ok,
        (Stage::Refused | Stage::Aborted, Reason::LinkDown) => ExitCode::LinkDown,
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
        Reason::AlreadyRunning => "the module is running; to restart it, `ril stop` it before",
        Reason::UnableToAbort => "a take-off or landing cannot be aborted: wait for its end",
        Reason::Busy => {
            "another movement or stop is under way: wait for its end, or `ril stop` a path"
        }
        Reason::LinkDown => {
            "the DSP cannot be reached: `ril state` shows the line, the bridge's log says why"
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
        Reason::DeadlineExpired => "it could not reach the DSP before its deadline",
        Reason::MovementTimeout => {
            "the movement took longer than `time_limit_s` in bridge.toml allows"
        }
        Reason::Stopped => "the module was stopped",
        Reason::DspFatalError => "the DSP reported a fatal error: `ril state` shows which",
        Reason::CommunicationFatalError => {
            "the DSP did not acknowledge, or the line broke: `ril state` shows the line"
        }
        Reason::DspRebooted => "the DSP rebooted",
        Reason::BridgeEnding => "the bridge was ended meanwhile",
        Reason::BridgeGone => "the bridge vanished: start it again and look at `ril state`",
        Reason::DeliveryFailed => {
            "waypoints did not reach the DSP although they were repeated: `ril state` shows the line"
        }
        Reason::RefusedByDsp => {
            "the DSP got the order and does not carry it out: `ril state` shows its errors"
        }
        Reason::Replaced => "another movement replaced it",
        Reason::PilotHasControl => {
            "the pilot's switch is on manual: movements are taken when it is on auto again"
        }
        Reason::FenceBreach => "the geofence forbids it: `[fence]` of bridge.toml",
        Reason::SupplyLow => {
            "battery or fuel is below its limit: `[safety]` of bridge.toml; landing is always taken"
        }
        Reason::LinkLost => "the link to the DSP was lost in flight",
        Reason::NoSuchPort => {
            "the port does not exist or is not for requests: `ril param list` shows those that are"
        }
        Reason::NotInFlight => "the port may not be written while the helicopter flies",
        Reason::InvalidFence => {
            "the geofence in bridge.toml is not valid: the bridge's log says why"
        }
        Reason::NotRemembered => {
            "another bridge may have carried it out: look at the helicopter, then ask anew"
        }
    }
}

/// How a request ended, as the end of an error.
pub fn ending(verb: Verb, word: FinalReport) -> String {
    let what = match word.stage {
        Stage::Refused => "was refused",
        Stage::Aborted => "was begun and ended early",
        _ => "has an unknown outcome",
    };
    let (name, reason) = (verb.name(), word.reason);
    format!("{name} {what} ({reason}): {}", explain(reason))
}

/// One report as a line for people, or nothing when it only repeats what another one says better.
///
/// `index` and `total` are the place of its request among those of the command.
pub fn line(verb: Verb, index: usize, total: usize, report: &RequestReport) -> Option<String> {
    let stage = match report.stage() {
        Some(stage) => stage,
        None => return Some(format!("{}: stage {}", verb.name(), report.stage)),
    };
    let is_last = index + 1 == total;
    let text = match (verb, stage) {
        // The waypoints before the last are done as soon as the path is complete.
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
        (_, Stage::Progress) => "begun on the DSP".to_owned(),
        (_, Stage::Accepted | Stage::Done) => stage.to_string(),
        (_, Stage::Refused | Stage::Aborted | Stage::Unknown) => {
            let reason = report
                .reason()
                .map_or_else(|| report.reason.to_string(), |reason| reason.to_string());
            format!("{stage} ({reason})")
        }
    };
    Some(format!("{}: {text}", verb.name()))
}

/// One report as an object for programs; the codes have their names.
#[derive(Debug, Serialize)]
pub struct ReportObject {
    schema: &'static str,
    request: &'static str,
    request_id: u64,
    path_id: u64,
    reported_ns: u64,
    stage: Code,
    reason: Code,
    imi_error: String,
    waypoints_total: u32,
    waypoints_sent: u32,
    waypoints_reached: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    rule: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    waypoint: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    dsp_error_code: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    value: Option<f64>,
}

/// A code by its name, or the number that nobody knows.
#[derive(Debug, Serialize)]
#[serde(untagged)]
enum Code {
    Name(&'static str),
    Number(u32),
}

impl ReportObject {
    /// The report as it answers `verb`.
    pub fn new(verb: Verb, report: &RequestReport) -> ReportObject {
        // Without `..`: a field that is added must be thought of here.
        let RequestReport {
            request_id,
            path_id,
            reported_ns,
            stage,
            reason,
            imi_error: _,
            waypoints_total,
            waypoints_sent,
            waypoints_reached,
            rule: _,
            waypoint,
            dsp_error_code: _,
            dsp_error_valid: _,
            value_valid: _,
            value: _,
            port: _,
        } = *report;
        ReportObject {
            schema: RequestReport::TYPE_NAME,
            request: verb.name(),
            request_id,
            path_id,
            reported_ns,
            stage: report
                .stage()
                .map_or(Code::Number(stage), |stage| Code::Name(stage.name())),
            reason: report
                .reason()
                .map_or(Code::Number(reason), |reason| Code::Name(reason.name())),
            imi_error: report.imi_error().to_string(),
            waypoints_total,
            waypoints_sent,
            waypoints_reached,
            rule: report.rule().map(SafetyRule::name),
            waypoint: (waypoint > 0).then_some(waypoint),
            dsp_error_code: report.dsp_error(),
            value: report.value().filter(|value| value.is_finite()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const VERBS: [Verb; 5] = [
        Verb::Start,
        Verb::Stop,
        Verb::TakeOff,
        Verb::Land,
        Verb::GoTo,
    ];

    #[test]
    fn every_final_word_has_its_exit_code() {
        for stage in Stage::ALL {
            for reason in Reason::ALL {
                let expected = match stage {
                    Stage::Done => 0,
                    Stage::Refused => match reason {
                        Reason::LinkDown => 6,
                        _ => 5,
                    },
                    Stage::Aborted => match reason {
                        Reason::LinkDown => 6,
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
        let word = |stage, reason| FinalReport { stage, reason };
        for (verb, word, expected) in [
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
            assert_eq!(ending(verb, word), expected);
        }
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
        for verb in VERBS {
            let can_be_stopped = verb == Verb::GoTo;
            assert_eq!(
                verb.goes_on().contains("`ril stop`"),
                can_be_stopped,
                "{}",
                verb.name()
            );
        }
    }
}
