//! [`Life`]: a process that stands still and dies; and the steps and units of time.

/// Nanoseconds of a millisecond.
pub const MS: u64 = 1_000_000;
/// The robots' clock when the simulators' is 0.
pub const EPOCH_MS: u64 = 86_400_000;
/// Samples that the queue of a topic keeps for a reader that stands still.
pub const QUEUE: usize = 64;
/// One step of time.
pub const TICK_MS: u64 = 10;

/// A process that can stand still, and die.
#[derive(Clone, Copy, Debug, Default)]
pub struct Life {
    pub stalls_until: u64,
    pub away_until: Option<u64>,
}

impl Life {
    pub fn is_up(&self) -> bool {
        self.away_until.is_none()
    }

    pub fn is_awake(&self, now_ms: u64) -> bool {
        self.is_up() && self.stalls_until <= now_ms
    }

    /// It begins again now.
    pub fn begins(&mut self, now_ms: u64) -> bool {
        let begins = self.away_until.is_some_and(|until| until <= now_ms);
        if begins {
            *self = Life::default();
        }
        begins
    }

    pub fn stalls(&mut self, until: u64) {
        self.stalls_until = self.stalls_until.max(until);
    }

    /// Its machine sleeps for one step.
    pub fn sleeps(&mut self) {
        self.stalls_until += TICK_MS;
        self.away_until = self.away_until.map(|until| until + TICK_MS);
    }
}
