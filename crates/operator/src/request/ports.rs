//! The ports of one robot, which feed what a screen or a page knows of it, and the orders that were sent from there:
//! [`RobotOrder`] and the requests that it makes.

use ipc_types::code::ControlCommand;
use ipc_types::outline::OutlineReader;
use ipc_types::payload::{
    BridgeOutline, DspTelemetry, HeroTelemetry, ModuleControl, ModuleState, MovementData,
    RelayLink, RelayStations, RequestReport, WaypointPosition,
};
use ipc_types::{
    Client, Domain, Ipc, MonotonicNs, ReceiveError, Request, RobotId, SendError, Source, StateOf,
    StatusModule, Subscriber, fresh_request_id,
};
use runtime::exit::{ExitCode, Failure, OrFail};

use crate::config::RequestConfig;
use crate::render::messages::Verb;
use crate::request::followed::{FollowedOrders, OrderNews};
use crate::request::{begin_by_ns, complete, control_request};
use crate::robot::changes::Weight;
use crate::robot::controller::own_session;
use crate::robot::freshness::Freshness;
use crate::robot::model::{Process, WatchedRobot};
use crate::session::is_relayed;

/// Services that orders go to.
pub const MAX_CLIENTS: usize = 2;

/// Topics that wake the screen for the robot in detail: its state, its telemetry, the relay's link.
pub const DETAIL_TOPICS: usize = 3;

/// What wakes the screen.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Wakers {
    /// Reports about orders alone.
    Orders,
    /// The bridge's state as well.
    State,
    /// Everything.
    All,
}

/// The ports of one robot: what a screen or a page knows of it comes in, and orders go out.
pub struct RobotPorts {
    ipc: Ipc,
    state: Subscriber<ModuleState>,
    hero: Subscriber<HeroTelemetry>,
    dsp: Subscriber<DspTelemetry>,
    status: Subscriber<StateOf<StatusModule>>,
    relay: Subscriber<RelayLink>,
    stations: Subscriber<RelayStations>,
    /// The bridge whose process was looked at: another one may be on another machine.
    looked_epoch_ns: Option<u64>,
    /// What the bridge holds; `None` if the operator named a file.
    outline: Option<(Subscriber<BridgeOutline>, OutlineReader)>,
    movement: Option<Client<MovementData>>,
    control: Option<Client<ModuleControl>>,
    orders: FollowedOrders,
    own_session: Option<u32>,
}

impl RobotPorts {
    /// Joins `robot`; `draws_held` says that the map has what its bridge holds.
    pub fn open(domain: &Domain, robot: RobotId, draws_held: bool) -> Result<RobotPorts, Failure> {
        let ipc = Ipc::join(domain, robot, "ril").or_fail(ExitCode::Internal)?;
        let failed = ExitCode::Internal;
        let outline = match draws_held {
            true => Some((ipc.subscriber().or_fail(failed)?, OutlineReader::new())),
            false => None,
        };
        Ok(RobotPorts {
            state: ipc.subscriber().or_fail(failed)?,
            hero: ipc.subscriber().or_fail(failed)?,
            dsp: ipc.subscriber().or_fail(failed)?,
            status: ipc.subscriber().or_fail(failed)?,
            relay: ipc.subscriber().or_fail(failed)?,
            stations: ipc.subscriber().or_fail(failed)?,
            looked_epoch_ns: None,
            outline,
            movement: None,
            control: None,
            orders: FollowedOrders::default(),
            own_session: own_session(),
            ipc,
        })
    }

    /// Feeds `robot` with all that is there; says whether something was.
    pub fn drain(&mut self, robot: &mut WatchedRobot, now: MonotonicNs) -> bool {
        robot.own_session = self.own_session;
        // The process before the telemetry: it says which telemetry counts.
        let results = [
            self.status.drain(|state| robot.status(state, now)),
            self.relay.drain(|link| robot.relay(link, now)),
            self.stations.drain(|stations| robot.stations(stations)),
            self.state.drain(|state| robot.state(state, now)),
            self.hero.drain(|hero| robot.hero(hero, now)),
            self.dsp.drain(|dsp| robot.dsp(dsp, now)),
        ];
        robot.lost = (self.hero.losses().lost).saturating_add(self.dsp.losses().lost);
        let count: usize = results.into_iter().map(count).sum();
        let reports = self.take_reports(robot, now);
        let outline = self.take_outline(robot);
        count > 0 || reports || outline
    }

