//! The station's side: it provides the services of robots on this machine, publishes what comes from them, and sends
//! them the requests of clients.
//!
//! [`RobotLink`] is how the link to one robot is, [`Mirrors`] are its services here,
//! [`orders::station`](crate::orders::station) decides about requests; here bytes move.

pub mod catalog;
pub mod link;
mod mirrors;
pub mod moments;
mod twins;

use std::os::fd::BorrowedFd;
use std::time::Duration;

use ipc_types::code::{Reason, Stage};
use ipc_types::payload::{RelayLink, RequestReport, ascii_bytes};
use ipc_types::waiter::SAFETY_BOUND;
use ipc_types::{Domain, Ipc, MonotonicNs, PortSet, RobotId, WaitError, Wake};
use module_kit::process::{Process, Sources};

use crate::Failure;
use crate::config::{Config, RemoteRobot, Side};
use crate::message::{
    Ask, MAX_REPLY_BYTES, Part, Pong, Reply, SampleHeader, Unreadable, decode, encode,
};
use crate::names::{self, instance_name};
use crate::network::{Inbox, MAX_MESSAGE_BYTES, Network, Room};
use crate::orders::message::{NOT_PERMITTED, RelayVerdict, request_id};
use crate::orders::station::{ClientRequest, Origin, Output, StationOrders};
use crate::own_topics::OwnTopics;
use crate::random::{fresh, suspended_ns};
use catalog::Question;
pub use link::RobotLink;
pub use mirrors::Mirrors;
use mirrors::Taken;
use moments::{Moments, translate_report};

/// What wakes the station's side.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum WakeSource {
    /// A port of a robot's services on this machine.
    #[default]
    Port,
    /// Something from a robot.
    Network,
}

/// The station's side of the relay.
pub struct StationSide {
    network: Network,
    remotes: Vec<Remote>,
    /// The ports of all robots.
    ports: PortSet,
    /// When all ports are looked at though none has woken the process, because a wake-up can be lost.
    next_look: MonotonicNs,
}

impl StationSide {
    /// Opens the ports and the network. `robots` are those of the configuration, or the one of the command line.
    ///
    /// # Errors
    ///
    /// Another relay provides one of the robots here, or shared memory or the network cannot be used.
    pub fn open(
        domain: &Domain,
        robots: &[RemoteRobot],
        name: &str,
        config: &Config,
        end: BorrowedFd<'_>,
    ) -> Result<StationSide, Failure> {
        let mut joined = Vec::new();
        for robot in robots {
            joined.push((
                *robot,
                Ipc::join(domain, RobotId::from(robot.here()), "relay")?,
            ));
        }
        let network = Network::open(config, Side::Station, end)?;
        let ports = PortSet::new()?;
        let mut remotes = Vec::new();
        for (robot, ipc) in joined {
            let remote = Remote::open(robot, ipc, name, config, &network)?;
            for port in remote.ports() {
                ports.add(port)?;
            }
            remotes.push(remote);
        }
        Ok(StationSide {
            network,
            remotes,
            ports,
            next_look: MonotonicNs(0),
        })
    }
}

impl Process for StationSide {
    type Error = WaitError;
    type Key = WakeSource;

    fn sources<'a>(&'a mut self, sources: &mut Sources<'a, WakeSource>) {
        sources.descriptor(WakeSource::Network, self.network.descriptor());
        sources.descriptor(WakeSource::Port, self.ports.descriptor());
    }

    fn drain(&mut self, wake: Wake<WakeSource>) -> Result<(), WaitError> {
        self.network.drained();
        // A look at a port takes two system calls, and a sample of one robot would pay for the ports of all.
        let now = MonotonicNs::now();
        let looks = !wake.is_only(WakeSource::Network) || now >= self.next_look;
        if looks {
            self.next_look = now + SAFETY_BOUND;
        }
        for remote in &mut self.remotes {
            remote.step(&self.network, MonotonicNs::now(), looks);
        }
        Ok(())
    }

    fn deadline(&self) -> Option<MonotonicNs> {
        self.remotes.iter().map(Remote::deadline).min()
    }
}

