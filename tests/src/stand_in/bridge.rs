//! [`StandInBridge`]: publishes the DSP's telemetry and the module's state, and answers requests as the test says.
//!
//! Where the test says nothing it answers as a bridge does: a path is assembled waypoint by waypoint, a movement that
//! may pre-empt replaces a path under way, and parameters are those of a [`PortTable`].

use std::collections::{BTreeMap, VecDeque};
use std::sync::mpsc::Sender;

use ipc_types::code::{
    DspPathState, Functionality, LinkState, ModuleId, ModuleStatus, MovementKind, Reason, Stage,
};
use ipc_types::payload::{
    DspTelemetry, LinkHealth, ModuleControl, ModuleState, MovementData, ParameterRequest,
    RequestReport,
};
use ipc_types::service::Request;
use ipc_types::{Domain, Ipc, MonotonicNs, ReportError, RobotId, Server, Source, Ticket};

use ipc_fixtures::stand_in::worker::{Inbox, Ports, Worker};
use ipc_fixtures::{Answer, StandInTopic};

use super::ports::{PortTable, StandInPort};

/// What the processes of a stand-in are called.
const NAME: &str = "stand-in-bridge";

/// In the place of the bridge. Its topics wait for subscribers, as a [`StandInTopic`] does.
///
/// It begins by publishing [`StandInBridge::idle_state`], as a bridge does. Requests are accepted and done at once,
/// unless [`StandInBridge::answer_next`] says otherwise; the module's documentation has the exceptions.
pub struct StandInBridge {
    telemetry: StandInTopic<DspTelemetry>,
    state: StandInTopic<ModuleState>,
    worker: Worker<BridgePorts>,
    received: Inbox<Received>,
}

/// A request that has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Received {
    /// Start or stop.
    Control(ModuleControl),
    /// A movement.
    Movement(MovementData),
    /// A parameter.
    Parameter(ParameterRequest),
}

impl StandInBridge {
    /// Stands in for robot 1's bridge in `domain`.
    ///
    /// # Panics
    ///
    /// When that is not possible, with the reason.
    pub fn start(domain: &Domain) -> StandInBridge {
        StandInBridge::start_for(domain, RobotId::DEFAULT)
    }

    /// Stands in for `robot`'s bridge in `domain`.
    ///
    /// # Panics
    ///
    /// When that is not possible, with the reason.
    pub fn start_for(domain: &Domain, robot: RobotId) -> StandInBridge {
        StandInBridge::start_as(domain, robot, false)
    }

    /// Stands in for `robot`'s bridge in `domain`, and does not wait for subscribers, as a bridge does not.
    ///
    /// # Panics
    ///
    /// When that is not possible, with the reason.
    pub fn start_lossy(domain: &Domain, robot: RobotId) -> StandInBridge {
        StandInBridge::start_as(domain, robot, true)
    }

    fn start_as(domain: &Domain, robot: RobotId, is_lossy: bool) -> StandInBridge {
        let (inbox, received) = Inbox::new();
        let open = |ipc: &Ipc| {
            Ok(BridgePorts {
                control: ipc.server()?,
                movement: ipc.server()?,
                parameters: ipc.server()?,
                table: PortTable::default(),
                paths: Paths::default(),
                answers: VecDeque::new(),
                open: BTreeMap::new(),
                inbox,
            })
        };
        let bridge = StandInBridge {
            telemetry: StandInTopic::start_as(domain, robot, NAME, is_lossy),
            state: StandInTopic::start_as(domain, robot, NAME, is_lossy),
            worker: Worker::start(domain, robot, NAME, open),
            received,
        };
        bridge.publish_state(&StandInBridge::idle_state());
        bridge
    }

    /// The state of a bridge that was started, rests and has a link: for tests to change what they care for.
    pub fn idle_state() -> ModuleState {
        ModuleState {
            module_id: ModuleId::HeroBridge.code(),
            status: ModuleStatus::Running.code(),
            functionality: Functionality::AtRest.code(),
            link: LinkHealth {
                state: LinkState::Up.code(),
                port_openings: 1,
                dsp_path: DspPathState::Empty.code(),
                ..LinkHealth::default()
            },
            ..ModuleState::default()
        }
    }

    /// Publishes `sample` and returns its number in the sequence. A `received_ns` of 0 becomes the present. Its flying
    /// flag says which ports may be written.
    ///
    /// # Panics
    ///
    /// When it cannot be published, or the stand-in has died.
    #[track_caller]
    pub fn publish(&self, sample: &DspTelemetry) -> u64 {
        let sample = *sample;
        (self.worker).call(move |ports| ports.table.set_flying(sample.is_flying()));
        self.telemetry.publish_with(move |slot| {
            *slot = sample;
            if slot.received_ns == 0 {
                slot.received_ns = MonotonicNs::now().0;
            }
        })
    }

