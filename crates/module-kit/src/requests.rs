//! [`Requests`]: serves one kind of request. Which of them the module carries out, [`Answers`] say; one that has a
//! `begin_by_ns` which has passed is refused: too-late.

use ipc_types::code::{Reason, Stage};
use ipc_types::payload::{FieldKind, Number, RequestReport};
use ipc_types::{Ipc, MonotonicNs, OpenError, ReportError, Request, Server, Source, Ticket};

use crate::answers::Answers;

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

    /// Takes every request that is there: `answer` carries one out and gives the report about it, of which only stage,
    /// reason and what they are about are its own. After a report that is not final, [`report`](Self::report) goes on.
    ///
    /// Call it after every wake.
    pub fn serve(&mut self, mut answer: impl FnMut(&R) -> RequestReport) {
        let answers = &mut self.answers;
        self.server.vanished(|ticket, _| answers.vanished(ticket));
        let inbox = &mut self.inbox;
        if let Err(error) = self
            .server
            .drain(|ticket, request| inbox.push((ticket, *request)))
        {
            tracing::warn!(%error, "requests could not be received");
        }
        for (ticket, request) in self.inbox.drain(..) {
            let id = request.request_id();
            let known = self.answers.known(id, ticket);
            let report = RequestReport {
                request_id: id,
                path_id: request.path_id(),
                ..known
                    .or_else(|| too_late(&request, MonotonicNs::now()))
                    .unwrap_or_else(|| answer(&request))
            };
            if known.is_none() {
                self.answers.begin(ticket, &report);
            }
            send(&mut self.server, &mut self.answers, ticket, &report);
        }
    }

    /// Says more about a request that is under way. False when it is not: it had its final report, or never came.
    ///
    /// A client that has ended changes nothing here. When it asks again with the same id, it gets the reports from then
    /// on.
    pub fn report(&mut self, request_id: u64, report: &RequestReport) -> bool {
        let report = RequestReport {
            request_id,
            ..*report
        };
        let Some(client) = self.answers.go_on(&report) else {
            return false;
        };
        if let Some(ticket) = client {
            send(&mut self.server, &mut self.answers, ticket, &report);
        }
        true
    }
}

/// The answer to a request that may not begin any more: it has the field `begin_by_ns`, which is not 0, and that moment
/// has passed.
fn too_late<R: Request>(request: &R, now: MonotonicNs) -> Option<RequestReport> {
    let mut fields = R::FIELDS.iter();
    let field = fields.find(|field| {
        field.name == "begin_by_ns" && field.kind == FieldKind::Number(Number::U64)
    })?;
    let bytes = request.bytes().get(field.offset..)?.first_chunk()?;
    late(MonotonicNs(u64::from_ne_bytes(*bytes)), now)
}

/// The refusal of a request that had to begin by `begin_by`, with by how many seconds it is late; `None` if it is in
/// time. 0 is no moment.
pub fn late(begin_by: MonotonicNs, now: MonotonicNs) -> Option<RequestReport> {
    (begin_by.0 > 0 && begin_by < now).then(|| RequestReport {
        value: now.since(begin_by).as_secs_f64(),
        value_valid: 1,
        ..RequestReport::new(Stage::Refused, Reason::TooLate)
    })
}

fn send<R: Request>(
    server: &mut Server<R>,
    answers: &mut Answers,
    ticket: Ticket,
    report: &RequestReport,
) {
    if let Err(error) = server.report(ticket, report) {
        // A client that does not read loses progress, never the final report.
        tracing::debug!(%error, request_id = report.request_id, "a report was not sent");
        if error == ReportError::Vanished {
            answers.vanished(ticket);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ipc_types::ControlOf;
    use ipc_types::code::ControlCommand;

    struct Watch;
    ipc_types::module!(Watch, "watch", 1000);

    #[test]
    fn a_request_whose_moment_has_passed_is_refused_with_by_how_much() {
        let by = |begin_by_ns| {
            let mut control = ControlOf::<Watch>::command(7, ControlCommand::Start);
            control.begin_by_ns = begin_by_ns;
            too_late(&control, MonotonicNs(2_500_000_000))
        };
        assert_eq!((by(0), by(2_500_000_000), by(u64::MAX)), (None, None, None));
        let late = by(1_000_000_000).unwrap();
        assert_eq!(
            (late.stage(), late.reason()),
            (Some(Stage::Refused), Some(Reason::TooLate))
        );
        assert_eq!((late.value, late.value_valid), (1.5, 1));
    }
}
