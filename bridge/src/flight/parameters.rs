//! The DSP's virtual ports at run time (requirement C8): requests to read, write and list them.
//!
//! One request at a time is with the DSP; the others wait. A write is read back, because the DSP acknowledges commands
//! that it cannot carry out. What was written is written again after each reboot of the DSP, until the bridge ends.

use std::collections::VecDeque;

use dsp_protocol::port::{Access, PORTS_16, PORTS_32, Port};
use dsp_protocol::{Command, DspErrorCode};
use ipc_types::MonotonicNs;
use ipc_types::code::{ImiError, ParameterOperation, Reason, Stage};
use serde::{Deserialize, Serialize};

use super::motion::Facts;
use super::report::{Detail, Verdict, in_time};
use super::request::RequestHeader;
use crate::link::commands::AckData;
use crate::link::{FlightCommand, Link};

/// Parameter requests that may be open at once. One more is refused with `too-many-requests`.
pub const MAX_OPEN: usize = 8;

/// Requests to read and write ports that have had no final report. The first one is with the DSP.
#[derive(Debug, Serialize, Deserialize)]
pub struct ParameterRequests(VecDeque<Job>);

/// A request to read or write a port.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Job {
    header: RequestHeader,
    #[serde(with = "port_number")]
    port: Port,
    /// The command that writes the port; `None` if it is only read.
    write: Option<Command>,
    /// The write was acknowledged, and the port is being read.
    is_written: bool,
}

impl Job {
    /// The end of the request without an answer of the DSP. A write that was sent may have been carried out.
    fn failed(&self, reason: Reason) -> (RequestHeader, Verdict) {
        let stage = match self.write {
            Some(_) => Stage::Unknown,
            None => Stage::Aborted,
        };
        (self.header, Verdict::ended(stage, reason, ImiError::None))
    }
}

impl Default for ParameterRequests {
    fn default() -> Self {
        ParameterRequests(VecDeque::with_capacity(MAX_OPEN))
    }
}

impl ParameterRequests {
    /// The requests that have had no final report.
    pub fn open(&self) -> impl Iterator<Item = &RequestHeader> {
        self.0.iter().map(|job| &job.header)
    }

    /// When the moment of a request passes next.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        self.open().map(|header| header.begin_by).min()
    }

    /// Takes a request. Returns its first report, which is its last one for the description of a port.
    ///
    /// # Errors
    /// The refusal.
    pub fn take(
        &mut self,
        header: &RequestHeader,
        operation: ParameterOperation,
        number: u32,
        value: f64,
        facts: &Facts,
    ) -> Result<Verdict, Verdict> {
        if operation == ParameterOperation::List {
            let port = port_at(number as usize).ok_or(Reason::NoSuchPort)?;
            return Ok(Verdict::DONE.about(Detail {
                port: Some(port),
                ..Detail::default()
            }));
        }
        in_time(header, facts.now)?;
        let port = port_number::find(number).ok_or(Reason::NoSuchPort)?;
        let write = match operation {
            ParameterOperation::Write => Some(write_command(port, value, facts.flying).map_err(
                |reason| match reason {
                    // The refusal then says what the port takes.
                    Reason::OutOfRange => Verdict::from(reason).about(Detail {
                        port: Some(port),
                        ..Detail::default()
                    }),
                    _ => reason.into(),
                },
            )?),
            _ => None,
        };
        if !facts.is_link_up {
            return Err(Reason::LinkDown.into());
        }
        if self.0.len() == MAX_OPEN {
            return Err(Reason::TooManyRequests.into());
        }
        self.0.push_back(Job {
            header: *header,
            port,
            write,
            is_written: false,
        });
        Ok(Verdict::ACCEPTED)
    }

    /// Gives the first request to the DSP, unless the DSP has it already. Returns the end of a request that cannot be
    /// sent.
    pub fn send(&mut self, link: &mut Link) -> Option<(RequestHeader, Verdict)> {
        let job = self.0.front()?;
        if link.has(FlightCommand::Parameter) {
            return None;
        }
        let command = match job.write {
            Some(write) if !job.is_written => write,
            _ => read(job.port),
        };
        let until = job.header.begin_by;
        let queued = link.command_until(command, FlightCommand::Parameter, until);
        queued.err()?;
        self.fail(Reason::TooManyRequests, link)
    }

    /// The DSP has answered the first request's command. Returns the end of the request, if that was its last command.
    pub fn delivered(
        &mut self,
        data: AckData,
        link: &mut Link,
    ) -> Option<(RequestHeader, Verdict)> {
        let job = self.0.front_mut()?;
        if job.write.is_some() && !job.is_written {
            job.is_written = true;
            return None;
        }
        let job = self.0.pop_front()?;
        let found = value_of(job.port, data);
        let is_refused = job
            .write
            .is_some_and(|write| wrote(job.port, write) != found);
        let detail = Detail {
            value: found,
            port: Some(job.port),
            dsp_error: is_refused.then_some(DspErrorCode::INVALID_COMMAND),
            ..Detail::default()
        };
        let verdict = match is_refused {
            true => Verdict::aborted(Reason::RefusedByDsp),
            false => Verdict::DONE,
        };
        if let (false, Some(write)) = (is_refused, job.write) {
            link.parameters_mut().set(write);
        }
        link.forget_parameter();
        Some((job.header, verdict.about(detail)))
    }

    /// The first request's command was not acknowledged, or cannot be sent.
    pub fn fail(&mut self, reason: Reason, link: &mut Link) -> Option<(RequestHeader, Verdict)> {
        link.forget_parameter();
        Some(self.0.pop_front()?.failed(reason))
    }

    /// Ends a request whose moment has passed. Of one that waits for others, and of a command that waits in the queue
    /// and is taken back, the DSP has nothing.
    pub fn expire(
        &mut self,
        now: MonotonicNs,
        link: &mut Link,
    ) -> Option<(RequestHeader, Verdict)> {
        let is_late = |job: &Job| now >= job.header.begin_by;
        let place = self.0.iter().position(is_late)?;
        let job = *self.0.get(place)?;
        let is_begun = place == 0 && (job.is_written || link.has(FlightCommand::Parameter));
        let mut is_untouched = !is_begun;
        if is_begun {
            is_untouched = link.withdraw(FlightCommand::Parameter) && !job.is_written;
            link.forget_parameter();
        }
        self.0.remove(place);
        let (header, verdict) = job.failed(Reason::TooLate);
        let stage = match is_untouched {
            true => Stage::Aborted,
            false => verdict.stage,
        };
        Some((header, Verdict::too_late(&header, now).at(stage)))
    }

    /// The end of the next request, when all of them end. Only the first one was sent to the DSP.
    pub fn end_next(&mut self, reason: Reason, is_first: bool) -> Option<(RequestHeader, Verdict)> {
        let (header, verdict) = self.0.pop_front()?.failed(reason);
        let stage = match is_first {
            true => verdict.stage,
            false => Stage::Aborted,
        };
        Some((header, verdict.at(stage)))
    }
}

