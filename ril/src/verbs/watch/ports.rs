//! The ports of one robot, which feed what the screen knows of it, and the orders that the screen has sent.

use std::time::Duration;

use ipc_types::code::ControlCommand;
use ipc_types::payload::{
    DspTelemetry, HeroTelemetry, ModuleControl, ModuleState, MovementData, RelayLink, RequestReport,
};
use ipc_types::{
    Client, Domain, Ipc, MonotonicNs, ReceiveError, Request, RobotId, SendError, Source, StateOf,
    StatusModule, Subscriber, Topic, fresh_request_id,
};
use runtime::exit::{ExitCode, Failure, OrFail};

use super::freshness::Freshness;
use super::model::{Process, WatchedRobot};
use super::prompt::ScreenOrder;
use crate::config::RequestConfig;
use crate::render::messages::{self, FinalReport, Verb};
use crate::request::{Exchange, Next, Outcome, Until, complete, control_request};
use crate::robot::changes::Weight;
use crate::robot::chart::{Chart, FenceFile};
use crate::robot::running::RunningBridge;
use crate::session::is_relayed;

/// Services that orders go to.
pub(super) const MAX_CLIENTS: usize = 2;

/// Topics that wake the screen for the robot in detail: its state, its telemetry, the relay's link.
pub(super) const DETAIL_TOPICS: usize = 3;

/// Most orders of a robot that are followed at a time. A further one is refused: the operator sees why nothing goes on.
const MAX_ORDERS: usize = 4;

/// How often the bridge is asked for its fence.
const ASKING_PERIOD: Duration = Duration::from_secs(30);

/// What wakes the screen.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Wakers {
    /// Reports about orders alone.
    Orders,
    /// The bridge's state as well.
    State,
    /// Everything.
    All,
}

/// See the module's documentation.
pub(super) struct RobotPorts {
    ipc: Ipc,
    state: Subscriber<ModuleState>,
    hero: Subscriber<HeroTelemetry>,
    dsp: Subscriber<DspTelemetry>,
    status: Subscriber<StateOf<StatusModule>>,
    relay: Subscriber<RelayLink>,
    /// The bridge whose process was looked at: another one may be on another machine.
    looked_epoch_ns: Option<u64>,
    /// Asks the bridge for its configuration, until it has said it.
    running: Option<RunningBridge>,
    /// When to ask again; `None` if the operator named a file.
    next_asking: Option<MonotonicNs>,
    /// The bridge, and the number of its fence's areas, when it was asked.
    asked: Option<(u64, u32)>,
    movement: Option<Client<MovementData>>,
    control: Option<Client<ModuleControl>>,
    orders: Vec<OpenOrder>,
}

/// An order that has no final report yet.
struct OpenOrder {
    verb: Verb,
    exchange: Exchange,
}

impl RobotPorts {
    /// Joins `robot`; `asks` its bridge for the fence.
    pub fn open(domain: &Domain, robot: RobotId, asks: bool) -> Result<RobotPorts, Failure> {
        let ipc = Ipc::join(domain, robot, "ril").or_fail(ExitCode::Internal)?;
        let failed = ExitCode::Internal;
        Ok(RobotPorts {
            state: ipc.subscriber().or_fail(failed)?,
            hero: ipc.subscriber().or_fail(failed)?,
            dsp: ipc.subscriber().or_fail(failed)?,
            status: ipc.subscriber().or_fail(failed)?,
            relay: ipc.subscriber().or_fail(failed)?,
            looked_epoch_ns: None,
            running: None,
            next_asking: asks.then_some(MonotonicNs(0)),
            asked: None,
            movement: None,
            control: None,
            orders: Vec::new(),
            ipc,
        })
    }

    /// Feeds `robot` with all that is there; says whether something was.
    pub fn drain(&mut self, robot: &mut WatchedRobot, now: MonotonicNs) -> bool {
        // The process before the telemetry: it says which telemetry counts.
        let results = [
            self.status.drain(|state| robot.status(state, now)),
            self.relay.drain(|link| robot.relay(link, now)),
            self.state.drain(|state| robot.state(state, now)),
            self.hero.drain(|hero| robot.hero(hero, now)),
            self.dsp.drain(|dsp| robot.dsp(dsp, now)),
        ];
        robot.lost = self.hero.losses().lost + self.dsp.losses().lost;
        let count: usize = results.into_iter().map(count).sum();
        let reports = self.take_reports(robot, now);
        let fence = self.take_fence(robot, now);
        count > 0 || reports || fence
    }

