//! The robot's side: a member of the robot's shared memory that reads its topics, sends them to the stations, and hands requests
//! of stations to the robot's processes.
//!
//! [`Services`] and [`Stations`] are what it knows, [`orders::robot`](crate::orders::robot) decides about requests; here bytes move.

pub mod admission;
mod reaction;
pub mod ros2_outlet;
pub mod services;
pub mod stations;

use std::num::NonZeroU32;
use std::os::fd::BorrowedFd;
use std::time::Duration;

use ipc_types::code::ModuleStatus;
use ipc_types::module::{State, doing_bytes};
use ipc_types::payload::RelayStations;
use ipc_types::{
    Ipc, Module, MonotonicNs, Publisher, RelayModule, SendError, StateOf, WaitError, Wake,
};
use module_kit::process::{Process, Sources};

use crate::Failure;
use crate::config::Config;
use crate::message::{
    AnswerBytes, Ask, Command, MAX_ASK_BYTES, MAX_COMMAND_BYTES, NoMessage, Ping, Pong, Tell,
    decode, encode,
};
use crate::names;
use crate::network::{Inbox, Network, Room, Side};
use crate::orders::message::Order;
use crate::orders::robot as orders;
use crate::orders::robot::{NotSent, Output};
use crate::random::{fresh, suspended_ns};
use admission::Admission;
use reaction::Reaction;
use ros2_outlet::Ros2Outlet;
use services::{LOOK_PERIOD, Services};
use stations::{Lives, Stations};

/// Messages that may wait: a station sends a few for each of its at most 32 open requests, and eight stations are served.
const INBOX: usize = 512;

/// Room for questions.
const ASK_ROOM: Room = Room {
    messages: INBOX,
    bytes: INBOX * MAX_ASK_BYTES,
    longest: MAX_ASK_BYTES,
};

/// Room for orders.
const ORDER_ROOM: Room = Room {
    messages: INBOX,
    bytes: ORDER_BYTES,
    longest: MAX_COMMAND_BYTES,
};

/// Bytes of orders that may wait: as many of the longest as 256, of the robot's own as wait at all.
const ORDER_BYTES: usize = 256 * MAX_COMMAND_BYTES;

/// How often the latest samples are sent again at most, whatever stations ask for. One ping brings all of them.
const LATEST_PERIOD: Duration = Duration::from_millis(500);

/// How often state and stations are published though nothing has changed.
const PUBLISH_PERIOD: Duration = Duration::from_millis(900);

/// The robot's side of the relay.
pub struct RobotSide {
    config: Config,
    robot: NonZeroU32,
    life: u64,
    network: Network,
    asks: Inbox,
    commands: Inbox,
    services: Services,
    stations: Stations,
    lives: Lives,
    admission: Admission,
    orders: orders::Robot,
    reaction: Option<Reaction>,
    state: Publisher<StateOf<RelayModule>>,
    stations_out: Publisher<RelayStations>,
    samples_sent: u64,
    since: MonotonicNs,
    was_relaying: bool,
    next_look: MonotonicNs,
    next_publish: MonotonicNs,
    /// When the latest samples may be sent again, and whether a station waits for them.
    next_latest: MonotonicNs,
    is_latest_wanted: bool,
    unreadable: u64,
    ipc: Ipc,
}

impl RobotSide {
    /// Opens the ports and the network.
    ///
    /// # Errors
    ///
    /// Another relay of this robot runs, or shared memory or the network cannot be used.
    pub fn open(ipc: Ipc, config: Config, end: BorrowedFd<'_>) -> Result<RobotSide, Failure> {
        let robot = NonZeroU32::new(ipc.robot().get()).unwrap_or(NonZeroU32::MIN);
        // First, so that a second relay of the robot ends before it takes the network's address.
        let state = ipc.publisher()?;
        let stations_out = ipc.publisher()?;
        let network = Network::open(&config, Side::Robot, end)?;
        let life = fresh();
        let order_config = orders::Config {
            link_loss: config.commands.lost_after(),
            ..orders::Config::default()
        };
        let ros2 = Ros2Outlet::open(&network, &config.ros2, ipc.robot())?;
        let named = |key: fn(NonZeroU32, &str) -> String| {
            let stations = config.commands.stations.iter();
            let stations = stations.chain(&config.security.stations);
            stations.map(|name| key(robot, name)).collect()
        };
        let asks = network.receive(&names::ask(robot, "*"), named(names::ask), ASK_ROOM)?;
        let commands =
            network.receive(&names::order(robot, "*"), named(names::order), ORDER_ROOM)?;
        let now = MonotonicNs::now();
        Ok(RobotSide {
            robot,
            life,
            asks,
            commands,
            services: Services::new(life, robot, ros2)?,
            stations: Stations::new(config.network.silent_after()),
            lives: Lives::default(),
            admission: Admission::new(
                names::ask(robot, ""),
                names::order(robot, ""),
                &config.commands.stations,
                &config.security.stations,
            ),
            orders: orders::Robot::new(order_config, fresh()),
            reaction: Reaction::open(&ipc, config.commands.link_loss)?,
            network,
            config,
            state,
            stations_out,
            samples_sent: 0,
            since: now,
            was_relaying: false,
            next_look: now,
            next_publish: now,
            next_latest: now,
            is_latest_wanted: false,
            unreadable: 0,
            ipc,
        })
    }

