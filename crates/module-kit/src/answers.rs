//! Each request gets one final report, and asking again with the same id never executes it twice (requirement D15).
//! [`Answers`] say so of a module's requests; the bridge says it by itself, as [`Completed`] alone remembers. Pure
//! values.
//!
//! | the id | a module | the bridge |
//! |---|---|---|
//! | is new | carries it out | carries it out, unless the request says that it is a repetition: unknown, a bridge that died may have |
//! | is under way, and its client is there | refuses it: still-open; the first stream goes on | the same |
//! | is under way, and its client is gone | accepts it, and answers as it would have answered the first client | refuses it: still-open |
//! | ended not long ago | gives the same final report once more | the same |

use std::collections::VecDeque;

use ipc_types::Ticket;
use ipc_types::code::{Reason, Stage};
use ipc_types::payload::RequestReport;
use ipc_types::server::MAX_OPEN_TICKETS;
use serde::{Deserialize, Serialize};

/// Final reports that are remembered, so that a request that is sent again is answered and not executed again.
pub const REMEMBERED: usize = 256;

/// Requests that may be under way at once, those included whose clients are gone: twice what all clients can have open.
/// While there are as many, a new one is refused: too-many-requests. To forget one would be to carry it out twice.
pub const UNDER_WAY: usize = MAX_OPEN_TICKETS as usize;

/// The last final reports, oldest first. An older one is forgotten, and asking again for it as a repetition is answered
/// with `unknown`, which is true.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Completed {
    #[serde(with = "reports")]
    ended: VecDeque<RequestReport>,
    /// Not of a snapshot: after one, [`Completed::set_capacity`] says it.
    #[serde(skip)]
    capacity: usize,
}

impl Completed {
    /// Nothing remembered, and room for so many reports. All memory that it will ever need is taken here.
    pub fn with_capacity(capacity: usize) -> Self {
        Completed {
            ended: VecDeque::with_capacity(capacity),
            capacity,
        }
    }

    /// Makes room for so many reports, and forgets the oldest of those that have none: after a snapshot.
    pub fn set_capacity(&mut self, capacity: usize) {
        let surplus = self.ended.len().saturating_sub(capacity);
        self.ended.drain(..surplus);
        self.ended.reserve(capacity - self.ended.len());
        self.capacity = capacity;
    }

    /// Remembers a final report.
    pub fn note(&mut self, report: &RequestReport) {
        if self.ended.len() == self.capacity {
            self.ended.pop_front();
        }
        self.ended.push_back(*report);
    }

    /// The final report of this request, if it is remembered.
    pub fn report_of(&self, request_id: u64) -> Option<&RequestReport> {
        self.ended
            .iter()
            .rfind(|report| report.request_id == request_id)
    }
}

/// Reports as values of serde.
mod reports {
    use super::{Deserialize, RequestReport, VecDeque};
    use crate::journal::raw::Raw;
    use serde::{Deserializer, Serializer};

    pub fn serialize<S: Serializer>(
        reports: &VecDeque<RequestReport>,
        to: S,
    ) -> Result<S::Ok, S::Error> {
        to.collect_seq(reports.iter().map(|report| Raw(*report)))
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(
        from: D,
    ) -> Result<VecDeque<RequestReport>, D::Error> {
        let reports = VecDeque::<Raw<RequestReport>>::deserialize(from)?;
        Ok(reports.into_iter().map(|Raw(report)| report).collect())
    }
}

/// Which requests are under way, and how those before them ended: [`Requests`](crate::Requests) asks it, and so does a
/// server of another language.
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

    const FIRST: Ticket = Ticket::from_bits(1);
    const SECOND: Ticket = Ticket::from_bits(2);

    #[test]
    fn the_last_final_reports_are_remembered_and_the_oldest_forgotten() {
        let mut completed = Completed::with_capacity(2);
        let capacity = completed.ended.capacity();
        for id in 1..=3 {
            completed.note(&report(id, Stage::Done));
        }
        assert_eq!(completed.report_of(1), None);
        assert_eq!(completed.report_of(2), Some(&report(2, Stage::Done)));
        assert_eq!(completed.ended.capacity(), capacity, "it never grows");
        // A snapshot has no capacity: of three, the newest two have room.
        let mut kept = Completed::with_capacity(3);
        (4..=6).for_each(|id| kept.note(&report(id, Stage::Done)));
        kept.set_capacity(2);
        let remembered = |kept: &Completed| {
            let known = (1..=9).filter(|id| kept.report_of(*id).is_some());
            known.collect::<Vec<u64>>()
        };
        assert_eq!(remembered(&kept), [5, 6]);
        kept.note(&report(7, Stage::Done));
        assert_eq!(remembered(&kept), [6, 7]);
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
