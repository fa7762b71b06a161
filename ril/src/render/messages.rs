//! Reports as messages: a line for people, an object for programs, an exit code for scripts.
//!
//! Pure functions over values; nothing is printed here. [`mod@details`] says which rule, waypoint, amount or DSP error a report
//! is about, [`object`] is the form for programs.

pub mod details;
mod final_report;
pub mod object;
#[cfg(test)]
mod tests;
mod verb;

use ipc_types::code::{Reason, Stage};
use ipc_types::payload::RequestReport;

use details::{details, port_label, port_value};
use final_report::explain_for_port;
pub use final_report::{FinalReport, exit_code, explain};
pub use object::{ErrorObject, ReportObject};
pub use verb::Verb;

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
    let of_port = verb
        .is_about_a_port()
        .then(|| explain_for_port(end))
        .flatten();
    let explanation = of_port.unwrap_or_else(|| explain(end.reason).to_owned());
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