    fn may_command(&self, station: &str) -> bool {
        self.config
            .commands
            .stations
            .iter()
            .any(|name| name == station)
    }

    fn take_messages(&mut self, out: &mut Vec<Output>) {
        self.network.drained();
        let now = MonotonicNs::now();
        let mut asks = Vec::new();
        let mut unreadable = None;
        let admission = &mut self.admission;
        self.asks.drain(|incoming| {
            let Some(station) = admission.asks(incoming.key, now) else {
                return;
            };
            match decode::<Ask>(incoming.payload) {
                Ok(ask) => asks.push((station.to_owned(), ask, incoming.at)),
                Err(error) => unreadable = Some((incoming.key.to_owned(), error)),
            }
        });
        let mut commands = Vec::new();
        self.commands.drain(|incoming| {
            let Some(station) = admission.orders(incoming.key, now) else {
                return;
            };
            match decode::<Command>(incoming.payload) {
                Ok(command) => commands.push((station.to_owned(), command)),
                Err(error) => unreadable = Some((incoming.key.to_owned(), error)),
            }
        });
        for (station, ask, at) in asks {
            self.answer(&station, &ask, at, out);
        }
        for (station, command) in commands {
            self.order(&station, command, out);
        }
        if let Some((key, error)) = unreadable {
            self.note_unreadable(&key, &error);
        }
    }

    /// Once, and then each time that their number has doubled.
    fn note_unreadable(&mut self, key: &str, error: &NoMessage) {
        self.unreadable += 1;
        if self.unreadable.is_power_of_two() {
            tracing::warn!(key, %error, count = self.unreadable, "messages that are none have come");
        }
    }

    fn answer(&mut self, station: &str, ask: &Ask, at: MonotonicNs, out: &mut Vec<Output>) {
        let tell = match ask {
            Ask::Ping(ping) => Tell::Pong(self.pong(station, ping, at, out)),
            Ask::Describe { robot_life, index } => {
                match self
                    .services
                    .describe(*index)
                    .filter(|_| *robot_life == self.life)
                {
                    // Else the station asks again.
                    Some(service) if self.admission.describes(service.schema.len(), at) => {
                        Tell::Service(service)
                    }
                    Some(_) | None => return,
                }
            }
        };
        self.tell(station, &tell);
    }

    fn pong(&mut self, station: &str, ping: &Ping, at: MonotonicNs, out: &mut Vec<Output>) -> Pong {
        let may_command = self.may_command(station);
        let is_news = self
            .stations
            .hear(station, ping.station_life, may_command, at);
        if is_news {
            if self.admission.logs(at) {
                tracing::info!(station, may_command, "a station is there");
            }
            self.next_publish = at;
        }
        self.is_latest_wanted |= ping.wants_latest;
        let session = match may_command && self.lives.admit(ping.station_life, station, at) {
            true => self.orders.session_for(ping.station_life, at, out),
            false => 0,
        };
        Pong {
            robot_life: self.life,
            station_life: ping.station_life,
            ping_sent_ns: ping.sent_ns,
            ping_suspended_ns: ping.suspended_ns,
            received_ns: at.0,
            sent_ns: MonotonicNs::now().0,
            suspended_ns: suspended_ns(),
            session,
            services: self.services.count(),
        }
    }

    fn order(&mut self, station: &str, command: Command, out: &mut Vec<Output>) {
        let order = Order::from(command);
        let from = out.len();
        let requests = self.services.requests_of(order.topic);
        // Its service would refuse it, and until then it would be remembered.
        if requests
            .as_ref()
            .is_some_and(|requests| requests.client.schema().size() != order.request.len())
        {
            return tracing::debug!(
                station,
                "a request has another length than its service takes"
            );
        }
        let repeat = requests.map(|requests| requests.fields.repeat());
        self.orders.order(
            &order,
            repeat.unwrap_or(orders::Repeat::None),
            MonotonicNs::now(),
            out,
        );
        // Only the sender of this order is to be told that its session is not known.
        for output in out.split_off(from) {
            match output {
                Output::UnknownSession(unknown) => {
                    self.tell(station, &Tell::UnknownSession(unknown.session));
                }
                output => out.push(output),
            }
        }
    }

    fn tell(&self, station: &str, tell: &Tell) {
        self.network
            .send(&names::tell(self.robot, station), encode(tell));
    }

