//! Two simulated clocks, and a link that delays and loses messages.

use fastrand::Rng;
use ipc_types::MonotonicNs;

use crate::clock::{Exchange, RemoteNs, Suspended};

pub const MS: u64 = 1_000_000;
pub const SECOND: u64 = 1_000_000_000;

/// From `low` up to, but not including, `high`.
pub fn between(random: &mut Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * random.f64()
}

/// Every order of magnitude from `low` to `high` is equally likely.
pub fn magnitude(random: &mut Rng, low: f64, high: f64) -> f64 {
    low * (high / low).powf(random.f64())
}

fn once_in(random: &mut Rng, count: f64) -> bool {
    random.f64() * count < 1.0
}

/// What makes the offset jump, `at` a local moment, for `lasts_ns`.
#[derive(Clone, Copy, Debug)]
pub enum Jump {
    Never,
    /// The local clock stands still, so on its own time it takes no time.
    LocalSuspend {
        at: u64,
        lasts_ns: u64,
    },
    RemoteSuspend {
        at: u64,
        lasts_ns: u64,
    },
    /// The remote clock shows so much more from then on, and no machine was suspended.
    RemoteStep {
        at: u64,
        by_ns: i128,
    },
    /// Afterwards the remote clock begins with 0.
    RemoteReboot {
        at: u64,
        lasts_ns: u64,
    },
}

/// The truth about two clocks: a drift that swings slowly about a mean, and trembles by less than a ppm.
#[derive(Clone, Debug)]
pub struct Clocks {
    /// The offset when the local clock shows `start_ns`.
    pub offset_ns: i128,
    pub start_ns: u64,
    pub drift_ppb: f64,
    pub swing_ppb: f64,
    pub swing_s: f64,
    pub tremble_ppb: f64,
    pub tremble_s: f64,
    pub jump: Jump,
}

impl Clocks {
    /// Zeros that are up to hours apart, up to ±100 ppm, changing by up to 5 ppb/s.
    pub fn random(random: &mut Rng) -> Clocks {
        let swing_s = magnitude(random, 30.0, 40_000.0);
        let greatest_swing = (5.0 * swing_s / std::f64::consts::TAU).min(50_000.0);
        let swing_ppb = random.f64() * greatest_swing;
        let start_s = magnitude(random, 40_000.0, 4_000_000.0);
        Clocks {
            offset_ns: (between(random, -36_000.0, 36_000.0) * 1e9) as i128,
            start_ns: (start_s * 1e9) as u64,
            drift_ppb: between(random, -1.0, 1.0) * (100_000.0 - swing_ppb),
            swing_ppb,
            swing_s,
            tremble_ppb: between(random, 0.0, 900.0),
            tremble_s: magnitude(random, 1.0, 100.0),
            jump: Jump::Never,
        }
    }

    pub fn steady(offset_ns: i128, drift_ppb: f64) -> Clocks {
        Clocks {
            offset_ns,
            start_ns: 1000 * SECOND,
            drift_ppb,
            swing_ppb: 0.0,
            swing_s: 1.0,
            tremble_ppb: 0.0,
            tremble_s: 1.0,
            jump: Jump::Never,
        }
    }

    fn offset_without_jump(&self, local: u64) -> i128 {
        let elapsed_s = (i128::from(local) - i128::from(self.start_ns)) as f64 / 1e9;
        // The integral of amplitude × sin(2π t / period).
        let swing = |amplitude: f64, period_s: f64| {
            let turns = std::f64::consts::TAU / period_s;
            amplitude / turns * (1.0 - (turns * elapsed_s).cos())
        };
        let gained_ns = self.drift_ppb * elapsed_s
            + swing(self.swing_ppb, self.swing_s)
            + swing(self.tremble_ppb, self.tremble_s);
        self.offset_ns + gained_ns.floor() as i128
    }

    /// The true offset.
    pub fn offset_at(&self, local: u64) -> i128 {
        let steady = self.offset_without_jump(local);
        match self.jump {
            Jump::LocalSuspend { at, lasts_ns } if local >= at => steady + i128::from(lasts_ns),
            Jump::RemoteStep { at, by_ns } if local >= at => steady + by_ns,
            Jump::RemoteSuspend { at, lasts_ns } if local >= at => {
                steady - i128::from((local - at).min(lasts_ns))
            }
            Jump::RemoteReboot { at, lasts_ns } if local >= at + lasts_ns => {
                let up = at + lasts_ns;
                steady - self.offset_without_jump(up) - i128::from(up)
            }
            _ => steady,
        }
    }

    pub fn remote(&self, local: u64) -> RemoteNs {
        RemoteNs(u64::try_from(i128::from(local) + self.offset_at(local)).expect("after boot"))
    }

