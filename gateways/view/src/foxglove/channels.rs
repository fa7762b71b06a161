//! [`Channels`]: what can be subscribed to, under numbers that stay the same as long as topic and layout do.
//!
//! Clients keep what they made of a schema by the number of its channel, so a number never means another one.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::id::ChannelId;

/// Most channels that were ever offered, of 32 robots with 30 topics each and as many again. Further ones are not offered.
pub const MAX_CHANNELS: usize = 2048;

/// A topic and its layout.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Channel {
    /// As in recordings.
    pub topic: String,
    /// Of the samples, such as `cdr`.
    pub encoding: String,
    /// Name of the layout.
    pub schema_name: String,
    /// Of the layout, such as `ros2msg`.
    pub schema_encoding: String,
    /// The layout.
    pub schema: Arc<str>,
}

/// A sample of a channel.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sample {
    pub channel: ChannelId,
    pub log_time_unix_ns: u64,
    pub bytes: Arc<[u8]>,
    /// Whether it is a line of a log, of which none is replaced by a newer one.
    pub is_line: bool,
}

/// A channel that is offered now.
#[derive(Debug)]
pub(crate) struct Offered {
    pub channel: Channel,
    /// The newest sample, for later subscribers; `None` if there was none.
    pub latest: Option<Sample>,
}

/// See the module's documentation.
#[derive(Debug, Default)]
pub(crate) struct Channels {
    ids: BTreeMap<Channel, ChannelId>,
    offered: BTreeMap<ChannelId, Offered>,
    /// Grows when what is offered changes.
    version: u64,
}

impl Channels {
    /// Offers a channel; `None` if there are too many. One that is offered already stays as it is.
    pub fn offer(&mut self, channel: Channel) -> Option<ChannelId> {
        let next = ChannelId(u32::try_from(self.ids.len()).ok()? + 1);
        let id = match self.ids.get(&channel) {
            Some(id) => *id,
            None if self.ids.len() >= MAX_CHANNELS => return None,
            None => next,
        };
        if !self.offered.contains_key(&id) {
            self.ids.insert(channel.clone(), id);
            self.offered.insert(
                id,
                Offered {
                    channel,
                    latest: None,
                },
            );
            self.version += 1;
        }
        Some(id)
    }

    /// Offers a channel no more.
    pub fn withdraw(&mut self, id: ChannelId) {
        if self.offered.remove(&id).is_some() {
            self.version += 1;
        }
    }

    /// Keeps the newest sample. False if the channel is not offered.
    pub fn keep(&mut self, sample: &Sample) -> bool {
        let offered = self.offered.get_mut(&sample.channel);
        let is_offered = offered.is_some();
        if let Some(offered) = offered {
            offered.latest = Some(sample.clone());
        }
        is_offered
    }

    /// Keeps no sample of a channel any more.
    pub fn forget(&mut self, id: ChannelId) {
        if let Some(offered) = self.offered.get_mut(&id) {
            offered.latest = None;
        }
    }

    /// A channel that is offered.
    pub fn get(&self, id: ChannelId) -> Option<&Offered> {
        self.offered.get(&id)
    }

    /// All that are offered.
    pub fn iter(&self) -> impl Iterator<Item = (ChannelId, &Channel)> {
        self.offered
            .iter()
            .map(|(id, offered)| (*id, &offered.channel))
    }

    /// Another one when what is offered has changed.
    pub fn version(&self) -> u64 {
        self.version
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channel(topic: &str, schema: &str) -> Channel {
        Channel {
            topic: topic.into(),
            encoding: "cdr".into(),
            schema_name: "pkg/msg/Type".into(),
            schema_encoding: "ros2msg".into(),
            schema: Arc::from(schema),
        }
    }

    #[test]
    fn a_number_returns_only_with_the_same_topic_and_layout() {
        let mut channels = Channels::default();
        let first = channels.offer(channel("/a", "uint8 x")).unwrap();
        let version = channels.version();
        assert_eq!(channels.offer(channel("/a", "uint8 x")), Some(first));
        assert_eq!(channels.version(), version);
        channels.withdraw(first);
        let other = channels.offer(channel("/a", "uint16 x")).unwrap();
        assert_ne!(other, first);
        assert_eq!(channels.offer(channel("/a", "uint8 x")), Some(first));
        assert_ne!(channels.version(), version);
        channels.withdraw(ChannelId(99));
        assert_eq!(channels.iter().count(), 2);
    }

    #[test]
    fn there_is_a_bound_of_all_that_ever_were() {
        let mut channels = Channels::default();
        for index in 0..MAX_CHANNELS {
            let id = channels.offer(channel(&index.to_string(), "")).unwrap();
            channels.withdraw(id);
        }
        assert_eq!(channels.offer(channel("more", "")), None);
        assert!(channels.offer(channel("0", "")).is_some());
    }
}
