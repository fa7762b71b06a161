//! [`Hub`]: all Foxglove clients, and what they are offered.

use std::collections::BTreeMap;

use ipc_types::MonotonicNs;

use super::channels::{Channel, Offers, Sample};
use super::client::{ClientFrame, FoxgloveClient, Notice};
use super::message::{Binary, Incoming, Outgoing, asset_response, read_binary};
use super::playback::{CAPABILITY, Playback};
use crate::event::{ChannelId, Event, Events, ViewerId};
use crate::page::{ReplayInfo, ReplayStatus};
use crate::websocket::{Close, WebSocketMessage};

/// What clients show as the server's name.
const NAME: &str = "HERO RIL";

/// Why a call of a service fails.
const NO_SERVICES: &str = "this server has no services: it shows, and takes no orders";

/// Files that clients can fetch: parts of the program, by their names. No path of the file system is ever read.
const ASSETS: [(&str, &[u8]); 1] = [(
    "package://hero_ril/helicopter.urdf",
    include_bytes!("helicopter.urdf"),
)];

/// The file of this name, or why there is none.
fn asset(uri: &str) -> Result<&'static [u8], &'static str> {
    let mut assets = ASSETS.iter();
    let found = assets.find(|(name, _)| *name == uri);
    found
        .map(|(_, bytes)| *bytes)
        .ok_or("there is no such file")
}

/// All Foxglove clients, and what they are offered.
#[derive(Debug)]
pub(crate) struct Hub {
    /// What distinguishes this beginning of time from others.
    session: String,
    clients: BTreeMap<ViewerId, FoxgloveClient>,
    channels: Offers,
    /// The newest sample of each channel that has had one since it has subscribers, for those that come later.
    latest: BTreeMap<ChannelId, Sample>,
    playback: Playback,
}

impl Hub {
    pub fn new(session: String, replay: Option<&ReplayInfo>) -> Hub {
        Hub {
            playback: Playback::new(replay),
            session,
            clients: BTreeMap::new(),
            channels: Offers::default(),
            latest: BTreeMap::new(),
        }
    }

    /// A client has connected.
    pub fn connect(&mut self, viewer: ViewerId) {
        let mut client = FoxgloveClient::default();
        let mut capabilities = vec!["time", "assets"];
        let range = self.playback.range();
        if range.is_some() {
            capabilities.push(CAPABILITY);
        }
        let info = Outgoing::ServerInfo {
            name: NAME,
            capabilities: &capabilities,
            session_id: &self.session,
            data_start_time: range.map(|(start, _)| start),
            data_end_time: range.map(|(_, end)| end),
        };
        client.answer(ClientFrame::Text(info.text()));
        self.clients.insert(viewer, client);
    }

    /// A client is gone.
    pub fn leave(&mut self, viewer: ViewerId) {
        self.playback.leave(viewer);
        if let Some(client) = self.clients.remove(&viewer) {
            for channel in client.followed() {
                self.forget_if_lost(channel);
            }
        }
    }

    /// What a channel without subscribers had is old when the next one comes.
    fn forget_if_lost(&mut self, channel: ChannelId) {
        if !self.is_subscribed(channel) {
            self.latest.remove(&channel);
        }
    }

    /// Whether a client has subscribed to this channel.
    pub fn is_subscribed(&self, channel: ChannelId) -> bool {
        self.clients.values().any(|client| client.follows(channel))
    }

    /// Whether a client is here.
    pub fn has_viewers(&self) -> bool {
        !self.clients.is_empty()
    }

    /// Takes a message of a client. An error ends its connection.
    pub fn take(
        &mut self,
        viewer: ViewerId,
        received: &WebSocketMessage,
        now: MonotonicNs,
        events: &mut Events,
    ) -> Result<(), Close> {
        match received {
            WebSocketMessage::Text(text) => {
                let message = serde_json::from_str(text).map_err(|_| Close::MEANING)?;
                self.text(viewer, message, now, events);
            }
            WebSocketMessage::Binary(bytes) => {
                let message = read_binary(bytes).ok_or(Close::MEANING)?;
                self.binary(viewer, &message, events);
            }
            WebSocketMessage::Sign => {}
        }
        let is_too_slow = self
            .clients
            .get(&viewer)
            .is_some_and(FoxgloveClient::is_too_slow);
        if is_too_slow {
            Err(Close::SLOW)
        } else {
            Ok(())
        }
    }