    /// When the remote machine does what it has to do at `local`; never, if its memory is lost by then.
    fn remote_awake(&self, local: u64) -> Option<u64> {
        match self.jump {
            Jump::RemoteSuspend { at, lasts_ns } if (at..at + lasts_ns).contains(&local) => {
                Some(at + lasts_ns)
            }
            Jump::RemoteReboot { at, lasts_ns } if (at..at + lasts_ns).contains(&local) => None,
            _ => Some(local),
        }
    }

    /// The end of the jump, if there is one.
    pub fn jumped_at(&self) -> Option<u64> {
        match self.jump {
            Jump::Never => None,
            Jump::LocalSuspend { at, .. } | Jump::RemoteStep { at, .. } => Some(at),
            Jump::RemoteSuspend { at, lasts_ns } | Jump::RemoteReboot { at, lasts_ns } => {
                Some(at + lasts_ns)
            }
        }
    }

    fn suspended(&self, sent: u64, remote_sent: u64, received: u64) -> Suspended {
        let mut suspended = Suspended::default();
        match self.jump {
            Jump::LocalSuspend { at, lasts_ns } => {
                suspended.at_sent_ns = if sent >= at { lasts_ns } else { 0 };
                suspended.at_received_ns = if received >= at { lasts_ns } else { 0 };
            }
            Jump::RemoteSuspend { at, lasts_ns } if remote_sent >= at + lasts_ns => {
                suspended.remote_ns = lasts_ns;
            }
            _ => {}
        }
        suspended
    }
}

/// How long messages take and which get lost.
#[derive(Clone, Debug)]
pub struct Link {
    pub there_ns: f64,
    pub back_ns: f64,
    pub jitter_ns: f64,
    pub lost: f64,
    /// One in so many exchanges begins a burst of ten slow ones.
    pub burst_once_in: f64,
    /// One in so many exchanges begins an outage.
    pub outage_once_in: f64,
    pub outage_s: f64,
}

impl Link {
    /// Delays of 0.1 ms to 2 s, different in both directions; bursts, losses, outages of up to 10 minutes.
    pub fn random(random: &mut Rng) -> Link {
        Link {
            there_ns: magnitude(random, 1e5, 3e8),
            back_ns: magnitude(random, 1e5, 3e8),
            jitter_ns: magnitude(random, 1e3, 1e9),
            lost: between(random, 0.0, 0.5),
            burst_once_in: magnitude(random, 10.0, 1000.0),
            outage_once_in: magnitude(random, 30.0, 3000.0),
            outage_s: magnitude(random, 1.0, 600.0),
        }
    }

    /// 200 µs ± 20 µs in both directions.
    pub fn quiet() -> Link {
        Link {
            there_ns: 180_000.0,
            back_ns: 180_000.0,
            jitter_ns: 40_000.0,
            lost: 0.0,
            burst_once_in: f64::INFINITY,
            outage_once_in: f64::INFINITY,
            outage_s: 0.0,
        }
    }

    fn delay(&self, base_ns: f64, burst: bool, random: &mut Rng) -> u64 {
        let extra_ns = if burst { 2e9 * random.f64() } else { 0.0 };
        let delay_ns = base_ns + self.jitter_ns * random.f64() + extra_ns;
        delay_ns.min(2e9) as u64
    }

    /// All exchanges that succeed in `duration_s`, with one request per `period_s`, in the order of their ends.
    pub fn exchanges(
        &self,
        clocks: &Clocks,
        duration_s: f64,
        period_s: f64,
        random: &mut Rng,
    ) -> Vec<Exchange> {
        let mut exchanges = Vec::new();
        let end = clocks.start_ns + (duration_s * 1e9) as u64;
        let mut sent = clocks.start_ns;
        let mut slow_ones = 0;
        while sent < end {
            if once_in(random, self.outage_once_in) {
                sent += (random.f64() * self.outage_s * 1e9) as u64;
            }
            if once_in(random, self.burst_once_in) {
                slow_ones = 10;
            }
            if !once_in(random, 1.0 / self.lost) {
                exchanges.extend(self.exchange(clocks, sent, slow_ones > 0, random));
            }
            slow_ones -= i32::from(slow_ones > 0);
            sent += (period_s * 1e9) as u64;
        }
        exchanges.sort_by_key(|exchange| exchange.received);
        exchanges
    }

    fn exchange(
        &self,
        clocks: &Clocks,
        sent: u64,
        burst: bool,
        random: &mut Rng,
    ) -> Option<Exchange> {
        let arrival = sent + self.delay(self.there_ns, burst, random);
        let remote_received = clocks.remote_awake(arrival)?;
        let held_ns = magnitude(random, 1e3, 1e7) as u64;
        let remote_sent = clocks.remote_awake(remote_received + held_ns)?;
        let received = remote_sent + self.delay(self.back_ns, burst, random);
        Some(Exchange {
            sent: MonotonicNs(sent),
            remote_received: clocks.remote(remote_received),
            remote_sent: clocks.remote(remote_sent),
            received: MonotonicNs(received),
            suspended: clocks.suspended(sent, remote_sent, received),
        })
    }
}