    /// Takes the pieces of what the bridge holds; says whether another outline is whole.
    fn take_outline(&mut self, robot: &mut WatchedRobot) -> bool {
        let Some((port, reader)) = &mut self.outline else {
            return false;
        };
        let mut is_new = false;
        count(port.drain(|piece| is_new |= reader.take(piece)));
        if let Some(outline) = reader.outline().filter(|_| is_new) {
            robot.held(outline);
        }
        is_new
    }

    /// Looks for the processes that are overdue; says whether it did.
    pub fn look(&mut self, robot: &mut WatchedRobot, now: MonotonicNs) -> bool {
        let epoch_ns = robot.state.as_ref().map(|state| state.epoch_ns);
        let is_another = epoch_ns != self.looked_epoch_ns;
        self.looked_epoch_ns = epoch_ns;
        let mut due: Vec<Process> = robot.looks_due(now).collect();
        if is_another && !due.contains(&Process::Bridge) {
            due.push(Process::Bridge);
        }
        for process in &due {
            let key = process.key();
            let provider = match self.ipc.provider(key) {
                Ok(provider) => provider,
                Err(error) => {
                    tracing::warn!(%error, "the process cannot be looked for");
                    None
                }
            };
            if let (Process::Bridge, Some(provider)) = (process, &provider) {
                robot.is_relayed = is_relayed(key, provider);
            }
            robot.provider(*process, provider.is_some(), now);
        }
        !due.is_empty()
    }

    /// What to wait for.
    pub fn sources(
        &mut self,
        detail: Wakers,
        status: Freshness,
    ) -> impl Iterator<Item = &mut dyn Source> {
        // Without status, raw telemetry is what comes. With it, both come together.
        let telemetry: &mut dyn Source = match status.is_fresh() {
            true => &mut self.hero,
            false => &mut self.dsp,
        };
        let movement = self
            .movement
            .as_mut()
            .filter(|client| client.outstanding() > 0);
        let control = self
            .control
            .as_mut()
            .filter(|client| client.outstanding() > 0);
        let is_all = detail == Wakers::All;
        let topics = [
            (detail != Wakers::Orders).then_some(&mut self.state as &mut dyn Source),
            is_all.then_some(telemetry),
            is_all.then_some(&mut self.relay as _),
            movement.map(|client| client as _),
            control.map(|client| client as _),
        ];
        topics.into_iter().flatten()
    }

    /// When an order is to be looked at although no report comes.
    pub fn next(&self) -> Option<MonotonicNs> {
        self.orders.next()
    }

    /// Sends `order`, which was given at `issued` or later, and gives its number, or why it was not sent. That, and
    /// what becomes of it, is written into the journal of `robot`.
    ///
    /// # Errors
    ///
    /// When the service cannot be opened.
    pub fn send(
        &mut self,
        order: RobotOrder,
        issued: MonotonicNs,
        config: &RequestConfig,
        robot: &mut WatchedRobot,
        now: MonotonicNs,
    ) -> Result<Result<u64, String>, Failure> {
        let verb = order.verb();
        if let Err(why) = self.orders.room(verb) {
            let text = format!("{}: not sent, {why}", verb.name());
            robot.journal.add(now, Weight::Warning, text);
            return Ok(Err(why));
        }
        let (request_id, sent) = match order.request(config.deadline_ms).issued_at(issued, config) {
            OrderRequest::Control(request) => (
                request.request_id,
                send(&self.ipc, &mut self.control, &request)?,
            ),
            OrderRequest::Movement(request) => (
                request.request_id,
                send(&self.ipc, &mut self.movement, &request)?,
            ),
        };
        match sent {
            Ok(()) => {
                let number = self.orders.begin(request_id, verb, config, now);
                robot
                    .journal
                    .add(now, Weight::Order, format!("{}: sent", verb.name()));
                Ok(Ok(number))
            }
            Err(error) => {
                let why = match error {
                    SendError::NoServer { .. } => {
                        format!("no bridge runs: start `ril bridge --robot {}`", robot.id)
                    }
                    error => error.to_string(),
                };
                let text = format!("{}: not sent, {why}", verb.name());
                robot.journal.add(now, Weight::Alarm, text);
                Ok(Err(why))
            }
        }
    }

    /// The part in the robot's shared memory.
    pub fn ipc(&self) -> &Ipc {
        &self.ipc
    }

    /// Takes reports alone, for a process that looks at samples by the time.
    pub fn drain_reports(&mut self, robot: &mut WatchedRobot, now: MonotonicNs) {
        self.take_reports(robot, now);
    }

