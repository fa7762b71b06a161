//! [`FoxgloveClient`]: one Foxglove client: what it knows of channels and has subscribed to, and what waits for it.

use std::collections::{BTreeMap, VecDeque};

use ipc_types::MonotonicNs;

use super::channels::{KnownOffers, Offers, Sample};
use super::message::{self, ChannelInfo, Outgoing, Subscription};
use super::samples::Samples;
use crate::event::ChannelId;

/// Answers that wait for a client; one for which more wait is closed. It has asked for all of them and reads none.
pub const MAX_ANSWERS: usize = 64;

/// Bytes of these answers.
const MAX_ANSWER_BYTES: usize = 512 << 10;

/// Channels in one message. A schema has 1 to 5 kB.
const ADVERTISED_AT_ONCE: usize = 8;

/// What a client gets to read at most once. These are two fixed texts: clients show each different text for ever.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Notice {
    /// Samples are left out.
    Slow,
    /// It wants to publish, or to set parameters.
    OnlyShows,
}

impl Notice {
    fn message(self) -> Outgoing<'static> {
        let (level, id, message) = match self {
            Notice::Slow => (
                1,
                "slow",
                "This connection is slow: of each topic only the newest samples come.",
            ),
            Notice::OnlyShows => (
                2,
                "only-shows",
                "This server shows: it takes no messages, parameters and orders.",
            ),
        };
        Outgoing::Status { level, message, id }
    }
}

/// What is sent.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum ClientFrame {
    Text(String),
    Binary(Vec<u8>),
}

/// One Foxglove client: what it knows and subscribes to, and what waits for it.
#[derive(Debug, Default)]
pub(crate) struct FoxgloveClient {
    answers: VecDeque<ClientFrame>,
    answer_bytes: usize,
    channels: KnownOffers,
    has_advertised: bool,
    by_subscription: BTreeMap<u32, ChannelId>,
    by_channel: BTreeMap<ChannelId, u32>,
    samples: Samples,
    time_unix_ns: Option<u64>,
    said: Vec<Notice>,
}

impl FoxgloveClient {
    /// Whether more answers wait than may.
    pub fn is_too_slow(&self) -> bool {
        self.answers.len() > MAX_ANSWERS || self.answer_bytes > MAX_ANSWER_BYTES
    }

    /// Puts an answer behind the others.
    pub fn answer(&mut self, frame: ClientFrame) {
        self.answer_bytes += frame.len();
        self.answers.push_back(frame);
    }

    /// Says something, once.
    pub fn notice(&mut self, notice: Notice) {
        if !self.said.contains(&notice) {
            self.said.push(notice);
            self.answer(ClientFrame::Text(notice.message().text()));
        }
    }

    /// Subscribes to a channel, of which `latest` is the newest sample. True if it is new.
    pub fn subscribe(
        &mut self,
        subscription: Subscription,
        channels: &Offers,
        latest: Option<&Sample>,
        now: MonotonicNs,
    ) -> bool {
        let channel = ChannelId(subscription.channel_id);
        let is_taken = self.by_subscription.contains_key(&subscription.id)
            || self.by_channel.contains_key(&channel);
        if is_taken || channels.get(channel.0).is_none() {
            return false;
        }
        self.by_subscription.insert(subscription.id, channel);
        self.by_channel.insert(channel, subscription.id);
        if let Some(latest) = latest {
            self.samples.push(latest.clone(), now);
        }
        true
    }

    /// Gives up a subscription, and says to which channel it was.
    pub fn unsubscribe(&mut self, id: u32) -> Option<ChannelId> {
        let channel = self.by_subscription.remove(&id)?;
        self.by_channel.remove(&channel);
        self.samples.forget(channel);
        Some(channel)
    }

    /// Whether it has subscribed to this channel.
    pub fn follows(&self, channel: ChannelId) -> bool {
        self.by_channel.contains_key(&channel)
    }

    /// All channels to which it has subscribed.
    pub fn followed(&self) -> impl Iterator<Item = ChannelId> {
        self.by_channel.keys().copied()
    }

    /// Takes a sample of a channel to which it has subscribed.
    pub fn sample(&mut self, sample: &Sample, now: MonotonicNs) {
        if self.follows(sample.channel) {
            self.samples.push(sample.clone(), now);
            if self.samples.left_out() > 0 {
                self.notice(Notice::Slow);
            }
        }
    }

    /// Takes the server's time in the place of the one that waits.
    pub fn set_time(&mut self, unix_ns: u64) {
        self.time_unix_ns = Some(unix_ns);
    }

    /// What is sent next: answers, what there is, the time, samples.
    pub fn next(&mut self, channels: &Offers) -> Option<ClientFrame> {
        if let Some(frame) = self.answers.pop_front() {
            self.answer_bytes -= frame.len();
            return Some(frame);
        }
        if let Some(message) = self.tell_channels(channels) {
            return Some(ClientFrame::Text(message));
        }
        if let Some(unix_ns) = self.time_unix_ns.take() {
            return Some(ClientFrame::Binary(message::time(unix_ns)));
        }
        loop {
            let sample = self.samples.next()?;
            if let Some(subscription) = self.by_channel.get(&sample.channel) {
                let bytes =
                    message::message_data(*subscription, sample.log_time_unix_ns, &sample.bytes);
                return Some(ClientFrame::Binary(bytes));
            }
        }
    }

    /// The next channels to advertise, some at a time, so that a slow client makes no list wait in memory.
    fn tell_channels(&mut self, channels: &Offers) -> Option<String> {
        if self.channels.is_current(channels) {
            return None;
        }
        let gone = self.channels.take_gone(channels);
        if !gone.is_empty() {
            for id in &gone {
                if let Some(subscription) = self.by_channel.get(&ChannelId(*id)).copied() {
                    self.unsubscribe(subscription);
                }
            }
            return Some(Outgoing::Unadvertise { channel_ids: gone }.text());
        }
        let new = self.channels.take_new(channels, ADVERTISED_AT_ONCE);
        // A client gets one such message at least, also when there is nothing.
        if new.is_empty() && self.has_advertised {
            return None;
        }
        self.has_advertised = true;
        let channels = new.into_iter().map(|(id, channel)| ChannelInfo {
            id,
            topic: &channel.topic,
            encoding: &channel.encoding,
            schema_name: &channel.schema_name,
            schema: &channel.schema,
            schema_encoding: &channel.schema_encoding,
        });
        Some(
            Outgoing::Advertise {
                channels: channels.collect(),
            }
            .text(),
        )
    }
}

impl ClientFrame {
    fn len(&self) -> usize {
        match self {
            ClientFrame::Text(text) => text.len(),
            ClientFrame::Binary(bytes) => bytes.len(),
        }
    }
}
