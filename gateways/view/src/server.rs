//! [`Server`]: all connections, and the messages to the viewers at their other ends.

use std::collections::BTreeMap;
use std::sync::Arc;

use ipc_types::MonotonicNs;

use crate::assets::Assets;
use crate::authority::access::Access;
use crate::connection::{Connection, Ending, Input};
use crate::event::{ChannelId, ConnectionId, Event, Events, Instance, Peer, Settings, ViewerId};
use crate::foxglove;
use crate::foxglove::channels::{Channel, Sample};
use crate::foxglove::client::ClientFrame;
use crate::foxglove::hub::Hub;
use crate::http::answer::Response;
use crate::http::refusal::Refusal;
use crate::http::request::{HttpRequest, Method, Upgrade};
use crate::http::tile::{FileRequest, Tile, Wanted};
use crate::metrics;
use crate::page::{self, Outgoing};
use crate::pages::Pages;
use crate::viewer::{Greeting, from};
use crate::websocket::{Close, WebSocketMessage};

/// Most pages and Foxglove clients. At the bound the page that has been here longest without a word is closed; if all
/// have said what they want, the new one is refused.
pub const MAX_VIEWERS: usize = 32;

/// Most connections beside them: 20 browsers load the page with six each. At the bound the one that has been idle
/// longest is closed; if none is idle, the new one is refused.
pub const MAX_HTTP: usize = 128;

/// Where the report of the recording is.
const REPORT_PATH: &str = "/report";

/// What a viewer speaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Speaks {
    Page,
    Foxglove,
}

/// The subprotocol that is spoken with this client; `None` if it offers none that there is.
fn protocol(upgrade: &Upgrade) -> Option<(&'static str, Speaks)> {
    let is_offered = |name: &&str| upgrade.protocols.iter().any(|offered| offered == name);
    if is_offered(&page::PROTOCOL) {
        return Some((page::PROTOCOL, Speaks::Page));
    }
    let foxglove = foxglove::PROTOCOLS.into_iter().find(is_offered)?;
    Some((foxglove, Speaks::Foxglove))
}

#[derive(Debug)]
struct ConnectionEntry {
    connection: Connection,
    /// `None` until it is a viewer.
    speaks: Option<Speaks>,
}

/// The live view's server, without its sockets: bytes and times in; bytes, events and a deadline out.
///
/// The program around it calls [`Server::accept`], [`Server::receive`], [`Server::sent`] and [`Server::closed`] as its
/// sockets say, and [`Server::advance`] at [`Server::deadline`]; then it takes all of [`Server::poll_event`], says what
/// there is to say, and writes [`Server::output`] of all connections.
#[derive(Debug)]
pub struct Server {
    access: Access,
    assets: Assets,
    has_tiles: bool,
    has_report: bool,
    connections: BTreeMap<ConnectionId, ConnectionEntry>,
    next_id: u64,
    pages: Pages,
    foxglove: Hub,
    events: Events,
    /// How often each reason to reject something held.
    rejected: BTreeMap<&'static str, u64>,
    /// The newest moment that was given.
    clock: MonotonicNs,
}

impl Server {
    /// A server without connections.
    pub fn new(settings: Settings, instance: Instance) -> Server {
        let access = Access::new(&settings);
        let assets = Assets::new();
        let foxglove = Hub::new(instance.0.clone(), settings.replay.as_ref());
        let greeting = Greeting {
            build: assets.build().to_owned(),
            instance: instance.0,
            replay: settings.replay,
            tiles: settings.tiles,
            has_report: settings.has_report,
        };
        Server {
            access,
            has_tiles: settings.tiles.is_some(),
            has_report: settings.has_report,
            assets,
            connections: BTreeMap::new(),
            next_id: 1,
            pages: Pages::new(greeting),
            foxglove,
            events: Events::new(),
            rejected: BTreeMap::new(),
            clock: MonotonicNs(0),
        }
    }

    /// Hash of the page's files.
    pub fn build(&self) -> &str {
        self.pages.build()
    }

