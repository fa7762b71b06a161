//! What is due when, and the steps that it takes.

use ipc_types::MonotonicNs;

use super::{FileStep, Files, Goal, OpenFile, Then};
use crate::action::FileAction;
use crate::encoder::Encoder;
use crate::notes::file_metadata;

/// Bytes of messages that are written at once, without the last one.
const CHUNK_BYTES: usize = 1 << 20;

/// Chunks of a file, after which another one is begun: 7 h at five chunks a second. The index of a file's chunks stays
/// in memory until the file is finished.
const MAX_CHUNKS: u32 = 1 << 17;

impl Files {
    /// When the oldest messages are to be written.
    pub(super) fn flush_at(&self) -> Option<MonotonicNs> {
        let oldest = self.inbox.queue.oldest()?;
        Some(if self.inbox.queue.has_bytes(CHUNK_BYTES) {
            oldest
        } else {
            oldest + self.settings.flush
        })
    }

    /// When what was written is to be forced onto the disk.
    pub(super) fn sync_at(&self) -> Option<MonotonicNs> {
        let since = self.file.as_ref().and_then(|file| file.unsynced_since)?;
        Some(since + self.settings.sync)
    }

    /// When the file is to be followed by another one.
    pub(super) fn split_at(&self) -> Option<MonotonicNs> {
        let file = self.file.as_ref()?;
        if self.goal != Goal::Record || !file.is_created {
            return None;
        }
        let chunks = file.encoder.as_ref().map_or(0, Encoder::chunks);
        let is_long = self
            .settings
            .split_bytes
            .is_some_and(|bytes| file.len >= bytes);
        if (is_long && file.messages > 0) || chunks >= MAX_CHUNKS {
            return Some(self.now);
        }
        self.settings.split_duration.map(|span| file.begun + span)
    }

    /// Decides what is to be done next.
    pub(super) fn plan(&mut self) {
        if self.file.is_none() {
            return self.plan_file();
        }
        let max_entries = match self.goal {
            Goal::Split(left) => left,
            _ => usize::MAX,
        };
        let is_finishing = matches!(self.goal, Goal::Split(_) | Goal::End);
        let is_due = self.flush_at().is_some_and(|at| at <= self.now) || is_finishing;
        if !is_finishing && self.sync_at().is_some_and(|at| at <= self.now) {
            self.then(FileAction::Sync, Then::Synced);
        } else if is_due && max_entries > 0 && self.inbox.queue.len() > 0 {
            self.plan_chunk(max_entries);
        } else if is_finishing {
            self.plan_finish();
        }
    }

    pub(super) fn then(&mut self, action: FileAction, then: Then) {
        self.steps.push_back(FileStep { action, then });
    }

    fn plan_file(&mut self) {
        let index = self.next_index;
        let mut info = self.info.clone();
        let of_file = file_metadata(info.robot, index, self.anchor);
        info.metadata.push(of_file);
        let channels = self.inbox.channels.all();
        match Encoder::begin(self.anchor, self.begun, info, channels) {
            Ok((encoder, parts)) => {
                let len = encoder.len();
                self.file = Some(OpenFile::new(encoder, index, self.now));
                self.then(FileAction::Open { index }, Then::Created);
                self.then(FileAction::Write { parts }, Then::Written(len));
            }
            Err(error) => self.give_up(&error.to_string()),
        }
    }

    fn plan_chunk(&mut self, max_entries: usize) {
        let file = self.file.as_mut().and_then(|file| file.encoder.as_mut());
        let Some(encoder) = file else { return };
        let entries = self.inbox.queue.give(CHUNK_BYTES, max_entries);
        let unix_ns = self.anchor.unix_ns_of(self.now);
        let described = encoder.describe(&self.info, unix_ns);
        match described.and_then(|()| encoder.chunk(self.inbox.channels.all(), entries)) {
            Ok(parts) => {
                let len = encoder.len();
                self.then(FileAction::Write { parts }, Then::Written(len));
            }
            Err(error) => self.give_up(&error.to_string()),
        }
    }

    fn plan_finish(&mut self) {
        let Some(file) = &mut self.file else { return };
        let Some(encoder) = file.encoder.take() else {
            return;
        };
        let messages = file.messages;
        let is_whole = true;
        match encoder.finish() {
            Ok((len, parts)) => {
                self.then(FileAction::Write { parts }, Then::Written(len));
                self.then(FileAction::Truncate { len }, Then::Written(len));
                self.then(FileAction::Sync, Then::Synced);
                self.then(FileAction::Close { is_whole, messages }, Then::Closed);
            }
            Err(error) => self.give_up(&error.to_string()),
        }
    }
}
