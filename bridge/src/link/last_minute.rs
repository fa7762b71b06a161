//! [`LastMinute`]: what the line lost in the last minute, so that an old outage does not count for ever.

use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::payload::{self, LinkHealth, RefusedCounters};
use serde::{Deserialize, Serialize};

/// Time between two marks.
const STEP: Duration = Duration::from_secs(10);

/// Marks that are kept: the oldest is six steps older than the newest, which is at most one step old.
const MARKS: usize = 7;

/// Pieces that each opening of the port and each boot of the DSP may cut: the end of one message and the beginning of
/// another.
const CUT_PER_OPENING: u64 = 2;

/// The totals at a moment.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct TotalsAt {
    at: MonotonicNs,
    messages: u64,
    rejected: u64,
    openings: u64,
    repeated: u32,
    failed: u32,
}

/// Totals of the last minute, a mark each ten seconds.
#[derive(Debug, Default, Serialize, Deserialize)]
pub struct LastMinute {
    /// The oldest first; all alike in the beginning.
    marks: [TotalsAt; MARKS],
}

impl LastMinute {
    /// The figures at `now`, from totals since the bridge began.
    pub fn look(
        &mut self,
        now: MonotonicNs,
        link: &LinkHealth,
        rejected: &RefusedCounters,
    ) -> payload::LastMinute {
        let present = TotalsAt {
            at: now,
            messages: link.messages_received,
            rejected: rejected.pieces(),
            openings: u64::from(link.port_openings) + u64::from(link.dsp_boots),
            repeated: link.commands_repeated,
            failed: link.commands_failed,
        };
        let newest = self.marks[MARKS - 1].at;
        if newest == MonotonicNs(0) {
            self.marks = [TotalsAt {
                at: now,
                ..TotalsAt::default()
            }; MARKS];
        } else if now.since(newest) >= STEP {
            self.marks.rotate_left(1);
            self.marks[MARKS - 1] = present;
        }
        let oldest = &self.marks[0];
        let cut = CUT_PER_OPENING * (present.openings - oldest.openings);
        let small = |number: u64| u32::try_from(number).unwrap_or(u32::MAX);
        payload::LastMinute {
            duration_s: small(now.since(oldest.at).as_secs()),
            messages: small(present.messages - oldest.messages),
            rejected: small((present.rejected - oldest.rejected).saturating_sub(cut)),
            commands_repeated: present.repeated - oldest.repeated,
            commands_failed: present.failed - oldest.failed,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_outage_is_forgotten_a_minute_later() {
        let mut minute = LastMinute::default();
        let mut link = LinkHealth::default();
        let mut rejected = RefusedCounters::default();
        let start = MonotonicNs(5_000_000_000);
        let mut now = start;
        let mut seen = Vec::new();
        // Four looks a second, 50 messages a second; the outage is in the tenth second.
        for quarter in 0..4 * 200 {
            now = start + Duration::from_millis(250 * quarter);
            link.messages_received += 12;
            if quarter == 40 {
                link.port_openings += 1;
                link.dsp_boots += 1;
                link.commands_repeated += 2;
                link.commands_failed += 1;
                rejected.checksum += 5;
            }
            if quarter == 4 * 150 {
                rejected.checksum += 1;
            }
            let last = minute.look(now, &link, &rejected);
            assert!(last.duration_s <= 70, "{last:?}");
            assert!(quarter < 4 * 70 || last.duration_s >= 60, "{last:?}");
            seen.push((last.rejected, last.commands_repeated, last.commands_failed));
        }
        assert_eq!(seen[40], (1, 2, 1));
        assert_eq!(seen[4 * 69], (1, 2, 1), "it is less than a minute ago");
        assert_eq!(seen[4 * 81], (0, 0, 0));
        assert_eq!(seen[4 * 151], (1, 0, 0));
        // A bridge that was stopped says of how long its figures are.
        now = now + Duration::from_secs(1200);
        assert!(minute.look(now, &link, &rejected).duration_s >= 1200);
    }
}
