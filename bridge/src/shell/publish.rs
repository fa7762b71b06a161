//! The core's outputs on shared memory, and in the log; and what it holds, on the topic `bridge/outline`.

use ipc_types::payload::{
    BridgeOutline, DspTelemetry, ModuleControl, ModuleState, MovementData, ParameterRequest,
    RequestReport,
};
use ipc_types::{
    Ipc, MonotonicNs, OpenError, Publisher, ReportError, Request, ServeError, Server, Source,
    Ticket,
};
use module_kit::pieces::PiecePort;

use super::audit::{Audit, AuditedSender, RelayStationNames};
use super::senders::{Senders, sender};
use crate::core::Input;
use crate::flight::control::Sender;
use crate::outline::Outline;
use crate::outputs::{Notice, Outputs, RequestKey};

/// The bridge's services.
pub struct BridgeServices {
    telemetry: Publisher<DspTelemetry>,
    state: Publisher<ModuleState>,
    control: Server<ModuleControl>,
    movement: Server<MovementData>,
    parameters: Server<ParameterRequest>,
    audit: Audit,
    stations: RelayStationNames,
    is_flying: bool,
}

impl BridgeServices {
    /// Opens all. Fails when another bridge of the same robot lives.
    pub fn open(ipc: &Ipc) -> Result<BridgeServices, OpenError> {
        Ok(BridgeServices {
            telemetry: ipc.publisher()?,
            state: ipc.publisher()?,
            control: ipc.server()?,
            movement: ipc.server()?,
            parameters: ipc.server()?,
            audit: Audit::default(),
            stations: RelayStationNames::open(ipc)?,
            is_flying: false,
        })
    }

    /// Whether the helicopter was in the air in the newest sample.
    pub fn is_flying(&self) -> bool {
        self.is_flying
    }

    /// What to wait for.
    pub fn sources(&mut self) -> [&mut dyn Source; 5] {
        [
            &mut self.telemetry,
            &mut self.state,
            &mut self.control,
            &mut self.movement,
            &mut self.parameters,
        ]
    }

    /// The bytes of one read have brought all their telemetry.
    pub fn end_batch(&mut self) {
        self.telemetry.end_batch();
    }

    /// Wakes the senders of requests that were answered. Their reports are there already; the bytes for the DSP go out
    /// first.
    pub fn wake_senders(&mut self) {
        self.control.wake_clients();
        self.movement.wake_clients();
        self.parameters.wake_clients();
    }

    /// Writes the lines of what has happened, once its bytes and reports are out.
    pub fn write_log(&self) {
        self.audit.write();
    }

    /// Writes the lines of what has happened until the end of the bridge.
    pub fn finish_log(&mut self) {
        self.audit.finish();
    }

    /// Takes everything that is there into `inbox`, which keeps its memory, but for what waits in `senders`.
    pub fn drain(&mut self, senders: &mut Senders, inbox: &mut Vec<Input<'static>>) {
        self.stations.drain();
        let (log, stations) = (&self.audit, &self.stations);
        let audited = |sender: &Sender, origin| AuditedSender {
            pid: sender.process,
            station: stations.name_of(origin),
        };
        drain(
            &mut self.control,
            inbox,
            log,
            senders,
            RequestKey::Control,
            |key, sender, request| {
                log.control(audited(&sender, request.origin), request);
                Input::Control {
                    key,
                    sender,
                    request,
                }
            },
        );
        drain(
            &mut self.movement,
            inbox,
            log,
            senders,
            RequestKey::Movement,
            |key, sender, request| {
                log.movement(audited(&sender, request.origin), request);
                Input::Movement {
                    key,
                    sender,
                    request,
                }
            },
        );
        drain(
            &mut self.parameters,
            inbox,
            log,
            senders,
            RequestKey::Parameter,
            |key, sender, request| {
                log.parameter(audited(&sender, request.origin), request);
                Input::Parameter {
                    key,
                    sender,
                    request,
                }
            },
        );
    }
}

/// Takes the requests of one service, and those whose senders are gone.
fn drain<R: Request>(
    server: &mut Server<R>,
    inbox: &mut Vec<Input<'static>>,
    audit: &Audit,
    senders: &mut Senders,
    key: fn(u64) -> RequestKey,
    incoming: impl Fn(RequestKey, Sender, R) -> Input<'static>,
) {
    server.vanished(|ticket, request_id| {
        let key = key(ticket.to_bits());
        audit.sender_gone(key, request_id);
        if !senders.forget(key) {
            inbox.push(Input::SenderGone(key));
        }
    });
    let mut requests = Vec::new();
    let drained: Result<usize, ServeError> =
        server.drain(|ticket, request| requests.push((ticket, *request)));
    let now = MonotonicNs::now();
    for (ticket, request) in requests {
        let sender = sender(server.sender(ticket));
        let input = incoming(key(ticket.to_bits()), sender, request);
        inbox.extend(senders.admit(input, now));
    }
    if let Err(error) = drained {
        audit.write();
        tracing::warn!(%error, "requests could not be received");
    }
}

impl Outputs for BridgeServices {
    fn telemetry(&mut self, fill: &mut dyn FnMut(&mut DspTelemetry)) {
        let published = self.telemetry.publish_batched(|sample| {
            fill(sample);
            self.is_flying = sample.is_flying();
        });
        if let Err(error) = published {
            self.audit.write();
            tracing::warn!(%error, "telemetry was not published");
        }
    }

    fn state(&mut self, state: &ModuleState) {
        let now = MonotonicNs::now();
        self.audit.state(state, now);
        let published = self.state.publish(|sample| {
            *sample = ModuleState {
                published_ns: now.0,
                ..*state
            };
        });
        if let Err(error) = published {
            self.audit.write();
            tracing::warn!(%error, "the state was not published");
        }
    }

    fn report(&mut self, to: RequestKey, report: &RequestReport) {
        self.audit.report(report);
        let result = match to {
            RequestKey::Control(bits) => {
                self.control.report_quietly(Ticket::from_bits(bits), report)
            }
            RequestKey::Movement(bits) => self
                .movement
                .report_quietly(Ticket::from_bits(bits), report),
            RequestKey::Parameter(bits) => self
                .parameters
                .report_quietly(Ticket::from_bits(bits), report),
        };
        match result {
            // A sender that does not read loses progress, never the final report; one that is gone asked for nothing
            // more.
            Ok(())
            | Err(ReportError::BufferFull | ReportError::Vanished | ReportError::NotOpen) => {}
            Err(error) => {
                self.audit.write();
                tracing::warn!(%error, request_id = report.request_id, "a report was not sent")
            }
        }
    }

    fn notice(&mut self, notice: &Notice) {
        self.audit.notice(notice, MonotonicNs::now());
    }
}

/// The publisher of the outline.
pub struct OutlinePort(PiecePort<BridgeOutline>);

impl OutlinePort {
    /// Opens the topic.
    pub fn open(ipc: &Ipc) -> Result<OutlinePort, OpenError> {
        Ok(OutlinePort(PiecePort::open(ipc)?))
    }

    /// What to wait for.
    pub fn source(&mut self) -> &mut dyn Source {
        self.0.source()
    }

    /// Publishes what is due now.
    pub fn publish(&mut self, outline: &Outline<'_>, now: MonotonicNs) {
        let whole = (outline.number, outline.pieces());
        self.0.publish(now, whole, |index| {
            let piece = outline.piece(index)?;
            Some(BridgeOutline {
                published_ns: now.0,
                ..piece
            })
        });
    }

    /// When [`OutlinePort::publish`] has something to do.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        self.0.deadline()
    }
}