    /// Carries out what the core wants, and what follows from it.
    fn carry_out(&mut self, out: &mut Vec<Output>) {
        while !out.is_empty() {
            for output in std::mem::take(out) {
                match output {
                    Output::Send {
                        topic,
                        request_id,
                        is_repeat,
                        expires,
                        request,
                    } => {
                        let sent = self.send(topic, is_repeat, expires, request);
                        if let Err(reason) = sent {
                            self.orders.not_sent(
                                topic,
                                request_id,
                                reason,
                                MonotonicNs::now(),
                                out,
                            );
                        }
                    }
                    Output::GiveUp { topic, request_id } => {
                        if let Some(requests) = self.services.requests_of(topic) {
                            requests.client.give_up_one(request_id);
                        }
                    }
                    Output::Answer { station, answer } => {
                        if let Some(name) = self.lives.name_of(station) {
                            self.tell(name, &Tell::Answer(AnswerBytes::new(&answer)));
                        }
                    }
                    Output::UnknownSession(_) => {}
                    Output::LinkLost { station } => {
                        let name = self.lives.name_of(station);
                        tracing::warn!(station = name, "lost, with a request open");
                        if let Some(reaction) = &mut self.reaction {
                            reaction.act();
                        }
                    }
                }
            }
        }
    }

    fn send(
        &mut self,
        topic: u64,
        is_repeat: bool,
        expires: MonotonicNs,
        mut request: Vec<u8>,
    ) -> Result<(), NotSent> {
        let requests = self.services.requests_of(topic).ok_or(NotSent::NoServer)?;
        if is_repeat {
            requests.fields.set_repeat(&mut request);
        }
        let left = expires.since(MonotonicNs::now());
        requests.fields.set_deadline(&mut request, left);
        match requests.client.send(&request) {
            Ok(_) => Ok(()),
            Err(SendError::NoServer { .. }) => Err(NotSent::NoServer),
            Err(error) => {
                tracing::debug!(%error, "a request was not handed on");
                Err(NotSent::Full)
            }
        }
    }

    fn take_reports(&mut self, now: MonotonicNs, out: &mut Vec<Output>) {
        let orders = &mut self.orders;
        for (index, requests) in self.services.all_requests() {
            requests
                .client
                .drain(|report| orders.report(index, report, now, out));
        }
    }

    fn publish(&mut self, now: MonotonicNs) {
        let is_relaying = self.stations.is_any_up();
        if is_relaying != self.was_relaying {
            self.since = now;
            self.was_relaying = is_relaying;
        }
        let (functionality, doing) = match is_relaying {
            true => (RelayModule::RELAYING, "relaying to stations"),
            false => (RelayModule::WAITING, "waiting for a station"),
        };
        let state = State {
            published_ns: now.0,
            since_ns: self.since.0,
            module_id: RelayModule::ID,
            status: ModuleStatus::Running.code(),
            functionality,
            doing: doing_bytes(doing),
            ..State::default()
        };
        let published = self.state.publish(|sample| *sample = StateOf::new(state));
        let orders = &self.orders;
        let rows = self
            .stations
            .rows(self.samples_sent, |life| orders.open_of(life));
        let stations = self.stations_out.publish(|sample| {
            sample.published_ns = now.0;
            sample.count = rows.len() as u32;
            for (place, row) in sample.stations.iter_mut().zip(rows) {
                *place = row;
            }
        });
        if let Err(error) = published.and(stations) {
            tracing::debug!(%error, "the state cannot be published");
        }
        self.next_publish = now + PUBLISH_PERIOD;
    }
}

impl Process for RobotSide {
    type Error = WaitError;
    type Key = ();

    fn sources<'a>(&'a mut self, sources: &mut Sources<'a>) {
        sources.port(&mut self.state);
        sources.port(&mut self.stations_out);
        if let Some(reaction) = &mut self.reaction {
            sources.port(reaction.client());
        }
        sources.descriptor((), self.network.descriptor());
        sources.descriptor((), self.services.ports().descriptor());
    }

    fn drain(&mut self, _wake: Wake) -> Result<(), WaitError> {
        let mut out = Vec::new();
        let now = MonotonicNs::now();
        // Before the first question of a station is answered.
        if now >= self.next_look {
            self.services
                .look(&self.ipc, &self.network, &self.config.topics);
            self.next_look = now + LOOK_PERIOD;
        }
        self.samples_sent += self.services.send_samples(now);
        self.take_messages(&mut out);
        self.carry_out(&mut out);
        self.take_reports(now, &mut out);
        self.orders.tick(now, &mut out);
        self.carry_out(&mut out);
        if let Some(reaction) = &mut self.reaction {
            reaction.drain();
        }
        for station in self.stations.pass(now) {
            if self.admission.logs(now) {
                tracing::warn!(station, "a station is heard no more");
            }
            self.next_publish = now;
        }
        if self.is_latest_wanted && now >= self.next_latest {
            self.services.send_latest();
            self.is_latest_wanted = false;
            self.next_latest = now + LATEST_PERIOD;
        }
        if now >= self.next_publish {
            self.publish(now);
        }
        Ok(())
    }

    fn deadline(&self) -> Option<MonotonicNs> {
        let fixed = self.next_look.min(self.next_publish);
        [
            self.services.deadline(),
            self.orders.deadline(),
            self.stations.deadline(),
            self.is_latest_wanted.then_some(self.next_latest),
        ]
        .into_iter()
        .flatten()
        .chain([fixed])
        .min()
    }
}