    /// Asks a bridge that has come, or whose fence has another number of areas, for its configuration, and any now and then: a fence
    /// of as many areas can be another one. Takes the fence when the bridge has said it, and says whether it did.
    ///
    /// The bridge writes its journal while it is asked, so it is not asked all the time.
    fn take_fence(&mut self, robot: &mut WatchedRobot, now: MonotonicNs) -> bool {
        let (Some(next), Some(state)) = (self.next_asking, robot.state.as_ref()) else {
            return false;
        };
        let asked = Some((state.epoch_ns, state.safety.fence_areas));
        if self.asked != asked || now >= next {
            (self.asked, self.next_asking) = (asked, Some(now + ASKING_PERIOD));
            self.running = RunningBridge::open(&self.ipc)
                .inspect_err(|error| tracing::warn!(%error, "the bridge cannot be asked"))
                .ok();
        }
        let Some(config) = self.running.as_mut().and_then(RunningBridge::take) else {
            return false;
        };
        self.running = None;
        let fence = FenceFile::from(&config.fence);
        robot.running_fence(Chart::new(&fence, &[]).fence);
        true
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
            let key = match process {
                Process::Bridge => ModuleState::KEY,
                Process::Status => StateOf::<StatusModule>::KEY,
                Process::Relay => RelayLink::KEY,
            };
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
        let now = MonotonicNs(0);
        let due = self
            .orders
            .iter()
            .filter_map(|order| match order.exchange.next(now) {
                Next::Wait(until) => until,
                _ => None,
            });
        due.min()
    }

    /// Sends `order`. What becomes of it is written into the journal of `robot`.
    pub fn send(
        &mut self,
        order: ScreenOrder,
        config: &RequestConfig,
        robot: &mut WatchedRobot,
        now: MonotonicNs,
    ) -> Result<(), Failure> {
        let (verb, is_control) = match order {
            ScreenOrder::Hold => (Verb::Hold, false),
            ScreenOrder::Land => (Verb::Land, false),
            ScreenOrder::Stop => (Verb::Stop, true),
        };
        if self.orders.len() >= MAX_ORDERS {
            let text = format!(
                "{}: not sent, {MAX_ORDERS} orders have no final report yet",
                verb.name()
            );
            robot.journal.add(now, Weight::Warning, text);
            return Ok(());
        }
        let deadline_ms = config.deadline_ms;
        let (request_id, sent) = if is_control {
            let request = control_request(ControlCommand::Stop, deadline_ms);
            (
                request.request_id,
                send(&self.ipc, &mut self.control, &request)?,
            )
        } else {
            let request = match order {
                ScreenOrder::Land => MovementData::land(fresh_request_id()),
                _ => MovementData::hold(fresh_request_id()),
            };
            let request = complete(request, true, deadline_ms);
            (
                request.request_id,
                send(&self.ipc, &mut self.movement, &request)?,
            )
        };
        match sent {
            Ok(()) => {
                let mut exchange = Exchange::new([request_id], Until::Final, config.timeout());
                exchange.sent(now);
                self.orders.push(OpenOrder { verb, exchange });
                robot
                    .journal
                    .add(now, Weight::Order, format!("{}: sent", verb.name()));
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
            }
        }
        Ok(())
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
        for report in &reports {
            for order in &mut self.orders {
                let is_end =
                    FinalReport::of(report).is_some_and(|end| end.exit_code() != ExitCode::Ok);
                // How it ends is written when it is over, with the explanation.
                if order.exchange.take(report, now).is_some()
                    && !is_end
                    && let Some(line) = messages::line(order.verb, 0, 1, report)
                {
                    robot.journal.add(now, Weight::Order, line);
                }
            }
        }
        let before = self.orders.len();
        self.orders.retain(|order| match order.exchange.next(now) {
            Next::Over(outcome) => {
                write_end(order.verb, &outcome, robot, now);
                false
            }
            _ => true,
        });
        !reports.is_empty() || self.orders.len() < before
    }
}

/// Sends one request over a client that is opened with the first one.
fn send<R: Request>(
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

/// Writes how an order ended, unless its last report has said it.
fn write_end(verb: Verb, outcome: &Outcome, robot: &mut WatchedRobot, now: MonotonicNs) {
    match outcome {
        Outcome::Accepted => {}
        Outcome::Final(end) if end.exit_code() == ExitCode::Ok => {}
        Outcome::Final(end) => robot
            .journal
            .add(now, Weight::Alarm, messages::ending(verb, end)),
        Outcome::NoAnswer(_) => {
            let text = format!(
                "{}: no answer in time, the bridge may hang; look whether it took effect all the same",
                verb.name()
            );
            robot.journal.add(now, Weight::Alarm, text);
        }
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
