//! One order in the memory of the robot side.

use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::payload::RequestReport;

use super::io::Output;
use crate::orders::message::Answer;
use crate::orders::verdict::Verdict;

/// An order, and what is known about it.
#[derive(Clone, Debug)]
pub(super) struct Record {
    /// Life of the station that ordered it.
    pub(super) station: u64,
    /// The session that it is answered in. None: that session is forgotten, and the request goes on without a station.
    pub(super) session: Option<u64>,
    pub(super) number: u64,
    pub(super) topic: u64,
    pub(super) request_id: u64,
    pub(super) state: State,
    reports: Reports,
}

#[derive(Clone, Debug)]
pub(super) enum State {
    /// It waits for the orders before it.
    Early(Passage),
    /// The server has it, as far as is known.
    PassedOn(Passage),
    /// It is passed on again at this time.
    Waiting(Passage, MonotonicNs),
    /// It has its final report.
    Ended,
}

/// What is needed to pass an order on to its server.
#[derive(Clone, Debug)]
pub(super) struct Passage {
    pub(super) request: Vec<u8>,
    pub(super) is_repeat: bool,
    pub(super) expires: MonotonicNs,
    /// When the robot side got the order.
    pub(super) since: MonotonicNs,
    /// Since when the server has taken no request.
    pub(super) unsent_since: Option<MonotonicNs>,
}

impl Passage {
    /// How long the server has taken no request, this attempt included.
    pub(super) fn unsent_for(&mut self, now: MonotonicNs) -> Duration {
        now.since(*self.unsent_since.get_or_insert(now))
    }
}

/// The first and the newest report about an order; what came between them is overtaken.
#[derive(Clone, Copy, Debug, Default)]
struct Reports {
    first: RequestReport,
    newest: RequestReport,
    /// Number of the newest one; 0 when there is none.
    serial: u32,
}

impl Record {
    pub(super) fn new(
        (station, session): (u64, u64),
        number: u64,
        topic: u64,
        request_id: u64,
        passage: Passage,
    ) -> Record {
        Record {
            station,
            session: Some(session),
            number,
            topic,
            request_id,
            state: State::Early(passage),
            reports: Reports::default(),
        }
    }

    pub(super) fn is_open(&self) -> bool {
        !matches!(self.state, State::Ended)
    }

    /// Whether it was passed on, or has ended without.
    pub(super) fn has_begun(&self) -> bool {
        !matches!(self.state, State::Early(_))
    }

    /// Whether it is to be passed on for the first time, and its server does not take it now.
    pub(super) fn is_held_up(&self) -> bool {
        matches!(&self.state, State::Waiting(passage, _) if !passage.is_repeat)
    }

    /// When it is passed on again, if it waits for that.
    pub(super) fn waits_until(&self) -> Option<MonotonicNs> {
        match self.state {
            State::Waiting(_, at) => Some(at),
            _ => None,
        }
    }

    /// Remembers a report, unless the order has ended.
    pub(super) fn note(&mut self, report: &RequestReport) {
        if !self.is_open() {
            return;
        }
        self.reports.serial = self.reports.serial.saturating_add(1);
        self.reports.newest = *report;
        if self.reports.serial == 1 {
            self.reports.first = *report;
        }
        if report.is_final() {
            self.state = State::Ended;
        }
    }

    /// The newest report, or that there is none. None when there is no session to answer in.
    pub(super) fn newest(&self) -> Option<Answer> {
        self.answer(self.reports.serial, &self.reports.newest)
    }

    /// The first report, if it is another one than the newest.
    pub(super) fn first(&self) -> Option<Answer> {
        (self.reports.serial > 1)
            .then(|| self.answer(1, &self.reports.first))
            .flatten()
    }

    /// Passes the order on again at `until`.
    pub(super) fn wait(&mut self, until: MonotonicNs) {
        if let State::PassedOn(passage) = &self.state {
            self.state = State::Waiting(passage.clone(), until);
        }
    }

    /// It waits no longer: it is passed on, or has ended, because it is too late.
    pub(super) fn go_on(&mut self, now: MonotonicNs) {
        let (State::Early(passage) | State::Waiting(passage, _)) = &self.state else {
            return;
        };
        if !passage.is_repeat && passage.expires < now {
            let late = now.since(passage.expires);
            self.note(&Verdict::Expired(late).report(self.request_id, now));
        } else {
            self.state = State::PassedOn(passage.clone());
        }
    }

    /// What gives the request up at its server.
    pub(super) fn give_up(&self) -> Output {
        Output::GiveUp {
            topic: self.topic,
            request_id: self.request_id,
        }
    }

    fn answer(&self, serial: u32, report: &RequestReport) -> Option<Answer> {
        Some(Answer {
            session: self.session?,
            number: self.number,
            serial,
            report: RequestReport {
                request_id: self.request_id,
                ..*report
            },
        })
    }
}
