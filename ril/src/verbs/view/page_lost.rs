//! [`PageLost`]: robots that a page has set in motion and that no page commands any more, and when they are to hold.
//!
//! A page that is loaded again, or whose network comes back, takes command again, and no hold is ordered. A page that is closed, hidden or silent
//! loses command by the rules of its lease: until then nobody is missing.

use std::collections::BTreeMap;
use std::time::Duration;

use ipc_types::MonotonicNs;

/// See the module's documentation.
#[derive(Debug)]
pub(super) struct PageLost {
    /// How long a robot may go on without a page; `None` for ever.
    after: Option<Duration>,
    /// Since when no page commands a robot whose movement goes on; `None` once it was held.
    deserted: BTreeMap<u32, Option<MonotonicNs>>,
}

impl PageLost {
    pub fn new(after: Option<Duration>) -> PageLost {
        PageLost {
            after,
            deserted: BTreeMap::new(),
        }
    }

    /// The robots that are to hold now, of all robots and whether each is deserted. Each is named once, until a page commands it again or
    /// its movement has ended.
    pub fn due(&mut self, robots: impl Iterator<Item = (u32, bool)>, now: MonotonicNs) -> Vec<u32> {
        let Some(after) = self.after else {
            return Vec::new();
        };
        let mut due = Vec::new();
        for (robot, is_deserted) in robots {
            if !is_deserted {
                self.deserted.remove(&robot);
                continue;
            }
            let since = self.deserted.entry(robot).or_insert(Some(now));
            if since.is_some_and(|since| now >= since + after) {
                *since = None;
                due.push(robot);
            }
        }
        due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: u64 = 1_000_000_000;

    #[test]
    fn a_robot_holds_once_when_it_was_deserted_for_long_enough() {
        let mut lost = PageLost::new(Some(Duration::from_secs(5)));
        for (at_s, first, second, expected) in [
            (0, false, false, &[][..]),
            (1, true, false, &[]),
            (5, true, true, &[]),
            (6, true, true, &[1]),
            (7, true, true, &[]),
            (10, true, true, &[2]),
            (20, true, true, &[]),
            // A page commands again, and is lost again.
            (21, false, true, &[]),
            (22, true, true, &[]),
            (26, true, true, &[]),
            (27, true, true, &[1]),
        ] {
            let robots = [(1, first), (2, second)].into_iter();
            let due = lost.due(robots, MonotonicNs(at_s * SECOND));
            assert_eq!(due, expected, "{at_s} s");
        }
    }

    #[test]
    fn without_a_time_nothing_is_held() {
        let mut lost = PageLost::new(None);
        for at_s in [0, 3600, 86_400] {
            let due = lost.due([(1, true)].into_iter(), MonotonicNs(at_s * SECOND));
            assert!(due.is_empty());
        }
    }
}
