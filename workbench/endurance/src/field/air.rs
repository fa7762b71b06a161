//! [`Air`]: packets between two machines are lost, delayed and paced. A pure value: what `tc netem` does, for kernels without it.

use std::collections::BinaryHeap;
use std::time::Duration;

use dsp_sim::random::Random;
use ipc_types::MonotonicNs;

/// What the air does to packets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weather {
    /// Share of the packets that is lost, 0 … 1, each by itself.
    pub loss: f64,
    /// How long each packet takes at least.
    pub delay: Duration,
    /// How much longer it takes at most; packets then overtake each other.
    pub jitter: Duration,
    /// Bits per second in each direction; nothing is without a limit.
    pub rate_bps: Option<u64>,
    /// Packets that may be under way in each direction; one more is dropped.
    pub packets: usize,
}

impl Default for Weather {
    /// Everything passes at once; the queue is as long as that of `tc netem`.
    fn default() -> Weather {
        Weather {
            loss: 0.0,
            delay: Duration::ZERO,
            jitter: Duration::ZERO,
            rate_bps: None,
            packets: 1000,
        }
    }
}

impl Weather {
    /// Nothing passes.
    pub const OUTAGE: Weather = Weather {
        loss: 1.0,
        delay: Duration::ZERO,
        jitter: Duration::ZERO,
        rate_bps: None,
        packets: 0,
    };

    /// Everything passes at once, but for a share that is lost.
    pub fn loss(loss: f64) -> Weather {
        Weather {
            loss,
            ..Weather::default()
        }
    }
}

/// A packet under way, the earliest first.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
struct UnderWay {
    due: std::cmp::Reverse<(MonotonicNs, u64)>,
    to: usize,
    bytes: Vec<u8>,
}

/// The air between machine 0 and machine 1.
pub struct Air {
    random: Random,
    under_way: BinaryHeap<UnderWay>,
    /// In each direction, until when the link is busy with what came before.
    busy_until: [MonotonicNs; 2],
    waiting: [usize; 2],
    number: u64,
}

impl Air {
    /// Air in which the same packets meet the same outcome for the same seed.
    pub fn new(seed: u64) -> Air {
        Air {
            random: Random::new(seed, 0),
            under_way: BinaryHeap::new(),
            busy_until: [MonotonicNs(0); 2],
            waiting: [0; 2],
            number: 0,
        }
    }

    /// A packet is sent to machine `to`.
    pub fn send(&mut self, to: usize, bytes: &[u8], weather: &Weather, now: MonotonicNs) {
        if self.random.uniform() < weather.loss || self.waiting[to] >= weather.packets {
            return;
        }
        let mut sent = now;
        if let Some(rate_bps) = weather.rate_bps {
            let lasts_ns = bytes.len() as u64 * 8 * 1_000_000_000 / rate_bps.max(1);
            sent = now.max(self.busy_until[to]) + Duration::from_nanos(lasts_ns);
            self.busy_until[to] = sent;
        }
        let jitter = weather.jitter.mul_f64(self.random.uniform());
        self.number += 1;
        self.waiting[to] += 1;
        self.under_way.push(UnderWay {
            due: std::cmp::Reverse((sent + weather.delay + jitter, self.number)),
            to,
            bytes: bytes.to_vec(),
        });
    }

    /// The next packet that has arrived, and where.
    pub fn arrived(&mut self, now: MonotonicNs) -> Option<(usize, Vec<u8>)> {
        if self.deadline()? > now {
            return None;
        }
        let packet = self.under_way.pop()?;
        self.waiting[packet.to] -= 1;
        Some((packet.to, packet.bytes))
    }

    /// When the next packet arrives.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        self.under_way.peek().map(|packet| packet.due.0.0)
    }
}
