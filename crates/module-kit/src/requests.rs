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
    use ipc_types::code::ControlCommand;
    use ipc_types::{Client, ControlOf, Domain, RobotId, Waiter};
    use std::time::Duration;

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

    /// The requests of a module, and a client of them.
    fn served() -> (Requests<ControlOf<Watch>>, Client<ControlOf<Watch>>, Ipc) {
        let ipc = Ipc::join(&Domain::isolated(), RobotId::DEFAULT, "test").unwrap();
        let requests = Requests::open(&ipc).unwrap();
        (requests, ipc.client().unwrap(), ipc)
    }

    /// What a client is told, without its stamps.
    fn told(client: &mut Client<ControlOf<Watch>>) -> Vec<(u64, Option<Stage>, Option<Reason>)> {
        let mut told = Vec::new();
        client.drain(|report| told.push((report.request_id, report.stage(), report.reason())));
        told
    }

    #[test]
    fn a_client_that_does_not_read_loses_progress_and_has_the_final_report() {
        let (mut requests, mut client, _ipc) = served();
        let start = ControlOf::<Watch>::command(7, ControlCommand::Start);
        client.send(&start).unwrap();
        requests.serve(|_| RequestReport::new(Stage::Accepted, Reason::None));
        for _ in 0..1_000 {
            let progress = RequestReport::new(Stage::Progress, Reason::None);
            assert!(requests.report(7, &progress));
        }
        assert!(requests.report(7, &RequestReport::new(Stage::Done, Reason::None)));
        assert!(told(&mut client).len() < 1_000, "it has lost some");
        // There is room for it now.
        requests.serve(|_| panic!("nothing came"));
        let done = (7, Some(Stage::Done), Some(Reason::None));
        assert_eq!(told(&mut client), [done]);
    }

    #[test]
    fn a_request_is_carried_out_once_in_time_and_reported_to_whoever_asks() {
        let (mut requests, mut client, ipc) = served();
        let start = ControlOf::<Watch>::command(7, ControlCommand::Start);
        let mut late = ControlOf::<Watch>::command(8, ControlCommand::Start);
        late.begin_by_ns = 1;
        let mut begun = Vec::new();
        let mut serve = |requests: &mut Requests<ControlOf<Watch>>, stage| {
            requests.serve(|request| {
                begun.push(request.request_id);
                RequestReport::new(stage, Reason::None)
            });
            begun.len()
        };
        for request in [&start, &late] {
            client.send(request).unwrap();
        }
        assert_eq!(
            serve(&mut requests, Stage::Accepted),
            1,
            "the other one came too late"
        );
        let (none, too_late) = (Some(Reason::None), Some(Reason::TooLate));
        let accepted = (7, Some(Stage::Accepted), none);
        assert_eq!(
            told(&mut client),
            [accepted, (8, Some(Stage::Refused), too_late)]
        );

        // Reports go to a request that is under way, whatever number they carry.
        let report = |stage| RequestReport {
            request_id: 99,
            ..RequestReport::new(stage, Reason::None)
        };
        assert!(
            !requests.report(8, &report(Stage::Progress)),
            "it was refused"
        );
        assert!(
            !requests.report(9, &report(Stage::Progress)),
            "it never came"
        );
        assert!(requests.report(7, &report(Stage::Progress)));
        assert_eq!(told(&mut client), [(7, Some(Stage::Progress), none)]);

        // Its client ends: the work goes on, and who asks again is told its end.
        drop(client);
        let limit = Some(Duration::from_secs(60));
        Waiter::new()
            .wait(&mut [((), requests.source())], limit)
            .unwrap();
        let mut client = ipc.client::<ControlOf<Watch>>().unwrap();
        serve(&mut requests, Stage::Done);
        assert!(
            requests.report(7, &report(Stage::Progress)),
            "nobody hears it"
        );
        client.send(&start).unwrap();
        assert_eq!(
            serve(&mut requests, Stage::Done),
            1,
            "it is not carried out again"
        );
        assert_eq!(told(&mut client), [accepted]);
        assert!(requests.report(7, &report(Stage::Done)));
        assert!(!requests.report(7, &report(Stage::Done)), "it has ended");
        client.send(&start).unwrap();
        assert_eq!(serve(&mut requests, Stage::Done), 1, "from memory");
        let done = (7, Some(Stage::Done), none);
        assert_eq!(told(&mut client), [done, done]);
    }
}
