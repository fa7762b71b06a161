//! [`Cadence`]: how often something arrives, and so how long it may stay away before it is missing.
//!
//! This is the bridge's only notion of freshness: whether the link is silent, whether a status is overdue and whether
//! an observation is still known all follow from it.
//!
//! `Grants`: which flow control 1 counts (`docs/protocol.md` section 8.4). Bytes wait while the bridge stands still,
//! and with them flow control that was right when the DSP sent it. So of one read at most the newest flow control
//! counts, and after a pause of the bridge none does that may have waited: it must come half a period after the pause,
//! when the line has long been read to its end.

use std::time::Duration;

use ipc_types::MonotonicNs;
use serde::{Deserialize, Serialize};

/// Gaps that are remembered. Their median is the period: an outage or a burst does not change it.
const GAPS: usize = 5;

/// So many periods may pass without an arrival: two in a row may be destroyed by noise.
const PERIODS: u32 = 3;

/// Longest period that counts: the longest status period (port 10001).
const MAX_PERIOD: Duration = Duration::from_secs(10);

/// Observes the period of arrivals.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Cadence {
    last: Option<MonotonicNs>,
    gaps: [Duration; GAPS],
    observed: usize,
}

impl Cadence {
    /// Something arrived.
    pub fn arrived(&mut self, now: MonotonicNs) {
        if let Some(last) = self.last.replace(now) {
            self.gaps[self.observed % GAPS] = now.since(last).min(MAX_PERIOD);
            self.observed += 1;
        }
    }

    /// The period; `None` before the second arrival.
    pub fn period(&self) -> Option<Duration> {
        let count = self.observed.min(GAPS);
        let mut gaps = self.gaps;
        let gaps = &mut gaps[..count];
        gaps.sort_unstable();
        gaps.get(count / 2).copied()
    }

    /// How long an arrival counts as recent: three observed periods, `at_least` in any case.
    pub fn fresh_for(&self, at_least: Duration) -> Duration {
        // The median is no longer than the longest gap, and that needs no sorting.
        if self.gaps.iter().all(|gap| PERIODS * *gap <= at_least) {
            return at_least;
        }
        at_least.max(PERIODS * self.period().unwrap_or_default())
    }
}

/// Flow control period of a DSP of which none was observed yet: that of its boot (port 10002).
const BOOT_PERIOD: Duration = Duration::from_millis(100);

/// Shortest and longest flow control period (port 10002).
const MIN_FLOW_PERIOD: Duration = Duration::from_millis(10);
const MAX_FLOW_PERIOD: Duration = Duration::from_secs(1);

/// Which flow control 1 counts.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct Grants {
    cadence: Cadence,
    last_input: MonotonicNs,
    /// None counts that is read before.
    from: MonotonicNs,
    /// The present input is the first after a pause.
    #[serde(skip)]
    ends_pause: bool,
    /// The newest flow control of the present read.
    #[serde(skip)]
    newest: Option<bool>,
}

impl Grants {
    /// When the bridge had its last input: it has one several times a second, whatever the DSP does.
    pub fn last_input(&self) -> MonotonicNs {
        self.last_input
    }

    /// The bridge handles an input.
    pub fn begin_input(&mut self, now: MonotonicNs) {
        let since = now.since(self.last_input);
        self.last_input = now;
        self.ends_pause = false;
        // No pause is shorter, whatever the period, and that needs no sorting.
        if since < 2 * MIN_FLOW_PERIOD {
            return;
        }
        let observed = self.cadence.period().unwrap_or(BOOT_PERIOD);
        let period = observed.clamp(MIN_FLOW_PERIOD, MAX_FLOW_PERIOD);
        if since >= 2 * period {
            self.ends_pause = true;
            self.from = now + period / 2;
        }
    }

    /// Flow control arrived.
    pub fn arrived(&mut self, is_grant: bool) {
        self.newest = Some(is_grant);
    }

