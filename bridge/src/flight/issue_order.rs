//! [`Mark`]: which of two orders was issued later, whatever way they came.
//!
//! An order says by its sender's clock when it was issued ([`Issued`]). Orders by one clock are compared as they are. Those by
//! two clocks are compared on the safe side: an order is the later one only when it surely is. The bridge keeps one mark, of all
//! orders that it has taken, and carries out no movement that lies before it.

use ipc_types::MonotonicNs;
use serde::{Deserialize, Serialize};

/// When an order was issued, as its sender says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Issued {
    /// By which clock: 0 for the robot's own, else that of one station.
    pub origin: u32,
    /// Not later than it truly was.
    pub at: MonotonicNs,
    /// Not earlier than it truly was; the same as `at` by the robot's own clock.
    pub latest: MonotonicNs,
}

impl Issued {
    /// Whether it says a moment that has been. What comes from the future, or says no moment, has no place among the orders.
    pub fn is_past(&self, now: MonotonicNs) -> bool {
        self.at > MonotonicNs(0) && self.at <= now
    }

    /// The moment of two parts of one order.
    #[must_use]
    pub fn with(&self, other: &Issued) -> Issued {
        Issued {
            origin: self.origin,
            at: self.at.min(other.at),
            latest: self.latest.max(other.latest),
        }
    }
}

/// The moment before which an order is not carried out any more.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Mark {
    /// Whose clock the last order was issued by.
    origin: u32,
    /// For orders by that clock.
    floor_same: MonotonicNs,
    /// For orders by any other clock.
    floor_other: MonotonicNs,
}

impl Mark {
    /// Whether a later order than this one was taken.
    pub fn supersedes(&self, issued: &Issued) -> bool {
        issued.at < self.floor(issued)
    }

    /// Takes an order. One by another clock that is surely not the last changes nothing.
    pub fn take(&mut self, issued: &Issued) {
        if issued.origin != self.origin && issued.latest <= self.floor_same {
            return;
        }
        *self = Mark {
            origin: issued.origin,
            floor_same: self.floor(issued).max(issued.at),
            floor_other: self.floor_other.max(issued.latest),
        };
    }

    fn floor(&self, issued: &Issued) -> MonotonicNs {
        match issued.origin == self.origin {
            true => self.floor_same,
            false => self.floor_other,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn order(origin: u32, at: u64, within: u64) -> Issued {
        Issued {
            origin,
            at: MonotonicNs(at),
            latest: MonotonicNs(at + within),
        }
    }

    #[test]
    fn orders_by_one_clock_are_compared_as_they_are() {
        let mut mark = Mark::default();
        for origin in [0, 7] {
            assert!(!mark.supersedes(&order(origin, 0, 0)));
        }
        mark.take(&order(7, 100, 50));
        assert!(mark.supersedes(&order(7, 99, 50)));
        assert!(!mark.supersedes(&order(7, 100, 50)));
        assert!(!mark.supersedes(&order(7, 101, 50)));
        mark.take(&order(7, 90, 50));
        assert!(
            mark.supersedes(&order(7, 99, 50)),
            "an earlier order takes nothing back"
        );
    }

    #[test]
    fn an_order_by_another_clock_is_later_only_when_it_surely_is() {
        let mut mark = Mark::default();
        mark.take(&order(7, 100, 50));
        assert!(mark.supersedes(&order(0, 149, 0)));
        assert!(!mark.supersedes(&order(0, 150, 0)));
        assert!(mark.supersedes(&order(8, 149, 50)));
        // A hold of the robot itself, which counts though it may have been issued before.
        mark.take(&order(0, 120, 0));
        assert!(mark.supersedes(&order(7, 149, 50)));
        assert!(mark.supersedes(&order(0, 149, 0)));
        assert!(!mark.supersedes(&order(0, 150, 0)));
        // One that is surely older leaves those by the clock of the last order in their places.
        mark.take(&order(8, 200, 50));
        mark.take(&order(0, 200, 0));
        assert!(!mark.supersedes(&order(8, 200, 50)));
        mark.take(&order(0, 201, 0));
        assert!(mark.supersedes(&order(8, 200, 50)));
    }

    #[test]
    fn the_parts_of_an_order_have_its_earliest_moment() {
        let whole = order(7, 100, 50).with(&order(7, 90, 80));
        assert_eq!(whole, order(7, 90, 80));
        assert!(whole.is_past(MonotonicNs(90)));
        assert!(!whole.is_past(MonotonicNs(89)));
        assert!(!order(0, 0, 0).is_past(MonotonicNs(89)));
    }
}
