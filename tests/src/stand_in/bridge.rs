//! [`StandInBridge`]: publishes the DSP's telemetry and the module's state, and answers requests as it is told.

use std::collections::{BTreeMap, VecDeque};
use std::sync::mpsc::{self, Receiver, Sender};

use ipc_types::code::{Functionality, LinkState, ModuleId, ModuleStatus, Reason, Stage};
use ipc_types::payload::{
    DspTelemetry, LinkHealth, ModuleControl, ModuleState, MovementData, RequestReport,
};
use ipc_types::service::Request;
use ipc_types::{
    Domain, Ipc, MonotonicNs, OpenError, Publisher, ReportError, RobotId, Server, Source, Ticket,
};

use super::worker::{Ports, Worker};
use crate::process::WAIT_LIMIT;

/// In the place of the bridge.
///
/// It begins by publishing [`StandInBridge::idle_state`], as a bridge does. Requests are accepted and done at once,
/// unless [`StandInBridge::answer_next`] says otherwise.
pub struct StandInBridge {
    worker: Worker<BridgePorts>,
    received: Receiver<Received>,
}

/// A request that has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Received {
    /// Start or stop.
    Control(ModuleControl),
    /// A movement.
    Movement(MovementData),
}

/// What to do with a request.
#[derive(Clone, Debug, PartialEq)]
pub enum Answer {
    /// Say exactly this. Without a final stage at the end the request stays open.
    Reports(Vec<RequestReport>),
    /// Take it and say nothing: a bridge that hangs. [`StandInBridge::report`] may say something later.
    Hang,
    /// Die: close everything without a word. The sender's own port then says that the outcome is unknown.
    Die,
}

impl Answer {
    /// Accepted, then done.
    pub fn done() -> Answer {
        Answer::accepted_then(vec![report(Stage::Done, Reason::None)])
    }

    /// Refused.
    pub fn refuse(reason: Reason) -> Answer {
        Answer::Reports(vec![report(Stage::Refused, reason)])
    }

    /// Accepted, then ended early.
    pub fn abort(reason: Reason) -> Answer {
        Answer::accepted_then(vec![report(Stage::Aborted, reason)])
    }

    /// Accepted, then one word for each of so many waypoints sent, one for each reached but the last, and done.
    pub fn progress(waypoints: u32) -> Answer {
        let counts = |sent: u32, reached: u32| RequestReport {
            waypoints_total: waypoints,
            waypoints_sent: sent,
            waypoints_reached: reached,
            ..report(Stage::Progress, Reason::None)
        };
        let sent = (1..=waypoints).map(|sent| counts(sent, 0));
        let reached = (1..waypoints).map(|reached| counts(waypoints, reached));
        let mut reports: Vec<_> = sent.chain(reached).collect();
        reports.push(RequestReport {
            stage: Stage::Done.code(),
            ..counts(waypoints, waypoints)
        });
        Answer::accepted_then(reports)
    }

    fn accepted_then(mut reports: Vec<RequestReport>) -> Answer {
        reports.insert(0, report(Stage::Accepted, Reason::None));
        Answer::Reports(reports)
    }
}

fn report(stage: Stage, reason: Reason) -> RequestReport {
    RequestReport::new(stage, reason)
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
        let (sender, received) = mpsc::channel();
        let worker = Worker::start(
            domain,
            robot,
            "stand-in-bridge",
            |ports: &mut BridgePorts| {
                ports.inbox = Some(sender);
            },
        );
        let bridge = StandInBridge { worker, received };
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
                ..LinkHealth::default()
            },
            ..ModuleState::default()
        }
    }

    /// Publishes `sample` and returns its number in the sequence. A `received_ns` of 0 becomes the present.
    ///
    /// # Panics
    ///
    /// When it cannot be published, or the stand-in has died.
    #[track_caller]
    pub fn publish(&self, sample: &DspTelemetry) -> u64 {
        let sample = *sample;
        let published = self.worker.call(move |ports| {
            ports.telemetry.publish(|slot| {
                *slot = sample;
                if slot.received_ns == 0 {
                    slot.received_ns = MonotonicNs::now().0;
                }
            })
        });
        published.expect("a sample that can be published")
    }

    /// Publishes `state` and returns its number in the sequence. A `published_ns` of 0 becomes the present.
    ///
    /// # Panics
    ///
    /// When it cannot be published, or the stand-in has died.
    #[track_caller]
    pub fn publish_state(&self, state: &ModuleState) -> u64 {
        let state = *state;
        let published = self.worker.call(move |ports| {
            ports.state.publish(|slot| {
                *slot = state;
                if slot.published_ns == 0 {
                    slot.published_ns = MonotonicNs::now().0;
                }
            })
        });
        published.expect("a state that can be published")
    }

    /// Answers the next request so. Several answers are for as many requests, in order.
    ///
    /// # Panics
    ///
    /// When the stand-in has died.
    #[track_caller]
    pub fn answer_next(&self, answer: Answer) {
        self.worker
            .call(move |ports| ports.answers.push_back(answer));
    }

    /// Says something about a request that is still open, as one that hung.
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
    /// When none comes for [`WAIT_LIMIT`], or the stand-in has died.
    #[track_caller]
    pub fn next_request(&self) -> Received {
        match self.received.recv_timeout(WAIT_LIMIT) {
            Ok(received) => received,
            Err(error) => panic!("no request came within {WAIT_LIMIT:?} ({error})"),
        }
    }

    /// Dies: everything is closed without a word to anybody. Returns when that is done.
    pub fn die(self) {
        self.worker.join();
    }
}