/// Samples that may wait: 5 s of ten topics at 50 a second, and not more bytes than a machine can spare for each robot.
/// The longest sample is the longest that Zenoh puts together.
const SAMPLES: Room = Room {
    messages: 2500,
    bytes: 32 * 1024 * 1024,
    longest: MAX_MESSAGE_BYTES,
};

/// Answers that may wait: the parts of descriptions are the long ones, of which one is asked for at a time.
const ANSWERS: Room = Room {
    messages: 512,
    bytes: 512 * MAX_REPLY_BYTES,
    longest: MAX_REPLY_BYTES,
};

/// One robot of a station.
struct Remote {
    robot: RemoteRobot,
    station: String,
    link: RobotLink,
    mirrors: Mirrors,
    orders: StationOrders,
    /// When requests were issued.
    moments: Moments,
    /// Deadline of a request that says neither when it was issued nor until when it may begin.
    default_deadline: Duration,
    endpoints: String,
    open_timeout_s: f64,
    replies: Inbox,
    samples: Inbox,
    topics: OwnTopics<RelayLink>,
    counts: LinkCounts,
    /// Why requests are refused, as it was published.
    shown_refusal: Reason,
    ipc: Ipc,
}

/// What was sent and received.
#[derive(Clone, Copy, Debug, Default)]
struct LinkCounts {
    bytes_received: u64,
    bytes_sent: u64,
    orders_sent: u64,
    orders_repeated: u64,
    orders_unknown: u64,
    unreadable: Unreadable,
}

impl Remote {
    /// Opens the ports that are there before anything of the robot is known.
    fn open(
        robot: RemoteRobot,
        ipc: Ipc,
        station: &str,
        config: &Config,
        network: &Network,
    ) -> Result<Remote, Failure> {
        let now = MonotonicNs::now();
        Ok(Remote {
            station: station.to_owned(),
            link: RobotLink::new(fresh(), config.network.silent_after(), now),
            mirrors: Mirrors::new()?,
            orders: StationOrders::new(config.commands.unknown_after()),
            moments: Moments::default(),
            default_deadline: config.commands.deadline(),
            endpoints: [&config.station.connect[..], &config.station.listen[..]]
                .concat()
                .join(" "),
            open_timeout_s: config.network.open_timeout_ms as f64 / 1e3,
            replies: network.receive(&names::tell(robot.number, station), Vec::new(), ANSWERS)?,
            samples: network.receive(&names::topics(robot.number), Vec::new(), SAMPLES)?,
            topics: OwnTopics::open(&ipc)?,
            counts: LinkCounts::default(),
            shown_refusal: Reason::None,
            robot,
            ipc,
        })
    }

    /// What to wait for.
    fn ports(&self) -> [Result<BorrowedFd<'_>, WaitError>; 3] {
        let [state, link] = self.topics.ports();
        [state, link, Ok(self.mirrors.ports().descriptor())]
    }

    /// Takes what has come, and does what is due. Ports are looked at when one may have woken the process (`looks`).
    fn step(&mut self, network: &Network, now: MonotonicNs, looks: bool) {
        let mut out = Vec::new();
        self.take_samples();
        self.take_replies(&mut out);
        let was_shown = self.link.shown_state();
        self.link.note_complete();
        if self.link.shown_state() != was_shown {
            self.topics.hasten(now);
        }
        if self.link.tick(now) {
            tracing::warn!(robot = %self.robot.number, "the link to the robot is down");
            self.topics.hasten(now);
        }
        self.note_refusal(now);
        if self.link.take_hint(now) {
            tracing::warn!(
                robot = %self.robot.number,
                over = self.endpoints,
                "no answer of the robot has come for 10 s: is its relay running, are address and protocol right, is the port open? Over a VPN or a \
                 tunnel large packets may be dropped: `ping -M do -s 1372` to the robot shows it (docs/network.md, Large packets)"
            );
        }
        if looks {
            self.take_requests(now, &mut out);
            self.topics.service();
        }
        self.orders.tick(now, &mut out);
        self.carry_out(&out, network, now);
        if let Some(ping) = self.link.ping(MonotonicNs::now(), suspended_ns()) {
            self.ask(network, &Ask::Ping(ping));
        }
        if let Some((robot_instance, Question { index, from })) = self.link.question(now) {
            let ask = Ask::Describe {
                robot_instance,
                index,
                from,
            };
            self.ask(network, &ask);
        }
        if now >= self.topics.deadline() {
            self.publish(now);
        }
    }

