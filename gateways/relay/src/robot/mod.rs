//! The robot's side: a member of the robot's shared memory that reads its topics, sends them to the stations, and hands
//! requests of stations to the robot's processes.
//!
//! `CarriedServices` and [`Stations`] are what it knows, [`orders::robot`](crate::orders::robot) decides about
//! requests; here bytes move.

pub mod mailbox;
mod ros2_publisher;
mod services;
pub mod stations;

use std::num::NonZeroU32;
use std::os::fd::BorrowedFd;
use std::time::Duration;

use ipc_types::payload::{MovementData, RelayStations};
use ipc_types::{Client, Ipc, MonotonicNs, OpenError, WaitError, Wake, fresh_request_id};
use module_kit::process::{Process, Sources};

use crate::Failure;
use crate::config::{Config, LinkLoss, Side};
use crate::message::{Ask, Ping, Pong, Reply, encode};
use crate::names;
use crate::network::{Network, Watch};
use crate::orders::message::{NOT_PERMITTED, Order};
use crate::orders::robot as orders;
use crate::orders::robot::{NotSent, Output};
use crate::own_topics::OwnTopics;
use crate::random::{fresh, suspended_ns};
use mailbox::{Admission, Mail, Mailbox};
use ros2_publisher::Ros2Publisher;
use services::{CarriedServices, LOOK_PERIOD};
use stations::Stations;

/// How often the latest samples are sent again at most, whatever stations ask for. One ping brings all of them.
const LATEST_PERIOD: Duration = Duration::from_millis(500);

/// The robot's side of the relay.
pub struct RobotSide {
    config: Config,
    robot: NonZeroU32,
    instance: u64,
    /// Notices who may be a station.
    newcomers: Watch,
    network: Network,
    mailbox: Mailbox,
    services: CarriedServices,
    stations: Stations,
    admission: Admission,
    orders: orders::RobotOrders,
    reaction: Option<Reaction>,
    own_topics: OwnTopics<RelayStations>,
    samples_sent: u64,
    next_look: MonotonicNs,
    /// When the latest samples may be sent again, and whether a station waits for them.
    next_latest: MonotonicNs,
    is_latest_wanted: bool,
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
        let own_topics = OwnTopics::open(&ipc)?;
        let network = Network::open(&config, Side::Robot, end)?;
        let instance = fresh();
        tracing::info!(%robot, instance = %names::instance_name(instance), "the relay of this robot");
        let order_config = orders::Config {
            link_loss: config.commands.lost_after(),
            ..orders::Config::default()
        };
        let ros2 = Ros2Publisher::open(&network, &config.ros2, ipc.robot());
        let now = MonotonicNs::now();
        Ok(RobotSide {
            robot,
            instance,
            mailbox: Mailbox::open(&network, robot, &config)?,
            services: CarriedServices::new(instance, robot, ros2)?,
            stations: Stations::new(config.network.silent_after()),
            admission: Admission::new(robot, config.stations()),
            orders: orders::RobotOrders::new(order_config, fresh()),
            reaction: Reaction::open(&ipc, config.commands.link_loss)?,
            newcomers: network.watch(names::tell(robot, "*")),
            network,
            config,
            own_topics,
            samples_sent: 0,
            next_look: now,
            next_latest: now,
            is_latest_wanted: false,
            ipc,
        })
    }

    fn take_messages(&mut self, out: &mut Vec<Output>) {
        self.network.drained();
        let now = MonotonicNs::now();
        for ask in self.mailbox.asks(&mut self.admission, now) {
            self.answer(&ask, out);
        }
        for order in self.mailbox.orders(&mut self.admission, now) {
            self.order(&order.station, &order.message, out);
        }
    }

    fn answer(&mut self, ask: &Mail<Ask>, out: &mut Vec<Output>) {
        let Mail { station, at, .. } = ask;
        let reply = match &ask.message {
            Ask::Ping(ping) => Reply::Pong(self.pong(station, ping, *at, out)),
            Ask::Describe {
                robot_instance,
                index,
                from,
            } => {
                let part = self.services.describe(*index, *from);
                match part.filter(|_| *robot_instance == self.instance) {
                    Some(part) if self.admission.describes(part.bytes.len(), *at) => {
                        Reply::Part(part)
                    }
                    // The station asks again.
                    Some(_) | None => return,
                }
            }
        };
        self.reply(station, &reply);
    }

    fn pong(&mut self, station: &str, ping: &Ping, at: MonotonicNs, out: &mut Vec<Output>) -> Pong {
        let may_command = self.admission.may_command(station);
        let is_changed =
            self.stations
                .note_message(station, ping.station_instance, may_command, at);
        if is_changed {
            if self.admission.logs(at) {
                tracing::info!(station, may_command, "a station is there");
            }
            self.own_topics.hasten(at);
        }
        self.is_latest_wanted |= ping.wants_latest;
        let pace = &mut self.services.pace;
        match ping.has_all {
            true => pace.note_exchange(ping.station_instance, ping.late_ms, at),
            false => pace.note_describing(ping.station_instance, at),
        }
        let session = match may_command {
            true => self
                .orders
                .session_for(ping.station_instance, station, at, out),
            false => NOT_PERMITTED,
        };
        Pong {
            robot_instance: self.instance,
            station_instance: ping.station_instance,
            ping_sent_ns: ping.sent_ns,
            ping_suspended_ns: ping.suspended_ns,
            received_ns: at.0,
            sent_ns: MonotonicNs::now().0,
            suspended_ns: suspended_ns(),
            session,
            pages: self.services.pages(),
        }
    }

    fn order(&mut self, station: &str, order: &Order, out: &mut Vec<Output>) {
        let requests = self.services.requests_of(order.service);
        // Its service would refuse it, and until then it would be remembered.
        let len = requests
            .as_ref()
            .map(|requests| requests.client.schema().size());
        if len.is_some_and(|len| len != order.request.len()) {
            return tracing::debug!(
                station,
                "a request has another length than its service takes"
            );
        }
        let traits = requests.map(|requests| requests.fields.traits(&order.request));
        let traits = traits.unwrap_or_default();
        if !self.orders.order(order, traits, MonotonicNs::now(), out) {
            self.reply(station, &Reply::UnknownSession(order.session));
        }
    }

    fn reply(&self, station: &str, reply: &Reply) {
        self.network
            .send(&names::tell(self.robot, station), encode(reply));
    }

    /// Carries out what the core wants, and what follows from it.
    fn carry_out(&mut self, out: &mut Vec<Output>) {
        while !out.is_empty() {
            for output in std::mem::take(out) {
                match output {
                    Output::Send {
                        station,
                        service,
                        request_id,
                        is_repeat,
                        request,
                    } => {
                        let sent = match self.services.requests_of(service) {
                            Some(requests) => {
                                requests.send(request, is_repeat, names::origin(station))
                            }
                            None => Err(NotSent::NoServer),
                        };
                        if sent.is_ok() && !is_repeat {
                            let station = self.orders.name_of(station);
                            tracing::info!(request = request_id, station, "request");
                        }
                        if let Err(reason) = sent {
                            self.orders.not_sent(
                                service,
                                request_id,
                                reason,
                                MonotonicNs::now(),
                                out,
                            );
                        }
                    }
                    Output::GiveUp {
                        service,
                        request_id,
                    } => {
                        if let Some(requests) = self.services.requests_of(service) {
                            requests.client.give_up_one(request_id);
                        }
                    }
                    Output::Answer { station, answer } => {
                        if let Some(name) = self.orders.name_of(station) {
                            self.reply(name, &Reply::Answer(answer));
                        }
                    }
                    Output::LinkLost { station } => {
                        let name = self.orders.name_of(station);
                        tracing::warn!(station = name, "lost, with a request open");
                        if let Some(reaction) = &mut self.reaction {
                            reaction.act();
                        }
                    }
                }
            }
        }
    }

    fn take_reports(&mut self, now: MonotonicNs, out: &mut Vec<Output>) {
        let orders = &mut self.orders;
        for requests in self.services.all_requests() {
            let id = requests.id;
            let client = &mut requests.client;
            client.drain(|report| orders.report(id, report, now, out));
        }
    }

    fn publish(&mut self, now: MonotonicNs) {
        let orders = &self.orders;
        let rows = self
            .stations
            .rows(self.samples_sent, |instance| orders.counts_of(instance));
        let is_any_up = self.stations.is_any_up();
        let samples_bytes_per_s = self.services.pace.shown(now);
        self.own_topics.publish(is_any_up, now, |sample| {
            sample.published_ns = now.0;
            sample.count = rows.len() as u32;
            sample.samples_bytes_per_s = samples_bytes_per_s;
            for (slot, row) in sample.stations.iter_mut().zip(rows) {
                *slot = row;
            }
        });
    }
}

