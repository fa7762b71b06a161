//! [`Requests`]: serves one kind of request; each gets one final report, and none is executed twice (requirement D15).

use ipc_types::code::{Reason, Stage};
use ipc_types::payload::RequestReport;
use ipc_types::{Ipc, OpenError, Request, Server, Source, Ticket};

use crate::completed::Completed;

/// Final reports that are remembered, so that a request that is sent again is answered and not executed again.
pub const REMEMBERED: usize = 256;

/// Serves the requests `R`.
pub struct Requests<R: Request> {
    server: Server<R>,
    answers: Answers,
    inbox: Vec<(Ticket, R)>,
}

impl<R: Request> Requests<R> {
    /// Opens the service.
    ///
    /// # Errors
    /// See [`OpenError`]; another process may serve it.
    pub fn open(ipc: &Ipc) -> Result<Requests<R>, OpenError> {
        Ok(Requests {
            server: ipc.server()?,
            answers: Answers::new(),
            inbox: Vec::new(),
        })
    }

    /// What to wait for.
    pub fn source(&mut self) -> &mut dyn Source {
        &mut self.server
    }

    /// Takes every request that is there: `answer` carries one out and gives the report about it, of which only stage, reason
    /// and what they are about are its own. After a report that is not final, [`report`](Self::report) goes on.
    ///
    /// Call it after every wake.
    pub fn serve(&mut self, mut answer: impl FnMut(&R) -> RequestReport) {
        let answers = &mut self.answers;
        self.server
            .vanished(|_, request_id| answers.close(request_id));
        let inbox = &mut self.inbox;
        if let Err(error) = self
            .server
            .drain(|ticket, request| inbox.push((ticket, *request)))
        {
            tracing::warn!(%error, "requests could not be received");
        }
        for (ticket, request) in self.inbox.drain(..) {
            let id = request.request_id();
            let report = match self.answers.known(id) {
                Some(report) => report,
                None => {
                    let report = RequestReport {
                        request_id: id,
                        path_id: request.path_id(),
                        ..answer(&request)
                    };
                    self.answers.note(ticket, &report);
                    report
                }
            };
            send(&mut self.server, ticket, &report);
        }
    }

    /// Says more about a request that has not had its final report. False when there is no such request any more: it had its
    /// final report, or its client is gone.
    pub fn report(&mut self, request_id: u64, report: &RequestReport) -> bool {
        let Some(ticket) = self.answers.ticket(request_id) else {
            return false;
        };
        let report = RequestReport {
            request_id,
            ..*report
        };
        self.answers.note(ticket, &report);
        send(&mut self.server, ticket, &report);
        true
    }
}

fn send<R: Request>(server: &mut Server<R>, ticket: Ticket, report: &RequestReport) {
    if let Err(error) = server.report(ticket, report) {
        // A client that does not read loses progress, never the final report; one that is gone asked for nothing more.
        tracing::debug!(%error, request_id = report.request_id, "a report was not sent");
    }
}

/// Which requests are open, and how those before them ended. A pure value.
struct Answers {
    completed: Completed,
    open: Vec<(u64, Ticket)>,
}

impl Answers {
    fn new() -> Answers {
        Answers {
            completed: Completed::with_capacity(REMEMBERED),
            open: Vec::new(),
        }
    }

    /// The answer to a request that must not be carried out; nothing when it is to be.
    fn known(&self, request_id: u64) -> Option<RequestReport> {
        if let Some(report) = self.completed.report_of(request_id) {
            return Some(RequestReport {
                reported_ns: 0,
                ..*report
            });
        }
        let reason = if request_id == 0 {
            Reason::InvalidRequest
        } else if self.ticket(request_id).is_some() {
            Reason::StillOpen
        } else {
            return None;
        };
        Some(RequestReport::new(Stage::Refused, reason))
    }

    fn ticket(&self, request_id: u64) -> Option<Ticket> {
        let open = self.open.iter().find(|(id, _)| *id == request_id);
        open.map(|(_, ticket)| *ticket)
    }

    /// Takes note of a report about a request.
    fn note(&mut self, ticket: Ticket, report: &RequestReport) {
        if report.is_final() {
            self.close(report.request_id);
            self.completed.note(report);
        } else if self.ticket(report.request_id).is_none() {
            self.open.push((report.request_id, ticket));
        }
    }

    fn close(&mut self, request_id: u64) {
        self.open.retain(|(id, _)| *id != request_id);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(request_id: u64, stage: Stage) -> RequestReport {
        RequestReport {
            request_id,
            ..RequestReport::new(stage, Reason::None)
        }
    }

    fn reason(answers: &Answers, request_id: u64) -> Option<Reason> {
        answers.known(request_id)?.reason()
    }

    #[test]
    fn a_request_is_carried_out_once_and_answered_as_often_as_it_is_asked() {
        let ticket = Ticket::from_bits(1);
        let mut answers = Answers::new();
        assert_eq!(reason(&answers, 7), None, "it is new");
        answers.note(ticket, &report(7, Stage::Accepted));
        assert_eq!(reason(&answers, 7), Some(Reason::StillOpen), "it is open");
        answers.note(ticket, &report(7, Stage::Done));
        let again = answers.known(7).unwrap();
        assert_eq!((again.stage(), again.request_id), (Some(Stage::Done), 7));
        assert!(answers.open.is_empty());
        assert_eq!(reason(&answers, 0), Some(Reason::InvalidRequest));
    }

    #[test]
    fn a_request_whose_client_is_gone_is_open_no_more() {
        let mut answers = Answers::new();
        answers.note(Ticket::from_bits(1), &report(7, Stage::Accepted));
        answers.close(7);
        assert_eq!(answers.ticket(7), None);
    }
}