    /// Takes a connection; `None` if there are too many: then [`BUSY`](crate::BUSY) is to be written, and the
    /// connection to be closed.
    pub fn accept(&mut self, peer: Peer, now: MonotonicNs) -> Option<ConnectionId> {
        self.clock = now;
        let plain = self
            .connections
            .values_mut()
            .filter(|entry| entry.speaks.is_none() && !entry.connection.is_gone());
        let plain: Vec<&mut ConnectionEntry> = plain.collect();
        if plain.len() >= MAX_HTTP {
            let idle = plain
                .into_iter()
                .filter_map(|entry| Some((entry.connection.idle_since()?, entry)));
            let (_, longest) = idle.min_by_key(|(since, _)| *since)?;
            longest.connection.end();
        }
        let id = ConnectionId(self.next_id);
        self.next_id += 1;
        self.connections.insert(
            id,
            ConnectionEntry {
                connection: Connection::new(peer, now),
                speaks: None,
            },
        );
        Some(id)
    }

    /// Takes note that the bytes of a connection are those of TLS, before the first of them is given.
    pub fn encrypted(&mut self, id: ConnectionId, now: MonotonicNs) {
        self.clock = now;
        if let Some(entry) = self.connections.get_mut(&id) {
            entry.connection.encrypted(now);
        }
    }

    /// Takes bytes that have come.
    pub fn receive(&mut self, id: ConnectionId, bytes: &[u8], now: MonotonicNs) {
        self.clock = now;
        let mut input = bytes;
        loop {
            let Some(entry) = self.connections.get_mut(&id) else {
                return;
            };
            let result = match entry.connection.next(&mut input, now) {
                Ok(None) => Ok(false),
                Ok(Some(Input::Request(request))) => self.request(id, &request, now).map(|()| true),
                Ok(Some(Input::Message(message))) => self.message(id, message, now).map(|()| true),
                Err(ending) => Err(ending),
            };
            match result {
                Ok(true) => {}
                Ok(false) => break,
                Err(ending) => {
                    self.reject(id, ending);
                    break;
                }
            }
        }
        self.release(id, now);
    }

    /// Answers a request.
    fn request(
        &mut self,
        id: ConnectionId,
        request: &HttpRequest,
        now: MonotonicNs,
    ) -> Result<(), Ending> {
        let answered = self.try_request(id, request, now);
        let entry = self.connections.get_mut(&id);
        match (answered, entry) {
            (Err(refusal), Some(entry)) => Err(entry.connection.refuse(refusal, now)),
            _ => Ok(()),
        }
    }

    fn try_request(
        &mut self,
        id: ConnectionId,
        request: &HttpRequest,
        now: MonotonicNs,
    ) -> Result<(), Refusal> {
        let Some(ConnectionEntry { connection, .. }) = self.connections.get_mut(&id) else {
            return Ok(());
        };
        let peer = connection.peer.clone();
        self.access.enter(request, &peer)?;
        let Some(upgrade) = &request.upgrade else {
            // A report shows what viewers of the recording see, so it is for those that may look without a token.
            let wants_report = self.has_report
                && request.path == REPORT_PATH
                && self.access.permit(&peer, None).is_some();
            let tile = Tile::of_path(&request.path).filter(|_| self.has_tiles);
            let wanted = match wants_report {
                true => Some(Wanted::Report),
                false if request.path == metrics::PATH => {
                    let permit = self.access.permit(&peer, request.token.as_deref());
                    permit.ok_or(Refusal::NoToken)?;
                    Some(Wanted::Metrics)
                }
                false => tile.map(Wanted::Tile),
            };
            if let Some(wanted) = wanted {
                if request.method == Method::Other {
                    return Err(Refusal::OtherMethod);
                }
                connection.waits(now);
                let request = FileRequest {
                    wanted,
                    stays: request.stays,
                    has_body: request.method == Method::Get,
                };
                let event = Event::File {
                    connection: id,
                    request,
                };
                self.events.push_back(event);
                return Ok(());
            }
            let answer = Response::file(request, &self.assets, peer.is_encrypted)?;
            connection.answer(answer, now);
            return Ok(());
        };
        let upgrade = upgrade.as_ref().map_err(|refusal| *refusal)?;
        if request.path != "/" {
            return Err(Refusal::NotFound);
        }
        let (protocol, what) = protocol(upgrade).ok_or(Refusal::OtherProtocol)?;
        if !self.makes_room(now) {
            return Err(Refusal::Busy);
        }
        let Some(ConnectionEntry { connection, speaks }) = self.connections.get_mut(&id) else {
            return Ok(());
        };
        let viewer = id.viewer();
        match what {
            Speaks::Page => self.pages.connect(viewer, peer, now),
            Speaks::Foxglove => {
                let permit = self.access.permit(&peer, request.token.as_deref());
                permit.ok_or(Refusal::NoToken)?;
                self.foxglove.connect(viewer);
            }
        }
        *speaks = Some(what);
        let rest = connection.upgrade(upgrade, protocol, now);
        self.receive(id, &rest, now);
        Ok(())
    }

