//! Between the telemetry and the thread of a log: one bounded queue, and the count of what it refused.

use std::convert::Infallible;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::payload::DspTelemetry;

use super::event::{LogEvent, LogSummary, WriterEnd};
use crate::rate_limited::RateLimitedCounter;

/// Samples that wait for a log: 20 s at 50 samples a second. That is longer than a memory card takes to tidy itself up,
/// and longer than four attempts to write. 1024 × 248 bytes are a quarter of a megabyte. Beyond it the newest samples
/// are refused and counted, so that the log is complete up to the gap.
pub const QUEUE_SAMPLES: usize = 1024;

/// How often losses are reported while they go on.
pub const LOSS_REPORT_PERIOD: Duration = Duration::from_secs(60);

/// All logs of the process, as the telemetry sees them; by default none.
#[derive(Default)]
pub struct Logs {
    queues: Vec<Queue>,
}

struct Queue {
    log: String,
    /// Gone when the logs are closed.
    writer: Option<QueueWriter>,
    offered: u64,
    refused: RateLimitedCounter,
    thread: LogThread,
}

struct QueueWriter {
    samples: SyncSender<DspTelemetry>,
    /// Never used to send: dropping it wakes a writer that takes no samples.
    _closing: SyncSender<Infallible>,
}

#[derive(PartialEq, Eq)]
enum LogThread {
    Running,
    Failed,
    FailureReported,
}

/// Where the samples of a log come out.
pub struct QueueReader {
    samples: Receiver<DspTelemetry>,
    closing: Receiver<Infallible>,
}

impl QueueReader {
    /// Waits for the next sample, or only for the end if the caller no longer `takes_samples`; for at most `timeout`.
    ///
    /// # Errors
    /// `Timeout`: the time has passed. `Disconnected`: the logs were closed; what is left is
    /// [`waiting`](Self::waiting).
    pub fn wait(
        &self,
        takes_samples: bool,
        timeout: Option<Duration>,
    ) -> Result<DspTelemetry, RecvTimeoutError> {
        if takes_samples {
            receive(&self.samples, timeout)
        } else {
            receive(&self.closing, timeout).map(|never| match never {})
        }
    }

    /// The samples that wait.
    pub fn waiting(&self) -> impl Iterator<Item = DspTelemetry> {
        self.samples.try_iter()
    }
}

fn receive<T>(from: &Receiver<T>, timeout: Option<Duration>) -> Result<T, RecvTimeoutError> {
    match timeout {
        Some(timeout) => from.recv_timeout(timeout),
        None => from.recv().map_err(|_| RecvTimeoutError::Disconnected),
    }
}

impl Logs {
    /// Adds the queue of a log; gives the end where the samples come out.
    pub fn add(&mut self, log: String) -> QueueReader {
        let (sample_inlet, samples) = sync_channel(QUEUE_SAMPLES);
        let (closing_inlet, closing) = sync_channel(0);
        self.queues.push(Queue {
            log,
            writer: Some(QueueWriter {
                samples: sample_inlet,
                _closing: closing_inlet,
            }),
            offered: 0,
            refused: RateLimitedCounter::every(LOSS_REPORT_PERIOD),
            thread: LogThread::Running,
        });
        QueueReader { samples, closing }
    }

    /// Offers a sample to every log. Takes no longer than copying it.
    pub fn record(&mut self, sample: &DspTelemetry) {
        for queue in &mut self.queues {
            queue.offer(sample);
        }
    }

    /// When [`on_time`](Self::on_time) wants to be called next; nothing means not before the next sample.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        let queues = self.queues.iter();
        queues.filter_map(|queue| queue.refused.deadline()).min()
    }

    /// What is to be reported at `now`.
    pub fn on_time(&mut self, now: MonotonicNs) -> Vec<LogEvent> {
        let mut events = Vec::new();
        for queue in &mut self.queues {
            let log = &queue.log;
            if queue.thread == LogThread::Failed {
                queue.thread = LogThread::FailureReported;
                events.push(LogEvent::ThreadFailed { log: log.clone() });
            }
            if let Some(lost) = queue.refused.due(now) {
                events.push(LogEvent::RowsLost {
                    log: log.clone(),
                    lost,
                    total: queue.refused.total(),
                });
            }
        }
        events
    }

    /// Lets the queues end; each writer finishes with the samples that are left.
    pub fn close(&mut self) {
        for queue in &mut self.queues {
            queue.writer = None;
        }
    }

    /// The counts of each log. How its writer ended is not known here: it counts as not ended yet.
    pub fn summaries(&self) -> impl Iterator<Item = LogSummary> {
        self.queues.iter().map(|queue| LogSummary {
            log: queue.log.clone(),
            offered: queue.offered,
            refused: queue.refused.total(),
            end: WriterEnd::DiskHangs,
        })
    }
}

