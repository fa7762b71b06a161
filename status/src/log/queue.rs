//! The logs as the telemetry sees them: a bounded queue for each, and never a wait.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::payload::DspTelemetry;

use super::{LogEvent, LogSummary};
use crate::tally::Tally;

/// Most samples that wait for a log: 20 s at 50 a second, which is longer than a memory card takes to tidy itself up,
/// and a third of a megabyte. Beyond it the newest are dropped and counted: what has been taken in is complete, and the
/// gap is where the disk hung.
pub const QUEUE_SAMPLES: usize = 1024;

/// How often drops are told while they go on.
pub const DROP_REPORT_PERIOD: Duration = Duration::from_secs(60);

/// All logs of the process; by default none.
#[derive(Default)]
pub struct Logs {
    queues: Vec<Queue>,
}

struct Queue {
    log: String,
    /// Gone when the process ends.
    samples: Option<SyncSender<DspTelemetry>>,
    taken: u64,
    dropped: Tally,
}

impl Logs {
    /// Adds the queue of a log; gives the end where the samples come out. It ends when the logs are closed.
    pub fn add(&mut self, log: String) -> Receiver<DspTelemetry> {
        let (sender, receiver) = sync_channel(QUEUE_SAMPLES);
        self.queues.push(Queue {
            log,
            samples: Some(sender),
            taken: 0,
            dropped: Tally::every(DROP_REPORT_PERIOD),
        });
        receiver
    }

    /// Gives a sample to every log that has room for it. Takes no longer than copying it.
    pub fn record(&mut self, sample: &DspTelemetry) {
        for queue in &mut self.queues {
            // A writer that is not there any more is like one that is too slow.
            let samples = queue.samples.as_ref();
            if samples.is_some_and(|samples| samples.try_send(*sample).is_ok()) {
                queue.taken += 1;
            } else {
                queue.dropped.add(1);
            }
        }
    }

    /// When [`on_time`](Self::on_time) wants to be called next; nothing means not before the next sample.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        let queues = self.queues.iter();
        queues.filter_map(|queue| queue.dropped.deadline()).min()
    }

    /// Tells the drops that are to be told at `now`.
    pub fn on_time(&mut self, now: MonotonicNs) -> Vec<LogEvent> {
        let mut events = Vec::new();
        for queue in &mut self.queues {
            if let Some(lost) = queue.dropped.due(now) {
                events.push(LogEvent::QueueFull {
                    log: queue.log.clone(),
                    lost,
                    lost_in_all: queue.dropped.total(),
                });
            }
        }
        events
    }

    /// Lets the queues end; the writers come to their ends when they have taken what is left.
    pub fn close(&mut self) {
        for queue in &mut self.queues {
            queue.samples = None;
        }
    }

    /// What each queue took. What its writer made of that is not known here.
    pub fn summaries(&self) -> impl Iterator<Item = LogSummary> {
        self.queues.iter().map(|queue| LogSummary {
            log: queue.log.clone(),
            taken: queue.taken,
            dropped: queue.dropped.total(),
            written: None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_samples::sample;

    #[test]
    fn a_full_queue_keeps_the_oldest_and_counts_the_rest() {
        let start = MonotonicNs(1_000_000_000);
        let mut logs = Logs::default();
        let full = logs.add("full".to_owned());
        let emptied = logs.add("emptied".to_owned());
        let told = |logs: &mut Logs, now| {
            let events = logs.on_time(now);
            let told = events.iter().map(|event| match event {
                LogEvent::QueueFull {
                    log,
                    lost,
                    lost_in_all,
                } => format!("{log}: {lost} of {lost_in_all}"),
                other => panic!("{other:?}"),
            });
            told.collect::<Vec<_>>()
        };
        let bound = QUEUE_SAMPLES as u64;
        for sequence in 1..=bound {
            logs.record(&sample(1, sequence));
            assert_eq!(emptied.recv().unwrap().sequence, sequence);
        }
        assert_eq!(logs.deadline(), None);
        logs.record(&sample(1, bound + 1));
        assert_eq!(told(&mut logs, start), ["full: 1 of 1"]);
        for sequence in bound + 2..=bound + 10 {
            logs.record(&sample(1, sequence));
        }
        assert!(told(&mut logs, start).is_empty());
        assert_eq!(logs.deadline(), Some(start + DROP_REPORT_PERIOD));
        let later = start + DROP_REPORT_PERIOD;
        assert_eq!(told(&mut logs, later), ["full: 9 of 10"]);

        // There is room again.
        assert_eq!(full.recv().unwrap().sequence, 1);
        logs.record(&sample(1, 5000));
        logs.close();
        let rest: Vec<_> = full.iter().map(|sample| sample.sequence).collect();
        let expected: Vec<_> = (2..=bound).chain([5000]).collect();
        assert_eq!(rest, expected);
        let counts = |log: LogSummary| (log.taken, log.dropped);
        let counts: Vec<_> = logs.summaries().map(counts).collect();
        assert_eq!(counts, [(bound + 1, 10), (bound + 11, 0)]);
    }

    #[test]
    fn a_writer_that_is_gone_costs_rows_and_nothing_else() {
        let mut logs = Logs::default();
        drop(logs.add("gone".to_owned()));
        logs.record(&sample(1, 1));
        logs.close();
        logs.record(&sample(1, 2));
        let summary = logs.summaries().next().unwrap();
        assert_eq!((summary.taken, summary.dropped), (0, 2));
    }
}