/// An open request's place.
#[derive(Clone, Copy, Debug)]
enum Place {
    Control(Ticket),
    Movement(Ticket),
}

struct BridgePorts {
    telemetry: Publisher<DspTelemetry>,
    state: Publisher<ModuleState>,
    control: Server<ModuleControl>,
    movement: Server<MovementData>,
    answers: VecDeque<Answer>,
    open: BTreeMap<u64, Place>,
    inbox: Option<Sender<Received>>,
}

impl BridgePorts {
    /// Says `report`; a final one closes the request.
    fn report(&mut self, request_id: u64, report: &RequestReport) -> Result<(), ReportError> {
        let place = *self.open.get(&request_id).ok_or(ReportError::NotOpen)?;
        if report.is_final() {
            self.open.remove(&request_id);
        }
        match place {
            Place::Control(ticket) => self.control.report(ticket, report),
            Place::Movement(ticket) => self.movement.report(ticket, report),
        }
    }

    /// Takes a request. False when that is to die of.
    fn take<R: Request>(&mut self, request: &R, place: Place, received: Received) -> bool {
        self.open.insert(request.request_id(), place);
        if let Some(inbox) = &self.inbox {
            // The test may have dropped its end already.
            let _ = inbox.send(received);
        }
        match self.answers.pop_front().unwrap_or_else(Answer::done) {
            Answer::Hang => true,
            Answer::Die => false,
            Answer::Reports(reports) => {
                for report in reports {
                    let report = RequestReport {
                        path_id: request.path_id(),
                        ..report
                    };
                    // A client that is gone, or that does not read, loses what it would have been told.
                    let _ = self.report(request.request_id(), &report);
                }
                true
            }
        }
    }
}

impl Ports for BridgePorts {
    fn open(ipc: &Ipc) -> Result<Self, OpenError> {
        Ok(BridgePorts {
            telemetry: ipc.publisher()?,
            state: ipc.publisher()?,
            control: ipc.server()?,
            movement: ipc.server()?,
            answers: VecDeque::new(),
            open: BTreeMap::new(),
            inbox: None,
        })
    }

    fn sources(&self) -> Vec<&dyn Source> {
        vec![&self.telemetry, &self.state, &self.control, &self.movement]
    }