    /// What became of orders since the last call.
    pub fn take_news(&mut self) -> impl Iterator<Item = OrderNews> {
        self.orders.take_news()
    }

    /// Takes reports, and ends the orders that are over; says whether anything changed.
    fn take_reports(&mut self, robot: &mut WatchedRobot, now: MonotonicNs) -> bool {
        let mut reports: Vec<RequestReport> = Vec::new();
        if let Some(client) = &mut self.movement {
            client.drain(|report| reports.push(*report));
        }
        if let Some(client) = &mut self.control {
            client.drain(|report| reports.push(*report));
        }
        self.orders.take(&reports, robot, now)
    }
}

/// Sends one request over a client that is opened with the first one.
pub fn send<R: Request>(
    ipc: &Ipc,
    client: &mut Option<Client<R>>,
    request: &R,
) -> Result<Result<(), SendError>, Failure> {
    if client.is_none() {
        *client = Some(ipc.client().or_fail(ExitCode::Internal)?);
    }
    match client {
        Some(client) => Ok(client.send(request).map(|_| ())),
        None => unreachable!("it was opened above"),
    }
}

fn count(result: Result<usize, ReceiveError>) -> usize {
    match result {
        Ok(count) => count,
        Err(error) => {
            tracing::warn!(%error, "samples could not be received");
            0
        }
    }
}

/// An order from a screen or a page.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RobotOrder {
    /// Hover on the spot; replaces a path, as `ril hold`.
    Hold,
    /// Land on the spot; replaces a path, as `ril land --preempt`.
    Land,
    /// Start the module, as `ril start`.
    Start,
    /// Stop the module, as `ril stop`.
    Stop,
    /// Take control of the robot, as `ril control take`.
    TakeControl,
    /// Give control up, as `ril control release`.
    ReleaseControl,
    /// Climb to this height above take-off, m, as `ril takeoff`.
    TakeOff(f64),
    /// Fly straight there; replaces a path, as `ril goto --preempt`.
    GoTo(WaypointPosition),
}

/// The request of an order, by the service that takes it.
pub enum OrderRequest {
    /// A movement.
    Movement(MovementData),
    /// A start or a stop.
    Control(ModuleControl),
}

impl OrderRequest {
    /// The request as it is given at `issued` or later.
    fn issued_at(self, issued: MonotonicNs, config: &RequestConfig) -> OrderRequest {
        let (issued_ns, begin_by_ns) = (issued.0, begin_by_ns(issued.0, config.deadline_ms));
        match self {
            OrderRequest::Movement(request) => OrderRequest::Movement(MovementData {
                issued_ns,
                begin_by_ns,
                ..request
            }),
            OrderRequest::Control(request) => OrderRequest::Control(ModuleControl {
                issued_ns,
                begin_by_ns,
                ..request
            }),
        }
    }
}

impl RobotOrder {
    /// The verb that does the same.
    pub fn verb(self) -> Verb {
        match self {
            RobotOrder::Hold => Verb::Hold,
            RobotOrder::Land => Verb::Land,
            RobotOrder::Start => Verb::Start,
            RobotOrder::Stop => Verb::Stop,
            RobotOrder::TakeControl => Verb::TakeControl,
            RobotOrder::ReleaseControl => Verb::ReleaseControl,
            RobotOrder::TakeOff(_) => Verb::TakeOff,
            RobotOrder::GoTo(_) => Verb::GoTo,
        }
    }

    /// Its one request, to be begun within `deadline_ms` of now.
    pub fn request(self, deadline_ms: u32) -> OrderRequest {
        let id = fresh_request_id();
        let now = MonotonicNs::now();
        let control = |command| OrderRequest::Control(control_request(command, now, deadline_ms));
        let movement = match self {
            RobotOrder::Start => return control(ControlCommand::Start),
            RobotOrder::Stop => return control(ControlCommand::Stop),
            RobotOrder::TakeControl => return control(ControlCommand::TakeControl),
            RobotOrder::ReleaseControl => return control(ControlCommand::ReleaseControl),
            RobotOrder::Hold => MovementData::hold(id),
            RobotOrder::Land => MovementData::land(id),
            RobotOrder::TakeOff(height_m) => MovementData::take_off(id, height_m),
            RobotOrder::GoTo(waypoint) => {
                MovementData::waypoint(id, fresh_request_id(), waypoint, true, true)
            }
        };
        let preempts = !matches!(self, RobotOrder::TakeOff(_));
        OrderRequest::Movement(complete(movement, preempts, deadline_ms))
    }
}
