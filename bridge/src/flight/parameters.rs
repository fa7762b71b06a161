//! The DSP's virtual ports at run time (requirement C8): requests to read, write and list them.
//!
//! One request at a time is with the DSP; the others wait. A write is read back, because the DSP acknowledges commands that
//! it cannot carry out. What was written is written again after each reboot of the DSP, until the bridge ends.

use dsp_protocol::port::{Access, PORTS_16, PORTS_32, Port};
use dsp_protocol::{Command, DspErrorCode};
use ipc_types::code::{ImiError, ParameterOperation, PortKind, Reason, Stage};
use ipc_types::payload::{ParameterRequest, PortInfo};

use super::parameter_jobs::Job;
pub use super::parameter_jobs::{MAX_OPEN, ParameterRequests};
use super::port_number;
use super::report::{Detail, Refusal, Verdict, in_time, too_late};
use super::request::RequestHeader;
use super::{Context, Flight, FlightTimer};
use crate::link::FlightCommand;
use crate::link::commands::AckData;
use crate::outputs::Outputs;

impl Flight {
    /// Takes a parameter request, or the reason why it cannot be one.
    pub fn parameter_request<O: Outputs>(
        &mut self,
        header: &RequestHeader,
        operation: Result<ParameterOperation, Reason>,
        request: &ParameterRequest,
        cx: &mut Context<'_, O>,
    ) {
        if !self.is_new(header, cx) {
            return;
        }
        let outcome = operation
            .map_err(Refusal::from)
            .and_then(|operation| match operation {
                ParameterOperation::List => self.describe(header, request.port, cx),
                ParameterOperation::Read => self.enqueue(header, request.port, None, cx),
                ParameterOperation::Write => {
                    self.enqueue(header, request.port, Some(request.value), cx)
                }
            });
        if let Err(refusal) = outcome {
            self.refuse(header, &refusal, cx);
        }
    }

    fn describe<O: Outputs>(
        &mut self,
        header: &RequestHeader,
        index: u32,
        cx: &mut Context<'_, O>,
    ) -> Result<(), Refusal> {
        let port = port_at(index as usize).ok_or(Reason::NoSuchPort)?;
        let detail = Detail {
            port: Some(info(port)),
            ..Detail::default()
        };
        self.report(header, &Verdict::DONE.about(detail), cx);
        Ok(())
    }

    fn enqueue<O: Outputs>(
        &mut self,
        header: &RequestHeader,
        number: u32,
        value: Option<f64>,
        cx: &mut Context<'_, O>,
    ) -> Result<(), Refusal> {
        in_time(header, cx.now)?;
        let port = port_number::find(number).ok_or(Reason::NoSuchPort)?;
        let write = match value {
            Some(value) => Some(self.write_command(port, value, cx)?),
            None => None,
        };
        if !cx.link.is_up() {
            return Err(Reason::LinkDown.into());
        }
        if self.parameters.open.len() == MAX_OPEN {
            return Err(Reason::TooManyRequests.into());
        }
        self.parameters.open.push_back(Job {
            header: *header,
            port,
            write,
            is_written: false,
        });
        self.report(header, &Verdict::ACCEPTED, cx);
        if self.parameters.open.len() == 1 {
            self.next_parameter(cx);
        }
        Ok(())
    }

    /// The command that writes `value`, if the port takes it now.
    fn write_command<O>(
        &self,
        port: Port,
        value: f64,
        cx: &Context<'_, O>,
    ) -> Result<Command, Refusal> {
        match access(port) {
            Access::Bridge => return Err(Reason::NoSuchPort.into()),
            // Not known to stand on the ground counts as in flight.
            Access::OnGround if self.observation.flying(cx.now) != Some(false) => {
                return Err(Reason::NotInFlight.into());
            }
            Access::OnGround | Access::Always => {}
        }
        if !value.is_finite() {
            return Err(Reason::NotFinite.into());
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
        Ok(command.ok_or(Reason::OutOfRange)?)
    }

    /// Gives the first request to the DSP.
    fn next_parameter<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        self.timers.stop(FlightTimer::Parameter);
        let Some(job) = self.parameters.open.front() else {
            return;
        };
        let until = job.header.begin_by;
        self.timers.arm(FlightTimer::Parameter, until);
        let command = match job.write {
            Some(write) if !job.is_written => write,
            _ => read(job.port),
        };
        let queued = cx
            .link
            .command_until(command, FlightCommand::Parameter, until);
        if queued.is_err() {
            self.parameter_failed(Reason::TooManyRequests, cx);
        }
    }

