//! [`Hub`]: all Foxglove clients, and what they are offered.

use std::collections::BTreeMap;

use ipc_types::MonotonicNs;
use serde_json::Value;

use super::channels::{
    Channel, ENCODING, MAX_CHANNELS, MAX_SERVICES, OfferedService, Offers, ParameterSubscriptions,
    Sample, refused,
};
use super::client::{ClientFrame, FoxgloveClient, Notice};
use super::message::{Binary, Incoming, Outgoing, Parameter, asset_response, read_binary};
use super::playback::{CAPABILITY, Playback};
use crate::authority::access::Permit;
use crate::event::{Call, ChannelId, Event, Events, Peer, ViewerId};
use crate::page::{ReplayInfo, ReplayStatus, Role};
use crate::viewer::from;
use crate::websocket::{Close, WebSocketMessage};

/// What clients show as the server's name.
const NAME: &str = "HERO RIL";

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
    has_commands: bool,
    has_parameters: bool,
    clients: BTreeMap<ViewerId, FoxgloveClient>,
    channels: Offers<Channel>,
    /// The newest sample of each channel that has had one since it has subscribers, for those that come later.
    latest: BTreeMap<ChannelId, Sample>,
    services: Offers<OfferedService>,
    parameters: ParameterSubscriptions,
    playback: Playback,
}

impl Hub {
    pub fn new(
        session: String,
        has_commands: bool,
        has_parameters: bool,
        replay: Option<&ReplayInfo>,
    ) -> Hub {
        Hub {
            playback: Playback::new(replay),
            session,
            has_commands,
            has_parameters,
            clients: BTreeMap::new(),
            channels: Offers::new(MAX_CHANNELS),
            latest: BTreeMap::new(),
            services: Offers::new(MAX_SERVICES),
            parameters: ParameterSubscriptions::default(),
        }
    }

    /// A client has connected.
    pub fn connect(&mut self, viewer: ViewerId, peer: Peer, permit: Permit) {
        let may_order = self.has_commands && permit.role == Role::Command;
        let role = if may_order {
            Role::Command
        } else {
            Role::Watch
        };
        let mut client = FoxgloveClient::new(peer, Permit { role, ..permit });
        let mut capabilities = vec!["time", "assets"];
        if self.has_parameters {
            capabilities.extend(["parameters", "parametersSubscribe"]);
        }
        if may_order {
            capabilities.push("services");
        }
        let range = self.playback.range();
        if range.is_some() {
            capabilities.push(CAPABILITY);
        }
        let info = Outgoing::ServerInfo {
            name: NAME,
            capabilities: &capabilities,
            supported_encodings: &[ENCODING],
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

    /// Whether a client has asked for parameters.
    pub fn wants_parameters(&self) -> bool {
        self.clients.values().any(|client| client.wants_parameters)
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
                self.binary(viewer, &message, now, events);
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
            Incoming::Advertise => client.notice(Notice::NoPublishing),
            Incoming::FetchAsset { uri, request_id } => {
                let response = asset_response(request_id, asset(&uri));
                client.answer(ClientFrame::Binary(response));
            }
            _ if !self.has_parameters => {}
            Incoming::GetParameters {
                parameter_names,
                id,
            } => {
                client.wants_parameters = true;
                let parameters = self.parameters.find(&parameter_names);
                let message = Outgoing::ParameterValues {
                    parameters,
                    id: id.as_deref(),
                };
                client.answer(ClientFrame::Text(message.text()));
            }
            Incoming::SetParameters { parameters, id } => {
                self.set(viewer, parameters, id.as_deref(), now, events)
            }
            Incoming::SubscribeParameterUpdates { parameter_names } => {
                client.wants_parameters = true;
                client.follow(&parameter_names, &self.parameters)
            }
            Incoming::UnsubscribeParameterUpdates { parameter_names } => {
                client.unfollow(&parameter_names)
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

    /// Parameters that may not be set are answered with the values that they have.
    fn set(
        &mut self,
        viewer: ViewerId,
        wanted: Vec<Parameter>,
        id: Option<&str>,
        now: MonotonicNs,
        events: &mut Events,
    ) {
        let Some(client) = self.clients.get_mut(&viewer) else {
            return;
        };
        let from = from(&client.peer, client.permit.name.as_deref());
        let mut refused = Vec::new();
        for parameter in wanted {
            let may = client.may_order()
                && self.parameters.contains(&parameter.name)
                && client.orders.allows(now);
            match parameter.value {
                Some(value) if may && client.want(&parameter.name, id) => {
                    events.push_back(Event::SetParameter {
                        name: parameter.name,
                        value,
                        from: from.clone(),
                    });
                }
                _ => refused.push(parameter.name),
            }
        }
        if !client.may_order() {
            client.notice(Notice::ReadOnly);
        }
        if !refused.is_empty() {
            let parameters = self.parameters.find(&refused);
            let message = Outgoing::ParameterValues { parameters, id };
            client.answer(ClientFrame::Text(message.text()));
        }
    }

    fn binary(
        &mut self,
        viewer: ViewerId,
        message: &Binary<'_>,
        now: MonotonicNs,
        events: &mut Events,
    ) {
        let Some(client) = self.clients.get_mut(&viewer) else {
            return;
        };
        let (service, call, encoding, request) = match *message {
            Binary::ServiceCall {
                service,
                call,
                encoding,
                request,
            } => (service, call, encoding, request),
            Binary::Playback(wanted) => return self.playback.take(viewer, &wanted, events),
            Binary::Publish => return client.notice(Notice::NoPublishing),
        };
        let call = Call {
            viewer,
            service,
            call,
        };
        if !client.may_order() {
            client.notice(Notice::ReadOnly);
        }
        let Some(known) = self.services.get(service).filter(|_| client.may_order()) else {
            let message = "there is no such service";
            let failure = Outgoing::ServiceCallFailure {
                service_id: service,
                call_id: call.call,
                message,
            };
            client.answer(ClientFrame::Text(failure.text()));
            return;
        };
        let refusal = if encoding != ENCODING.as_bytes() {
            "requests are JSON"
        } else if !client.orders.allows(now) {
            "more than five calls in a second"
        } else if !client.call(call) {
            "too many calls wait for their answers"
        } else {
            events.push_back(Event::ServiceCall {
                call,
                service: known.name.clone(),
                request: request.to_vec(),
                from: from(&client.peer, client.permit.name.as_deref()),
            });
            return;
        };
        client.refuse(call, &refused(refusal));
    }

    /// The message to send next to a client.
    pub fn next(&mut self, viewer: ViewerId) -> Option<ClientFrame> {
        self.clients
            .get_mut(&viewer)?
            .next(&self.channels, &self.services, &self.parameters)
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

    /// Offers these services and no others.
    pub fn services(&mut self, services: &[OfferedService]) {
        self.services.set(services);
    }

    /// Takes the value of a parameter, and sends it to the clients that follow it or have set it.
    pub fn parameter(&mut self, name: &str, value: Option<Value>) {
        let has_changed = self.parameters.set(name, value);
        for client in self.clients.values_mut() {
            client.parameter(name, has_changed, &self.parameters);
        }
    }

    /// Answers a call.
    pub fn respond(&mut self, call: Call, response: &[u8]) {
        if let Some(client) = self.clients.get_mut(&call.viewer) {
            client.respond(call, response);
        }
    }

    /// Begins another time. Gives the clients, which are to connect anew.
    pub fn restart(&mut self, session: String) -> Vec<ViewerId> {
        self.session = session;
        self.clients.keys().copied().collect()
    }
}
