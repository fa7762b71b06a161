//! What the serial link does to single bytes of one direction.
//!
//! A byte is damaged when it enters, by the faults that are active then; delays, pauses and stalls decide when it
//! leaves. Bytes never overtake each other. It knows nothing of messages.

use std::collections::VecDeque;
use std::time::Duration;

use crate::random::Random;

use super::counters::ByteCounters;
use super::script::{AfterStall, Damage, Window};

/// Bytes that may be under way, in bytes: 5 s of a serial link of 115200 baud. Those that enter beyond it are lost
/// and counted, as by a receiver that overruns.
pub const QUEUE_PLACES: usize = 65_536;

/// Bytes that may become of one. It bounds what many faults that duplicate and insert make together; beyond it nothing
/// more is added.
const MAX_FROM_ONE: usize = 16;

/// A serial link of one direction that damages bytes.
#[derive(Clone, Debug, Default)]
pub(super) struct ByteStage {
    faults: Vec<ByteFault>,
    /// Bytes under way and when they leave, ascending.
    queue: VecDeque<(Duration, u8)>,
    /// When the last byte that entered leaves.
    last_due: Duration,
    /// The end of the last stall that held a byte up.
    stalled_until: Duration,
    /// What becomes of the byte that is entering; kept for its memory alone.
    entering: Vec<u8>,
    counters: ByteCounters,
}

/// One fault at work.
#[derive(Clone, Debug)]
struct ByteFault {
    window: Window,
    damage: Damage,
    random: Random,
    /// Bytes left of the burst, or of the piece, that has begun.
    left: u64,
}

impl ByteStage {
    /// Appends a fault, which draws from `random`.
    pub(super) fn add(&mut self, window: Window, damage: Damage, random: Random) {
        self.faults.push(ByteFault {
            window,
            damage,
            random,
            left: 0,
        });
    }

    /// Takes a byte that went through the serial link at `at`, which is no earlier than that of the byte before.
    pub(super) fn enter(&mut self, at: Duration, byte: u8) {
        self.entering.clear();
        self.entering.push(byte);
        for fault in &mut self.faults {
            if fault.window.contains(at) {
                fault.damage(&mut self.entering, &mut self.counters);
            }
        }
        for index in 0..self.entering.len() {
            let Some(byte) = self.entering.get(index) else {
                return;
            };
            let byte = *byte;
            if let Some(due) = self.due(at) {
                if self.queue.len() == QUEUE_PLACES {
                    self.counters.overflowed += 1;
                    continue;
                }
                self.last_due = due;
                self.queue.push_back((due, byte));
            }
        }
    }

    /// Gives the next byte that has left by `now`, and when it did.
    pub(super) fn leave(&mut self, now: Duration) -> Option<(Duration, u8)> {
        self.queue.front().filter(|(due, _)| *due <= now)?;
        self.queue.pop_front()
    }

    /// When the next byte leaves.
    pub(super) fn next_deadline(&self) -> Option<Duration> {
        self.queue.front().map(|(due, _)| *due)
    }

    /// What was done so far.
    pub(super) fn counters(&self) -> ByteCounters {
        self.counters
    }

    /// Bytes under way.
    pub(super) fn waiting(&self) -> usize {
        self.queue.len()
    }

    /// When a byte leaves that enters at `at`; `None` if a stall loses it.
    fn due(&mut self, at: Duration) -> Option<Duration> {
        let mut due = at;
        for fault in self.faults.iter_mut() {
            if fault.window.contains(at) {
                due = due.saturating_add(fault.delay());
            }
        }
        if due > at {
            self.counters.delayed += 1;
        }
        // First in, first out.
        due = due.max(self.last_due);
        for fault in self.faults.iter_mut() {
            if fault.window.contains(at)
                && let Some(gap) = fault.pause()
            {
                due = due.max(self.last_due.saturating_add(gap));
                self.counters.pieces += 1;
            }
        }
        self.after_stalls(at, due)
    }