/// The command that writes `value`, if the port takes it now.
fn write_command(port: Port, value: f64, flying: Option<bool>) -> Result<Command, Reason> {
    match access(port) {
        Access::Bridge => return Err(Reason::NoSuchPort),
        // A helicopter that is not known to stand on the ground counts as in flight.
        Access::OnGround if flying != Some(false) => return Err(Reason::NotInFlight),
        Access::OnGround | Access::Always => {}
    }
    if !value.is_finite() {
        return Err(Reason::NotFinite);
    }
    let command = match port {
        Port::Bits16(port) => {
            let bits = (value.fract() == 0.0 && value.abs() <= f64::from(i32::MAX))
                .then(|| port.bits_of(value as i32))
                .flatten();
            bits.map(|value| Command::Write16 {
                port: port.number,
                value,
            })
        }
        Port::Bits32(port) => {
            let value = value as f32;
            port.accepts(value).then_some(Command::Write32 {
                port: port.number,
                value,
            })
        }
    };
    command.ok_or(Reason::OutOfRange)
}

/// The ports of the list: those of 16 bits, then those of 32 bits.
fn port_at(index: usize) -> Option<Port> {
    PORTS_16.get(index).map(Port::Bits16).or_else(|| {
        PORTS_32
            .get(index.checked_sub(PORTS_16.len())?)
            .map(Port::Bits32)
    })
}

fn access(port: Port) -> Access {
    match port {
        Port::Bits16(port) => port.access,
        Port::Bits32(port) => port.access,
    }
}

fn read(port: Port) -> Command {
    match port {
        Port::Bits16(port) => Command::Read16 { port: port.number },
        Port::Bits32(port) => Command::Read32 { port: port.number },
    }
}

/// The value of a port in an acknowledgement.
fn value_of(port: Port, data: AckData) -> Option<f64> {
    match (port, data) {
        (Port::Bits16(port), AckData::Bits16(bits)) => Some(f64::from(port.value_of(bits))),
        (Port::Bits32(_), AckData::Bits32(value)) => Some(f64::from(value)),
        _ => None,
    }
}

/// The value that a command writes.
fn wrote(port: Port, write: Command) -> Option<f64> {
    match write {
        Command::Write16 { value, .. } => value_of(port, AckData::Bits16(value)),
        Command::Write32 { value, .. } => value_of(port, AckData::Bits32(value)),
        _ => None,
    }
}

/// A port by its number: what a request names, and what stands for it in a snapshot.
mod port_number {
    use dsp_protocol::port::{Port, port16, port32};
    use serde::de::{Deserialize, Deserializer, Error};
    use serde::{Serialize, Serializer};

    /// The port of this number, if there is one.
    pub fn find(number: u32) -> Option<Port> {
        let number = u16::try_from(number).ok()?;
        port16(number)
            .map(Port::Bits16)
            .or_else(|| port32(number).map(Port::Bits32))
    }

    pub fn serialize<S: Serializer>(port: &Port, to: S) -> Result<S::Ok, S::Error> {
        let number = match port {
            Port::Bits16(port) => port.number,
            Port::Bits32(port) => port.number,
        };
        number.serialize(to)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Port, D::Error> {
        let number = u16::deserialize(from)?;
        find(number.into()).ok_or_else(|| D::Error::custom("no such port"))
    }
}
