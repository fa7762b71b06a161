//! `ril param list | get | set`: the DSP's virtual ports by name.
//!
//! Names are the bridge's: it lists its ports, and a name is looked up in that list. The bridge checks ranges and who
//! may write what.

use clap::{Args, Subcommand};
use ipc_types::payload::{ParameterRequest, RequestReport};
use ipc_types::{MonotonicNs, fresh_request_id};
use operator::options::{AskArgs, number};
use operator::render::messages::Verb;
use operator::render::messages::details::{port_header, port_name, port_row};
use operator::render::messages::object::ReportObject;
use operator::render::{Weight, json_text, tell};
use operator::request::{Conversation, Format, Until, begin_by_ns};
use operator::session::OrderContext;
use runtime::config::nearest;
use runtime::exit::{ExitCode, Failure};

/// `ril param`
#[derive(Args, Clone, Debug)]
pub struct ParamArgs {
    /// What to do with the parameters.
    #[command(subcommand)]
    pub command: ParamCommand,
}

/// `ril param …`
#[derive(Clone, Debug, Subcommand)]
pub enum ParamCommand {
    /// List all parameters with value, unit, range and whether a request may write them
    List(ParamListArgs),
    /// Read a parameter from the DSP
    Get(ParamGetArgs),
    /// Write a parameter, and print the value that the DSP then has and the one that it had
    Set(ParamSetArgs),
}

/// `ril param list`
///
/// The values are read from the DSP one after the other. When the DSP does not answer, the list has none, and the exit
/// code says why.
#[derive(Args, Clone, Debug)]
pub struct ParamListArgs {
    /// Do not read the values from the DSP
    #[arg(long)]
    pub no_values: bool,

    /// What every request takes.
    #[command(flatten)]
    pub ask: AskArgs,
}

/// `ril param get`
#[derive(Args, Clone, Debug)]
pub struct ParamGetArgs {
    /// Name of the parameter, as `ril param list` shows it, or number of its port
    #[arg(value_name = "NAME", value_parser = port_key)]
    pub port: PortKey,

    /// What every request takes.
    #[command(flatten)]
    pub ask: AskArgs,
}

/// `ril param set`
#[derive(Args, Clone, Debug)]
pub struct ParamSetArgs {
    /// Name of the parameter, as `ril param list` shows it, or number of its port
    #[arg(value_name = "NAME", value_parser = port_key)]
    pub port: PortKey,

    /// Value to write
    #[arg(value_name = "VALUE", allow_negative_numbers = true, value_parser = finite)]
    pub value: f64,

    /// What every request takes.
    #[command(flatten)]
    pub ask: AskArgs,
}

/// How a command names a port of the DSP.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PortKey {
    /// By the number of the port.
    Number(u16),
    /// By the name that the bridge gives it.
    Name(String),
}

/// Reads the name or the number of a port.
fn port_key(text: &str) -> Result<PortKey, String> {
    match text.bytes().all(|byte| byte.is_ascii_digit()) {
        true => text
            .parse()
            .map(PortKey::Number)
            .map_err(|_| "the number of a port is from 0 to 65535".to_owned()),
        false => Ok(PortKey::Name(text.to_owned())),
    }
}

/// Reads the value of a parameter. Its range is the port's, which the bridge knows.
fn finite(text: &str) -> Result<f64, String> {
    number("value", text, f64::MAX)
}

/// Longest list that is read: port numbers have 16 bits.
const MAX_PORTS: u32 = 1 << 16;

/// `ril param …`
///
/// # Errors
///
/// As all requests: see [`messages::exit_code`](operator::render::messages::exit_code); code 2 also for a name that no
/// port has.
pub fn param(command: &ParamCommand) -> Result<(), Failure> {
    match command {
        ParamCommand::List(args) => run(Verb::ListParameters, &args.ask, |ports| {
            ports.print_all(!args.no_values)
        }),
        ParamCommand::Get(args) => run(Verb::GetParameter, &args.ask, |ports| {
            let number = ports.resolve(&args.port)?;
            ports.print(|id| ParameterRequest::read(id, number))
        }),
        ParamCommand::Set(args) => run(Verb::SetParameter, &args.ask, |ports| {
            let number = ports.resolve(&args.port)?;
            let previous = ports.value(number)?.ok().flatten();
            ports.conversation.show_previous(previous);
            let issued_ns = ports.issued.0;
            ports.print(|id| ParameterRequest {
                issued_ns,
                ..ParameterRequest::write(id, number, args.value)
            })
        }),
    }
}

/// Runs one command. One that writes must not guess the robot.
fn run(
    verb: Verb,
    args: &AskArgs,
    work: impl FnOnce(&mut ParameterPorts) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let asked = match verb {
        Verb::SetParameter => OrderContext::of(args)?,
        _ => OrderContext::of_reader(args)?,
    };
    work(&mut ParameterPorts {
        conversation: Conversation::open(&asked.session, verb, asked.timeout)?,
        format: Format::of(args.json),
        deadline_ms: asked.deadline_ms,
        issued: asked.issued,
    })
}

/// The bridge's ports, as a command asks for them.
struct ParameterPorts<'a> {
    conversation: Conversation<'a, ParameterRequest>,
    format: Format,
    deadline_ms: u32,
    /// Of a write; what is read before it is asked at its own moment.
    issued: MonotonicNs,
}