    /// When something is to be done though nothing comes.
    fn deadline(&self) -> MonotonicNs {
        let orders = self.orders.deadline().unwrap_or(MonotonicNs(u64::MAX));
        self.link.deadline().min(orders).min(self.topics.deadline())
    }

    fn ask(&mut self, network: &Network, ask: &Ask) {
        let message = encode(ask);
        self.counts.bytes_sent += message.len() as u64;
        network.send(&names::ask(self.robot.number, &self.station), message);
    }

    fn take_samples(&mut self) {
        let (link, mirrors, counts) = (&mut self.link, &mut self.mirrors, &mut self.counts);
        self.samples.drain(|incoming| {
            counts.bytes_received += (incoming.payload.len() + incoming.attachment.len()) as u64;
            let header = match decode::<SampleHeader>(incoming.attachment) {
                Ok(header) => header,
                Err(error) => return counts.unreadable.note(incoming.key, &error),
            };
            // A sample of another instance of the robot's relay waits for its first answer, which may have another
            // clock.
            if !link.is_up() || link.robot_instance() != Some(header.robot_instance) {
                return;
            }
            let key = names::last(incoming.key);
            if mirrors.publish(key, &header, incoming.payload, link.clock(), incoming.at) {
                link.note_sample();
            }
        });
    }

    fn take_replies(&mut self, out: &mut Vec<Output>) {
        let mut replies = Vec::new();
        let counts = &mut self.counts;
        self.replies.drain(|incoming| {
            counts.bytes_received += incoming.payload.len() as u64;
            match decode::<Reply>(incoming.payload) {
                Ok(reply) => replies.push((reply, incoming.at)),
                Err(error) => counts.unreadable.note(incoming.key, &error),
            }
        });
        for (reply, at) in replies {
            match reply {
                Reply::Pong(pong) => self.take_pong(&pong, at, out),
                Reply::Part(part) => self.take_part(&part),
                Reply::Answer(answer) => self.orders.answer(&answer, at, out),
                // The robot gives it with each answer to a ping: another one of its number does not know it.
                Reply::UnknownSession(session) if session == self.link.session() => {}
                Reply::UnknownSession(session) => self.orders.unknown_session(session),
            }
        }
    }

    fn take_pong(&mut self, pong: &Pong, at: MonotonicNs, out: &mut Vec<Output>) {
        let update = self.link.take(pong, at, suspended_ns());
        if pong.session != NOT_PERMITTED && self.link.is_of_robot(pong) {
            self.orders.session(pong.session, at, out);
        }
        self.orders.round_trip(self.link.round_trip());
        if update.is_up {
            tracing::info!(robot = %self.robot.number, "the link to the robot is up");
            if self.robot.command && !self.link.may_command() {
                tracing::warn!(
                    robot = %self.robot.number,
                    station = self.station,
                    "this station may not command: its name is not in `commands.stations` of the robot's relay"
                );
            }
            self.topics.hasten(at);
        }
    }

    /// Takes note whether the robot takes requests.
    fn note_refusal(&mut self, now: MonotonicNs) {
        let refusal = self.refusal();
        if std::mem::replace(&mut self.shown_refusal, refusal) == refusal {
            return;
        }
        self.topics.hasten(now);
        if let Some([first, second]) = self.link.two_robots() {
            tracing::error!(
                robot = %self.robot.number,
                first = %instance_name(first),
                second = %instance_name(second),
                "two robots answer under this number: the telemetry of the first is shown, and neither is ordered until one of them \
                 is silent for ten seconds. The log of each robot's relay has its instance: give one another number"
            );
        }
    }

