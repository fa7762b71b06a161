//! Coherence in time: which status samples are newer than the one before (requirement D10).
//!
//! A serial line does not reorder, but a corrupted time that slips through the 7-bit checksum, a frame that a DSP sends
//! twice, or a reboot do make the DSP's clock look as if it jumped. Two rules are offered:
//!
//! * [`Rule::Confirmed`], the source's: a sample is sent when the next one is newer than it and it is itself newer than
//!   the last one sent. Every sample is late by one.
//! * [`Rule::Immediate`], the default: a sample in order is sent at once. Only a sample that looks wrong (its time
//!   stands still, goes back, or leaps ahead) is held until the next one shows whether it or its predecessor was wrong.
//!
//! A clock that goes back and keeps running from there is a reboot. This module never looks at anything but times.

use serde::{Deserialize, Serialize};

pub use crate::config::CoherenceRule as Rule;

/// Whether `time_ms` follows `earlier_ms` closely: the usual case, also where the clock wraps at 2³² ms (49.7 days).
const fn is_next(earlier_ms: u32, time_ms: u32) -> bool {
    let step_ms = time_ms.wrapping_sub(earlier_ms);
    step_ms > 0 && step_ms <= LEAP_MS
}

/// Whether `time_ms` is newer than `earlier_ms`. A clock that wraps while more than [`LEAP_MS`] pass unseen looks like
/// a reboot; the link was lost by then anyway.
const fn is_newer(earlier_ms: u32, time_ms: u32) -> bool {
    is_next(earlier_ms, time_ms) || time_ms > earlier_ms && !is_next(time_ms, earlier_ms)
}

/// A time that leaps further ahead than this is held until the next sample confirms it. Far above any status period
/// (at most 10 s, port 10001), so that a real line never gets here; a flipped bit 16 or higher always does.
const LEAP_MS: u32 = 60_000;

/// What to do after a sample arrived: at most two samples to send, in order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Released<S> {
    /// The DSP's clock restarted before the samples of this verdict.
    pub rebooted: bool,
    /// Samples to send, oldest first.
    pub send: [Option<S>; 2],
    /// Samples given up by this arrival.
    pub dropped: u32,
}

impl<S> Released<S> {
    const fn nothing() -> Self {
        Released {
            rebooted: false,
            send: [None, None],
            dropped: 0,
        }
    }
}

/// The filter: at most one sample is held at any time.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Coherence<S> {
    #[serde(skip)]
    rule: Rule,
    /// Times of the last sample sent and of the one sent before it.
    last_ms: Option<u32>,
    before_last_ms: Option<u32>,
    held: Option<(u32, S)>,
}

impl<S> Coherence<S> {
    /// A filter that has seen nothing.
    pub const fn new(rule: Rule) -> Self {
        Coherence {
            rule,
            last_ms: None,
            before_last_ms: None,
            held: None,
        }
    }

    /// Takes over the rule, after a snapshot.
    pub fn configure(&mut self, rule: Rule) {
        self.rule = rule;
    }

    /// Forgets all times, as after the port was re-opened. A held sample is given up.
    pub fn reset(&mut self) {
        *self = Coherence::new(self.rule);
    }

    /// Takes the next sample, measured at `time_ms` of the DSP's clock.
    pub fn arrive(&mut self, time_ms: u32, sample: S) -> Released<S> {
        match self.rule {
            Rule::Immediate => self.arrive_immediate(time_ms, sample),
            Rule::Confirmed => self.arrive_confirmed(time_ms, sample),
        }
    }

    fn arrive_immediate(&mut self, time_ms: u32, sample: S) -> Released<S> {
        let mut verdict = Released::nothing();
        let held = self.held.take();
        let in_order = |earlier_ms: u32| is_next(earlier_ms, time_ms);
        match (self.last_ms, held) {
            // The usual case. Whatever was held is older than this one or contradicted by it.
            (last, held) if last.is_none_or(in_order) => {
                verdict.dropped = u32::from(held.is_some());
                verdict.send[0] = Some(self.sent(time_ms, sample));
            }
            // This sample continues the one held, so the clock really is where the held one said.
            (Some(last), Some((held_ms, held))) if in_order(held_ms) => {
                let went_back = !is_newer(last, held_ms);
                // When both continue what was sent before `last`, then `last` was the wrong one and nothing rebooted.
                let last_was_wrong = self
                    .before_last_ms
                    .is_some_and(|before| is_newer(before, held_ms));
                verdict.rebooted = went_back && !last_was_wrong;
                verdict.send = [
                    Some(self.sent(held_ms, held)),
                    Some(self.sent(time_ms, sample)),
                ];
            }
            (_, held) => {
                verdict.dropped = u32::from(held.is_some());
                self.held = Some((time_ms, sample));
            }
        }
        verdict
    }

