//! [`MessageQueue`]: messages that wait for the disk, and the count of those that found no room.

use std::collections::{BTreeMap, VecDeque};

use ipc_types::MonotonicNs;

use crate::settings::ChannelId;

/// What an entry takes beside its message, bytes.
const OVERHEAD: usize = 64;

/// Room for events beyond the bound for messages, bytes: a loss of each channel.
const EVENT_RESERVE: usize = 2 << 20;

/// A message that waits.
#[derive(Debug)]
pub(crate) struct QueuedMessage {
    pub(crate) channel: ChannelId,
    /// The time in the message: not later than its arrival, whatever it says itself.
    pub(crate) at: MonotonicNs,
    pub(crate) added: MonotonicNs,
    pub(crate) sequence: u32,
    pub(crate) data: Vec<u8>,
    pub(crate) is_event: bool,
}

impl QueuedMessage {
    fn bytes(&self) -> usize {
        self.data.len() + OVERHEAD
    }
}

/// Messages of a channel that were dropped since the last event that says so.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Loss {
    pub(crate) count: u64,
    pub(crate) first: MonotonicNs,
    pub(crate) last: MonotonicNs,
}

/// The one bound of a recorder. When it is reached, new messages are dropped and counted until a quarter is free, so
/// that losses come in few long gaps.
#[derive(Debug)]
pub(crate) struct MessageQueue {
    entries: VecDeque<QueuedMessage>,
    bytes: usize,
    messages: u64,
    limit: usize,
    is_full: bool,
    losses: BTreeMap<ChannelId, Loss>,
    dropped: u64,
    /// Entries at the front that were given to the disk.
    in_flight: usize,
}

impl MessageQueue {
    pub(crate) fn new(limit: usize) -> MessageQueue {
        MessageQueue {
            entries: VecDeque::new(),
            bytes: 0,
            messages: 0,
            limit,
            is_full: false,
            losses: BTreeMap::new(),
            dropped: 0,
            in_flight: 0,
        }
    }

    /// Appends a message or an event, or drops it.
    pub(crate) fn push(&mut self, entry: QueuedMessage) {
        let reserve = if entry.is_event { EVENT_RESERVE } else { 0 };
        let fits = self.bytes + entry.bytes() <= self.limit.saturating_add(reserve);
        if !fits || (self.is_full && !entry.is_event) {
            return self.lose(&entry);
        }
        self.bytes += entry.bytes();
        self.messages += u64::from(!entry.is_event);
        self.entries.push_back(entry);
    }

    fn lose(&mut self, entry: &QueuedMessage) {
        self.is_full |= !entry.is_event;
        self.dropped += u64::from(!entry.is_event);
        let loss = self.losses.entry(entry.channel).or_insert(Loss {
            count: 0,
            first: entry.at,
            last: entry.at,
        });
        loss.count += 1;
        loss.last = entry.at;
    }

    /// Whether losses are to be reported now: messages have room again.
    pub(crate) fn has_room_again(&self) -> bool {
        !self.losses.is_empty() && self.bytes <= self.limit / 4 * 3
    }

    /// The losses since the last call; messages are taken again.
    pub(crate) fn take_losses(&mut self) -> BTreeMap<ChannelId, Loss> {
        self.is_full = false;
        std::mem::take(&mut self.losses)
    }

    /// Entries, those included that were given to the disk.
    pub(crate) fn len(&self) -> usize {
        self.entries.len()
    }

    /// Messages that wait, events not counted.
    pub(crate) fn messages(&self) -> u64 {
        self.messages
    }

    /// Messages that were dropped.
    pub(crate) fn dropped(&self) -> u64 {
        self.dropped
    }

    /// When the oldest entry came that the disk was not given yet.
    pub(crate) fn oldest(&self) -> Option<MonotonicNs> {
        self.entries.get(self.in_flight).map(|entry| entry.added)
    }

    /// Whether as many bytes wait.
    pub(crate) fn has_bytes(&self, bytes: usize) -> bool {
        self.bytes >= bytes
    }

    /// Gives the oldest entries to the disk: at least one, then up to `max_bytes`, and at most `max_entries`.
    pub(crate) fn give(
        &mut self,
        max_bytes: usize,
        max_entries: usize,
    ) -> impl Iterator<Item = &QueuedMessage> {
        let mut bytes = 0;
        let fitting = self.entries.iter().take(max_entries).take_while(|entry| {
            let is_first = bytes == 0;
            bytes += entry.bytes();
            is_first || bytes <= max_bytes
        });
        self.in_flight = fitting.count();
        self.entries.iter().take(self.in_flight)
    }

    /// The disk has what it was given; gives how many entries, and how many of them are messages.
    pub(crate) fn taken(&mut self) -> (usize, u64) {
        let count = std::mem::take(&mut self.in_flight);
        let mut messages = 0;
        for entry in self.entries.drain(..count) {
            self.bytes -= entry.bytes();
            messages += u64::from(!entry.is_event);
        }
        self.messages -= messages;
        (count, messages)
    }

    /// The disk did not take what it was given.
    pub(crate) fn take_back(&mut self) {
        self.in_flight = 0;
    }

    /// Drops all that waits.
    pub(crate) fn clear(&mut self) {
        self.dropped += self.messages;
        *self = MessageQueue {
            dropped: self.dropped,
            ..MessageQueue::new(self.limit)
        };
    }
}
