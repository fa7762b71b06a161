//! A report as one JSON object; codes have their names, and what a report does not say is left out.

use ipc_types::code::{PortKind, SafetyRule, Stage};
use ipc_types::payload::{PortInfo, RequestReport, SharedStruct};
use serde::Serialize;

use super::details::{port_name, port_value};
use super::verb::Verb;

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
    /// What a parameter was before it was written.
    #[serde(skip_serializing_if = "Option::is_none")]
    previous_value: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    port: Option<PortObject>,
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
    /// The same with the value that the parameter had before, where the report says that it was written.
    #[must_use]
    pub fn with_previous(self, report: &RequestReport, value: Option<f64>) -> ReportObject {
        ReportObject {
            previous_value: value
                .filter(|_| report.stage() == Some(Stage::Done))
                .map(|value| port_value(&report.port, value)),
            ..self
        }
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
            value: report
                .value()
                .filter(|value| value.is_finite())
                .map(|value| port_value(port, value)),
            previous_value: None,
            port: PortObject::new(port),
        }
    }
}
