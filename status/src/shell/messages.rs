//! What happened, in words for the operator.

use crate::core::Event;
use crate::log::event::LogEvent;

/// Logs what happened to the process.
pub fn log(event: &Event) {
    match event {
        Event::InputStarted => tracing::info!("telemetry arrives"),
        Event::InputSilent => {
            tracing::warn!("no telemetry: is the bridge running, and does the DSP talk?");
        }
        Event::PublisherRestarted => tracing::info!("telemetry comes from another bridge now"),
        Event::SamplesLost { lost, total } => {
            tracing::warn!(lost, total, "samples were lost on the way to this process");
        }
        Event::GroupsImplausible { groups } => tracing::warn!(
            %groups,
            "implausible values were published: these groups are left out; is another program publishing in the bridge's place?"
        ),
        Event::OutputFailed { reason } => tracing::error!(reason, "telemetry cannot be published"),
        Event::Log(event) => log_event(event),
    }
}

/// Logs what happened to a log.
pub fn log_event(event: &LogEvent) {
    match event {
        LogEvent::Opened { file, groups } => {
            tracing::info!(file = %file.display(), %groups, "log opened");
        }
        LogEvent::Removed { file, bytes } => {
            tracing::info!(file = %file.display(), bytes, "old log removed to make room (max_total_mib)");
        }
        LogEvent::PartialRowTruncated { file, bytes } => tracing::info!(
            file = %file.display(),
            bytes,
            "the last run ended in the middle of a row: the partial row was truncated"
        ),
        LogEvent::GroupsMissing { log, groups } => tracing::warn!(
            log,
            %groups,
            "the log asks for groups that are not valid; their cells stay empty (see the bridge's status mask)"
        ),
        LogEvent::Failed { file, error } => tracing::warn!(
            file = %file.display(),
            %error,
            "the log cannot be written, telemetry goes on: make room, give permission, or name another folder by `directory` of status.toml; the \
             log retries"
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
        LogEvent::Resumed { log } => tracing::info!(log, "the log is written again"),
        LogEvent::RowsLost { log, lost, total } => tracing::warn!(
            log,
            lost,
            total,
            "rows are lost: the log's queue is full because the disk is slow or the log cannot be written"
        ),
        LogEvent::ThreadFailed { log } => tracing::error!(
            log,
            "the log's thread failed: nothing is logged until status is restarted; telemetry goes on"
        ),
    }
}
