//! `ril param list | get | set`: the DSP's virtual ports by name.
//!
//! Names are those of the DSP's protocol, so that a command is for one port from the beginning: its request goes out at
//! once, with the moment of the command line. The bridge checks ranges and who may write what.

use clap::{Args, Subcommand};
use dsp_protocol::port::{PORTS_16, PORTS_32, Port, by_name};
use ipc_types::payload::{ParameterRequest, RequestReport};
use ipc_types::{MonotonicNs, fresh_request_id};
use operator::options::{AskArgs, number};
use operator::render::messages::Verb;
use operator::render::messages::details::{port_header, port_row};
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
        ParamCommand::Get(args) => {
            let number = resolve(&args.port)?;
            run(Verb::GetParameter, &args.ask, |ports| {
                ports.print(|id| ParameterRequest::read(id, number))
            })
        }
        ParamCommand::Set(args) => {
            let number = resolve(&args.port)?;
            run(Verb::SetParameter, &args.ask, |ports| {
                ports.write(number, args.value)
            })
        }
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
    /// Of a write, and of the read before it; other reads are asked at their own moments.
    issued: MonotonicNs,
}

impl ParameterPorts<'_> {
    /// Asks one thing; `request` gets a fresh id.
    fn ask(
        &mut self,
        request: impl FnOnce(u64) -> ParameterRequest,
        format: Format,
    ) -> Result<RequestReport, Failure> {
        let request = self.bounded(request(fresh_request_id()));
        let end = self.conversation.follow(&[request], Until::Final, format)?;
        // Until the final report, there is always one.
        Ok(end.unwrap_or_default())
    }

    /// A request that begins within the deadline of its issue.
    fn bounded(&self, request: ParameterRequest) -> ParameterRequest {
        ParameterRequest {
            begin_by_ns: begin_by_ns(request.issued_ns, self.deadline_ms),
            ..request
        }
    }

    /// Writes a port, and reads what it had before. Both requests are sent at once, so that the write waits for no
    /// answer to the read; the bridge carries them out in this order.
    fn write(&mut self, number: u16, value: f64) -> Result<(), Failure> {
        let issued = |request| ParameterRequest {
            issued_ns: self.issued.0,
            ..request
        };
        let read = ParameterRequest::read(fresh_request_id(), number);
        let write = ParameterRequest::write(fresh_request_id(), number, value);
        let [read, write] = [read, write].map(|request| [self.bounded(issued(request))]);
        let reading = self.conversation.begin(&read, Until::Final)?;
        let writing = self.conversation.begin(&write, Until::Final)?;
        let read = self
            .conversation
            .follow_begun(reading, &read, Format::Silent);
        let previous = match read {
            Ok(report) => report.and_then(|report| report.value()),
            Err(failure) if failure.code() == ExitCode::OutcomeUnknown => return Err(failure),
            // What keeps the port from being read ends the write, too.
            Err(_) => None,
        };
        self.conversation.show_previous(previous);
        let format = self.format;
        let end = self.conversation.follow_begun(writing, &write, format);
        end.map(drop)
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
}

/// The number of the port that is meant, or which name may have been.
fn resolve(key: &PortKey) -> Result<u16, Failure> {
    let name = match key {
        PortKey::Number(number) => return Ok(*number),
        PortKey::Name(name) => name,
    };
    match by_name(name) {
        Some(Port::Bits16(port)) => return Ok(port.number),
        Some(Port::Bits32(port)) => return Ok(port.number),
        None => {}
    }
    let names = PORTS_16.iter().map(|port| port.name);
    let names = names.chain(PORTS_32.iter().map(|port| port.name));
    let hint = match nearest(name, names) {
        Some(near) => format!("did you mean `{near}`?"),
        None => "`ril param list` shows all names".to_owned(),
    };
    let text = format!("no parameter has the name `{name}`; {hint}");
    Err(Failure::usage(text))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_known_and_a_slip_of_the_keyboard_is_pointed_out() {
        let number = |name: &str| resolve(&PortKey::Name(name.to_owned()));
        assert_eq!(number("yaw_gain").unwrap(), 20_013);
        assert_eq!(number("trim_tail_us").unwrap(), 10_203);
        assert_eq!(resolve(&PortKey::Number(7)).unwrap(), 7);
        for (name, expected) in [
            ("yaw_gian", "did you mean `yaw_gain`?"),
            ("zzz", "`ril param list` shows all names"),
            ("", "`ril param list` shows all names"),
        ] {
            let error = number(name).unwrap_err().chain().join(": ");
            assert!(error.contains(expected), "{name:?}: {error}");
        }
    }
}