    /// When a byte leaves that entered at `at` and would leave at `due` if nothing stalled; `None` if a stall
    /// loses it.
    fn after_stalls(&mut self, at: Duration, mut due: Duration) -> Option<Duration> {
        for fault in &self.faults {
            let Damage::Stall { then } = fault.damage else {
                continue;
            };
            if !fault.window.contains(due) {
                continue;
            }
            match (then, fault.window.end_at(due)) {
                (AfterStall::Pass, Some(end)) => {
                    due = end;
                    self.stalled_until = end;
                }
                // A stall without an end never lets anything pass.
                (AfterStall::Drop, _) | (AfterStall::Pass, None) => {
                    self.counters.stall_dropped += 1;
                    return None;
                }
            }
        }
        // Those behind a byte that was held up come with it.
        self.counters.stalled += u64::from(due == self.stalled_until && at < due);
        Some(due)
    }
}

impl ByteFault {
    /// Damages what is entering.
    fn damage(&mut self, bytes: &mut Vec<u8>, counters: &mut ByteCounters) {
        match self.damage {
            Damage::FlipBits { bit_error_rate } => {
                for byte in bytes {
                    for bit in 0..8 {
                        if self.random.uniform() < bit_error_rate {
                            *byte ^= 1 << bit;
                            counters.flipped_bits += 1;
                        }
                    }
                }
            }
            Damage::Drop { rate } => bytes.retain(|_| {
                let is_lost = self.random.uniform() < rate;
                counters.dropped += u64::from(is_lost);
                !is_lost
            }),
            Damage::Duplicate { rate } => {
                counters.duplicated += self.add(rate, bytes, |_, byte| byte);
            }
            Damage::Insert { rate } => {
                counters.inserted += self.add(rate, bytes, |random, _| random_byte(random));
            }
            Damage::Burst { rate, length_bytes } => {
                for byte in bytes {
                    self.burst(rate, length_bytes, byte, counters);
                }
            }
            Damage::Outage => {
                counters.outage_dropped += bytes.len() as u64;
                bytes.clear();
            }
            Damage::Delay { .. } | Damage::Split { .. } | Damage::Stall { .. } => {}
        }
    }

    /// Puts a byte that `make` makes before each one that is drawn; returns how many.
    fn add(&mut self, rate: f64, bytes: &mut Vec<u8>, make: fn(&mut Random, u8) -> u8) -> u64 {
        let mut added = 0;
        let mut index = 0;
        while let Some(byte) = bytes.get(index).copied() {
            if bytes.len() < MAX_FROM_ONE && self.random.uniform() < rate {
                bytes.insert(index, make(&mut self.random, byte));
                added += 1;
                index += 1;
            }
            index += 1;
        }
        added
    }

    /// Replaces `byte` when a burst has begun or begins with it.
    fn burst(&mut self, rate: f64, length_bytes: u32, byte: &mut u8, counters: &mut ByteCounters) {
        if self.left == 0 && self.random.uniform() < rate {
            self.left = length_bytes.into();
            counters.bursts += 1;
        }
        let Some(left) = self.left.checked_sub(1) else {
            return;
        };
        self.left = left;
        *byte = random_byte(&mut self.random);
        counters.burst_bytes += 1;
    }

    /// How much later the next byte comes.
    fn delay(&mut self) -> Duration {
        match self.damage {
            Damage::Delay { delay, jitter } => {
                delay.saturating_add(jitter.mul_f64(self.random.uniform()))
            }
            _ => Duration::ZERO,
        }
    }

    /// The pause before the next byte; `None` if it belongs to the piece that has begun.
    fn pause(&mut self) -> Option<Duration> {
        let Damage::Split { chunk_bytes, gap } = self.damage else {
            return None;
        };
        let begins = self.left == 0;
        if begins {
            let longest = (chunk_bytes as u64).max(1);
            self.left = 1 + self.random.next_u64() % longest;
        }
        self.left -= 1;
        begins.then_some(gap)
    }
}

fn random_byte(random: &mut Random) -> u8 {
    (random.next_u64() >> 56) as u8
}

#[cfg(test)]
mod tests;
