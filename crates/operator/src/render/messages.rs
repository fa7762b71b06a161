//! Reports as messages: a line for people, an object for programs, an exit code for scripts.
//!
//! Pure functions over values; nothing is printed here. [`Verb`] is the command that a report answers, [`FinalReport`]
//! how its request ended; [`mod@details`] says which rule, waypoint, amount or DSP error a report is about, [`object`]
//! is the form for programs.

pub mod details;
pub mod object;
#[cfg(test)]
mod tests;

use details::{details, port_label, port_range, port_value};
use dsp_protocol::port;
use ipc_types::code::{PortKind, Reason, SafetyRule, SenderLost, Stage};
use ipc_types::payload::RequestReport;
use plans::check::ANOTHER_SITE_M;
use runtime::exit::ExitCode;

use super::words::count;

/// Which command a report answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verb {
    /// `ril start`
    Start,
    /// `ril stop`
    Stop,
    /// `ril fence reload`
    ReloadFence,
    /// `ril control take`
    TakeControl,
    /// `ril control release`
    ReleaseControl,
    /// `ril control pass`
    PassControl,
    /// `ril takeoff`
    TakeOff,
    /// `ril land`
    Land,
    /// `ril hold`
    Hold,
    /// `ril goto`
    GoTo,
    /// `ril rtl`
    ReturnToHome,
    /// `ril param list`
    ListParameters,
    /// `ril param get`
    GetParameter,
    /// `ril param set`
    SetParameter,
}