    fn drain(&mut self) -> bool {
        self.telemetry.welcome();
        self.state.welcome();
        self.control.vanished(|_, id| _ = self.open.remove(&id));
        self.movement.vanished(|_, id| _ = self.open.remove(&id));
        let mut controls = Vec::new();
        let mut movements = Vec::new();
        // What cannot be received now is tried again at the next wake.
        let _ = self
            .control
            .drain(|ticket, request| controls.push((ticket, *request)));
        let _ = self
            .movement
            .drain(|ticket, request| movements.push((ticket, *request)));
        controls.iter().all(|(ticket, request)| {
            self.take(
                request,
                Place::Control(*ticket),
                Received::Control(*request),
            )
        }) && movements.iter().all(|(ticket, request)| {
            self.take(
                request,
                Place::Movement(*ticket),
                Received::Movement(*request),
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use ipc_types::code::ControlCommand;
    use ipc_types::{Client, SendError};

    use super::*;
    use crate::TestDomain;

    /// Sends a take-off and follows its reports to the final word.
    fn take_off(client: &mut Client<MovementData>, id: u64) -> Vec<(Stage, Reason)> {
        client
            .send(&MovementData::take_off(id, 10.0))
            .expect("sent");
        follow(client)
    }

    fn follow(client: &mut Client<MovementData>) -> Vec<(Stage, Reason)> {
        let mut words = Vec::new();
        while client.outstanding() > 0 {
            client.wait(WAIT_LIMIT).expect("a wait");
            client.drain(|report| {
                words.push((
                    report.stage().expect("a stage"),
                    report.reason().expect("a reason"),
                ));
            });
        }
        words
    }

    #[test]
    fn requests_are_answered_as_told_and_then_as_usual() {
        use Stage::{Aborted, Accepted, Done, Progress, Refused};
        let domain = TestDomain::new();
        let bridge = StandInBridge::start(&domain);
        let ipc = domain.join("operator");
        let mut client = ipc.client::<MovementData>().expect("a client");
        let none = Reason::None;
        for (answer, words) in [
            (
                Answer::refuse(Reason::NotStarted),
                vec![(Refused, Reason::NotStarted)],
            ),
            (
                Answer::abort(Reason::DspRebooted),
                vec![(Accepted, none), (Aborted, Reason::DspRebooted)],
            ),
            (
                Answer::progress(2),
                vec![
                    (Accepted, none),
                    (Progress, none),
                    (Progress, none),
                    (Progress, none),
                    (Done, none),
                ],
            ),
        ] {
            bridge.answer_next(answer);
            assert_eq!(take_off(&mut client, 7), words);
            assert_eq!(
                bridge.next_request(),
                Received::Movement(MovementData::take_off(7, 10.0))
            );
        }
        assert_eq!(take_off(&mut client, 8), [(Accepted, none), (Done, none)]);
    }

    #[test]
    fn a_request_that_hangs_can_be_answered_later() {
        let domain = TestDomain::new();
        let bridge = StandInBridge::start(&domain);
        let ipc = domain.join("operator");
        let mut client = ipc.client::<MovementData>().expect("a client");
        bridge.answer_next(Answer::Hang);
        client.send(&MovementData::land(5)).expect("sent");
        bridge.next_request();
        assert_eq!(client.drain(|report| panic!("unasked: {report:?}")), 0);
        let done = RequestReport::new(Stage::Done, Reason::None);
        assert_eq!(bridge.report(5, &done), Ok(()));
        assert_eq!(follow(&mut client), [(Stage::Done, Reason::None)]);
        assert_eq!(bridge.report(5, &done), Err(ReportError::NotOpen));
    }

    #[test]
    fn a_bridge_that_dies_leaves_the_outcome_unknown() {
        let domain = TestDomain::new();
        let bridge = StandInBridge::start(&domain);
        let ipc = domain.join("operator");
        let mut client = ipc.client::<MovementData>().expect("a client");
        bridge.answer_next(Answer::Die);
        assert_eq!(
            take_off(&mut client, 5),
            [(Stage::Unknown, Reason::BridgeGone)]
        );
        let again = client.send(&MovementData::land(6));
        assert!(
            matches!(again, Err(SendError::NoServer { .. })),
            "{again:?}"
        );
        bridge.die();
    }

    #[test]
    fn both_telemetries_and_controls_pass() {
        let domain = TestDomain::new();
        let bridge = StandInBridge::start(&domain);
        let ipc = domain.join("consumer");
        let mut states = ipc.subscriber::<ModuleState>().expect("a subscriber");
        states.wait(WAIT_LIMIT).expect("a wait");
        let state = states.latest().expect("states").expect("the first");
        assert_eq!(state.status(), Some(ModuleStatus::Running));
        let mut telemetry = ipc.subscriber::<DspTelemetry>().expect("a subscriber");
        assert_eq!(bridge.publish(&DspTelemetry::default()), 1);
        telemetry.wait(WAIT_LIMIT).expect("a wait");
        assert!(
            telemetry
                .latest()
                .expect("samples")
                .expect("one")
                .received_ns
                > 0
        );
        let mut control = ipc.client::<ModuleControl>().expect("a client");
        let start = ModuleControl::new(3, ControlCommand::Start);
        control.send(&start).expect("sent");
        assert_eq!(bridge.next_request(), Received::Control(start));
    }
}
