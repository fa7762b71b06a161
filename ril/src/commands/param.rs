//! `ril param list | get | set`: the DSP's virtual ports by name.
//!
//! Names are the bridge's: it lists its ports, and a name is looked up in that list. The bridge checks ranges and who may
//! write what.

use std::io::{self, Write};

use ipc_types::fresh_request_id;
use ipc_types::payload::{ParameterRequest, RequestReport};
use runtime::config::nearest;
use runtime::exit::Failure;

use super::conversation::{Conversation, Format};
use super::exchange::Until;
use super::robot::refuse_to_guess;
use super::{Session, configuration};
use crate::cli::{AskArgs, ParamCommand, PortKey, RobotChoice};
use crate::messages::Verb;
use crate::messages::details::{port_header, port_name, port_row};

/// Longest list that is read: port numbers have 16 bits.
const MAX_PORTS: u32 = 1 << 16;

/// `ril param …`
///
/// # Errors
///
/// As all requests: see [`messages::exit_code`](crate::messages::exit_code); code 2 also for a name that no port has.
pub fn param(command: &ParamCommand, choice: RobotChoice) -> Result<(), Failure> {
    match command {
        ParamCommand::List(args) => {
            run(Verb::ListParameters, args, None, |ports| ports.print_all())
        }
        ParamCommand::Get(args) => run(Verb::GetParameter, &args.ask, None, |ports| {
            let number = ports.resolve(&args.port)?;
            ports.print(|id| ParameterRequest::read(id, number))
        }),
        ParamCommand::Set(args) => run(Verb::SetParameter, &args.ask, Some(choice), |ports| {
            let number = ports.resolve(&args.port)?;
            ports.print(|id| ParameterRequest::write(id, number, args.value))
        }),
    }
}

/// Runs one command; `choice` is given when it must not guess the robot.
fn run(
    verb: Verb,
    args: &AskArgs,
    choice: Option<RobotChoice>,
    work: impl FnOnce(&mut Ports) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let Some(config) = configuration(&args.common)? else {
        return Ok(());
    };
    choice.map_or(Ok(()), refuse_to_guess)?;
    let session = Session::join(&args.common)?;
    let timeout = args.timeout.unwrap_or_else(|| config.request.timeout());
    work(&mut Ports {
        conversation: Conversation::open(&session, verb, timeout)?,
        format: Format::of(args.json),
        deadline_ms: args.deadline.unwrap_or(config.request.deadline_ms),
    })
}

/// The bridge's ports, as a command asks for them.
struct Ports<'a> {
    conversation: Conversation<'a, ParameterRequest>,
    format: Format,
    deadline_ms: u32,
}

impl Ports<'_> {
    /// Asks one thing; `request` gets a fresh id.
    fn ask(
        &mut self,
        request: impl FnOnce(u64) -> ParameterRequest,
        format: Format,
    ) -> Result<RequestReport, Failure> {
        let request = ParameterRequest {
            deadline_ms: self.deadline_ms,
            ..request(fresh_request_id())
        };
        let end = self.conversation.hold(&[request], Until::Final, format)?;
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

    fn print_all(&mut self) -> Result<(), Failure> {
        if self.format == Format::Json {
            return self.list(Format::Json).map(drop);
        }
        // Nothing is printed before all is there: a list that breaks off must not look like a short one.
        let list = self.list(Format::Silent)?;
        let mut out = io::stdout().lock();
        writeln!(out, "{}", port_header()).map_err(Failure::output)?;
        for report in list {
            writeln!(out, "{}", port_row(&report.port)).map_err(Failure::output)?;
        }
        Ok(())
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