    /// Why the robot takes no requests of the clients here, if they may send any.
    fn refusal(&self) -> Reason {
        match (self.link.refusal(), self.robot.command) {
            (Reason::RelayTwoRobots, _) => Reason::RelayTwoRobots,
            (refusal, true) => refusal,
            (_, false) => Reason::None,
        }
    }

    fn take_part(&mut self, part: &Part) {
        for service in self.link.take_part(part) {
            if self.robot.command || !service.takes_requests {
                self.mirrors.provide(service, &self.ipc);
            }
        }
    }

    fn take_requests(&mut self, now: MonotonicNs, out: &mut Vec<Output>) {
        let (mut taken, mut gone) = (Vec::new(), Vec::new());
        self.mirrors
            .serve(|request| taken.push(request), |handle| gone.push(handle));
        for handle in gone {
            self.orders.give_up(handle, out);
        }
        for mut request in taken {
            let verdict = match self.link.refusal() {
                Reason::RelayTwoRobots => Some(RelayVerdict::TwoRobots),
                Reason::RelayNotPermitted if self.link.is_up() => Some(RelayVerdict::NotPermitted),
                _ => None,
            };
            if let Some(verdict) = verdict {
                out.push(refusal(&request, verdict, now));
                continue;
            }
            let expires = self.moments.translate(
                &mut request.bytes,
                &request.fields,
                self.link.clock(),
                self.default_deadline,
                now,
            );
            let is_up = self.link.is_up() && expires.is_some();
            let request = ClientRequest {
                handle: request.handle,
                path_id: request.fields.path_id(&request.bytes),
                service: request.service,
                expires: expires.unwrap_or_default(),
                bytes: request.bytes,
            };
            self.counts.orders_sent += 1;
            self.orders.request(request, is_up, now, out);
        }
    }

    fn carry_out(&mut self, out: &[Output], network: &Network, now: MonotonicNs) {
        for output in out {
            match output {
                Output::Send(order) => {
                    let message = encode(order);
                    self.counts.bytes_sent += message.len() as u64;
                    self.counts.orders_repeated += u64::from(order.is_repeat);
                    network.send(&names::order(self.robot.number, &self.station), message);
                }
                Output::Report {
                    handle,
                    report,
                    origin,
                } => {
                    let mut report = *report;
                    if *origin == Origin::Robot {
                        translate_report(&mut report, self.link.clock(), now);
                    }
                    let is_unknown = report.stage() == Some(Stage::Unknown);
                    self.counts.orders_unknown += u64::from(is_unknown);
                    self.mirrors.report(*handle, &report);
                }
            }
        }
    }

    fn publish(&mut self, now: MonotonicNs) {
        self.mirrors.retry(&self.ipc);
        let row = self.row(now);
        self.topics
            .publish(self.link.is_up(), now, |sample| *sample = row);
    }

    /// How the link is, as it is published.
    fn row(&self, now: MonotonicNs) -> RelayLink {
        let samples = self.mirrors.counts();
        let mut row = RelayLink {
            published_ns: now.0,
            samples_received: samples.received,
            samples_lost_on_air: samples.lost_on_air,
            samples_lost_in_relay: samples.lost_in_relay,
            samples_left_out: samples.left_out,
            bytes_received: self.counts.bytes_received,
            bytes_sent: self.counts.bytes_sent,
            orders_sent: self.counts.orders_sent,
            orders_repeated: self.counts.orders_repeated,
            orders_unknown: self.counts.orders_unknown,
            robot: self.robot.number.get(),
            orders_open: self.orders.open() as u32,
            refusal: self.refusal().code(),
            open_timeout_s: self.open_timeout_s,
            link: ascii_bytes(&self.endpoints),
            station: ascii_bytes(&self.station),
            ..RelayLink::default()
        };
        self.link.fill(&mut row, now);
        row
    }
}

/// The report for a client whose request the station does not send.
fn refusal(request: &Taken, verdict: RelayVerdict, now: MonotonicNs) -> Output {
    let id = request_id(&request.bytes);
    let report = RequestReport {
        path_id: request.fields.path_id(&request.bytes),
        ..verdict.report(id, now)
    };
    Output::Report {
        handle: request.handle,
        report,
        origin: Origin::Station,
    }
}