impl Verb {
    /// All commands that send requests.
    pub const ALL: [Verb; 14] = [
        Verb::Start,
        Verb::Stop,
        Verb::ReloadFence,
        Verb::TakeControl,
        Verb::ReleaseControl,
        Verb::PassControl,
        Verb::TakeOff,
        Verb::Land,
        Verb::Hold,
        Verb::GoTo,
        Verb::ReturnToHome,
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
            Verb::TakeControl => "control take",
            Verb::ReleaseControl => "control release",
            Verb::PassControl => "control pass",
            Verb::TakeOff => "takeoff",
            Verb::Land => "land",
            Verb::Hold => "hold",
            Verb::GoTo => "goto",
            Verb::ReturnToHome => "rtl",
            Verb::ListParameters => "param list",
            Verb::GetParameter => "param get",
            Verb::SetParameter => "param set",
        }
    }

    /// What happens to an accepted request when the command that sent it ends.
    pub const fn goes_on(self) -> &'static str {
        match self {
            Verb::Start
            | Verb::Stop
            | Verb::ReloadFence
            | Verb::TakeControl
            | Verb::ReleaseControl
            | Verb::PassControl => "the bridge goes on with it; `ril status` shows how it ends",
            Verb::TakeOff => {
                "the take-off goes on and cannot be aborted; `ril status` shows how it ends"
            }
            Verb::Land => {
                "the landing goes on and cannot be aborted; `ril status` shows how it ends"
            }
            Verb::Hold => {
                "the bridge goes on stopping the helicopter; `ril status` shows how it ends"
            }
            Verb::GoTo | Verb::ReturnToHome => {
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

/// What happens to an accepted request when the command that sent it ends; `action` is what that said of its path.
pub const fn without_sender(verb: Verb, action: Option<SenderLost>) -> &'static str {
    match (verb, action) {
        (Verb::GoTo | Verb::ReturnToHome, Some(SenderLost::Hold)) => {
            "the bridge lets the helicopter hover where it is"
        }
        (Verb::GoTo | Verb::ReturnToHome, Some(SenderLost::Land)) => {
            "the bridge lands the helicopter where it is"
        }
        (Verb::GoTo | Verb::ReturnToHome, None) => {
            "the bridge lets the helicopter hover where it is, unless `sender_lost` in bridge.toml says otherwise"
        }
        _ => verb.goes_on(),
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
    /// `report` if it is final; `None` if more follows.
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
        (
            Stage::Refused | Stage::Aborted,
            Reason::LinkDown | Reason::LinkLost | Reason::RelayLinkDown,
        ) => ExitCode::LinkDown,
        (
            Stage::Aborted,
            Reason::TooLate
            | Reason::MovementTimeout
            | Reason::CommunicationFatalError
            | Reason::DeliveryFailed,
        ) => ExitCode::Timeout,
        (Stage::Refused | Stage::Aborted, _) => ExitCode::Refused,
        (Stage::Unknown | Stage::Accepted | Stage::Progress, _) => ExitCode::OutcomeUnknown,
    }
}

/// What the reason means, and what the operator can do: behind a colon, if there is something to do.
pub const fn explain(reason: Reason) -> &'static str {
    match reason {
        Reason::None => "no reason was given",
        Reason::InvalidRequest => {
            "the request holds a number that the bridge does not know: install the same version of all programs"
        }
        Reason::NotFinite => "a coordinate or altitude is not finite",
        Reason::OutOfRange => {
            "a coordinate or altitude is out of range: altitudes are from `min_altitude_m` to `max_altitude_m` of `[movement]` in bridge.toml"
        }
        Reason::TooFar => {
            "the waypoint is farther away than `[movement] max_distance_m` of bridge.toml allows: fly there in two paths"
        }
        Reason::NotStarted => {
            "the module takes no movement, because it was not started, was stopped, or ended with an error that `ril status` shows: \
             `ril start`"
        }
        Reason::AlreadyRunning => {
            "the module is running: `ril stop` comes first if a restart is meant"
        }
        Reason::UnableToAbort => "a take-off or landing cannot be aborted: wait for its end",
        Reason::Busy => {
            "another movement or stop is under way: wait for its end; `ril hold` ends a path"
        }
        Reason::LinkDown => {
            "the DSP cannot be reached: `ril status` shows the link, the bridge's log says why"
        }
        Reason::NotFlying => "the helicopter is on the ground",
        Reason::AlreadyFlying => "the helicopter is in the air already",
        Reason::NoPosition => {
            "the position is not known: `ril echo dsp --field geographic` shows it once the DSP sends it"
        }
        Reason::PathWithoutHead => "the waypoint belongs to a path that was never opened",
        Reason::PathReplaced => "another movement was begun before the path was complete",
        Reason::PathTooLong => "the path has too many waypoints: split it",
        Reason::PathBroken => "another waypoint of the path was refused, or its sender vanished",
        Reason::TooManyRequests => "the bridge has too many open requests: try again later",
        Reason::TooLate => {
            "the moment until which it might begin had passed, so nothing was done: look at `ril status`, then order it again"
        }
        Reason::Superseded => {
            "something newer came first, and holds: look at `ril status`, then order it again if it is still meant"
        }
        Reason::MovementTimeout => {
            "the movement took longer than `time_limit_s` in bridge.toml allows"
        }
        Reason::Stopped => "the module was stopped",
        Reason::DspFatalError => "the DSP reported a fatal error: `ril status` shows which",
        Reason::CommunicationFatalError => {
            "the DSP did not acknowledge, or the link broke: `ril status` shows the link"
        }
        Reason::DspRebooted => "the DSP rebooted",
        Reason::BridgeEnding => "the bridge was ended meanwhile",
        Reason::BridgeGone => "the bridge vanished: start it again and look at `ril status`",
        Reason::NotInControl => {
            "another sender has control: `ril control show` names it; `ril control take` asks it for control. `ril hold` and `ril land` are taken all the same"
        }
        Reason::ModuleGone => "the module vanished: start it again and look at its state",
        Reason::DeliveryFailed => {
            "waypoints did not reach the DSP although they were sent again: `ril status` shows the link"
        }
        Reason::RefusedByDsp => {
            "the DSP received the request and does not carry it out: `ril status` shows its errors"
        }
        Reason::Replaced => "another movement or `ril hold` took its place",
        Reason::PilotHasControl => {
            "the pilot's switch is on manual, so the pilot flies: movements are taken again when it is on auto"
        }
        Reason::FenceBreach => "the geofence forbids it",
        Reason::SupplyLow => {
            "battery or fuel is below its limit in `[safety]` of bridge.toml: land, with `ril land`, and charge or refuel"
        }
        Reason::LinkLost => {
            "the link to the DSP was lost in flight: `ril status` shows whether the DSP stops by itself"
        }
        Reason::NoSuchPort => {
            "the port does not exist, or may not be written by request: `ril param list` shows all ports"
        }
        Reason::NotInFlight => "the port may not be written while the helicopter flies: land first",
        Reason::InvalidFence => {
            "the geofence in bridge.toml is not valid, so the one in force stays: the bridge's log says why"
        }
        Reason::FenceUnread => {
            "bridge.toml was not read in time, so the geofence in force stays: is its disk there? Then reload it again"
        }
        Reason::RelayLinkDown => {
            "the link to the robot was down, so nothing was sent: `ril relay status` shows the link, then send it again"
        }
        Reason::RelayLinkLost => {
            "the link to the robot was lost before the outcome came, so the robot may be carrying it out: watch the helicopter, \
             and look at `ril status` when `ril relay status` shows the link up"
        }
        Reason::RelayNotPermitted => {
            "this station may not command the robot, so nothing was sent: `ril relay status` shows the station's name; add it to \
             `[commands]` `stations` of relay.toml on the robot, and start the relay there again"
        }
        Reason::RelayTooManyStations => {
            "eight other stations are active, from which the robot's relay takes requests, so nothing was sent: `ril relay status` \
             on the robot shows them; end the relay of one that need not command, and send it again ten seconds later"
        }
        Reason::RelayTwoRobots => {
            "two robots answer under this number, and nothing was sent to either: the log of this station's relay names both; end the \
             relay of one, or give it another number, and send it again ten seconds later"
        }
        Reason::StillOpen => {
            "a request with this id is under way and goes on: send a new request for something else"
        }
        Reason::Replayed => {
            "this is a recorded flight that `ril replay` plays, and no robot: unset RIL_IPC_ROOT, or name the robot that is meant with --robot"
        }
        Reason::ClockDiffers => {
            "this program's clock is not the bridge's, so the order may be an old one: run both in one time namespace (`ril doctor` \
             shows it). `ril hold`, `ril land` and `ril stop` are taken all the same"
        }
        Reason::SenderLost => {
            "the program that ordered it ended, gave it up, or did not renew its lease: look at `ril status`, then order it again if it \
             is still meant"
        }
        Reason::NotRemembered => {
            "another bridge may have carried it out: look at the helicopter, then send a new request"
        }
    }
}

