//! [`OpenFile`]: the file that a recorder is writing.

use ipc_types::MonotonicNs;

use crate::encoder::Encoder;

/// The file that is being written.
#[derive(Debug)]
pub(crate) struct OpenFile {
    /// Gone when the rest of the file was made.
    pub(crate) encoder: Option<Encoder>,
    pub(crate) index: u32,
    /// Whether it was created; before that there is nothing to close.
    pub(crate) is_created: bool,
    /// When it was begun.
    pub(crate) begun: MonotonicNs,
    /// Bytes that the disk has taken as a whole.
    pub(crate) len: u64,
    /// Messages that the disk has taken.
    pub(crate) messages: u64,
    /// Messages of these that were not forced onto the disk yet.
    pub(crate) unsynced: u64,
    /// When the oldest of them was written.
    pub(crate) unsynced_since: Option<MonotonicNs>,
}

impl OpenFile {
    pub(crate) fn new(encoder: Encoder, index: u32, begun: MonotonicNs) -> OpenFile {
        OpenFile {
            encoder: Some(encoder),
            index,
            is_created: false,
            begun,
            len: 0,
            messages: 0,
            unsynced: 0,
            unsynced_since: None,
        }
    }

    /// The disk has taken the file up to `len`, with more `messages`.
    pub(crate) fn written(&mut self, len: u64, messages: u64, now: MonotonicNs) {
        self.len = len;
        self.messages += messages;
        self.unsynced += messages;
        self.unsynced_since.get_or_insert(now);
    }

    /// All that was written was forced onto the disk; gives how many messages.
    pub(crate) fn synced(&mut self) -> u64 {
        self.unsynced_since = None;
        std::mem::take(&mut self.unsynced)
    }
}
