//! The channels of a recording, in the order in which they were announced.

use std::collections::HashMap;

use crate::settings::{Channel, ChannelId};

/// Channels of a recording, its own events included. A robot has some twenty topics.
pub const MAX_CHANNELS: usize = 4096;

/// The channels of a recording.
#[derive(Debug, Default)]
pub(crate) struct Channels {
    list: Vec<Channel>,
    ids: HashMap<Channel, ChannelId>,
}

impl Channels {
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
