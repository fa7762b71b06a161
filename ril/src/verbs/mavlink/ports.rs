//! [`Ports`]: what the gateway reads of the robot, and the requests that its orders become.

use dsp_protocol::port;
use ipc_types::payload::{
    HeroTelemetry, ModuleControl, ModuleState, MovementData, ParameterRequest, RequestReport,
};
use ipc_types::{
    Client, Ipc, MonotonicNs, Request, SendError, Source, Subscriber, fresh_request_id,
};
use mavlink_gateway::{Gateway, Order, OrderKind};
use runtime::exit::{ExitCode, Failure, OrFail};

use crate::render::messages::{self, FinalReport, Verb};
use crate::request::order::{OrderRequest, RobotOrder};

/// See the module's documentation.
pub(super) struct Ports {
    ipc: Ipc,
    telemetry: Subscriber<HeroTelemetry>,
    state: Subscriber<ModuleState>,
    movement: Option<Client<MovementData>>,
    control: Option<Client<ModuleControl>>,
    parameters: Option<Client<ParameterRequest>>,
    open: Vec<Open>,
}

/// A request without a final report.
struct Open {
    request_id: u64,
    number: u64,
    verb: Verb,
}

impl Ports {
    pub fn open(ipc: Ipc) -> Result<Ports, Failure> {
        Ok(Ports {
            telemetry: ipc.subscriber().or_fail(ExitCode::Internal)?,
            state: ipc.subscriber().or_fail(ExitCode::Internal)?,
            ipc,
            movement: None,
            control: None,
            parameters: None,
            open: Vec::new(),
        })
    }

    /// What to wait for. Without a station no sample wakes the process.
    pub fn sources(&mut self, with_samples: bool) -> impl Iterator<Item = &mut dyn Source> {
        let telemetry = with_samples.then_some(&mut self.telemetry as &mut dyn Source);
        let movement = self.movement.as_mut().map(|client| client as _);
        let control = self.control.as_mut().map(|client| client as _);
        let parameters = self.parameters.as_mut().map(|client| client as _);
        let state = Some(&mut self.state as _);
        [telemetry, state, movement, control, parameters]
            .into_iter()
            .flatten()
    }

    /// Gives the gateway what has come.
    pub fn drain(&mut self, gateway: &mut Gateway, now: MonotonicNs) {
        let states = self.state.drain(|state| gateway.state(state, now));
        // Of telemetry the newest counts.
        let newest = self.telemetry.latest().map(|newest| {
            if let Some(telemetry) = newest {
                gateway.telemetry(&telemetry, now);
            }
        });
        for error in [states.err(), newest.err()].into_iter().flatten() {
            tracing::warn!(%error, "samples could not be received");
        }
        for report in self.reports() {
            let Some(index) = self
                .open
                .iter()
                .position(|one| one.request_id == report.request_id)
            else {
                continue;
            };
            let Open { number, verb, .. } = self.open[index];
            let end = FinalReport::of(&report);
            let words = end.map_or_else(String::new, |end| messages::ending(verb, &end));
            if end.is_some() {
                self.open.swap_remove(index);
            }
            gateway.report(number, &report, &words, now);
        }
    }

    fn reports(&mut self) -> Vec<RequestReport> {
        let mut reports = Vec::new();
        drain(&mut self.movement, &mut reports);
        drain(&mut self.control, &mut reports);
        drain(&mut self.parameters, &mut reports);
        reports
    }

    /// Sends an order; one that cannot be sent is reported to the gateway.
    pub fn send(
        &mut self,
        order: Order,
        gateway: &mut Gateway,
        now: MonotonicNs,
    ) -> Result<(), Failure> {
        let (issued_ns, begin_by_ns) = (order.issued.0, order.begin_by.map_or(0, |by| by.0));
        let (verb, request_id, sent) = match wanted(order.kind) {
            Wanted::Parameter(verb, request) => {
                let request = ParameterRequest {
                    issued_ns,
                    begin_by_ns,
                    ..request
                };
                let sent = send(&self.ipc, &mut self.parameters, &request)?;
                (verb, request.request_id, sent)
            }
            Wanted::Robot(wanted) => match wanted.request(0) {
                OrderRequest::Movement(request) => {
                    let preempt = u16::from(order.preempts);
                    let request = MovementData {
                        issued_ns,
                        begin_by_ns,
                        preempt,
                        ..request
                    };
                    let sent = send(&self.ipc, &mut self.movement, &request)?;
                    (wanted.verb(), request.request_id, sent)
                }
                OrderRequest::Control(request) => {
                    let request = ModuleControl {
                        issued_ns,
                        begin_by_ns,
                        ..request
                    };
                    let sent = send(&self.ipc, &mut self.control, &request)?;
                    (wanted.verb(), request.request_id, sent)
                }
            },
        };
        match sent {
            Ok(()) => self.open.push(Open {
                request_id,
                number: order.number,
                verb,
            }),
            Err(error) => {
                let words = match error {
                    SendError::NoServer { .. } => format!(
                        "{} was refused: robot {}'s bridge is not running",
                        verb.name(),
                        self.ipc.robot()
                    ),
                    error => format!("{} was refused: {error}", verb.name()),
                };
                gateway.not_sent(order.number, &words, now);
            }
        }
        Ok(())
    }
}

/// What an order is in the words of `ril`.
enum Wanted {
    Robot(RobotOrder),
    Parameter(Verb, ParameterRequest),
}

fn wanted(kind: OrderKind) -> Wanted {
    let write = |port, value| {
        let request = ParameterRequest::write(fresh_request_id(), port, value);
        Wanted::Parameter(Verb::SetParameter, request)
    };
    Wanted::Robot(match kind {
        OrderKind::Start => RobotOrder::Start,
        OrderKind::Stop => RobotOrder::Stop,
        OrderKind::TakeOff(height_m) => RobotOrder::TakeOff(height_m),
        OrderKind::Hold => RobotOrder::Hold,
        OrderKind::Land => RobotOrder::Land,
        OrderKind::GoTo(position) => RobotOrder::GoTo(position),
        OrderKind::Speed(speed_mps) => return write(port::CRUISE_SPEED_MPS, speed_mps),
        OrderKind::WritePort(port, value) => return write(port, value),
        OrderKind::ReadPort(port) => {
            let request = ParameterRequest::read(fresh_request_id(), port);
            return Wanted::Parameter(Verb::GetParameter, request);
        }
    })
}

fn drain<R: Request>(client: &mut Option<Client<R>>, reports: &mut Vec<RequestReport>) {
    if let Some(client) = client {
        client.drain(|report| reports.push(*report));
    }
}

/// Sends one request over a client that is opened with the first one.
fn send<R: Request>(
    ipc: &Ipc,
    client: &mut Option<Client<R>>,
    request: &R,
) -> Result<Result<(), SendError>, Failure> {
    let client = match client {
        Some(client) => client,
        None => client.insert(ipc.client().or_fail(ExitCode::Internal)?),
    };
    Ok(client.send(request).map(|_| ()))
}