    /// Publishes `state` and returns its number in the sequence. A `published_ns` of 0 becomes the present.
    ///
    /// # Panics
    ///
    /// When it cannot be published, or the stand-in has died.
    #[track_caller]
    pub fn publish_state(&self, state: &ModuleState) -> u64 {
        let state = *state;
        self.state.publish_with(move |slot| {
            *slot = state;
            if slot.published_ns == 0 {
                slot.published_ns = MonotonicNs::now().0;
            }
        })
    }

    /// Answers the next request so. Several answers are for as many requests, of whatever service, in order.
    ///
    /// # Panics
    ///
    /// When the stand-in has died.
    #[track_caller]
    pub fn answer_next(&self, answer: Answer) {
        self.worker
            .call(move |ports| ports.answers.push_back(Some(answer)));
    }

    /// Answers as many requests as where the test says nothing, before the next answer that it gives.
    ///
    /// # Panics
    ///
    /// When the stand-in has died.
    #[track_caller]
    pub fn answer_as_usual(&self, requests: usize) {
        self.worker
            .call(move |ports| ports.answers.extend((0..requests).map(|_| None)));
    }

    /// Adds a port to the DSP's, or replaces the one with its number.
    ///
    /// # Panics
    ///
    /// When the stand-in has died.
    #[track_caller]
    pub fn set_port(&self, port: StandInPort) {
        self.worker.call(move |ports| ports.table.set(port));
    }

    /// The DSP's port with this number, with the value that it has now.
    ///
    /// # Panics
    ///
    /// When the stand-in has died.
    #[track_caller]
    pub fn port(&self, number: u16) -> Option<StandInPort> {
        self.worker
            .call(move |ports| ports.table.port(number).cloned())
    }

    /// Reports something about a request that is still open, as one that hung.
    ///
    /// # Errors
    ///
    /// When the request is not open any more, or its client is gone.
    ///
    /// # Panics
    ///
    /// When the stand-in has died.
    #[track_caller]
    pub fn report(&self, request_id: u64, report: &RequestReport) -> Result<(), ReportError> {
        let report = *report;
        self.worker
            .call(move |ports| ports.report(request_id, &report))
    }

    /// Waits for the next request, in the order in which they came, and returns it.
    ///
    /// # Panics
    ///
    /// When none comes for [`WAIT_LIMIT`](ipc_fixtures::process::WAIT_LIMIT), or the stand-in has died.
    #[track_caller]
    pub fn next_request(&self) -> Received {
        self.received.next()
    }

    /// The requests that have come and were not returned yet, in the order in which they came.
    pub fn take_requests(&self) -> Vec<Received> {
        self.received.take()
    }

    /// Dies: everything is closed without a word to anybody. Returns when that is done.
    pub fn die(self) {
        self.worker.join();
    }
}

/// Accepted, then one report for each of so many waypoints sent, one for each reached but the last, and done.
pub fn progress(waypoints: u32) -> Answer {
    let counts = |stage: Stage, sent: u32, reached: u32| RequestReport {
        waypoints_total: waypoints,
        waypoints_sent: sent,
        waypoints_reached: reached,
        ..RequestReport::new(stage, Reason::None)
    };
    let sent = (1..=waypoints).map(|sent| counts(Stage::Progress, sent, 0));
    let reached = (1..waypoints).map(|reached| counts(Stage::Progress, waypoints, reached));
    let mut reports: Vec<_> = sent.chain(reached).collect();
    reports.push(counts(Stage::Done, waypoints, waypoints));
    Answer::accepted_then(reports)
}

/// An open request's place.
#[derive(Clone, Copy, Debug)]
enum Place {
    Control(Ticket),
    Movement(Ticket),
    Parameter(Ticket),
}

struct BridgePorts {
    control: Server<ModuleControl>,
    movement: Server<MovementData>,
    parameters: Server<ParameterRequest>,
    table: PortTable,
    paths: Paths,
    /// `None` stands for the usual answer.
    answers: VecDeque<Option<Answer>>,
    open: BTreeMap<u64, Place>,
    inbox: Sender<Received>,
}

impl BridgePorts {
    /// Sends `report`; a final one closes the request.
    fn report(&mut self, request_id: u64, report: &RequestReport) -> Result<(), ReportError> {
        let place = *self.open.get(&request_id).ok_or(ReportError::NotOpen)?;
        if report.is_final() {
            self.open.remove(&request_id);
            self.paths.closed(request_id);
        }
        match place {
            Place::Control(ticket) => self.control.report(ticket, report),
            Place::Movement(ticket) => self.movement.report(ticket, report),
            Place::Parameter(ticket) => self.parameters.report(ticket, report),
        }
    }

    /// Takes a request, and answers it. False when the answer is to die.
    fn take(&mut self, place: Place, received: Received) -> bool {
        let (request_id, path_id) = match &received {
            Received::Control(request) => (request.request_id(), request.path_id()),
            Received::Movement(request) => (request.request_id(), request.path_id()),
            Received::Parameter(request) => (request.request_id(), request.path_id()),
        };
        self.open.insert(request_id, place);
        // The test may have dropped its end already.
        let _ = self.inbox.send(received);
        let scripted = self.answers.pop_front().flatten();
        let answer = scripted.unwrap_or_else(|| self.usual_answer(&received));
        if let Received::Movement(request) = &received {
            for (id, report) in self.paths.take(request, &answer) {
                // Its client may be gone.
                let _ = self.report(id, &report);
            }
        }
        match answer {
            Answer::Hang => true,
            Answer::Die => false,
            Answer::Reports(reports) => {
                for report in reports {
                    let report = RequestReport { path_id, ..report };
                    // A client that is gone, or that does not read, loses its reports.
                    let _ = self.report(request_id, &report);
                }
                true
            }
        }
    }