    /// Whether there is room for one more viewer.
    fn makes_room(&mut self, now: MonotonicNs) -> bool {
        let viewers = self
            .connections
            .values()
            .filter(|entry| entry.speaks.is_some());
        if viewers.count() < MAX_VIEWERS {
            return true;
        }
        let mute = self.pages.oldest_mute();
        if let Some(viewer) = mute {
            self.dismiss(viewer, Close::MUTE, now);
        }
        mute.is_some()
    }

    /// Takes a message of a viewer.
    fn message(
        &mut self,
        id: ConnectionId,
        message: WebSocketMessage,
        now: MonotonicNs,
    ) -> Result<(), Ending> {
        let viewer = id.viewer();
        let taken = match (
            self.connections.get(&id).and_then(|entry| entry.speaks),
            message,
        ) {
            (_, WebSocketMessage::Sign) => Ok(()),
            (Some(Speaks::Page), WebSocketMessage::Text(text)) => {
                self.pages
                    .take(viewer, &text, &self.access, now, &mut self.events)
            }
            (Some(Speaks::Foxglove), message) => {
                self.foxglove.take(viewer, &message, now, &mut self.events)
            }
            (Some(Speaks::Page), WebSocketMessage::Binary(_)) => Err(Close::MEANING),
            (None, _) => Ok(()),
        };
        taken.map_err(|close| {
            self.close(id, close, now);
            Ending::Closed(close)
        })
    }

    /// Ends a viewer, and says why. A page is sent the text that says it in words.
    fn close(&mut self, id: ConnectionId, close: Close, now: MonotonicNs) {
        if let Some(entry) = self.connections.get_mut(&id) {
            if close == Close::TOKEN && entry.speaks == Some(Speaks::Page) {
                while let Some(text) = self.pages.next(id.viewer(), now) {
                    entry.connection.send_text(&text);
                }
            }
            entry.connection.close(close, now);
        }
    }

    /// A connection that has ended here is no viewer any more, whenever the program around it closes it.
    fn release(&mut self, id: ConnectionId, now: MonotonicNs) {
        let Some(entry) = self.connections.get_mut(&id) else {
            return;
        };
        if !entry.connection.is_ended() {
            return;
        }
        match entry.speaks.take() {
            Some(Speaks::Page) => self.pages.leave(id.viewer(), now, &mut self.events),
            Some(Speaks::Foxglove) => self.foxglove.leave(id.viewer()),
            None => {}
        }
    }

    /// Counts what was rejected.
    fn reject(&mut self, id: ConnectionId, ending: Ending) {
        let why = ending.why();
        let count = self.rejected.entry(why).or_default();
        *count += 1;
        if count.is_power_of_two() {
            let count = *count;
            let peer = self
                .connections
                .get(&id)
                .map(|entry| from(&entry.connection.peer, None));
            let from = peer.unwrap_or_default();
            self.events.push_back(Event::Rejected { from, why, count });
        }
    }

