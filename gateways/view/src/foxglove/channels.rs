//! [`Offers`]: the channels that are offered, under numbers that stay the same as long as they do; [`KnownOffers`]:
//! what a client knows of them.
//!
//! Clients keep what they made of a schema by the number of its channel, so a number never means another one.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use crate::event::ChannelId;

/// Most channels that were ever offered, of 32 robots with 30 topics each and as many again. Further ones are not
/// offered.
pub const MAX_CHANNELS: usize = 2048;

/// A topic and its layout.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Channel {
    /// Its name in recordings.
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

/// The channels that are offered, under numbers that never mean something else.
#[derive(Debug, Default)]
pub(crate) struct Offers {
    /// The numbers of all that were ever offered, at most [`MAX_CHANNELS`].
    ids: BTreeMap<Channel, u32>,
    offered: BTreeMap<u32, Channel>,
    /// Grows when what is offered changes.
    version: u64,
}

impl Offers {
    /// Offers one, and gives its number; `None` if there are too many. One that is offered already stays as it is.
    pub fn offer(&mut self, one: Channel) -> Option<u32> {
        let next = u32::try_from(self.ids.len()).ok()? + 1;
        let id = match self.ids.get(&one) {
            Some(id) => *id,
            None if self.ids.len() >= MAX_CHANNELS => return None,
            None => next,
        };
        if !self.offered.contains_key(&id) {
            self.ids.insert(one.clone(), id);
            self.offered.insert(id, one);
            self.version += 1;
        }
        Some(id)
    }

    /// Offers one no more.
    pub fn withdraw(&mut self, id: u32) {
        if self.offered.remove(&id).is_some() {
            self.version += 1;
        }
    }

    /// One that is offered.
    pub fn get(&self, id: u32) -> Option<&Channel> {
        self.offered.get(&id)
    }

    /// All that are offered.
    pub fn iter(&self) -> impl Iterator<Item = (u32, &Channel)> {
        self.offered.iter().map(|(id, one)| (*id, one))
    }
}

/// What a client knows of the offers.
#[derive(Debug, Default)]
pub(crate) struct KnownOffers {
    ids: BTreeSet<u32>,
    /// The version of the offers of which all is known; `None` before the first.
    version: Option<u64>,
}

impl KnownOffers {
    /// Whether all is known.
    pub fn is_current(&self, offers: &Offers) -> bool {
        self.version == Some(offers.version)
    }

    /// Takes those that are offered no more.
    pub fn take_gone(&mut self, offers: &Offers) -> Vec<u32> {
        let gone = self.ids.iter().copied();
        let gone: Vec<u32> = gone.filter(|id| offers.get(*id).is_none()).collect();
        self.ids.retain(|id| !gone.contains(id));
        gone
    }

    /// Takes those that are new, `most` at a time.
    pub fn take_new<'a>(&mut self, offers: &'a Offers, most: usize) -> Vec<(u32, &'a Channel)> {
        let new = offers.iter().filter(|(id, _)| !self.ids.contains(id));
        let new: Vec<_> = new.take(most).collect();
        if new.len() < most {
            self.version = Some(offers.version);
        }
        self.ids.extend(new.iter().map(|(id, _)| *id));
        new
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
        let mut channels = Offers::default();
        let first = channels.offer(channel("/a", "uint8 x")).unwrap();
        let version = channels.version;
        assert_eq!(channels.offer(channel("/a", "uint8 x")), Some(first));
        assert_eq!(channels.version, version);
        channels.withdraw(first);
        let other = channels.offer(channel("/a", "uint16 x")).unwrap();
        assert_ne!(other, first);
        assert_eq!(channels.offer(channel("/a", "uint8 x")), Some(first));
        assert_ne!(channels.version, version);
        channels.withdraw(99);
        assert_eq!(channels.iter().count(), 2);
    }

    #[test]
    fn there_is_a_bound_of_all_that_ever_were() {
        let mut channels = Offers::default();
        for index in 0..MAX_CHANNELS {
            let id = channels.offer(channel(&index.to_string(), "")).unwrap();
            channels.withdraw(id);
        }
        assert_eq!(channels.offer(channel("more", "")), None);
        assert!(channels.offer(channel("0", "")).is_some());
    }

    #[test]
    fn a_client_learns_what_is_gone_and_what_is_new() {
        let mut channels = Offers::default();
        let mut known = KnownOffers::default();
        let [a, b] = ["/a", "/b"].map(|topic| channels.offer(channel(topic, "")).unwrap());
        let take_new = |known: &mut KnownOffers, channels: &Offers, most| -> Vec<u32> {
            let new = known.take_new(channels, most).into_iter();
            new.map(|(id, _)| id).collect()
        };
        assert_eq!(take_new(&mut known, &channels, 1), [a]);
        assert!(!known.is_current(&channels));
        assert_eq!(take_new(&mut known, &channels, 9), [b]);
        assert!(known.is_current(&channels));
        channels.withdraw(a);
        let c = channels.offer(channel("/c", "")).unwrap();
        assert!(!known.is_current(&channels));
        assert_eq!(known.take_gone(&channels), [a]);
        assert_eq!(take_new(&mut known, &channels, 9), [c]);
        assert!(known.is_current(&channels));
    }
}
