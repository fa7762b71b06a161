//! The moments at which something is sent: a fixed rate, whatever the sending itself takes.

use std::time::Duration;

use anyhow::Result;
use ipc_types::MonotonicNs;
use rustix::io::Errno;
use rustix::thread::ClockId;
use rustix::time::Timespec;

/// Ticks of a fixed rate.
pub struct Pace {
    next: MonotonicNs,
    period: Duration,
}

impl Pace {
    /// Begins now; `rate_hz` is greater than 0.
    pub fn new(rate_hz: u32) -> Pace {
        Pace {
            next: MonotonicNs::now(),
            period: Duration::from_secs(1) / rate_hz,
        }
    }

    /// When the next tick is.
    pub fn next(&self) -> MonotonicNs {
        self.next
    }

    /// Goes on to the tick after the next one. Ticks that were missed are left out, so that a stall is not followed by
    /// a burst.
    pub fn advance(&mut self) {
        self.next = (self.next + self.period).max(MonotonicNs::now());
    }

    /// Sleeps until the next tick.
    pub fn wait(&mut self) -> Result<()> {
        self.advance();
        sleep_until(self.next)
    }
}

/// Sleeps until `moment`.
pub fn sleep_until(moment: MonotonicNs) -> Result<()> {
    let request = Timespec {
        tv_sec: (moment.0 / 1_000_000_000) as i64,
        tv_nsec: (moment.0 % 1_000_000_000) as i64,
    };
    loop {
        match rustix::thread::clock_nanosleep_absolute(ClockId::Monotonic, &request) {
            Err(Errno::INTR) => {}
            result => return Ok(result?),
        }
    }
}
