//! [`StandInServer`]: in the place of whoever serves a request, whatever its struct is.

use std::collections::{BTreeMap, VecDeque};
use std::sync::mpsc::Sender;

use ipc_types::payload::RequestReport;
use ipc_types::{Domain, Ipc, ReportError, Request, RobotId, Server, Source, Ticket};

use super::answer::Answer;
use super::worker::{Inbox, Ports, Worker};

/// In the place of the module that serves `R`. Requests are accepted and done at once, unless
/// [`StandInServer::answer_next`] says otherwise.
pub struct StandInServer<R: Request> {
    worker: Worker<ServerPorts<R>>,
    received: Inbox<R>,
}

struct ServerPorts<R: Request> {
    server: Server<R>,
    answers: VecDeque<Answer>,
    open: BTreeMap<u64, Ticket>,
    inbox: Sender<R>,
}

impl<R: Request> StandInServer<R> {
    /// Stands in for robot 1's server in `domain`.
    ///
    /// # Panics
    ///
    /// When that is not possible, with the reason.
    pub fn start(domain: &Domain) -> StandInServer<R> {
        StandInServer::start_for(domain, RobotId::DEFAULT)
    }

    /// Stands in for `robot`'s server in `domain`.
    ///
    /// # Panics
    ///
    /// When that is not possible, with the reason.
    pub fn start_for(domain: &Domain, robot: RobotId) -> StandInServer<R> {
        let (inbox, received) = Inbox::new();
        let open = |ipc: &Ipc| {
            Ok(ServerPorts {
                server: ipc.server()?,
                answers: VecDeque::new(),
                open: BTreeMap::new(),
                inbox,
            })
        };
        StandInServer {
            worker: Worker::start(domain, robot, R::PROVIDER, open),
            received,
        }
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
    /// When none comes for [`WAIT_LIMIT`](crate::process::WAIT_LIMIT), or the stand-in has died.
    #[track_caller]
    pub fn next_request(&self) -> R {
        self.received.next()
    }

    /// Dies: the service is closed without a word to anybody. Returns when that is done.
    pub fn die(self) {
        self.worker.join();
    }
}

impl<R: Request> ServerPorts<R> {
    fn report(&mut self, request_id: u64, report: &RequestReport) -> Result<(), ReportError> {
        let ticket = *self.open.get(&request_id).ok_or(ReportError::NotOpen)?;
        if report.is_final() {
            self.open.remove(&request_id);
        }
        self.server.report(ticket, report)
    }

    /// Takes a request, and answers it. False when the answer is to die.
    fn take(&mut self, ticket: Ticket, request: R) -> bool {
        let (id, path_id) = (request.request_id(), request.path_id());
        self.open.insert(id, ticket);
        // The test may have dropped its end already.
        let _ = self.inbox.send(request);
        match self.answers.pop_front().unwrap_or_else(Answer::done) {
            Answer::Hang => {}
            Answer::Die => return false,
            Answer::Reports(reports) => {
                for report in reports {
                    // A client that is gone, or that does not read, loses its reports.
                    let _ = self.report(id, &RequestReport { path_id, ..report });
                }
            }
        }
        true
    }
}

impl<R: Request> Ports for ServerPorts<R> {
    fn sources(&mut self) -> Vec<&mut dyn Source> {
        vec![&mut self.server]
    }

    fn drain(&mut self) -> bool {
        let open = &mut self.open;
        self.server.vanished(|_, id| _ = open.remove(&id));
        let mut came = Vec::new();
        // What cannot be received now is tried again at the next wake.
        let _ = self
            .server
            .drain(|ticket, request| came.push((ticket, *request)));
        came.into_iter()
            .all(|(ticket, request)| self.take(ticket, request))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::process::WAIT_LIMIT;
    use crate::{StandInTopic, TestDomain};
    use ipc_types::code::{Reason, Stage};
    use ipc_types::module::State;
    use ipc_types::payload::ModuleControl;
    use ipc_types::{ControlOf, StateOf, code::ControlCommand};

    struct Watch;
    ipc_types::module!(Watch, "watch", 1000);

    #[test]
    fn a_module_s_state_and_control_are_stood_in_for() {
        let domain = TestDomain::new();
        let topic = StandInTopic::<StateOf<Watch>>::start(&domain);
        let server = StandInServer::<ControlOf<Watch>>::start(&domain);
        let ipc = domain.join("operator");

        let state = State {
            module_id: 1000,
            ..State::default()
        };
        assert_eq!(topic.publish(&StateOf::new(state)), 1);
        let mut states = ipc.subscriber::<StateOf<Watch>>().expect("a subscriber");
        states.wait(WAIT_LIMIT).expect("a wait");
        let seen = states.latest().expect("samples").expect("the last one");
        assert_eq!((seen.module_id, seen.sequence), (1000, 1));

        let mut client = ipc.client::<ControlOf<Watch>>().expect("a client");
        let mut ends = Vec::new();
        for (id, answer) in [(7, None), (8, Some(Answer::refuse(Reason::Busy)))] {
            if let Some(answer) = answer {
                server.answer_next(answer);
            }
            let request = ControlOf::command(id, ControlCommand::Start);
            client.send(&request).expect("a request that is taken");
            assert_eq!(server.next_request(), request);
            while client.outstanding() > 0 {
                client.wait(WAIT_LIMIT).expect("a wait");
                client.drain(|report| ends.extend(report.is_final().then(|| report.stage())));
            }
        }
        assert_eq!(ends, [Some(Stage::Done), Some(Stage::Refused)]);
        let _: ModuleControl = *ControlOf::<Watch>::default();
    }
}