    /// The read is over. Whether it brought a 1 that counts.
    pub fn end_read(&mut self, now: MonotonicNs) -> bool {
        let Some(is_grant) = self.newest.take() else {
            return false;
        };
        let may_have_waited = now < self.from;
        // Several reads of what has waited say nothing of the period.
        if !may_have_waited || self.ends_pause {
            self.cadence.arrived(now);
        }
        is_grant && !may_have_waited
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    fn cadence(times_ms: &[u64]) -> Cadence {
        let mut cadence = Cadence::default();
        for ms in times_ms {
            cadence.arrived(MonotonicNs(ms * 1_000_000));
        }
        cadence
    }

    #[test]
    fn the_period_is_the_median_of_the_last_gaps() {
        assert_eq!(cadence(&[]).period(), None);
        assert_eq!(cadence(&[7]).period(), None);
        assert_eq!(cadence(&[0, 5000]).fresh_for(SECOND), 15 * SECOND);
        assert_eq!(cadence(&[0, 20, 40, 60]).fresh_for(SECOND), SECOND);
        let with_outage = cadence(&[0, 20, 40, 8000, 8020, 8040]);
        assert_eq!(with_outage.period(), Some(Duration::from_millis(20)));
        let with_burst = cadence(&[0, 5000, 10_000, 15_000, 15_000, 20_000, 25_000]);
        assert_eq!(with_burst.period(), Some(5 * SECOND));
    }

    #[test]
    fn nothing_is_believed_to_come_more_slowly_than_the_slowest_status() {
        assert_eq!(cadence(&[0, 600_000]).fresh_for(SECOND), 30 * SECOND);
    }

    fn at(ms: u64) -> MonotonicNs {
        MonotonicNs(ms * 1_000_000)
    }

    /// One read at `ms` with these flow controls.
    fn read(grants: &mut Grants, ms: u64, flow: &[bool]) -> bool {
        grants.begin_input(at(ms));
        flow.iter().for_each(|grant| grants.arrived(*grant));
        grants.end_read(at(ms))
    }

    /// A flow control each 50 ms until 1000 ms, with inputs between them.
    fn observed() -> Grants {
        let mut grants = Grants::default();
        for ms in (10..=1000).step_by(10) {
            let flow: &[bool] = if ms % 50 == 0 { &[true] } else { &[] };
            read(&mut grants, ms, flow);
        }
        grants
    }

    #[test]
    fn the_newest_of_one_read_counts_once() {
        let mut grants = observed();
        assert!(read(&mut grants, 1050, &[true]));
        assert!(!read(&mut grants, 1060, &[]), "it is not kept");
        assert!(read(&mut grants, 1110, &[false, true]));
        assert!(!read(&mut grants, 1160, &[true, false]));
    }

    #[test]
    fn none_counts_that_may_have_waited_while_the_bridge_stood_still() {
        let mut grants = observed();
        assert!(!read(&mut grants, 2300, &[true; 26]));
        for rest in 0..20 {
            assert!(!read(&mut grants, 2301 + rest, &[true; 2]), "more of them");
        }
        assert!(read(&mut grants, 2350, &[true]));
        // Nor is one that comes when another input has ended the pause.
        grants.begin_input(at(3600));
        assert!(!read(&mut grants, 3601, &[true; 26]));
        assert!(read(&mut grants, 3650, &[true]));
    }

    /// Two periods without an input.
    #[test]
    fn a_pause_begins_with_its_limit() {
        for (ms, counts) in [(99, true), (100, false)] {
            let mut grants = observed();
            assert_eq!(read(&mut grants, 1000 + ms, &[true]), counts, "{ms}");
            // Half a period later it is over.
            assert_eq!(read(&mut grants, 1124, &[true]), counts);
            assert!(read(&mut grants, 1125, &[true]));
        }
    }

    #[test]
    fn a_long_flow_control_period_is_no_pause() {
        let mut grants = Grants::default();
        for ms in (1000..10_000).step_by(1000) {
            for quarter in 1..4 {
                grants.begin_input(at(ms - 1000 + 250 * quarter));
            }
            assert_eq!(read(&mut grants, ms, &[true]), ms > 2000, "{ms}");
        }
    }
}