    /// The bytes to write next to a connection; empty if there are none. What waits for a viewer is made ready when
    /// nothing is, at most 16 KiB and what does not fit at once: so it is as new as it can be.
    pub fn output(&mut self, id: ConnectionId) -> &[u8] {
        let now = self.clock;
        let Some(ConnectionEntry { connection, speaks }) = self.connections.get_mut(&id) else {
            return &[];
        };
        if connection.is_free() {
            if *speaks == Some(Speaks::Page) {
                self.pages.is_free(id.viewer(), now);
            }
            while !connection.is_full() {
                match speaks {
                    Some(Speaks::Page) => match self.pages.next(id.viewer(), now) {
                        Some(text) => connection.send_text(&text),
                        None => break,
                    },
                    Some(Speaks::Foxglove) => match self.foxglove.next(id.viewer()) {
                        Some(ClientFrame::Text(text)) => connection.send_text(&text),
                        Some(ClientFrame::Binary(bytes)) => connection.send_binary(bytes),
                        None => break,
                    },
                    None => break,
                }
            }
        }
        connection.output()
    }

    /// Takes note that the first `count` bytes of [`Server::output`] were written.
    pub fn sent(&mut self, id: ConnectionId, count: usize, now: MonotonicNs) {
        self.clock = now;
        let entry = self.connections.get_mut(&id);
        let can_read = entry.is_some_and(|entry| entry.connection.sent(count, now));
        if can_read {
            self.receive(id, &[], now);
        }
    }

    /// Whether a connection is to be closed as soon as it has no output.
    pub fn is_ended(&self, id: ConnectionId) -> bool {
        self.connections
            .get(&id)
            .is_none_or(|entry| entry.connection.is_ended())
    }

    /// Takes note that a connection was closed, by whichever side.
    pub fn closed(&mut self, id: ConnectionId, now: MonotonicNs) {
        self.clock = now;
        if let Some(entry) = self.connections.get_mut(&id) {
            entry.connection.end();
            self.release(id, now);
            self.connections.remove(&id);
        }
    }

    /// What viewers want, one after the other.
    pub fn poll_event(&mut self) -> Option<Event> {
        self.pages.poll_joined().or_else(|| self.events.pop_front())
    }

