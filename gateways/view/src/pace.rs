//! How often something may happen.

use std::collections::VecDeque;
use std::time::Duration;

use ipc_types::MonotonicNs;

/// The span in which is counted.
const SPAN: Duration = Duration::from_secs(1);

/// Orders and checks of a viewer within a second; those beyond are refused.
pub const ORDERS_PER_S: usize = 5;

/// Messages and control frames of a viewer within a second; one that sends more is closed. A page at 20 Hz sends 25.
pub const MESSAGES_PER_S: usize = 200;

/// Allows so many within each second.
#[derive(Debug)]
pub(crate) struct RateLimit {
    most: usize,
    /// When those within the last second were, at most `most`.
    past: VecDeque<MonotonicNs>,
}

impl RateLimit {
    pub fn new(most: usize) -> RateLimit {
        RateLimit {
            most,
            past: VecDeque::new(),
        }
    }

    /// Whether one more may happen now; what may not is not counted.
    pub fn allows(&mut self, now: MonotonicNs) -> bool {
        while self.past.front().is_some_and(|at| *at + SPAN <= now) {
            self.past.pop_front();
        }
        let allows = self.past.len() < self.most;
        if allows {
            self.past.push_back(now);
        }
        allows
    }
}
