//! The core's outputs on shared memory.

use ipc_types::payload::{DspTelemetry, ModuleControl, ModuleState, MovementData, RequestReport};
use ipc_types::{Ipc, MonotonicNs, OpenError, Publisher, ReportError, Server, Source, Ticket};

use crate::flight::request::RequestKey;
use crate::outputs::Outputs;

/// The bridge's four services.
pub struct Services {
    telemetry: Publisher<DspTelemetry>,
    state: Publisher<ModuleState>,
    control: Server<ModuleControl>,
    movement: Server<MovementData>,
}

/// What came in through the services.
pub enum Incoming {
    /// A control request.
    Control(RequestKey, ModuleControl),
    /// A movement request.
    Movement(RequestKey, MovementData),
    /// The sender of a request is gone.
    Gone(RequestKey),
}

impl Services {
    /// Opens all four. Fails when another bridge of the same robot lives.
    pub fn open(ipc: &Ipc) -> Result<Services, OpenError> {
        Ok(Services {
            telemetry: ipc.publisher()?,
            state: ipc.publisher()?,
            control: ipc.server()?,
            movement: ipc.server()?,
        })
    }

    /// What to wait for.
    pub fn sources(&self) -> [&dyn Source; 4] {
        [&self.telemetry, &self.state, &self.control, &self.movement]
    }

    /// Wakes the senders of requests that were answered. Their reports are there already; what the DSP is to be told comes
    /// first.
    pub fn wake_senders(&mut self) {
        self.control.wake_clients();
        self.movement.wake_clients();
    }

    /// Takes everything that is there into `inbox`, which keeps its memory.
    pub fn drain(&mut self, inbox: &mut Vec<Incoming>) {
        self.telemetry.welcome();
        self.state.welcome();
        self.control.vanished(|ticket, _| {
            inbox.push(Incoming::Gone(RequestKey::Control(ticket.to_bits())))
        });
        self.movement.vanished(|ticket, _| {
            inbox.push(Incoming::Gone(RequestKey::Movement(ticket.to_bits())))
        });
        let control = self.control.drain(|ticket, request| {
            inbox.push(Incoming::Control(
                RequestKey::Control(ticket.to_bits()),
                *request,
            ));
        });
        let movement = self.movement.drain(|ticket, request| {
            inbox.push(Incoming::Movement(
                RequestKey::Movement(ticket.to_bits()),
                *request,
            ));
        });
        for error in [control.err(), movement.err()].into_iter().flatten() {
            tracing::warn!(%error, "requests could not be received");
        }
    }
}

impl Outputs for Services {
    fn telemetry(&mut self, fill: impl FnOnce(&mut DspTelemetry)) {
        if let Err(error) = self.telemetry.publish(fill) {
            tracing::warn!(%error, "telemetry was not published");
        }
    }

    fn state(&mut self, state: &ModuleState) {
        let published = self.state.publish(|sample| {
            *sample = ModuleState {
                published_ns: MonotonicNs::now().0,
                ..*state
            };
        });
        if let Err(error) = published {
            tracing::warn!(%error, "the state was not published");
        }
    }

    fn report(&mut self, to: RequestKey, report: &RequestReport) {
        let result = match to {
            RequestKey::Control(bits) => {
                self.control.report_quietly(Ticket::from_bits(bits), report)
            }
            RequestKey::Movement(bits) => self
                .movement
                .report_quietly(Ticket::from_bits(bits), report),
        };
        match result {
            // Who does not read loses progress, never the final word; who is gone asked for nothing more.
            Ok(())
            | Err(ReportError::BufferFull | ReportError::Vanished | ReportError::NotOpen) => {}
            Err(error) => {
                tracing::warn!(%error, request_id = report.request_id, "a report was not sent")
            }
        }
    }
}