impl Queue {
    fn offer(&mut self, sample: &DspTelemetry) {
        let Some(writer) = &self.writer else {
            return;
        };
        self.offered += 1;
        let Err(error) = writer.samples.try_send(*sample) else {
            return;
        };
        self.refused.add(1);
        if matches!(error, TrySendError::Disconnected(_)) && self.thread == LogThread::Running {
            self.thread = LogThread::Failed;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_samples::sample;

    fn reported(logs: &mut Logs, now: MonotonicNs) -> Vec<String> {
        let words = |event: &LogEvent| match event {
            LogEvent::RowsLost { log, lost, total } => format!("{log}: {lost} of {total}"),
            LogEvent::ThreadFailed { log } => format!("{log}: thread failed"),
            other => panic!("{other:?}"),
        };
        logs.on_time(now).iter().map(words).collect()
    }

    fn next(reader: &QueueReader) -> u64 {
        reader.wait(true, None).unwrap().sequence
    }

    #[test]
    fn a_full_queue_keeps_the_oldest_and_counts_the_rest() {
        let start = MonotonicNs(1_000_000_000);
        let mut logs = Logs::default();
        let full = logs.add("full".to_owned());
        let emptied = logs.add("emptied".to_owned());
        let bound = QUEUE_SAMPLES as u64;
        for sequence in 1..=bound {
            logs.record(&sample(1, sequence));
            assert_eq!(next(&emptied), sequence);
        }
        assert_eq!(logs.deadline(), None);
        logs.record(&sample(1, bound + 1));
        assert_eq!(reported(&mut logs, start), ["full: 1 of 1"]);
        for sequence in bound + 2..=bound + 10 {
            logs.record(&sample(1, sequence));
        }
        assert!(reported(&mut logs, start).is_empty());
        assert_eq!(logs.deadline(), Some(start + LOSS_REPORT_PERIOD));
        let later = start + LOSS_REPORT_PERIOD;
        assert_eq!(reported(&mut logs, later), ["full: 9 of 10"]);

        // There is room again.
        assert_eq!(next(&full), 1);
        logs.record(&sample(1, 5000));
        logs.close();
        let rest: Vec<_> = full.waiting().map(|sample| sample.sequence).collect();
        let expected: Vec<_> = (2..=bound).chain([5000]).collect();
        assert_eq!(rest, expected);
        let counts = |log: LogSummary| (log.offered, log.refused);
        let counts: Vec<_> = logs.summaries().map(counts).collect();
        assert_eq!(counts, [(bound + 11, 10), (bound + 11, 0)]);
    }

    #[test]
    fn the_end_wakes_a_writer_whether_it_takes_samples_or_not() {
        for takes_samples in [true, false] {
            let mut logs = Logs::default();
            let reader = logs.add("log".to_owned());
            let at_once = reader.wait(takes_samples, Some(Duration::ZERO));
            assert_eq!(at_once.unwrap_err(), RecvTimeoutError::Timeout);
            logs.close();
            let closed = reader.wait(takes_samples, None);
            assert_eq!(closed.unwrap_err(), RecvTimeoutError::Disconnected);
        }
    }

    #[test]
    fn a_thread_that_is_gone_is_reported_once_as_such_and_costs_only_rows() {
        let mut logs = Logs::default();
        drop(logs.add("gone".to_owned()));
        logs.record(&sample(1, 1));
        let now = MonotonicNs(1);
        assert_eq!(
            reported(&mut logs, now),
            ["gone: thread failed", "gone: 1 of 1"]
        );
        logs.record(&sample(1, 2));
        assert!(reported(&mut logs, now).is_empty());
        let summary = logs.summaries().next().unwrap();
        assert_eq!((summary.offered, summary.refused), (2, 2));
    }
}