    /// How a request is answered that the test says nothing about.
    fn usual_answer(&mut self, received: &Received) -> Answer {
        match received {
            Received::Control(_) => Answer::done(),
            Received::Movement(request) => self.paths.usual_answer(request),
            Received::Parameter(request) => Answer::Reports(vec![self.table.answer(request)]),
        }
    }

    /// The client of this request has given it up.
    fn vanished(&mut self, request_id: u64) {
        self.open.remove(&request_id);
        self.paths.closed(request_id);
    }
}

impl Ports for BridgePorts {
    fn sources(&mut self) -> Vec<&mut dyn Source> {
        vec![&mut self.control, &mut self.movement, &mut self.parameters]
    }

    fn drain(&mut self) -> bool {
        let mut gone = Vec::new();
        self.control.vanished(|_, id| gone.push(id));
        self.movement.vanished(|_, id| gone.push(id));
        self.parameters.vanished(|_, id| gone.push(id));
        gone.into_iter().for_each(|id| self.vanished(id));
        let mut came = Vec::new();
        // What cannot be received now is tried again at the next wake.
        let _ = self.control.drain(|ticket, request| {
            came.push((Place::Control(ticket), Received::Control(*request)));
        });
        let _ = self.movement.drain(|ticket, request| {
            came.push((Place::Movement(ticket), Received::Movement(*request)));
        });
        let _ = self.parameters.drain(|ticket, request| {
            came.push((Place::Parameter(ticket), Received::Parameter(*request)));
        });
        came.into_iter()
            .all(|(place, received)| self.take(place, received))
    }
}

/// Which requests of paths are open, and what a movement that comes does to them.
///
/// A waypoint before the last is done when the next one of its path is accepted, and broken when that is refused. A
/// path that is under way is replaced by a movement that may pre-empt it; any other movement is busy, unless the test
/// says otherwise.
#[derive(Debug, Default)]
struct Paths {
    /// The newest waypoint of the path that is being assembled, and the path.
    assembling: Option<(u64, u64)>,
    /// The request that closed the path under way.
    under_way: Option<u64>,
}

impl Paths {
    /// The request is not open any more.
    fn closed(&mut self, request_id: u64) {
        self.assembling = self.assembling.filter(|(id, _)| *id != request_id);
        self.under_way = self.under_way.filter(|id| *id != request_id);
    }

    /// How a movement is answered that the test says nothing about.
    fn usual_answer(&self, request: &MovementData) -> Answer {
        if !closes(request) {
            return Answer::Reports(vec![RequestReport::new(Stage::Accepted, Reason::None)]);
        }
        match self.under_way {
            Some(_) if !preempts(request) => Answer::refuse(Reason::Busy),
            _ => Answer::done(),
        }
    }

    /// Takes a movement that will be answered so. Returns the final reports about requests that it ends.
    fn take(&mut self, request: &MovementData, answer: &Answer) -> Vec<(u64, RequestReport)> {
        let first = match answer {
            Answer::Reports(reports) => reports.first().and_then(RequestReport::stage),
            Answer::Hang | Answer::Die => None,
        };
        let mut ended = Vec::new();
        if let Some((id, path_id)) = self.assembling
            && path_id == request.path_id
        {
            match first {
                Some(Stage::Refused) => {
                    ended.push((id, RequestReport::new(Stage::Aborted, Reason::PathBroken)));
                }
                Some(_) => ended.push((id, RequestReport::new(Stage::Done, Reason::None))),
                None => {}
            }
        }
        if first.is_some_and(|stage| stage != Stage::Refused) {
            if preempts(request)
                && let Some(id) = self.under_way
            {
                ended.push((id, RequestReport::new(Stage::Aborted, Reason::Replaced)));
            }
            self.note(request);
        }
        ended
    }

    fn note(&mut self, request: &MovementData) {
        if !closes(request) {
            self.assembling = Some((request.request_id, request.path_id));
        } else if request.kind() == Some(MovementKind::GoToWaypoint) {
            self.under_way = Some(request.request_id);
        }
    }
}

/// Whether the helicopter is to move when this was taken: all but a waypoint before the last.
fn closes(request: &MovementData) -> bool {
    request.kind() != Some(MovementKind::GoToWaypoint) || request.is_last() == Some(true)
}

/// Whether it replaces a path that is under way.
fn preempts(request: &MovementData) -> bool {
    request.kind() == Some(MovementKind::Hold) || (closes(request) && request.preempt == 1)
}

#[cfg(test)]
mod tests;