    /// The DSP has answered the first request's command.
    pub(super) fn parameter_delivered<O: Outputs>(
        &mut self,
        data: AckData,
        cx: &mut Context<'_, O>,
    ) {
        let Some(job) = self.parameters.open.front_mut() else {
            return;
        };
        if job.write.is_some() && !job.is_written {
            job.is_written = true;
            return self.next_parameter(cx);
        }
        let job = *job;
        let found = value_of(job.port, data);
        let detail = Detail {
            value: found,
            port: Some(info(job.port)),
            ..Detail::default()
        };
        let is_refused = job
            .write
            .is_some_and(|write| wrote(job.port, write) != found);
        let verdict = if is_refused {
            let detail = Detail {
                dsp_error: Some(DspErrorCode::INVALID_COMMAND),
                ..detail
            };
            Verdict::aborted(Reason::RefusedByDsp).about(detail)
        } else {
            if let Some(write) = job.write {
                cx.link.parameters_mut().set(write);
            }
            Verdict::DONE.about(detail)
        };
        self.end_parameter(&verdict, cx);
    }

    /// The first request's command was not acknowledged, or cannot be sent.
    pub(super) fn parameter_failed<O: Outputs>(&mut self, reason: Reason, cx: &mut Context<'_, O>) {
        let Some(job) = self.parameters.open.front() else {
            return;
        };
        let verdict = Verdict::ended(job.stage_of_failure(), reason, ImiError::None);
        self.end_parameter(&verdict, cx);
    }

    pub(super) fn parameter_expired<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        if let Some(job) = self.parameters.open.front() {
            let verdict = too_late(&job.header, cx.now).at(job.stage_of_failure());
            self.end_parameter(&verdict, cx);
        }
    }

    fn end_parameter<O: Outputs>(&mut self, verdict: &Verdict, cx: &mut Context<'_, O>) {
        cx.link.forget_parameter();
        if let Some(job) = self.parameters.open.pop_front() {
            self.report(&job.header, verdict, cx);
        }
        self.next_parameter(cx);
    }

    /// All parameter requests end: the DSP is gone, or the bridge ends.
    pub(super) fn end_parameter_requests<O: Outputs>(
        &mut self,
        reason: Reason,
        cx: &mut Context<'_, O>,
    ) {
        self.timers.stop(FlightTimer::Parameter);
        let mut is_first = true;
        while let Some(job) = self.parameters.open.pop_front() {
            let stage = if is_first {
                job.stage_of_failure()
            } else {
                Stage::Aborted
            };
            is_first = false;
            self.report(
                &job.header,
                &Verdict::ended(stage, reason, ImiError::None),
                cx,
            );
        }
        cx.link.forget_parameter();
    }
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

fn info(port: Port) -> PortInfo {
    let (number, name, kind, min, max) = match port {
        Port::Bits16(port) => {
            let kind = if port.signed {
                PortKind::I16
            } else {
                PortKind::U16
            };
            let (min, max) = (f64::from(port.min), f64::from(port.max));
            (port.number, port.name, kind, min, max)
        }
        Port::Bits32(port) => {
            let (min, max) = (f64::from(port.min), f64::from(port.max));
            (port.number, port.name, PortKind::F32, min, max)
        }
    };
    let access = match access(port) {
        Access::Bridge => 0,
        Access::OnGround => PortInfo::WRITABLE,
        Access::Always => PortInfo::WRITABLE | PortInfo::WRITABLE_IN_FLIGHT,
    };
    PortInfo {
        min,
        max,
        number: number.into(),
        kind: kind.code(),
        access,
        count: (PORTS_16.len() + PORTS_32.len()) as u32,
        name: PortInfo::name_bytes(name),
    }
}
