//! [`Gather`]: when the recorder looks for samples. While samples flow it looks by the time: then no publisher has to
//! wake it, which would hold up the telemetry that the publisher carries. When none came for a while, the next one
//! wakes it.

use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::service::SUBSCRIBER_BUFFER;

/// Shortest time between two looks: at most 100 wakes a second, however many topics there are and how often they come.
/// A subscriber holds 128 samples, so that topics of up to 12.8 kHz lose nothing by it.
const SHORTEST: Duration = Duration::from_millis(10);

/// Longest time between two looks: 25 wakes a second. A topic that begins beside others with more than 3.2 kHz may lose
/// some of its first samples by it, which the record reports.
const LONGEST: Duration = Duration::from_millis(40);

/// Samples of one topic that gather between two looks, if it has such a rate: a quarter of what a subscriber holds.
const FILL: usize = SUBSCRIBER_BUFFER / 4;

/// How long no sample comes until the flow is over: two of the longest times, so that topics of 12.5 Hz and more are a
/// flow.
const LINGER: Duration = LONGEST.saturating_mul(2);

/// When the recorder looks for samples: by the time while samples flow, else when the next one wakes it.
#[derive(Debug, Default)]
pub(crate) struct Gather(Option<Flow>);

/// Samples flow.
#[derive(Debug)]
struct Flow {
    /// When the last ones were taken.
    taken: MonotonicNs,
    /// When to look again.
    next: MonotonicNs,
}

impl Gather {
    /// Whether to look for samples now.
    pub fn is_due(&self, now: MonotonicNs) -> bool {
        self.0.as_ref().is_none_or(|flow| now >= flow.next)
    }

    /// Whether the recorder looks by the time now and in future: it need not be woken.
    pub fn flows(&self, now: MonotonicNs) -> bool {
        let flow = self.0.as_ref();
        flow.is_some_and(|flow| now.since(flow.taken) < LINGER)
    }

    /// A look has taken at most `most` samples of a topic. What [`flows`](Gather::flows) said before it decides whether
    /// publishers may wake the recorder again.
    pub fn looked(&mut self, now: MonotonicNs, most: usize) {
        let flows = self.flows(now);
        let pause = match (&self.0, most) {
            (_, 0) if !flows => {
                self.0 = None;
                return;
            }
            (Some(flow), 1..) => now.since(flow.taken) * FILL as u32 / most as u32,
            _ => SHORTEST,
        };
        let taken = match (&self.0, most) {
            (Some(flow), 0) => flow.taken,
            _ => now,
        };
        self.0 = Some(Flow {
            taken,
            next: now + pause.clamp(SHORTEST, LONGEST),
        });
    }

    /// When to look for samples though nothing wakes the recorder; `None` if a sample does.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        self.0.as_ref().map(|flow| flow.next)
    }
}

#[cfg(test)]
mod tests {
    use module_kit::journal;
    use recording::Settings;

    use super::*;

    /// What a kill costs at most.
    const PROMISE: Duration = Duration::from_millis(500);

    /// How late the threads of three processes may be, together, for the promise to hold.
    const LATE: Duration = Duration::from_millis(50);

    #[test]
    fn bytes_of_the_serial_line_wait_less_than_a_kill_may_cost() {
        // They wait in a piece of the journal, in shared memory, and then in the recorder.
        let waiting = journal::DELAY + LONGEST + Settings::default().flush;
        assert!(waiting + LATE <= PROMISE, "{waiting:?}");
    }

    const fn at(ms: u64) -> MonotonicNs {
        MonotonicNs(1_000_000 * ms)
    }

    /// Looks whenever it is due, at a topic with a sample every `period` from 0 on until `last`, up to `end`. Returns
    /// the looks: when, and how many samples came.
    fn looks(period: Duration, last: MonotonicNs, end: MonotonicNs) -> Vec<(u64, usize)> {
        let period_ns = period.as_nanos() as u64;
        let (mut gather, mut looks) = (Gather::default(), Vec::new());
        let (mut now, mut seen) = (MonotonicNs(0), 0);
        while now <= end {
            let published = now.0.min(last.0) / period_ns + 1;
            assert!(gather.is_due(now));
            let came = (published - seen) as usize;
            gather.looked(now, came);
            looks.push((now.0 / 1_000_000, came));
            seen = published;
            match gather.deadline() {
                Some(next) => now = next,
                None => break,
            }
        }
        looks
    }

    #[test]
    fn a_flow_is_looked_at_by_the_time_and_seldom() {
        let looks = looks(Duration::from_millis(20), at(10_000), at(1000));
        let beginning = [(0, 1), (10, 0), (20, 1), (60, 2), (100, 2), (140, 2)];
        assert_eq!(looks[..6], beginning);
        assert_eq!(looks.last(), Some(&(980, 2)));
    }

    #[test]
    fn the_faster_a_topic_is_the_sooner_it_is_looked_at_so_that_nothing_is_lost() {
        for (hz, most) in [(1000, 32), (3000, 32), (10_000, 101), (12_700, 128)] {
            let looks = looks(Duration::from_secs(1) / hz, at(10_000), at(2000));
            let found = looks.iter().map(|(_, came)| *came).max();
            assert!(found <= Some(most + 1), "{hz} Hz: {found:?}");
            assert!(looks.len() <= 202, "{hz} Hz: {}", looks.len());
        }
    }

    #[test]
    fn when_the_flow_ends_a_sample_wakes_the_recorder_again() {
        let looks = looks(Duration::from_millis(20), at(200), at(1000));
        let (ended, came) = looks[looks.len() - 1];
        assert!((280..=360).contains(&ended) && came == 0, "{looks:?}");
        let mut gather = Gather::default();
        gather.looked(at(0), 0);
        assert!(!gather.flows(at(0)) && gather.is_due(at(0)) && gather.deadline().is_none());
        gather.looked(at(0), 1);
        assert!(gather.flows(at(0)) && !gather.is_due(at(9)) && gather.is_due(at(10)));
        assert!(
            !gather.flows(at(80)),
            "then the recorder looks as one who waits"
        );
    }
}
