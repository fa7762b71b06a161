//! The orders that the robot side remembers.

use std::ops::{Index, IndexMut};

use ipc_types::MonotonicNs;

use super::io::Output;
use super::record::{Passage, Record, State};
use super::sessions::Sessions;
use crate::orders::message::{Order, request_id};
use crate::orders::verdict::Verdict;

/// Requests that go on although their session is forgotten: as many as eight services can have open for one client. Above that
/// the oldest is given up at its server.
pub const ORPHANS: usize = 64;

/// Orders: of each session those from its floor on, and [`ORPHANS`].
#[derive(Clone, Debug, Default)]
pub(super) struct Records {
    records: Vec<Record>,
}

/// What an order is to this robot side.
pub(super) enum Known {
    /// This record is about it.
    Yes(usize),
    /// The record of the same request, which gets this order's session and number.
    Moved(usize),
    /// Another station, or another service, has a request with this id open.
    IdIsTaken,
    No,
}

impl Records {
    pub(super) fn len(&self) -> usize {
        self.records.len()
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &Record> {
        self.records.iter()
    }

    pub(super) fn remove(&mut self, index: usize) {
        self.records.swap_remove(index);
    }

    /// Whether an order of this session has no final report.
    pub(super) fn has_open(&self, session: u64) -> bool {
        self.open(session) > 0
    }

    /// How many orders of this session are open.
    pub(super) fn open(&self, session: u64) -> usize {
        let is_open = |record: &&Record| record.session == Some(session) && record.is_open();
        self.records.iter().filter(is_open).count()
    }

    /// What is remembered about this order of this station.
    pub(super) fn known(&self, order: &Order, station: u64) -> Known {
        let id = request_id(&order.request);
        let is_here = |record: &Record| record.session == Some(order.session);
        let records = || self.records.iter().enumerate();
        let copy = records().find(|(_, record)| is_here(record) && record.number == order.number);
        if let Some((index, _)) = copy {
            return Known::Yes(index);
        }
        let same = records().filter(|(_, record)| {
            record.station == station && record.topic == order.topic && record.request_id == id
        });
        if let Some((index, record)) = same.max_by_key(|(_, record)| record.number) {
            if record.number > order.number {
                // A late copy of an order that has moved to another number.
                return Known::Yes(index);
            }
            if record.is_open() || (is_here(record) && order.is_repeat) {
                return Known::Moved(index);
            }
        }
        let is_taken = records().any(|(_, record)| record.is_open() && record.request_id == id);
        if is_taken {
            Known::IdIsTaken
        } else {
            Known::No
        }
    }

    /// Remembers an order, ended if there is a verdict about it.
    pub(super) fn remember(
        &mut self,
        order: &Order,
        station: u64,
        verdict: Option<Verdict>,
        now: MonotonicNs,
    ) -> usize {
        let passage = Passage {
            request: order.request.clone(),
            is_repeat: order.is_repeat,
            expires: order.expires,
            since: now,
            unsent_since: None,
        };
        let id = request_id(&order.request);
        let owner = (station, order.session);
        let mut record = Record::new(owner, order.number, order.topic, id, passage);
        if let Some(verdict) = verdict {
            record.note(&verdict.report(id, now));
        }
        self.records.push(record);
        self.records.len() - 1
    }

    /// The order of this request that was passed on.
    pub(super) fn passed_on(&self, topic: u64, request_id: u64) -> Option<usize> {
        self.records.iter().position(|record| {
            record.topic == topic
                && record.request_id == request_id
                && matches!(record.state, State::PassedOn(_))
        })
    }

    /// The lowest order of those that are due to be passed on again.
    pub(super) fn due(&self, now: MonotonicNs) -> Option<usize> {
        self.lowest(|record| record.waits_until().is_some_and(|at| at <= now))
    }

    /// The lowest order of those that are passed on now, because all before them were here, and their server has taken its own.
    pub(super) fn in_turn(&self, sessions: &Sessions) -> Option<usize> {
        self.lowest(|early| {
            let is_before = |other: &&Record| {
                other.session == early.session
                    && other.topic == early.topic
                    && other.number < early.number
            };
            !early.has_begun()
                && early
                    .session
                    .is_some_and(|session| sessions.is_in_turn(session, early.number))
                && !self.iter().filter(is_before).any(Record::is_held_up)
        })
    }

    fn lowest(&self, is_meant: impl Fn(&Record) -> bool) -> Option<usize> {
        let records = self.records.iter().enumerate();
        let meant = records.filter(|(_, record)| is_meant(record));
        let lowest = meant.min_by_key(|(_, record)| (record.session, record.number));
        lowest.map(|(index, _)| index)
    }

    /// Forgets what a session has below `floor`. What is open goes on without a session, if it was passed on.
    pub(super) fn forget(&mut self, session: u64, floor: u64, out: &mut Vec<Output>) {
        let is_meant = |record: &Record| record.session == Some(session) && record.number < floor;
        self.records
            .retain(|record| !is_meant(record) || (record.is_open() && record.has_begun()));
        for record in &mut self.records {
            if is_meant(record) {
                record.session = None;
            }
        }
        let orphans = self
            .records
            .iter()
            .filter(|record| record.session.is_none());
        for _ in ORPHANS..orphans.count() {
            // Records are not in the order of their age, but about so: the first one is old.
            let oldest = self
                .records
                .iter()
                .position(|record| record.session.is_none());
            if let Some(index) = oldest {
                out.push(self.records.swap_remove(index).give_up());
            }
        }
    }
}

impl Index<usize> for Records {
    type Output = Record;

    fn index(&self, index: usize) -> &Record {
        &self.records[index]
    }
}

impl IndexMut<usize> for Records {
    fn index_mut(&mut self, index: usize) -> &mut Record {
        &mut self.records[index]
    }
}
