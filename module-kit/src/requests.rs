//! [`Requests`]: serves one kind of request; each gets one final report, and none is executed twice (requirement D15).
//!
//! | the id | is answered |
//! |---|---|
//! | is new | by the module |
//! | is under way, and its client is there | refused: still-open; the first stream goes on |
//! | is under way, and its client is gone | accepted, and then as the first client would have been |
//! | ended not long ago | the same final report once more |
//! | is new, and the request has a `begin_by_ns` that has passed | refused: too-late |

use ipc_types::code::{Reason, Stage};
use ipc_types::payload::{FieldKind, Number, RequestReport};
use ipc_types::server::MAX_OPEN_TICKETS;
use ipc_types::{Ipc, MonotonicNs, OpenError, ReportError, Request, Server, Source, Ticket};

use crate::completed::Completed;

/// Final reports that are remembered, so that a request that is sent again is answered and not executed again.
pub const REMEMBERED: usize = 256;

/// Requests that may be under way at once, those included whose clients are gone: twice what all clients can have open. While there are
/// as many, a new one is refused: too-many-requests. To forget one would be to carry it out twice.
pub const UNDER_WAY: usize = MAX_OPEN_TICKETS as usize;

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
    /// A client that is gone changes nothing here. It may ask again with the same id, and then gets what is said from then on.
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

/// The answer to a request that may not begin any more: it has the field `begin_by_ns`, which is not 0, and that moment has passed.
fn too_late<R: Request>(request: &R, now: MonotonicNs) -> Option<RequestReport> {
    let mut fields = R::FIELDS.iter();
    let field = fields.find(|field| {
        field.name == "begin_by_ns" && field.kind == FieldKind::Number(Number::U64)
    })?;
    let bytes = request.bytes().get(field.offset..)?.first_chunk()?;
    late(MonotonicNs(u64::from_ne_bytes(*bytes)), now)
}

/// The refusal of a request that had to begin by `begin_by`, with by how many seconds it is late; `None` if it is in time. 0 is no moment.
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

/// Which requests are under way, and how those before them ended. A pure value: [`Requests`] asks it, and so does a server of another
/// language.
pub struct Answers {
    completed: Completed,
    under_way: Vec<Execution>,
}

/// What is done for a request, from its first report to its final one.
struct Execution {
    request_id: u64,
    /// `None` while the client is gone.
    client: Option<Ticket>,
}

impl Default for Answers {
    fn default() -> Answers {
        Answers::new()
    }
}

impl Answers {
    /// No request was there yet.
    pub fn new() -> Answers {
        Answers {
            completed: Completed::with_capacity(REMEMBERED),
            under_way: Vec::new(),
        }
    }

    /// The answer to a request that must not be carried out; `None` if it is to be.
    pub fn known(&mut self, request_id: u64, ticket: Ticket) -> Option<RequestReport> {
        if let Some(report) = self.completed.report_of(request_id) {
            return Some(RequestReport {
                reported_ns: 0,
                ..*report
            });
        }
        let is_full = self.under_way.len() >= UNDER_WAY;
        let mut under_way = self.under_way.iter_mut();
        let (stage, reason) = match under_way.find(|work| work.request_id == request_id) {
            Some(Execution { client, .. }) if client.is_none() => {
                *client = Some(ticket);
                (Stage::Accepted, Reason::None)
            }
            Some(_) => (Stage::Refused, Reason::StillOpen),
            None if request_id == 0 => (Stage::Refused, Reason::InvalidRequest),
            None if is_full => (Stage::Refused, Reason::TooManyRequests),
            None => return None,
        };
        Some(RequestReport::new(stage, reason))
    }

    /// The first report about a request that is carried out.
    pub fn begin(&mut self, ticket: Ticket, report: &RequestReport) {
        if report.is_final() {
            self.completed.note(report);
        } else {
            self.under_way.push(Execution {
                request_id: report.request_id,
                client: Some(ticket),
            });
        }
    }

