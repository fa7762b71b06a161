//! A report, and a failure, as one JSON object each. Codes have their names, and what a report does not say is left
//! out. The failure is the last line of standard output when `--json` was given and the exit code is not 0.

use ipc_types::code::{PortKind, SafetyRule, Stage};
use ipc_types::payload::{PortInfo, RequestReport, SharedStruct};
use runtime::exit::{ExitCode, Failure};
use serde::Serialize;

use super::Verb;
use super::details::{port_name, port_value};

/// One report as an object for programs; the codes have their names.
#[derive(Debug, Serialize)]
pub struct ReportObject {
    schema: &'static str,
    request: &'static str,
    /// Of a command about several robots: which.
    #[serde(skip_serializing_if = "Option::is_none")]
    robot: Option<u32>,
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
    /// The area of the geofence that was broken.
    #[serde(skip_serializing_if = "Option::is_none")]
    area: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    waypoint: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    dsp_error_code: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    value: Option<f64>,
    /// What a parameter was before it was written.
    #[serde(skip_serializing_if = "Option::is_none")]
    previous_value: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    port: Option<PortObject>,
    /// What came between the request and the step before.
    #[serde(skip_serializing_if = "Option::is_none")]
    between: Option<BetweenObject>,
}

/// What came between two steps of a command.
#[derive(Debug, Serialize)]
struct BetweenObject {
    what: &'static str,
    request_id: u64,
    origin: u32,
    session: u32,
    process: u32,
}

impl BetweenObject {
    fn new(report: &RequestReport) -> Option<BetweenObject> {
        let sender = report.between_sender;
        Some(BetweenObject {
            what: report.between()?.name(),
            request_id: report.between_request_id,
            origin: sender.origin,
            session: sender.session,
            process: sender.process,
        })
    }
}

/// A virtual port of the DSP.
#[derive(Debug, Serialize)]
struct PortObject {
    number: u32,
    name: Option<String>,
    kind: &'static str,
    min: f64,
    max: f64,
    writable: bool,
    writable_in_flight: bool,
}

impl PortObject {
    /// `None` if the report is about no port.
    fn new(port: &PortInfo) -> Option<PortObject> {
        // Without `..`: a field that is added must be thought of here.
        let PortInfo {
            min,
            max,
            number,
            kind: _,
            access,
            count: _,
            name: _,
        } = *port;
        Some(PortObject {
            number,
            name: port_name(port).map(str::to_owned),
            kind: port.kind().map(PortKind::name)?,
            min: port_value(port, min),
            max: port_value(port, max),
            writable: access & PortInfo::WRITABLE != 0,
            writable_in_flight: access & PortInfo::WRITABLE_IN_FLIGHT != 0,
        })
    }
}

/// A code by its name, or a number that is not in the contract.
#[derive(Debug, Serialize)]
#[serde(untagged)]
enum Code {
    Name(&'static str),
    Number(u32),
}

impl ReportObject {
    /// Adds the value that the parameter had before, where the report says that it was written.
    #[must_use]
    pub fn with_previous(self, report: &RequestReport, value: Option<f64>) -> ReportObject {
        ReportObject {
            previous_value: value
                .filter(|_| report.stage() == Some(Stage::Done))
                .map(|value| port_value(&report.port, value)),
            ..self
        }
    }

    /// Adds the number of the robot.
    #[must_use]
    pub fn of_robot(self, robot: Option<u32>) -> ReportObject {
        ReportObject { robot, ..self }
    }

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
            ref port,
            between_request_id: _,
            between_sender: _,
            between: _,
        } = *report;
        ReportObject {
            schema: RequestReport::TYPE_NAME,
            request: verb.name(),
            robot: None,
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
            area: report.area().map(str::to_owned),
            waypoint: (waypoint > 0).then_some(waypoint),
            dsp_error_code: report.dsp_error(),
            value: report
                .value()
                .filter(|value| value.is_finite())
                .map(|value| port_value(port, value)),
            previous_value: None,
            port: PortObject::new(port),
            between: BetweenObject::new(report),
        }
    }
}

/// Name of the JSON object's layout.
pub const ERROR_SCHEMA: &str = "ril.Error.v1";

/// Why a command failed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ErrorObject {
    schema: &'static str,
    exit_code: u8,
    code: &'static str,
    message: String,
    causes: Vec<String>,
    next_step: String,
}

impl ErrorObject {
    /// The failure of a command.
    pub fn of(failure: &Failure) -> ErrorObject {
        let mut chain = failure.chain().into_iter();
        let (exit_code, code) = match failure.signal().map(u8::try_from) {
            // What a shell makes of it.
            Some(Ok(signal)) => (128 | signal, "interrupted"),
            _ => (failure.code().code(), failure.code().name()),
        };
        ErrorObject {
            schema: ERROR_SCHEMA,
            exit_code,
            code,
            message: chain.next().unwrap_or_default(),
            causes: chain.collect(),
            next_step: failure.next_step().to_owned(),
        }
    }

    /// A usage error. `text` is what the parser prints for people: the message, perhaps with details on the next lines,
    /// then paragraphs with tips and the usage.
    pub fn of_usage(text: &str) -> ErrorObject {
        let text = text.trim_start();
        let message = match text.strip_prefix("error: ") {
            Some(text) => {
                let paragraph = text.split("\n\n").next().unwrap_or_default();
                let lines: Vec<&str> = paragraph.lines().map(str::trim).collect();
                lines.join(" ")
            }
            // The help, because nothing was asked for.
            None => "no command was given".to_owned(),
        };
        let tip = text
            .lines()
            .find_map(|line| line.trim().strip_prefix("tip: "));
        let next_step = tip.unwrap_or(ExitCode::Usage.next_step()).to_owned();
        ErrorObject {
            schema: ERROR_SCHEMA,
            exit_code: ExitCode::Usage.code(),
            code: ExitCode::Usage.name(),
            message,
            causes: Vec::new(),
            next_step,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failure_has_its_code_causes_and_next_step() {
        let failure = Failure::new(ExitCode::Refused, "busy")
            .context("land was refused")
            .with_next_step("wait");
        let json = serde_json::to_string(&ErrorObject::of(&failure)).unwrap();
        assert_eq!(
            json,
            r#"{"schema":"ril.Error.v1","exit_code":5,"code":"refused","message":"land was refused","causes":["busy"],"next_step":"wait"}"#
        );
    }

    #[test]
    fn an_interruption_has_the_number_that_a_shell_gives_it() {
        let object = ErrorObject::of(&Failure::interrupted(2, "interrupted"));
        assert_eq!((object.exit_code, object.code), (130, "interrupted"));
    }

    #[test]
    fn a_usage_error_has_its_tip_as_next_step() {
        let text = "error: unrecognized subcommand 'strat'\n\n  tip: a similar subcommand exists: 'start'\n\nUsage: ril\n";
        let object = ErrorObject::of_usage(text);
        assert_eq!(object.message, "unrecognized subcommand 'strat'");
        assert_eq!(object.next_step, "a similar subcommand exists: 'start'");
        let text = "error: the following required arguments were not provided:\n  <TOPIC>\n\nUsage: ril hz <TOPIC>\n";
        let object = ErrorObject::of_usage(text);
        assert_eq!(
            object.message,
            "the following required arguments were not provided: <TOPIC>"
        );
        assert_eq!(object.next_step, "look at the command's --help");
        assert_eq!(
            ErrorObject::of_usage("The tool\n\nUsage: ril").message,
            "no command was given"
        );
    }
}