/// What the reason means for a request about a port, where that differs from [`explain`].
fn explain_for_port(verb: Verb, report: &FinalReport) -> Option<String> {
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
        Reason::NotRemembered if verb == Verb::SetParameter => {
            "whether the port was written is not known: `ril param get` shows its value, then set it again if it is still meant".to_owned()
        }
        Reason::NotRemembered => "nothing was read, and nothing was changed: ask again".to_owned(),
        _ => return None,
    };
    Some(text)
}

/// What the reason means for this movement, the rule that is broken and the stage, where that differs from [`explain`].
fn explain_for_movement(verb: Verb, end: &FinalReport) -> Option<String> {
    let is_path = matches!(verb, Verb::GoTo | Verb::ReturnToHome);
    let on_the_spot = matches!(verb, Verb::Land | Verb::Hold);
    let is_refused = end.stage == Stage::Refused;
    let distance_m = end.report.value().unwrap_or_default();
    let text = match end.reason {
        Reason::OutOfRange if verb == Verb::TakeOff => {
            let port = port::port32(port::TAKE_OFF_ALTITUDE_M)?;
            return Some(format!(
                "the DSP takes {} to {} m above take-off (port {})",
                port.min, port.max, port.number
            ));
        }
        Reason::TooFar if distance_m >= ANOTHER_SITE_M => {
            "no flight leads there: are latitude and longitude swapped? Is it for another site?"
        }
        Reason::TooFar if verb == Verb::ReturnToHome => {
            "home is farther away than `[movement] max_distance_m` of bridge.toml allows: fly a part of the way first, with `ril goto`"
        }
        // In the air both are taken.
        Reason::NotStarted if on_the_spot => "the helicopter is on the ground",
        Reason::NotFlying if is_path => {
            "the helicopter is on the ground: `ril takeoff` comes first"
        }
        Reason::Busy if is_path => {
            "another movement or stop is under way: wait for its end, or replace a path with --preempt; `ril hold` ends it"
        }
        Reason::Busy if verb == Verb::Land => {
            "another movement or stop is under way: wait for its end, or land in the middle of a path with --preempt"
        }
        Reason::SupplyLow if !is_path => {
            "battery or fuel is below its limit in `[safety]` of bridge.toml: charge or refuel"
        }
        Reason::FenceBreach => explain_breach(end.report.rule().filter(|_| is_refused), is_refused),
        _ => return None,
    };
    Some(text.to_owned())
}