    fn text(&mut self, viewer: ViewerId, message: Incoming, now: MonotonicNs, events: &mut Events) {
        let Some(client) = self.clients.get_mut(&viewer) else {
            return;
        };
        match message {
            Incoming::Subscribe { subscriptions } => {
                for subscription in subscriptions {
                    self.subscribe(viewer, subscription, now, events);
                }
            }
            Incoming::Unsubscribe { subscription_ids } => {
                let lost: Vec<_> = subscription_ids
                    .into_iter()
                    .filter_map(|id| client.unsubscribe(id))
                    .collect();
                for channel in lost {
                    self.forget_if_lost(channel);
                }
            }
            Incoming::Advertise | Incoming::SetParameters => client.notice(Notice::OnlyShows),
            Incoming::FetchAsset { uri, request_id } => {
                let response = asset_response(request_id, asset(&uri));
                client.answer(ClientFrame::Binary(response));
            }
            Incoming::Other => {}
        }
    }

    fn subscribe(
        &mut self,
        viewer: ViewerId,
        subscription: super::message::Subscription,
        now: MonotonicNs,
        events: &mut Events,
    ) {
        let channel = ChannelId(subscription.channel_id);
        let was_subscribed = self.is_subscribed(channel);
        let latest = self.latest.get(&channel);
        let client = self.clients.get_mut(&viewer);
        let is_new = client
            .is_some_and(|client| client.subscribe(subscription, &self.channels, latest, now));
        if is_new && !was_subscribed {
            events.push_back(Event::Subscribed(channel));
        }
    }

    fn binary(&mut self, viewer: ViewerId, message: &Binary<'_>, events: &mut Events) {
        let Some(client) = self.clients.get_mut(&viewer) else {
            return;
        };
        match message {
            Binary::Playback(wanted) => self.playback.take(viewer, wanted, events),
            Binary::Publish => client.notice(Notice::OnlyShows),
            Binary::ServiceCall { service, call } => {
                let failure = Outgoing::ServiceCallFailure {
                    service_id: *service,
                    call_id: *call,
                    message: NO_SERVICES,
                };
                client.answer(ClientFrame::Text(failure.text()));
            }
        }
    }

    /// The message to send next to a client.
    pub fn next(&mut self, viewer: ViewerId) -> Option<ClientFrame> {
        self.clients.get_mut(&viewer)?.next(&self.channels)
    }

    /// Offers a channel; `None` if there are too many.
    pub fn offer(&mut self, channel: Channel) -> Option<ChannelId> {
        self.channels.offer(channel).map(ChannelId)
    }

    /// Offers a channel no more.
    pub fn withdraw(&mut self, channel: ChannelId) {
        self.channels.withdraw(channel.0);
        self.latest.remove(&channel);
    }

    /// Sends a sample to all that have subscribed to its channel.
    pub fn sample(&mut self, sample: &Sample, now: MonotonicNs) {
        if self.channels.get(sample.channel.0).is_some() {
            self.latest.insert(sample.channel, sample.clone());
            for client in self.clients.values_mut() {
                client.sample(sample, now);
            }
        }
    }

    /// Sends the time to all.
    pub fn time(&mut self, unix_ns: u64) {
        for client in self.clients.values_mut() {
            client.set_time(unix_ns);
        }
    }

    /// Says where the recording is to those that control it.
    pub fn replay(&mut self, replay: &ReplayStatus) {
        for (viewer, state) in self.playback.states(replay) {
            if let Some(client) = self.clients.get_mut(&viewer) {
                client.answer(ClientFrame::Binary(state));
            }
        }
    }

    /// Begins another time. Gives the clients, which are to connect anew.
    pub fn restart(&mut self, session: String) -> Vec<ViewerId> {
        self.session = session;
        self.clients.keys().copied().collect()
    }
}
