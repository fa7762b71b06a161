//! [`Inbox`]: what comes in to be recorded, and the events that say what was lost of it.

use std::collections::HashMap;

use ipc_types::{MonotonicNs, RobotId};

use crate::event::Event;
use crate::event_message;
use crate::notes::loss_event;
use crate::queue::{MessageQueue, QueuedMessage};
use crate::settings::{Channel, ChannelId};

/// The channel of the recording's own events is the first one.
const EVENTS: ChannelId = ChannelId(0);

/// Channels, and messages that wait.
#[derive(Debug)]
pub(crate) struct Inbox {
    pub(crate) channels: RecordingChannels,
    pub(crate) queue: MessageQueue,
    event_sequence: u32,
}

impl Inbox {
    pub(crate) fn new(robot: RobotId, queue_bytes: usize) -> Inbox {
        let mut channels = RecordingChannels::default();
        // The first one, so there is room.
        let _ = channels.add(event_message::channel(robot));
        Inbox {
            channels,
            queue: MessageQueue::new(queue_bytes),
            event_sequence: 0,
        }
    }

    pub(crate) fn message(
        &mut self,
        now: MonotonicNs,
        channel: ChannelId,
        at: MonotonicNs,
        sequence: u32,
        cdr: &[u8],
    ) {
        self.queue.push(QueuedMessage {
            channel,
            at: at.min(now),
            added: now,
            sequence,
            data: cdr.to_vec(),
            is_event: false,
        });
        self.report_losses(now);
    }

    pub(crate) fn event(&mut self, now: MonotonicNs, event: &Event) {
        self.event_sequence = self.event_sequence.wrapping_add(1);
        self.queue.push(QueuedMessage {
            channel: EVENTS,
            at: event.at.min(now),
            added: now,
            sequence: self.event_sequence,
            data: event_message::write(event),
            is_event: true,
        });
    }

    /// Events about losses, if there is room again.
    pub(crate) fn report_losses(&mut self, now: MonotonicNs) {
        if self.queue.has_room_again() {
            self.add_loss_events(now);
        }
    }

    /// Events about losses, at once.
    pub(crate) fn add_loss_events(&mut self, now: MonotonicNs) {
        for (channel, loss) in self.queue.take_losses() {
            let event = loss_event(now, self.channels.topic(channel), loss);
            self.event(now, &event);
        }
    }
}

/// Channels of a recording, its own events included. A robot has some twenty topics.
pub const MAX_CHANNELS: usize = 4096;

/// The channels of a recording.
#[derive(Debug, Default)]
pub(crate) struct RecordingChannels {
    list: Vec<Channel>,
    ids: HashMap<Channel, ChannelId>,
}

impl RecordingChannels {
    /// The id of a channel; the same one when it is known already, `None` if there are [`MAX_CHANNELS`].
    pub(crate) fn add(&mut self, channel: Channel) -> Option<ChannelId> {
        if let Some(known) = self.ids.get(&channel) {
            return Some(*known);
        }
        if self.list.len() >= MAX_CHANNELS {
            return None;
        }
        let id = ChannelId(self.list.len() as u16);
        self.list.push(channel.clone());
        self.ids.insert(channel, id);
        Some(id)
    }

    /// All of them; an id is the place in it.
    pub(crate) fn all(&self) -> &[Channel] {
        &self.list
    }

    /// The topic of a channel.
    pub(crate) fn topic(&self, id: ChannelId) -> &str {
        let channel = self.list.get(usize::from(id.0));
        channel.map_or("", |channel| &channel.topic)
    }
}
