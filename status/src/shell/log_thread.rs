//! The threads of the logs: each sleeps until there is a sample, or until its [`LogWriter`] has something to do, and
//! may wait for its disk as long as that takes. They decide nothing and share nothing: a queue leads in, and how the
//! writer ended comes out.

use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread;
use std::time::Duration;

use ipc_types::{MonotonicNs, RobotId};

use super::messages;
use crate::log::Logs;
use crate::log::config::LogConfig;
use crate::log::event::{LogSummary, WriterEnd, Written};
use crate::log::file_name::Series;
use crate::log::queue::QueueReader;
use crate::log::store::Store;
use crate::log::writer::LogWriter;

/// How long the end of the process waits for disks. Most of what a disk does takes less; what takes longer may hang for
/// ever, and a process that cannot be ended is worse than an unknown number of rows.
pub const END_TIMEOUT: Duration = Duration::from_secs(2);

/// The threads of all logs, in their order.
pub struct LogThreads {
    /// Where each thread reports its end.
    pub(super) ends: Vec<Receiver<Written>>,
}

impl LogThreads {
    /// Starts a thread for each log of `configs` that has groups; `store` gives each its access to files.
    ///
    /// A thread that cannot be started is logged, and counts as a thread that failed: telemetry matters more.
    pub fn start<S>(
        configs: &[LogConfig],
        robot: RobotId,
        mut store: impl FnMut() -> S,
    ) -> (Logs, LogThreads)
    where
        S: Store + Send + 'static,
        S::File: Send,
    {
        let mut logs = Logs::default();
        let mut ends = Vec::new();
        for config in configs.iter().filter(|config| !config.groups.is_empty()) {
            let label = Series::new(robot, config).label(&config.directory);
            let samples = logs.add(label.clone());
            let writer = LogWriter::new(config, config.limits(), robot, store());
            // Room for the one message, so that the thread ends even if the process no longer waits for it.
            let (end, ended) = sync_channel(1);
            ends.push(ended);
            let body = move || run(writer, &samples, &end, MonotonicNs::now);
            let name = format!("log {}", config.name);
            if let Err(error) = thread::Builder::new().name(name).spawn(body) {
                tracing::error!(log = label, %error, "the log cannot have a thread: nothing is logged");
            }
        }
        (logs, LogThreads { ends })
    }

    /// Fills in how the writers ended, as far as it is known within `timeout`. The logs must have been closed.
    pub fn end(self, summaries: &mut [LogSummary], timeout: Duration) {
        let end = MonotonicNs::now() + timeout;
        for (summary, ended) in summaries.iter_mut().zip(self.ends) {
            let left = end.since(MonotonicNs::now());
            summary.end = match ended.recv_timeout(left) {
                Ok(written) => WriterEnd::Finished(written),
                Err(RecvTimeoutError::Timeout) => WriterEnd::DiskHangs,
                // It is gone without a word: it panicked.
                Err(RecvTimeoutError::Disconnected) => WriterEnd::ThreadFailed,
            };
        }
    }
}

/// What a thread does until the logs are closed.
fn run<S: Store>(
    mut writer: LogWriter<S>,
    samples: &QueueReader,
    end: &SyncSender<Written>,
    mut clock: impl FnMut() -> MonotonicNs,
) {
    writer.start(clock());
    loop {
        log_events(&mut writer);
        let deadline = writer.deadline();
        let timeout = deadline.map(|deadline| deadline.since(clock()));
        match samples.wait(writer.takes_samples(), timeout) {
            Ok(sample) => writer.record(&sample, clock()),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
        writer.on_time(clock());
    }
    let written = writer.finish(samples.waiting(), clock());
    log_events(&mut writer);
    // The process may have ended its wait.
    let _ = end.send(written);
}

fn log_events<S: Store>(writer: &mut LogWriter<S>) {
    for event in writer.take_events() {
        messages::log_event(&event);
    }
}
