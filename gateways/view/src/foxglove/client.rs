//! [`FoxgloveClient`]: one Foxglove client: what it knows of channels and services, what it has subscribed to, and what
//! waits for it.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use ipc_types::MonotonicNs;

use super::channels::{
    Channel, ENCODING, KnownOffers, OfferedService, Offers, ParameterSubscriptions, Sample,
};
use super::message::{self, ChannelInfo, Outgoing, Subscription};
use super::samples::Samples;
use crate::authority::access::Permit;
use crate::event::{Call, ChannelId, Peer};
use crate::pace::{ORDERS_PER_S, RateLimit};
use crate::page::Role;

/// Answers that wait for a client; one for which more wait is closed. It has asked for all of them and reads none.
pub const MAX_ANSWERS: usize = 64;

/// Bytes of these answers.
const MAX_ANSWER_BYTES: usize = 512 << 10;

/// Calls, and parameters that were set, of a client that wait for the program around the server. Further ones are
/// refused.
pub const MAX_OPEN: usize = 16;

/// Channels in one message. A schema has 1 to 5 kB.
const ADVERTISED_AT_ONCE: usize = 8;

/// What a client gets to read at most once. These are three fixed texts: clients show each different text for ever.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Notice {
    /// Samples are left out.
    Slow,
    /// It may not order.
    ReadOnly,
    /// It wants to publish.
    NoPublishing,
}

