//! The threads of the logs: each sleeps until there is a sample, or until its [`LogWriter`] wants to do something, and
//! may wait for its disk as long as that takes. They decide nothing and share nothing: a queue leads in, and what
//! became of the rows comes out at the end.

use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread;
use std::time::Duration;

use ipc_types::payload::DspTelemetry;
use ipc_types::{MonotonicNs, RobotId};

use crate::config::LogConfig;
use crate::log::store::Store;
use crate::log::{LogEvent, LogSummary, LogWriter, Logs, Written, label};

/// How long the end of the process waits for disks. Most of what a disk does takes less; what takes longer may hang for
/// ever, and a process that cannot be ended is worse than an unknown number of rows.
pub const END_PATIENCE: Duration = Duration::from_secs(5);

/// The threads of all logs, in their order.
pub struct LogThreads {
    /// Where each thread says what became of its rows when it ends.
    pub(super) ends: Vec<Receiver<Written>>,
}

impl LogThreads {
    /// Starts a thread for each log of `configs` that has groups; `store` gives each its access to files.
    ///
    /// A thread that cannot be started is told, and counts as a log that loses everything: telemetry matters more.
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
            let label = label(config, robot);
            let samples = logs.add(label.clone());
            let writer = LogWriter::new(config, config.limits(), robot, store());
            // Room for the one word at the end, so that nobody has to be there to hear it.
            let (end, ended) = sync_channel(1);
            ends.push(ended);
            let body = move || work(writer, &samples, &end, MonotonicNs::now);
            let name = format!("log {}", config.name);
            if let Err(error) = thread::Builder::new().name(name).spawn(body) {
                tracing::error!(log = label, %error, "the log cannot have a thread: nothing is logged");
            }
        }
        (logs, LogThreads { ends })
    }

    /// Fills in what became of the rows, as far as it is known in `patience`. The logs must have been closed.
    pub fn end(self, summaries: &mut [LogSummary], patience: Duration) {
        let end = MonotonicNs::now() + patience;
        for (summary, ended) in summaries.iter_mut().zip(self.ends) {
            let left = end.since(MonotonicNs::now());
            summary.written = ended.recv_timeout(left).ok();
        }
    }
}

/// What a thread does until the end of `samples`.
fn work<S: Store>(
    mut writer: LogWriter<S>,
    samples: &Receiver<DspTelemetry>,
    end: &SyncSender<Written>,
    mut clock: impl FnMut() -> MonotonicNs,
) {
    writer.start(clock());
    loop {
        tell(&mut writer);
        let sample = match writer.deadline() {
            Some(deadline) => samples.recv_timeout(deadline.since(clock())),
            None => samples.recv().map_err(|_| RecvTimeoutError::Disconnected),
        };
        match sample {
            Ok(sample) => writer.record(&sample, clock()),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
        writer.on_time(clock());
    }
    let written = writer.finish(clock());
    tell(&mut writer);
    // Whoever has gone does not want to know.
    let _ = end.send(written);
}

fn tell<S: Store>(writer: &mut LogWriter<S>) {
    for event in writer.take_events() {
        tell_event(&event);
    }
}

/// Logs what happened to a log.
pub fn tell_event(event: &LogEvent) {
    match event {
        LogEvent::Opened { file, groups } => {
            tracing::info!(file = %file.display(), %groups, "log opened");
        }
        LogEvent::Removed { file, bytes } => {
            tracing::info!(file = %file.display(), bytes, "old log removed to make room (max_total_mib)");
        }
        LogEvent::Mended { file, bytes } => tracing::info!(
            file = %file.display(),
            bytes,
            "the last run ended in the middle of a row: the piece was cut off"
        ),
        LogEvent::GroupsMissing { log, groups } => tracing::warn!(
            log,
            %groups,
            "the log asks for groups that are not valid; their cells stay empty (see the bridge's status mask)"
        ),
        LogEvent::Failed { file, error } => tracing::warn!(
            file = %file.display(),
            %error,
            "the log cannot be written, telemetry goes on: make room or give permission; it is being tried again"
        ),
        LogEvent::Paused {
            log,
            free_bytes,
            min_free_bytes,
        } => tracing::warn!(
            log,
            free_mib = free_bytes >> 20,
            min_free_mib = min_free_bytes >> 20,
            "the disk is nearly full: the log pauses, telemetry goes on; it resumes when there is room"
        ),
        LogEvent::Resumed { log, lost } => {
            tracing::info!(log, lost, "the log is written again");
        }
        LogEvent::RowsLost {
            log,
            lost,
            lost_in_all,
        } => tracing::warn!(
            log,
            lost,
            lost_in_all,
            "rows are lost while the log cannot be written"
        ),
        LogEvent::QueueFull {
            log,
            lost,
            lost_in_all,
        } => tracing::warn!(
            log,
            lost,
            lost_in_all,
            "rows are lost because the disk does not keep up; telemetry goes on"
        ),
    }
}