    /// A further report: which client it is for. `None` if its request is not under way.
    pub fn go_on(&mut self, report: &RequestReport) -> Option<Option<Ticket>> {
        let mut under_way = self.under_way.iter();
        let index = under_way.position(|work| work.request_id == report.request_id)?;
        let client = self.under_way[index].client;
        if report.is_final() {
            self.under_way.swap_remove(index);
            self.completed.note(report);
        }
        Some(client)
    }

    /// The client that has this ticket is gone. What it has asked for goes on.
    pub fn vanished(&mut self, ticket: Ticket) {
        for work in &mut self.under_way {
            work.client = work.client.filter(|client| *client != ticket);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ipc_types::ControlOf;
    use ipc_types::code::ControlCommand;

    const FIRST: Ticket = Ticket::from_bits(1);
    const SECOND: Ticket = Ticket::from_bits(2);

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

    fn report(request_id: u64, stage: Stage) -> RequestReport {
        RequestReport {
            request_id,
            ..RequestReport::new(stage, Reason::None)
        }
    }

    fn reason(answers: &mut Answers, request_id: u64) -> Option<Reason> {
        answers.known(request_id, SECOND)?.reason()
    }

    #[test]
    fn a_request_is_carried_out_once_and_answered_as_often_as_it_is_asked() {
        let mut answers = Answers::new();
        assert_eq!(reason(&mut answers, 7), None, "it is new");
        answers.begin(FIRST, &report(7, Stage::Accepted));
        assert_eq!(reason(&mut answers, 7), Some(Reason::StillOpen));
        let client = answers.go_on(&report(7, Stage::Done));
        assert_eq!(client, Some(Some(FIRST)));
        let again = answers.known(7, SECOND).unwrap();
        assert_eq!((again.stage(), again.request_id), (Some(Stage::Done), 7));
        assert_eq!(answers.go_on(&report(7, Stage::Done)), None, "it has ended");
        answers.begin(FIRST, &report(8, Stage::Done));
        assert_eq!(answers.known(8, SECOND), Some(report(8, Stage::Done)));
        assert_eq!(reason(&mut answers, 0), Some(Reason::InvalidRequest));
    }

    #[test]
    fn a_request_whose_client_is_gone_goes_on_and_who_asks_again_is_answered_in_its_place() {
        let mut answers = Answers::new();
        answers.begin(FIRST, &report(7, Stage::Accepted));
        answers.vanished(FIRST);
        assert_eq!(answers.go_on(&report(7, Stage::Progress)), Some(None));
        let again = answers.known(7, SECOND).unwrap();
        assert_eq!(again.stage(), Some(Stage::Accepted));
        answers.vanished(FIRST);
        assert_eq!(reason(&mut answers, 7), Some(Reason::StillOpen));
        let client = answers.go_on(&report(7, Stage::Done));
        assert_eq!(client, Some(Some(SECOND)));
    }

    #[test]
    fn a_request_that_ends_without_a_client_is_remembered() {
        let mut answers = Answers::new();
        answers.begin(FIRST, &report(7, Stage::Accepted));
        answers.vanished(FIRST);
        assert_eq!(answers.go_on(&report(7, Stage::Done)), Some(None));
        assert_eq!(answers.known(7, SECOND), Some(report(7, Stage::Done)));
    }

    #[test]
    fn none_that_is_under_way_is_forgotten_for_a_new_one() {
        let mut answers = Answers::new();
        for id in 1..=UNDER_WAY as u64 {
            assert_eq!(answers.known(id, FIRST), None);
            answers.begin(FIRST, &report(id, Stage::Accepted));
            answers.vanished(FIRST);
        }
        let one_more = UNDER_WAY as u64 + 1;
        assert_eq!(
            reason(&mut answers, one_more),
            Some(Reason::TooManyRequests)
        );
        let known = answers.known(1, SECOND).unwrap();
        assert_eq!(known.stage(), Some(Stage::Accepted), "it is there still");
        answers.go_on(&report(2, Stage::Done));
        assert_eq!(reason(&mut answers, one_more), None);
    }
}
