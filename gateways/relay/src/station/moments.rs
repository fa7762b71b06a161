//! [`Moments`]: when the orders of this machine were issued, by the robot's clock; and the other way round, the moments
//! in samples and reports of the robot. Pure values.

use std::collections::BTreeMap;
use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::payload::RequestReport;

use crate::clock::{Clock, RemoteNs};
use crate::request::{RequestFields, word};

/// For how long a request is handed on that says when it was issued, and not until when it may begin. Its server knows
/// what it is, and may want it sooner.
const HANDED_ON_WITHIN: Duration = Duration::from_secs(30);

/// Moments that are remembered, so that later ones keep the order: of more orders than a station has open.
const REMEMBERED: usize = 64;

/// When an order was issued, by the robot's clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Issued {
    /// The earliest moment at which it can have been.
    pub earliest: MonotonicNs,
    /// By how much later it can have been at most, ns.
    pub within_ns: u32,
}

/// Translates moments, and keeps their order: what was issued later here is later there, and what was issued at the
/// same moment, as the waypoints of a path are, is issued at the same moment there, however the estimate of the robot's
/// clock changes.
#[derive(Clone, Debug, Default)]
pub struct Moments {
    translated: BTreeMap<MonotonicNs, MonotonicNs>,
    /// Of the clock, when they were translated.
    resets: u64,
}

impl Moments {
    /// Gives the moments in a request by the robot's clock, and says until when the robot's relay may hand it on: the
    /// earliest moment that this can be. `default_deadline` is for a request that says neither when it was issued nor
    /// until when it may begin. `None` if the robot's clock is not known.
    pub fn translate(
        &mut self,
        request: &mut [u8],
        fields: &RequestFields,
        clock: &Clock,
        default_deadline: Duration,
        now: MonotonicNs,
    ) -> Option<MonotonicNs> {
        let (issued, begin_by) = (fields.issued(request), fields.begin_by(request));
        if let Some(at) = issued {
            let issued = self.issued(at, clock, now)?;
            fields.set_issued(request, issued.earliest, issued.within_ns);
        }
        if let Some(at) = begin_by {
            let begin_by = earliest(at, clock)?;
            fields.set_begin_by(request, begin_by);
            return Some(begin_by);
        }
        let within = match issued {
            Some(_) => HANDED_ON_WITHIN,
            None => default_deadline,
        };
        earliest(now + within, clock)
    }

    /// When something was issued by the robot's clock. `None` if that is not known, or not within four seconds.
    pub fn issued(&mut self, at: MonotonicNs, clock: &Clock, now: MonotonicNs) -> Option<Issued> {
        if self.resets != clock.resets() {
            self.translated.clear();
            self.resets = clock.resets();
        }
        let uncertainty_ns = clock.estimate(at)?.uncertainty_ns;
        let latest_ns = clock.to_remote(at)?.0.saturating_add(uncertainty_ns);
        let mut earliest = earliest(at, clock)?;
        // Between two orders passes as much time there as here, but for the drift.
        if let Some((then, before)) = self.translated.range(..=at).next_back() {
            let passed_ns = at.0 - then.0;
            let least_ns = passed_ns - passed_ns.div_ceil(4096);
            earliest = earliest.max(MonotonicNs(before.0.saturating_add(least_ns)));
        }
        if let Some((then, after)) = self.translated.range(at..).next() {
            let passes_ns = then.0 - at.0;
            let least_ns = passes_ns - passes_ns.div_ceil(2048);
            earliest = earliest.min(MonotonicNs(after.0.saturating_sub(least_ns)));
        }
        if at <= now {
            self.translated.insert(at, earliest);
        }
        if self.translated.len() > REMEMBERED {
            self.translated.pop_first();
        }
        let within_ns = latest_ns.saturating_sub(earliest.0);
        Some(Issued {
            earliest,
            within_ns: u32::try_from(within_ns).ok()?,
        })
    }
}

/// The earliest moment of the robot's clock at which it can be `at` here. Never 0, which stands for none.
pub fn earliest(at: MonotonicNs, clock: &Clock) -> Option<MonotonicNs> {
    let uncertainty_ns = clock.estimate(at)?.uncertainty_ns;
    let earliest_ns = clock.to_remote(at)?.0.saturating_sub(uncertainty_ns);
    Some(MonotonicNs(earliest_ns.max(1)))
}

/// Turns the robot's moments into those of this machine's clock. What is not younger than the sample can be is as old
/// as it: no moment lies in the future. 0 stands for never and stays.
pub fn translate_sample(sample: &mut [u8], moments: &[usize], clock: &Clock, now: MonotonicNs) {
    for offset in moments {
        let Some(remote) = word(sample, *offset).filter(|remote| *remote > 0) else {
            continue;
        };
        // Without an estimate nothing is published: the link is up only with one.
        let local = clock
            .to_local(RemoteNs(remote))
            .unwrap_or_default()
            .min(now);
        if let Some(bytes) = sample.get_mut(*offset..*offset + 8) {
            bytes.copy_from_slice(&local.0.max(1).to_le_bytes());
        }
    }
}

/// Turns the moment of a report into that of this machine's clock: `now` without an estimate, and never later than
/// `now`.
pub fn translate_report(report: &mut RequestReport, clock: &Clock, now: MonotonicNs) {
    let local = clock.to_local(RemoteNs(report.reported_ns)).unwrap_or(now);
    report.reported_ns = local.min(now).0;
}

#[cfg(test)]
mod tests {
    use std::mem::offset_of;

