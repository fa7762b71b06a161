//! The orders that the robot side remembers, and what has to be done about them.

use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::payload::RequestReport;

use super::sessions::Sessions;
use crate::orders::message::{Answer, Order, RelayVerdict, request_id};

/// What is to be known of a request before it is handed on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traits {
    /// It has a field `repeat`, so that its server can be asked again without executing it. One without that field is
    /// not passed on again if it may have been executed.
    pub is_repeatable: bool,
    /// It ends a movement, or makes the robot do nothing: a hold, a landing, a stop. It waits for no order before it.
    pub ends_movement: bool,
}

/// Why a request could not be sent to its server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotSent {
    /// No process serves it.
    NoServer,
    /// The server, or this process's client port, has no room for one more request, or the port failed.
    Full,
}

/// What the robot side has to do.
#[derive(Clone, Debug, PartialEq)]
pub enum Output {
    /// Send a request to its server on the robot. If that fails,
    /// [`RobotOrders::not_sent`](super::RobotOrders::not_sent) has to be called.
    Send {
        /// Instance of the station that ordered it.
        station: u64,
        /// Which service.
        service: u64,
        /// Id of the request.
        request_id: u64,
        /// Set the request's field `repeat` to 1. Otherwise the request is sent as it is.
        is_repeat: bool,
        /// The request.
        request: Vec<u8>,
    },
    /// Drop the pending request.
    GiveUp {
        /// Which service.
        service: u64,
        /// Id of the request.
        request_id: u64,
    },
    /// Send this to a station.
    Answer {
        /// Instance of the station.
        station: u64,
        /// The message.
        answer: Answer,
    },
    /// A station with an open order has been silent for the configured time. Once for each silence.
    LinkLost {
        /// Instance of the station.
        station: u64,
    },
}

/// An order, and what is known about it.
#[derive(Clone, Debug)]
pub(super) struct OrderRecord {
    /// Instance of the station that ordered it.
    pub(super) station: u64,
    /// The session that it is answered in. `None` if that session is forgotten, and the request goes on without a
    /// station.
    pub(super) session: Option<u64>,
    pub(super) number: u64,
    pub(super) service: u64,
    pub(super) request_id: u64,
    pub(super) state: OrderState,
    reports: Reports,
}

#[derive(Clone, Debug)]
pub(super) enum OrderState {
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

impl OrderRecord {
    pub(super) fn is_open(&self) -> bool {
        !matches!(self.state, OrderState::Ended)
    }

    /// Whether it was passed on, or has ended without.
    pub(super) fn has_begun(&self) -> bool {
        !matches!(self.state, OrderState::Early(_))
    }

    /// Whether it is to be passed on for the first time, and its server does not take it now.
    pub(super) fn is_held_up(&self) -> bool {
        matches!(&self.state, OrderState::Waiting(passage, _) if !passage.is_repeat)
    }

    /// When it is passed on again, if it waits for that.
    pub(super) fn waits_until(&self) -> Option<MonotonicNs> {
        match self.state {
            OrderState::Waiting(_, at) => Some(at),
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
            self.state = OrderState::Ended;
        }
    }

    /// The newest report, or that there is none. `None` if there is no session to answer in.
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
        if let OrderState::PassedOn(passage) = &self.state {
            self.state = OrderState::Waiting(passage.clone(), until);
        }
    }

    /// It waits no longer: it is passed on, or has ended, because it is too late.
    pub(super) fn go_on(&mut self, now: MonotonicNs) {
        let (OrderState::Early(passage) | OrderState::Waiting(passage, _)) = &self.state else {
            return;
        };
        if !passage.is_repeat && passage.expires < now {
            let late = now.since(passage.expires);
            self.note(&RelayVerdict::Expired(late).report(self.request_id, now));
        } else {
            self.state = OrderState::PassedOn(passage.clone());
        }
    }