impl Process for RobotSide {
    type Error = WaitError;
    type Key = ();

    fn sources<'a>(&'a mut self, sources: &mut Sources<'a>) {
        self.own_topics.sources(sources);
        if let Some(reaction) = &mut self.reaction {
            sources.port(&mut reaction.client);
        }
        sources.descriptor((), self.network.descriptor());
        sources.descriptor((), self.services.ports().descriptor());
    }

    fn drain(&mut self, _wake: Wake) -> Result<(), WaitError> {
        let mut out = Vec::new();
        let now = MonotonicNs::now();
        if self.newcomers.take_arrival() {
            self.services.pace.note_newcomer(now);
        }
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
        for station in self.stations.tick(now) {
            if self.admission.logs(now) {
                tracing::warn!(station, "a station is silent");
            }
            self.own_topics.hasten(now);
        }
        if self.is_latest_wanted && now >= self.next_latest {
            self.services.want_latest();
            self.is_latest_wanted = false;
            self.next_latest = now + LATEST_PERIOD;
        }
        if now >= self.own_topics.deadline() {
            self.publish(now);
        }
        Ok(())
    }

    fn deadline(&self) -> Option<MonotonicNs> {
        let fixed = self.next_look.min(self.own_topics.deadline());
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

/// What the robot does when a station is lost whose request is under way: it holds or lands, as it was configured.
struct Reaction {
    link_loss: LinkLoss,
    client: Client<MovementData>,
}

impl Reaction {
    /// `None` if the movement is to go on. It fails if there is a bridge, and its service cannot be opened.
    fn open(ipc: &Ipc, link_loss: LinkLoss) -> Result<Option<Reaction>, OpenError> {
        match link_loss {
            LinkLoss::Continue => Ok(None),
            LinkLoss::Hold | LinkLoss::Land => Ok(Some(Reaction {
                link_loss,
                client: ipc.client()?,
            })),
        }
    }

    /// Ends the movement that is under way.
    fn act(&mut self) {
        let id = fresh_request_id();
        let request = match self.link_loss {
            LinkLoss::Land => MovementData::land(id).preempting(),
            LinkLoss::Hold | LinkLoss::Continue => MovementData::hold(id),
        };
        tracing::warn!(reaction = ?self.link_loss, "the movement is ended");
        if let Err(error) = self.client.send(&request) {
            tracing::error!(%error, "the movement could not be ended");
        }
    }

    /// Takes what the bridge reports.
    fn drain(&mut self) {
        self.client.drain(|report| {
            if report.is_final() {
                tracing::warn!(stage = ?report.stage(), reason = ?report.reason(), "the movement was ended");
            }
        });
    }
}
