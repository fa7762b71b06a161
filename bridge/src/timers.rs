//! One table of deadlines for each state machine: what is due next and what to do when it is cannot disagree.
//!
//! A machine names its timers in an enum, arms and stops them here, and handles the expired one in one exhaustive
//! match.

use ipc_types::MonotonicNs;
use serde::{Deserialize, Serialize};

/// Timers of one machine at most.
const MAX_TIMERS: usize = 8;

/// Names of timers: an enum without data.
pub trait TimerName: Copy + 'static {
    /// All of them, in the order of [`TimerName::index`]; at most eight.
    const ALL: &'static [Self];

    /// Place in [`TimerName::ALL`].
    fn index(self) -> usize;
}

/// Deadlines by name.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct TimerTable<N> {
    due: [Option<MonotonicNs>; MAX_TIMERS],
    #[serde(skip)]
    names: std::marker::PhantomData<N>,
}

impl<N: TimerName> TimerTable<N> {
    /// Nothing is armed.
    pub const fn new() -> Self {
        assert!(N::ALL.len() <= MAX_TIMERS);
        TimerTable {
            due: [None; MAX_TIMERS],
            names: std::marker::PhantomData,
        }
    }

    /// Arms `timer`, or moves it.
    pub fn arm(&mut self, timer: N, due: MonotonicNs) {
        self.due[timer.index()] = Some(due);
    }

    /// Disarms `timer`.
    pub fn stop(&mut self, timer: N) {
        self.due[timer.index()] = None;
    }

    /// Disarms all of them.
    pub fn stop_all(&mut self) {
        self.due = [None; MAX_TIMERS];
    }

    /// Whether `timer` is armed.
    pub fn is_armed(&self, timer: N) -> bool {
        self.due(timer).is_some()
    }

    /// When `timer` expires, if it is armed.
    pub fn due(&self, timer: N) -> Option<MonotonicNs> {
        self.due[timer.index()]
    }

    /// The earliest deadline.
    pub fn next(&self) -> Option<MonotonicNs> {
        self.due.iter().flatten().min().copied()
    }

    /// Takes out the timer that expired first, if one has by `now`.
    pub fn expired(&mut self, now: MonotonicNs) -> Option<N> {
        let timer = N::ALL
            .iter()
            .copied()
            .filter(|timer| self.due[timer.index()].is_some_and(|due| due <= now))
            .min_by_key(|timer| self.due[timer.index()])?;
        self.stop(timer);
        Some(timer)
    }
}

impl<N: TimerName> Default for TimerTable<N> {
    fn default() -> Self {
        TimerTable::new()
    }
}

/// Defines the enum of a machine's timers.
macro_rules! timers {
    (
        $(#[$meta:meta])*
        $visibility:vis enum $name:ident { $( $(#[$timer_meta:meta])* $timer:ident, )+ }
    ) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        $visibility enum $name { $( $(#[$timer_meta])* $timer, )+ }

        impl $crate::timers::TimerName for $name {
            const ALL: &'static [Self] = &[$( $name::$timer, )+];

            fn index(self) -> usize {
                self as usize
            }
        }
    };
}
pub(crate) use timers;

#[cfg(test)]
mod tests {
    use super::*;

    timers! {
        enum Name { A, B, C, }
    }

    #[test]
    fn timers_expire_in_the_order_of_their_deadlines_and_once() {
        let mut table = TimerTable::new();
        for (timer, due) in [(Name::A, 30), (Name::B, 10), (Name::C, 20)] {
            table.arm(timer, MonotonicNs(due));
        }
        assert_eq!(table.next(), Some(MonotonicNs(10)));
        assert_eq!(table.expired(MonotonicNs(9)), None);
        assert_eq!(table.expired(MonotonicNs(30)), Some(Name::B));
        table.stop(Name::C);
        assert_eq!(table.expired(MonotonicNs(30)), Some(Name::A));
        assert_eq!(table.expired(MonotonicNs(30)), None);
        assert_eq!(table.next(), None);
    }
}