    /// What gives the request up at its server.
    pub(super) fn give_up(&self) -> Output {
        Output::GiveUp {
            service: self.service,
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

/// Requests that go on although their session is forgotten: as many as eight services can have open for one client.
/// Above that the oldest is given up at its server.
pub const ORPHANS: usize = 64;

/// Orders: of each session those from its floor on, and [`ORPHANS`].
#[derive(Clone, Debug, Default)]
pub(super) struct Records {
    pub(super) list: Vec<OrderRecord>,
}

/// What an order is to this robot side.
pub(super) enum OrderMatch {
    /// This record is about it.
    Yes(usize),
    /// The record of the same request, which gets this order's session and number.
    Moved(usize),
    /// Another station, or another service, has a request with this id open.
    IdIsTaken,
    No,
}

impl Records {
    /// Whether an order of this session has no final report.
    pub(super) fn has_open(&self, session: u64) -> bool {
        self.open(session) > 0
    }

    /// How many orders of this session are open.
    pub(super) fn open(&self, session: u64) -> usize {
        let is_open = |record: &&OrderRecord| record.session == Some(session) && record.is_open();
        self.list.iter().filter(is_open).count()
    }

    /// What is remembered about this order of this station.
    pub(super) fn known(&self, order: &Order, station: u64) -> OrderMatch {
        let id = request_id(&order.request);
        let is_here = |record: &OrderRecord| record.session == Some(order.session);
        let records = || self.list.iter().enumerate();
        let copy = records().find(|(_, record)| is_here(record) && record.number == order.number);
        if let Some((index, _)) = copy {
            return OrderMatch::Yes(index);
        }
        let same = records().filter(|(_, record)| {
            record.station == station && record.service == order.service && record.request_id == id
        });
        if let Some((index, record)) = same.max_by_key(|(_, record)| record.number) {
            if record.number > order.number {
                // A late copy of an order that has moved to another number.
                return OrderMatch::Yes(index);
            }
            if record.is_open() || (is_here(record) && order.is_repeat) {
                return OrderMatch::Moved(index);
            }
        }
        let is_taken = records().any(|(_, record)| record.is_open() && record.request_id == id);
        if is_taken {
            OrderMatch::IdIsTaken
        } else {
            OrderMatch::No
        }
    }

    /// Remembers an order, ended if there is a verdict about it.
    pub(super) fn remember(
        &mut self,
        order: &Order,
        station: u64,
        verdict: Option<RelayVerdict>,
        now: MonotonicNs,
    ) -> usize {
        let mut record = OrderRecord {
            station,
            session: Some(order.session),
            number: order.number,
            service: order.service,
            request_id: request_id(&order.request),
            state: OrderState::Early(Passage {
                request: order.request.clone(),
                is_repeat: order.is_repeat,
                expires: order.expires,
                since: now,
                unsent_since: None,
            }),
            reports: Reports::default(),
        };
        if let Some(verdict) = verdict {
            record.note(&verdict.report(record.request_id, now));
        }
        self.list.push(record);
        self.list.len() - 1
    }

    /// The order of this request that was passed on.
    pub(super) fn passed_on(&self, service: u64, request_id: u64) -> Option<usize> {
        self.list.iter().position(|record| {
            record.service == service
                && record.request_id == request_id
                && matches!(record.state, OrderState::PassedOn(_))
        })
    }

    /// # Panics
    /// When two records are about one order, or one that waits for its turn has reports, which is a defect.
    pub(super) fn assert_sound(&self) {
        for (index, record) in self.list.iter().enumerate() {
            debug_assert!(record.has_begun() || record.session.is_some(), "{record:?}");
            debug_assert!(
                record.has_begun() || record.reports.serial == 0,
                "{record:?}"
            );
            let is_same = |other: &OrderRecord| {
                record.session.is_some()
                    && (other.session, other.number) == (record.session, record.number)
            };
            debug_assert!(!self.list[index + 1..].iter().any(is_same), "{record:?}");
        }
        let orphans = self.list.iter().filter(|record| record.session.is_none());
        debug_assert!(orphans.count() <= ORPHANS);
    }

    /// The lowest order of those that are due to be passed on again.
    pub(super) fn due(&self, now: MonotonicNs) -> Option<usize> {
        self.lowest(|record| record.waits_until().is_some_and(|at| at <= now))
    }

    /// The lowest order of those that are passed on now, because all before them were here, and their server has taken
    /// its own.
    pub(super) fn in_turn(&self, sessions: &Sessions) -> Option<usize> {
        self.lowest(|early| {
            let is_before = |other: &&OrderRecord| {
                other.session == early.session
                    && other.service == early.service
                    && other.number < early.number
            };
            !early.has_begun()
                && early
                    .session
                    .is_some_and(|session| sessions.is_in_turn(session, early.number))
                && !self
                    .list
                    .iter()
                    .filter(is_before)
                    .any(OrderRecord::is_held_up)
        })
    }

    fn lowest(&self, is_meant: impl Fn(&OrderRecord) -> bool) -> Option<usize> {
        let records = self.list.iter().enumerate();
        let meant = records.filter(|(_, record)| is_meant(record));
        let lowest = meant.min_by_key(|(_, record)| (record.session, record.number));
        lowest.map(|(index, _)| index)
    }

    /// Forgets what a session has below `floor`. What is open goes on without a session, if it was passed on.
    pub(super) fn forget(&mut self, session: u64, floor: u64, out: &mut Vec<Output>) {
        let is_meant =
            |record: &OrderRecord| record.session == Some(session) && record.number < floor;
        self.list
            .retain(|record| !is_meant(record) || (record.is_open() && record.has_begun()));
        for record in &mut self.list {
            if is_meant(record) {
                record.session = None;
            }
        }
        let orphans = self.list.iter().filter(|record| record.session.is_none());
        for _ in ORPHANS..orphans.count() {
            // Records are not in the order of their age, but about so: the first one is old.
            let oldest = self.list.iter().position(|record| record.session.is_none());
            if let Some(index) = oldest {
                out.push(self.list.swap_remove(index).give_up());
            }
        }
    }
}