    /// When [`Server::advance`] is to be called.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        let connections = self
            .connections
            .values()
            .filter_map(|entry| entry.connection.deadline());
        connections.chain(self.pages.deadline(self.clock)).min()
    }

    /// Does what is due.
    pub fn advance(&mut self, now: MonotonicNs) {
        self.clock = now;
        let ids: Vec<ConnectionId> = self.connections.keys().copied().collect();
        for id in ids {
            let Some(entry) = self.connections.get_mut(&id) else {
                continue;
            };
            if let Err(ending) = entry.connection.advance(now) {
                self.reject(id, ending);
            }
            self.release(id, now);
        }
        for viewer in self.pages.advance(now, &mut self.events) {
            self.dismiss(viewer, Close::MUTE, now);
        }
    }

    fn dismiss(&mut self, viewer: ViewerId, close: Close, now: MonotonicNs) {
        let id = ConnectionId(viewer.0);
        self.close(id, close, now);
        self.reject(id, Ending::Closed(close));
        self.release(id, now);
    }

    /// Whether a page that has opened, or a Foxglove client, is here.
    pub fn has_viewers(&self) -> bool {
        self.pages.has_viewers() || self.foxglove.has_viewers()
    }

    /// Whether a page commands this robot.
    pub fn is_commanded(&self, robot: u32) -> bool {
        self.pages.is_commanded(robot)
    }

    /// The robots that pages look at.
    pub fn watched(&self) -> impl Iterator<Item = u32> + use<> {
        self.pages.watched().into_iter()
    }

    /// Answers a request with what was read; `None` if it is missing.
    pub fn file(
        &mut self,
        id: ConnectionId,
        request: FileRequest,
        bytes: Option<Vec<u8>>,
        now: MonotonicNs,
    ) {
        self.clock = now;
        if let Some(entry) = self.connections.get_mut(&id)
            && entry.connection.is_waiting()
        {
            entry.connection.answer(Response::read(request, bytes), now);
        }
    }

    /// What the wall clock said when the monotonic one was 0, ns since 1970-01-01 UTC. Pages show by it when they heard
    /// of this server.
    pub fn set_wall_clock(&mut self, zero_unix_ns: u64) {
        self.pages.set_wall_clock(zero_unix_ns);
    }

    /// The robots that are shown from now on.
    pub fn set_robots(&mut self, robots: Vec<u32>) {
        self.pages.set_robots(robots);
    }

    /// Says the list of robots to all pages.
    pub fn send_robots(&mut self, robots: &page::Robots) {
        self.pages.say(None, &Outgoing::Robots(robots));
    }

    /// Says a robot's state to the pages that look at it.
    pub fn robot(&mut self, robot: &page::RobotStatus) {
        self.pages.say(Some(robot.robot), &Outgoing::Robot(robot));
    }

    /// Says a robot's fence, path and home to the pages that look at it.
    pub fn chart(&mut self, chart: &page::Chart) {
        self.pages.say(Some(chart.robot), &Outgoing::Chart(chart));
    }

    /// Puts a robot's newest values before the pages that look at it.
    pub fn now(&mut self, values: &page::Now, now: MonotonicNs) {
        self.clock = now;
        self.pages.now(values, now);
    }

    /// Says the last minutes to a page, if it still looks at this robot.
    pub fn past(&mut self, viewer: ViewerId, past: &page::Past) {
        self.pages.say_to(viewer, past.robot, &Outgoing::Past(past));
    }

    /// Says what happened to the pages that look at this robot.
    pub fn event(&mut self, event: &page::Event) {
        self.pages.say(Some(event.robot), &Outgoing::Event(event));
    }

    /// Says what a check has found to the page that asked, if it still looks at this robot.
    pub fn check(&mut self, viewer: ViewerId, check: &page::CheckResult) {
        self.pages
            .say_to(viewer, check.robot, &Outgoing::Check(check));
    }

    /// Says how far an order has come to the pages that look at this robot, and remembers it.
    pub fn order(&mut self, report: &page::OrderReport) {
        self.pages.report(report, self.clock);
    }

    /// Says where the recording is to all pages, and to Foxglove clients that control it.
    pub fn replay(&mut self, replay: &page::ReplayStatus) {
        self.foxglove.replay(replay);
        self.pages.say(None, &Outgoing::Replay(replay));
    }

    /// All that pages know is of another moment: they are to get the past and all states anew, by an [`Event::Joined`]
    /// each.
    pub fn begin_anew(&mut self) {
        self.pages.begin_anew();
    }

    /// Offers a channel to Foxglove clients; `None` if there are too many. The number stays the same as long as topic
    /// and layout do.
    pub fn channel(&mut self, channel: Channel) -> Option<ChannelId> {
        self.foxglove.offer(channel)
    }

    /// Offers a channel no more.
    pub fn withdraw(&mut self, channel: ChannelId) {
        self.foxglove.withdraw(channel);
    }

    /// Whether a Foxglove client has subscribed to a channel.
    pub fn is_subscribed(&self, channel: ChannelId) -> bool {
        self.foxglove.is_subscribed(channel)
    }

    /// Sends a sample to the subscribers of its channel, and keeps it for later ones.
    pub fn sample(
        &mut self,
        channel: ChannelId,
        log_time_unix_ns: u64,
        bytes: impl Into<Arc<[u8]>>,
    ) {
        let sample = Sample {
            channel,
            log_time_unix_ns,
            bytes: bytes.into(),
            is_line: false,
        };
        self.foxglove.sample(&sample, self.clock);
    }

    /// Sends a line of a log to the subscribers of its channel; no newer one replaces it.
    pub fn line(&mut self, channel: ChannelId, log_time_unix_ns: u64, bytes: impl Into<Arc<[u8]>>) {
        let line = Sample {
            channel,
            log_time_unix_ns,
            bytes: bytes.into(),
            is_line: true,
        };
        self.foxglove.sample(&line, self.clock);
    }

    /// Sends the time to Foxglove clients: that of the samples that follow.
    pub fn time(&mut self, unix_ns: u64) {
        self.foxglove.time(unix_ns);
    }

    /// Begins another time for Foxglove clients, because a clock was set: they are to connect anew, and drop what they
    /// have.
    pub fn restart_foxglove(&mut self, session: String) {
        let now = self.clock;
        for viewer in self.foxglove.restart(session) {
            let id = ConnectionId(viewer.0);
            self.close(id, Close::ANEW, now);
            self.release(id, now);
        }
    }
}