/// What to do about a rule of the geofence that refuses a movement, or has ended it.
const fn explain_breach(rule: Option<SafetyRule>, is_refused: bool) -> &'static str {
    match rule {
        Some(SafetyRule::BelowTakeOff) => {
            "the waypoint lies below the ground of the take-off: was a height above take-off meant? It has a plus sign, such as +5m"
        }
        Some(SafetyRule::FenceAhead) => {
            "it would come too near to the geofence to stop before it: keep farther away from it, or fly slower (`ril param set \
             cruise_speed_mps`)"
        }
        Some(SafetyRule::FenceUnjudgeable) => {
            "the geofence cannot judge the leg, which is too long or too near to a pole: fly there in shorter legs"
        }
        _ if is_refused => {
            "the geofence forbids it: go elsewhere, or change `[fence]` of bridge.toml, then `ril fence reload`"
        }
        _ => {
            "the geofence ended it: look at `ril status`, then fly to where it is allowed, or land"
        }
    }
}

/// How a request ended, in one line: what happened, why, and what to do next.
pub fn ending(verb: Verb, end: &FinalReport) -> String {
    match ending_parts(verb, end) {
        (text, Some(next_step)) => format!("{text}: {next_step}"),
        (text, None) => text,
    }
}

/// How a request ended: what happened and why, and apart from that what to do next, where there is something to do.
pub fn ending_parts(verb: Verb, end: &FinalReport) -> (String, Option<String>) {
    let what = match end.stage {
        Stage::Refused => "was refused",
        Stage::Aborted => "was begun and ended early",
        _ => "has an unknown outcome",
    };
    let of_verb = match verb {
        _ if verb.is_about_a_port() => explain_for_port(verb, end),
        _ => explain_for_movement(verb, end),
    };
    let explanation = of_verb.unwrap_or_else(|| explain(end.reason).to_owned());
    let why = with_details(end.reason.name(), &end.report);
    // An explanation is what the reason means, and what to do behind a colon.
    let (meaning, next_step) = match explanation.split_once(": ") {
        Some((meaning, next_step)) => (meaning, Some(next_step.to_owned())),
        None => (explanation.as_str(), None),
    };
    let text = format!("{} {what} ({why}): {meaning}", verb.name());
    (text, next_step)
}

/// What a line about a parameter that was written adds: the value that it had before; `None` of other reports.
pub fn previous(report: &RequestReport, value: Option<f64>) -> String {
    let value = value.filter(|_| report.stage() == Some(Stage::Done));
    value.map_or_else(String::new, |value| {
        format!(" (was {})", port_value(&report.port, value))
    })
}

/// One report as a line for people, or `None` if it only repeats what another one says better.
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
        // The waypoints before the last are accepted and done before the path is flown.
        (Verb::GoTo | Verb::ReturnToHome, Stage::Accepted | Stage::Done) if !is_last => {
            return None;
        }
        (Verb::GoTo | Verb::ReturnToHome, Stage::Accepted) => {
            format!(
                "{} accepted, the path is complete",
                count(total, "waypoint")
            )
        }
        (Verb::GoTo | Verb::ReturnToHome, Stage::Progress | Stage::Done) => format!(
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
            Some(height) => format!("{stage}, {height:.1} m above take-off"),
            None => stage.to_string(),
        },
        (_, Stage::Progress) => "begun on the DSP".to_owned(),
        (_, Stage::Accepted) if report.reason() == Some(Reason::LinkDown) => {
            format!("{stage}, and carried out as soon as the DSP is heard")
        }
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