    fn arrive_confirmed(&mut self, time_ms: u32, sample: S) -> Released<S> {
        let mut verdict = Released::nothing();
        if let Some((held_ms, held)) = self.held.take() {
            let confirmed = is_newer(held_ms, time_ms);
            // Two samples in a row below the last one sent: the clock went back for good.
            verdict.rebooted =
                confirmed && self.last_ms.is_some_and(|last| is_newer(time_ms, last));
            if confirmed
                && (verdict.rebooted || self.last_ms.is_none_or(|last| is_newer(last, held_ms)))
            {
                verdict.send[0] = Some(self.sent(held_ms, held));
            } else {
                verdict.dropped = 1;
            }
        }
        self.held = Some((time_ms, sample));
        verdict
    }

    fn sent(&mut self, time_ms: u32, sample: S) -> S {
        self.before_last_ms = self.last_ms.replace(time_ms);
        sample
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Feeds `arrivals` and compares what is sent, where a reboot happened (index into `sent`) and what was dropped.
    fn check(rule: Rule, arrivals: &[u32], sent: &[u32], reboots: &[usize], dropped: u32) {
        let mut filter = Coherence::new(rule);
        let (mut got, mut got_reboots, mut got_dropped) = (vec![], vec![], 0);
        for time in arrivals {
            let verdict = filter.arrive(*time, *time);
            if verdict.rebooted {
                got_reboots.push(got.len());
            }
            got.extend(verdict.send.into_iter().flatten());
            got_dropped += verdict.dropped;
        }
        assert_eq!(
            (got.as_slice(), got_reboots.as_slice(), got_dropped),
            (sent, reboots, dropped),
            "{rule:?} {arrivals:?}"
        );
    }

    /// The source's table: t0 t1 t2 t3 t2! t4 t5 t6.
    const SOURCE_EXAMPLE: [u32; 8] = [10, 11, 12, 13, 12, 14, 15, 16];

    #[test]
    fn the_sources_example_under_the_sources_rule() {
        check(
            Rule::Confirmed,
            &SOURCE_EXAMPLE,
            &[10, 11, 12, 14, 15],
            &[],
            2,
        );
    }

    #[test]
    fn the_sources_example_under_the_default_rule() {
        check(
            Rule::Immediate,
            &SOURCE_EXAMPLE,
            &[10, 11, 12, 13, 14, 15, 16],
            &[],
            1,
        );
    }

    #[test]
    fn samples_in_order_pass_at_once_or_one_late() {
        check(Rule::Immediate, &[0, 20, 40], &[0, 20, 40], &[], 0);
        check(Rule::Confirmed, &[0, 20, 40], &[0, 20], &[], 0);
    }

    #[test]
    fn a_clock_that_restarts_is_a_reboot() {
        check(
            Rule::Immediate,
            &[5000, 5020, 3, 23, 43],
            &[5000, 5020, 3, 23, 43],
            &[2],
            0,
        );
        check(
            Rule::Confirmed,
            &[5000, 5020, 5040, 3, 23, 43],
            &[5000, 5020, 3, 23],
            &[2],
            1,
        );
    }

    #[test]
    fn one_repeated_or_old_sample_is_dropped() {
        check(
            Rule::Immediate,
            &[100, 120, 120, 140],
            &[100, 120, 140],
            &[],
            1,
        );
        check(
            Rule::Immediate,
            &[100, 120, 60, 140],
            &[100, 120, 140],
            &[],
            1,
        );
        check(
            Rule::Immediate,
            &[100, 120, 60, 60, 140],
            &[100, 120, 140],
            &[],
            2,
        );
    }

    #[test]
    fn one_time_far_ahead_is_dropped_and_never_mistaken_for_a_reboot() {
        let far = 120 + LEAP_MS + 1;
        check(
            Rule::Immediate,
            &[100, 120, far, 140, 160],
            &[100, 120, 140, 160],
            &[],
            1,
        );
    }

    #[test]
    fn a_time_a_little_ahead_passes_and_the_next_two_put_it_right() {
        check(
            Rule::Immediate,
            &[100, 120, 4216, 140, 160],
            &[100, 120, 4216, 140, 160],
            &[],
            0,
        );
    }

    #[test]
    fn a_clock_that_stays_ahead_is_believed() {
        let far = 120 + LEAP_MS + 1;
        check(
            Rule::Immediate,
            &[100, 120, far, far + 20],
            &[100, 120, far, far + 20],
            &[],
            0,
        );
    }

    #[test]
    fn reset_forgets() {
        for rule in [Rule::Immediate, Rule::Confirmed] {
            let mut filter = Coherence::new(rule);
            let _ = filter.arrive(1000, ());
            filter.reset();
            assert!(!filter.arrive(5, ()).rebooted);
            assert!(!filter.arrive(25, ()).rebooted);
        }
    }
}