impl Notice {
    fn message(self) -> Outgoing<'static> {
        let (level, id, message) = match self {
            Notice::Slow => (
                1,
                "slow",
                "This connection is slow: of each topic only the newest samples come.",
            ),
            Notice::ReadOnly => (
                1,
                "read-only",
                "This connection may only look: services and parameters need a token, and view.toml that allows it.",
            ),
            Notice::NoPublishing => (
                2,
                "no-publishing",
                "This server takes no messages: orders are services.",
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

/// A parameter that a client has set.
#[derive(Debug)]
struct Wanted {
    name: String,
    /// What the answer is called.
    id: Option<String>,
}

/// One Foxglove client: what it knows and subscribes to, and what waits for it.
#[derive(Debug)]
pub(crate) struct FoxgloveClient {
    pub peer: Peer,
    pub permit: Permit,
    pub orders: RateLimit,
    /// Whether it has asked for parameters.
    pub wants_parameters: bool,
    answers: VecDeque<ClientFrame>,
    answer_bytes: usize,
    channels: KnownOffers,
    has_advertised: bool,
    services: KnownOffers,
    by_subscription: BTreeMap<u32, ChannelId>,
    by_channel: BTreeMap<ChannelId, u32>,
    samples: Samples,
    time_unix_ns: Option<u64>,
    said: Vec<Notice>,
    /// Parameters whose changes it gets.
    follows: BTreeSet<String>,
    /// Whether it gets those of parameters that come, too.
    follows_all: bool,
    changed: BTreeSet<String>,
    wanted: Vec<Wanted>,
    calls: BTreeSet<Call>,
}

impl FoxgloveClient {
    pub fn new(peer: Peer, permit: Permit) -> FoxgloveClient {
        FoxgloveClient {
            peer,
            permit,
            orders: RateLimit::new(ORDERS_PER_S),
            wants_parameters: false,
            answers: VecDeque::new(),
            answer_bytes: 0,
            channels: KnownOffers::default(),
            has_advertised: false,
            services: KnownOffers::default(),
            by_subscription: BTreeMap::new(),
            by_channel: BTreeMap::new(),
            samples: Samples::default(),
            time_unix_ns: None,
            said: Vec::new(),
            follows: BTreeSet::new(),
            follows_all: false,
            changed: BTreeSet::new(),
            wanted: Vec::new(),
            calls: BTreeSet::new(),
        }
    }

    /// Whether it may call services and set parameters.
    pub fn may_order(&self) -> bool {
        self.permit.role == Role::Command
    }

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
        channels: &Offers<Channel>,
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

    /// Gets the changes of these parameters, or of all.
    pub fn follow(&mut self, names: &[String], parameters: &ParameterSubscriptions) {
        self.follows_all |= names.is_empty();
        let found = parameters.find(names);
        self.follows
            .extend(found.into_iter().map(|parameter| parameter.name));
    }

    /// Gets the changes of these parameters no more, or of any.
    pub fn unfollow(&mut self, names: &[String]) {
        self.follows_all = false;
        match names {
            [] => self.follows.clear(),
            names => self.follows.retain(|name| !names.contains(name)),
        }
    }

    /// Remembers that it has set a parameter. False if too many wait.
    pub fn want(&mut self, name: &str, id: Option<&str>) -> bool {
        let has_room = self.wanted.len() < MAX_OPEN;
        if has_room {
            self.wanted.push(Wanted {
                name: name.to_owned(),
                id: id.map(str::to_owned),
            });
        }
        has_room
    }

    /// A parameter has its value, whether it changed or not.
    pub fn parameter(
        &mut self,
        name: &str,
        has_changed: bool,
        parameters: &ParameterSubscriptions,
    ) {
        let (wanted, others) = std::mem::take(&mut self.wanted)
            .into_iter()
            .partition(|one| one.name == name);
        self.wanted = others;
        let wanted: Vec<Wanted> = wanted;
        for one in &wanted {
            let parameters = vec![parameters.get(name)];
            let message = Outgoing::ParameterValues {
                parameters,
                id: one.id.as_deref(),
            };
            self.answer(ClientFrame::Text(message.text()));
        }
        if has_changed && self.follows_all {
            self.follows.insert(name.to_owned());
        }
        if has_changed && self.follows.contains(name) {
            self.changed.insert(name.to_owned());
        }
    }

    /// Remembers a call. False if too many wait, or it is one that waits already.
    pub fn call(&mut self, call: Call) -> bool {
        self.calls.len() < MAX_OPEN && self.calls.insert(call)
    }

    /// Answers a call, once.
    pub fn respond(&mut self, call: Call, response: &[u8]) {
        if self.calls.remove(&call) {
            self.refuse(call, response);
        }
    }

    /// Answers a call that does not wait.
    pub fn refuse(&mut self, call: Call, response: &[u8]) {
        let bytes = message::service_response(call.service, call.call, ENCODING, response);
        self.answer(ClientFrame::Binary(bytes));
    }

    /// What is sent next: answers, what there is, the time, samples.
    pub fn next(
        &mut self,
        channels: &Offers<Channel>,
        services: &Offers<OfferedService>,
        parameters: &ParameterSubscriptions,
    ) -> Option<ClientFrame> {
        if let Some(frame) = self.answers.pop_front() {
            self.answer_bytes -= frame.len();
            return Some(frame);
        }
        let told = self
            .tell_channels(channels)
            .or_else(|| self.tell_services(services));
        if let Some(message) = told {
            return Some(ClientFrame::Text(message));
        }
        if !self.changed.is_empty() {
            let names = std::mem::take(&mut self.changed);
            let parameters = names.iter().map(|name| parameters.get(name)).collect();
            let message = Outgoing::ParameterValues {
                parameters,
                id: None,
            };
            return Some(ClientFrame::Text(message.text()));
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
    fn tell_channels(&mut self, channels: &Offers<Channel>) -> Option<String> {
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

    fn tell_services(&mut self, services: &Offers<OfferedService>) -> Option<String> {
        if !self.may_order() || self.services.is_current(services) {
            return None;
        }
        let gone = self.services.take_gone(services);
        if !gone.is_empty() {
            return Some(Outgoing::UnadvertiseServices { service_ids: gone }.text());
        }
        let new = self.services.take_new(services, usize::MAX).into_iter();
        let services: Vec<_> = new.map(|(id, service)| service.info(id)).collect();
        (!services.is_empty()).then(|| Outgoing::AdvertiseServices { services }.text())
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