    use ipc_types::payload::{ModuleState, MovementEnd, SharedStruct};

    use super::*;
    use crate::clock::{Exchange, RemoteNs, Suspended};

    const MS: u64 = 1_000_000;
    /// By how much the robot's clock is ahead.
    const AHEAD: u64 = 3_600_000 * MS;

    const fn at(ms: u64) -> MonotonicNs {
        MonotonicNs(ms * MS)
    }

    /// Asked at `sent_ms`; both messages take `delay_ms`.
    fn exchange(clock: &mut Clock, sent_ms: u64, delay_ms: u64) {
        let remote = RemoteNs(at(sent_ms + delay_ms).0 + AHEAD);
        let exchange = Exchange {
            sent: at(sent_ms),
            remote_received: remote,
            remote_sent: remote,
            received: at(sent_ms + 2 * delay_ms),
            suspended: Suspended::default(),
        };
        clock.take(&exchange).unwrap();
    }

    fn issued(moments: &mut Moments, ms: u64, clock: &Clock) -> Issued {
        moments.issued(at(ms), clock, at(100_000)).unwrap()
    }

    #[test]
    fn the_true_moment_lies_within_what_is_said() {
        let (mut moments, mut clock) = (Moments::default(), Clock::new());
        assert_eq!(moments.issued(at(5), &clock, at(5)), None, "no estimate");
        exchange(&mut clock, 1_000, 40);
        for ms in [900, 1_080, 2_000] {
            let issued = issued(&mut moments, ms, &clock);
            let truth = at(ms).0 + AHEAD;
            let latest = issued.earliest.0 + u64::from(issued.within_ns);
            assert!(issued.earliest.0 <= truth && truth <= latest, "{issued:?}");
            assert_eq!(earliest(at(ms), &clock), Some(issued.earliest));
        }
    }

    #[test]
    fn a_later_order_is_not_issued_earlier_however_the_estimate_changes() {
        let (mut moments, mut clock) = (Moments::default(), Clock::new());
        exchange(&mut clock, 1_000, 40);
        let wide = issued(&mut moments, 1_100, &clock);
        exchange(&mut clock, 1_200, 1);
        let narrow = issued(&mut moments, 1_300, &clock);
        assert!(narrow.within_ns < wide.within_ns, "{narrow:?} {wide:?}");
        let again = issued(&mut moments, 1_100, &clock);
        assert_eq!(again.earliest, wide.earliest, "a path has one moment");
        // Without an exchange for a minute nothing is as sure.
        let mut vague = Clock::new();
        exchange(&mut vague, 1_000, 300);
        let later = issued(&mut moments, 1_301, &vague);
        assert!(later.earliest > narrow.earliest, "{later:?} {narrow:?}");
        let between = issued(&mut moments, 1_200, &vague);
        assert!(between.earliest > wide.earliest && between.earliest < narrow.earliest);
    }

    #[test]
    fn after_a_jump_of_the_offset_nothing_of_before_counts() {
        let (mut moments, mut clock) = (Moments::default(), Clock::new());
        exchange(&mut clock, 1_000, 1);
        let before = issued(&mut moments, 1_100, &clock);
        clock.reset(at(1_200));
        assert_eq!(moments.issued(at(1_250), &clock, at(1_250)), None);
        exchange(&mut clock, 1_300, 400);
        let after = issued(&mut moments, 1_100, &clock);
        assert!(after.earliest < before.earliest, "{after:?} {before:?}");
    }

    #[test]
    fn the_end_of_a_movement_stays_the_same_end_however_the_estimate_changes() {
        let offset = offset_of!(ModuleState, last_end) + offset_of!(MovementEnd, ended_ns);
        let mut sent = ModuleState::default();
        sent.last_end.ended_ns = AHEAD + at(500).0;
        sent.last_end.request_id = 7;
        let translated = |clock: &Clock| {
            let mut bytes = sent.bytes().to_vec();
            translate_sample(&mut bytes, &[offset], clock, at(2_000));
            ModuleState::from_bytes(&bytes).unwrap().last_end
        };
        let mut clock = Clock::new();
        exchange(&mut clock, 1_000, 40);
        let first = translated(&clock);
        let mut other = Clock::new();
        exchange(&mut other, 1_200, 1);
        other.reset(at(1_250));
        let remote = RemoteNs(at(1_300).0 + AHEAD + MS / 50);
        let late = Exchange {
            sent: at(1_300),
            remote_received: remote,
            remote_sent: remote,
            received: at(1_300),
            suspended: Suspended::default(),
        };
        other.take(&late).unwrap();
        let second = translated(&other);
        assert_ne!(first.ended_ns, second.ended_ns);
        assert!(!second.is_another_than(&first));
    }

    #[test]
    fn what_is_too_vague_is_not_known_and_garbage_is_no_panic() {
        let (mut moments, mut clock) = (Moments::default(), Clock::new());
        exchange(&mut clock, 1_000, 2_500);
        assert_eq!(moments.issued(at(6_000), &clock, at(6_000)), None);
        let mut clock = Clock::new();
        exchange(&mut clock, 1_000, 1);
        for ns in [1, u64::MAX] {
            let _ = moments.issued(MonotonicNs(ns), &clock, at(2_000));
            assert!(earliest(MonotonicNs(ns), &clock).is_some());
        }
        for ms in 2_000..3_000 {
            let _ = issued(&mut moments, ms, &clock);
        }
        assert_eq!(moments.translated.len(), REMEMBERED);
    }
}