impl ParameterPorts<'_> {
    /// Asks one thing; `request` gets a fresh id.
    fn ask(
        &mut self,
        request: impl FnOnce(u64) -> ParameterRequest,
        format: Format,
    ) -> Result<RequestReport, Failure> {
        let request = request(fresh_request_id());
        let request = ParameterRequest {
            begin_by_ns: begin_by_ns(request.issued_ns, self.deadline_ms),
            ..request
        };
        let end = self.conversation.follow(&[request], Until::Final, format)?;
        // Until the final report, there is always one.
        Ok(end.unwrap_or_default())
    }

    fn print(&mut self, request: impl FnOnce(u64) -> ParameterRequest) -> Result<(), Failure> {
        self.ask(request, self.format).map(drop)
    }

    /// Reads the whole list, port by port.
    fn list(&mut self, format: Format) -> Result<Vec<RequestReport>, Failure> {
        let mut list: Vec<RequestReport> = Vec::new();
        for index in 0..MAX_PORTS {
            let report = self.ask(|id| ParameterRequest::list(id, index), format)?;
            list.push(report);
            if index + 1 >= report.port.count {
                break;
            }
        }
        Ok(list)
    }

    /// The value that the DSP has, or why it is not known; `None` of a port that gives none.
    ///
    /// # Errors
    ///
    /// Code 7 when a signal ends the command.
    fn value(&mut self, number: u16) -> Result<Result<Option<f64>, Failure>, Failure> {
        match self.ask(|id| ParameterRequest::read(id, number), Format::Silent) {
            Ok(report) => Ok(Ok(report.value())),
            Err(failure) => match failure.code() {
                ExitCode::OutcomeUnknown => Err(failure),
                ExitCode::Refused => Ok(Ok(None)),
                _ => Ok(Err(failure)),
            },
        }
    }

    /// Writes the values into the reports of `list`. What keeps the DSP from answering for one port keeps it for all:
    /// then the rest has none, and the failure comes out.
    fn read_values(&mut self, list: &mut [RequestReport]) -> Result<Option<Failure>, Failure> {
        for report in list {
            let Ok(number) = u16::try_from(report.port.number) else {
                continue;
            };
            match self.value(number)? {
                Ok(value) => {
                    report.value = value.unwrap_or_default();
                    report.value_valid = u16::from(value.is_some());
                }
                Err(failure) => return Ok(Some(failure)),
            }
        }
        Ok(None)
    }

    fn print_all(&mut self, with_values: bool) -> Result<(), Failure> {
        // Nothing is printed before all is there: a list that breaks off must not look like a short one.
        let mut list = self.list(Format::Silent)?;
        let trouble = match with_values {
            true => self.read_values(&mut list)?,
            false => None,
        };
        let mut text = match self.format {
            Format::Text => port_header() + "\n",
            Format::Json | Format::Silent => String::new(),
        };
        for report in list {
            match self.format {
                Format::Text => text += &(port_row(&report.port, report.value()) + "\n"),
                Format::Json => {
                    text += &json_text(&ReportObject::new(Verb::ListParameters, &report))?;
                }
                Format::Silent => {}
            }
        }
        tell(Weight::Result, text)?;
        match trouble {
            None => Ok(()),
            Some(failure) => Err(failure.context("the values could not be read")),
        }
    }

    /// The number of the port that is meant.
    fn resolve(&mut self, key: &PortKey) -> Result<u16, Failure> {
        match key {
            PortKey::Number(number) => Ok(*number),
            PortKey::Name(name) => {
                let list = self.list(Format::Silent)?;
                find(name, &list).map_err(Failure::usage)
            }
        }
    }
}

/// The number of the port of this name, or which name may have been meant.
fn find(name: &str, list: &[RequestReport]) -> Result<u16, String> {
    let named = || {
        list.iter().filter_map(|report| {
            let number = u16::try_from(report.port.number).ok()?;
            Some((port_name(&report.port)?, number))
        })
    };
    if let Some((_, number)) = named().find(|(known, _)| *known == name) {
        return Ok(number);
    }
    let hint = match nearest(name, named().map(|(known, _)| known)) {
        Some(near) => format!("did you mean `{near}`?"),
        None => "`ril param list` shows all names".to_owned(),
    };
    Err(format!("no parameter has the name `{name}`; {hint}"))
}

#[cfg(test)]
mod tests {
    use ipc_types::payload::PortInfo;

    use super::*;

    #[test]
    fn a_name_is_found_in_the_list_and_a_slip_of_the_keyboard_is_pointed_out() {
        let list: Vec<RequestReport> = [(20_000, "cruise_speed_mps"), (20_013, "yaw_gain")]
            .into_iter()
            .map(|(number, name)| RequestReport {
                port: PortInfo {
                    number,
                    name: PortInfo::name_bytes(name),
                    ..PortInfo::default()
                },
                ..RequestReport::default()
            })
            .collect();
        assert_eq!(find("yaw_gain", &list), Ok(20_013));
        for (name, expected) in [
            ("yaw_gian", "did you mean `yaw_gain`?"),
            ("zzz", "`ril param list` shows all names"),
            ("", "`ril param list` shows all names"),
        ] {
            let error = find(name, &list).unwrap_err();
            assert!(error.contains(expected), "{name:?}: {error}");
        }
    }
}
