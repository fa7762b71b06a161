//! The relays: that of each robot and those of the stations, around the cores that run in flight; and the network
//! between them, which loses, doubles, delays and reorders.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use ipc_types::code::{Reason, Stage};
use ipc_types::payload::{
    HeroTelemetry, ModuleControl, MovementData, ParameterRequest, RequestReport, SharedStruct,
};
use ipc_types::{MonotonicNs, Schema};
use relay::message::{Ping, Pong, SampleHeader};
use relay::names;
use relay::orders::message::{Answer, NOT_PERMITTED, Order as RelayOrder, WINDOW};
use relay::orders::robot::{self as robot_orders, NotSent, ORPHANS, RobotOrders, SESSIONS};
use relay::orders::station::{self as station_orders, ClientRequest, OPEN_ORDERS, StationOrders};
use relay::pace::Pace;
use relay::request::RequestFields;
use relay::station::RobotLink;
use relay::station::moments::{Moments, translate_report, translate_sample};
use relay::telemetry::{SampleReceiver, SampleSender, Selection};

use crate::beliefs::before_ms;
use crate::judge::Ordered;
use crate::life::{EPOCH_MS, Life, MS};
use crate::plant::Plant;
use crate::request::{COPY, Request};
use crate::robot::Robot;
use crate::script::{Dice, LINK_LOSS_MS, LinkLoss, StationPlan};

/// A link without an answer for so long is down.
const SILENT_AFTER: Duration = Duration::from_millis(2_500);
/// Without an answer of the robot for so long its client is told that the outcome is unknown.
const GIVE_UP: Duration = Duration::from_secs(4);
/// Requests of one client that one service has open.
const OUTSTANDING: usize = 8;
/// A topic at a station has at most so many samples a second.
const SAMPLE_PERIOD: Duration = Duration::from_millis(100);

/// What the requests of the services have.
pub struct Layouts {
    fields: [RequestFields; 3],
    moments: Vec<usize>,
}

impl Layouts {
    pub fn new() -> Layouts {
        Layouts {
            fields: [
                RequestFields::of(&Schema::of::<MovementData>()),
                RequestFields::of(&Schema::of::<ModuleControl>()),
                RequestFields::of(&Schema::of::<ParameterRequest>()),
            ],
            moments: Schema::of::<HeroTelemetry>().moments(),
        }
    }
}

/// A message between the relay of a robot and that of a station.
#[derive(Clone)]
pub enum Message {
    Ping(Ping),
    Order(RelayOrder),
    Pong(Pong),
    Answer(Answer),
    UnknownSession(u64),
    Sample(SampleHeader, Vec<u8>),
}

/// Where a message goes.
#[derive(Clone, Copy, PartialEq)]
pub enum End {
    Robot,
    Station,
}

struct Letter {
    robot: usize,
    station: usize,
    to: End,
    message: Message,
}

/// All links between robots and stations.
pub struct Network {
    pub now_ms: u64,
    count: u64,
    letters: BTreeMap<(u64, u64), Letter>,
    dice: Dice,
    plans: Vec<StationPlan>,
    pub outage_until: Vec<u64>,
}

impl Network {
    pub fn new(seed: u64, plans: &[StationPlan]) -> Network {
        Network {
            now_ms: 0,
            count: 0,
            letters: BTreeMap::new(),
            dice: Dice::new(seed, 12),
            plans: plans.to_vec(),
            outage_until: vec![0; plans.len()],
        }
    }

    /// Nothing is lost from now on.
    pub fn heal(&mut self) {
        self.outage_until.fill(0);
        for plan in &mut self.plans {
            plan.loses_one_in = 0;
        }
    }

    /// Whether messages of this station may be lost now.
    pub fn is_bad(&self, station: usize) -> bool {
        self.plans[station].loses_one_in > 0 || self.outage_until[station] > self.now_ms
    }

    pub fn carry(&mut self, robot: usize, station: usize, to: End, message: Message) {
        let plan = self.plans[station];
        let dice = &mut self.dice;
        let is_lost = plan.loses_one_in > 0 && dice.once_in(plan.loses_one_in);
        if is_lost || self.outage_until[station] > self.now_ms {
            return;
        }
        let is_double = plan.doubles_one_in > 0 && dice.once_in(plan.doubles_one_in);
        for _ in 0..1 + u32::from(is_double) {
            let mut delay_ms = dice.count(0, plan.delay_ms);
            if dice.once_in(20) {
                delay_ms *= 10;
            }
            self.count += 1;
            let letter = Letter {
                robot,
                station,
                to,
                message: message.clone(),
            };
            // It is read in the next step at the earliest.
            let at = self.now_ms + delay_ms.max(1);
            self.letters.insert((at, self.count), letter);
        }
    }

    /// What has come by now.
    pub fn take(&mut self) -> impl Iterator<Item = (usize, usize, End, Message)> + use<> {
        let later = self.letters.split_off(&(self.now_ms + 1, 0));
        let due = std::mem::replace(&mut self.letters, later);
        let due = due.into_values();
        due.map(|letter| (letter.robot, letter.station, letter.to, letter.message))
    }
}

struct Open {
    service: u64,
    request_id: u64,
}

/// The relay of a robot.
pub struct RobotRelay {
    pub life: Life,
    pub process: u32,
    plant: Plant,
    link_loss: LinkLoss,
    instance: u64,
    orders: RobotOrders,
    open: Vec<Open>,
    inbox: VecDeque<(usize, Message)>,
    reports: VecDeque<RequestReport>,
    samples: SampleSender,
    pace: Pace,
    /// Which station an instance is.
    stations: BTreeMap<u64, usize>,
    next_id: u64,
}

/// The processes of relays have numbers from here on: a hundred for each robot.
const FIRST_PROCESS: u32 = 10_000;
/// The requests that a relay makes by itself have ids from here on.
const OWN_IDS: u64 = 1 << 40;

/// What a relay of this robot calls itself, which counts the processes that were there.
fn instance_of(robot: usize, count: u64) -> u64 {
    100 * (1 + robot as u64) + count
}

impl RobotRelay {
    pub fn new(robot: usize, instance: u64, plant: Plant, link_loss: LinkLoss) -> RobotRelay {
        let config = robot_orders::Config {
            link_loss: (link_loss != LinkLoss::Continue && plant != Plant::NoLinkLoss)
                .then_some(Duration::from_millis(LINK_LOSS_MS)),
            ..robot_orders::Config::default()
        };
        RobotRelay {
            life: Life::default(),
            process: FIRST_PROCESS + 100 * robot as u32 + instance as u32,
            plant,
            link_loss,
            instance,
            orders: RobotOrders::new(config, 1_000 * instance + robot as u64),
            open: Vec::new(),
            inbox: VecDeque::new(),
            reports: VecDeque::new(),
            samples: SampleSender::new(
                instance_of(robot, instance),
                Selection::Newest(SAMPLE_PERIOD),
            ),
            pace: Pace::default(),
            stations: BTreeMap::new(),
            next_id: OWN_IDS + 1_000_000 * instance,
        }
    }

    /// The one that begins after it was killed.
    pub fn next(&self, robot: usize) -> RobotRelay {
        RobotRelay::new(robot, self.instance + 1, self.plant, self.link_loss)
    }

    pub fn receive(&mut self, station: usize, message: Message) {
        self.inbox.push_back((station, message));
    }

    pub fn report(&mut self, report: RequestReport) {
        self.reports.push_back(report);
    }

    /// A sample is in the queue of its subscriber.
    pub fn sample(&mut self, hero: &HeroTelemetry) {
        self.samples.take(hero.bytes());
    }

    /// It is awake: takes what has come, and does what is due.
    pub fn step(&mut self, robot: &mut Robot, network: &mut Network, layouts: &Layouts) {
        let now = robot.host();
        let stations: Vec<usize> = self.stations.values().copied().collect();
        let mut sent = Vec::new();
        self.samples.send(now, 0, &mut self.pace, |header, sample| {
            sent.push((*header, sample.to_vec()));
        });
        for (header, sample) in sent {
            for station in &stations {
                let message = Message::Sample(header, sample.clone());
                network.carry(robot.index, *station, End::Station, message);
            }
        }
        let mut out = Vec::new();
        while let Some((station, message)) = self.inbox.pop_front() {
            match message {
                Message::Ping(ping) => {
                    self.stations.retain(|_, other| *other != station);
                    self.stations.insert(ping.station_instance, station);
                    robot.judge.station_heard(station);
                    if ping.wants_latest {
                        self.samples.want_latest();
                    }
                    let pong = self.pong(station, &ping, robot, &mut out);
                    network.carry(robot.index, station, End::Station, Message::Pong(pong));
                }
                Message::Order(order) => {
                    robot.judge.station_heard(station);
                    let fields = &layouts.fields[order.service as usize];
                    let traits = fields.traits(&order.request);
                    if !self.orders.order(&order, traits, now, &mut out) {
                        let unknown = Message::UnknownSession(order.session);
                        network.carry(robot.index, station, End::Station, unknown);
                    } else if self.plant == Plant::RelayCopies {
                        self.copy(&order, robot);
                    }
                }
                _ => {}
            }
            self.carry_out(&mut out, robot, network, layouts);
        }
        while let Some(report) = self.reports.pop_front() {
            if self.plant == Plant::RelayIsDeaf && report.request_id.is_multiple_of(3) {
                continue;
            }
            let mut open = self.open.iter();
            let Some(place) = open.position(|open| open.request_id == report.request_id) else {
                continue;
            };
            let service = self.open[place].service;
            if report.is_final() {
                self.open.remove(place);
            }
            self.orders.report(service, &report, now, &mut out);
        }
        self.orders.tick(now, &mut out);
        self.carry_out(&mut out, robot, network, layouts);
        let bound = SESSIONS * WINDOW as usize + ORPHANS;
        if self.orders.remembered() > bound || self.open.len() > 3 * OUTSTANDING {
            let text = "the relay of a robot remembers more than its bound";
            robot.judge.fail(text.to_owned());
        }
    }

    fn pong(
        &mut self,
        station: usize,
        ping: &Ping,
        robot: &Robot,
        out: &mut Vec<robot_orders::Output>,
    ) -> Pong {
        let now = robot.host();
        let name = format!("gcs-{station}");
        let instance = ping.station_instance;
        let session = self.orders.session_for(instance, &name, now, out);
        Pong {
            robot_instance: instance_of(robot.index, self.instance),
            station_instance: ping.station_instance,
            ping_sent_ns: ping.sent_ns,
            ping_suspended_ns: ping.suspended_ns,
            received_ns: now.0,
            sent_ns: now.0,
            suspended_ns: robot.slept_ms * MS,
            session,
            pages: 0,
        }
    }

    /// A planted fault: an order is passed on twice, once as a request of its own.
    fn copy(&self, order: &RelayOrder, robot: &mut Robot) {
        if let Some(Request::Movement(data)) = Request::read(order.service, &order.request)
            && let Some(number) = robot.judge.order_of(data.request_id)
        {
            let request = Request::Movement(data);
            let copy = request.copy(Plant::CopyIsNew).unwrap_or(request);
            robot.send(robot.now_ms + 200, number, self.process, copy);
        }
    }

    fn carry_out(
        &mut self,
        out: &mut Vec<robot_orders::Output>,
        robot: &mut Robot,
        network: &mut Network,
        layouts: &Layouts,
    ) {
        while !out.is_empty() {
            for output in std::mem::take(out) {
                match output {
                    robot_orders::Output::Send {
                        station,
                        service,
                        request_id,
                        is_repeat,
                        mut request,
                    } => {
                        let fields = &layouts.fields[service as usize];
                        fields.set_origin(&mut request, names::origin(station));
                        if is_repeat {
                            fields.set_repeat(&mut request);
                        }
                        if let Err(why) = self.send(service, &request, robot) {
                            let now = robot.host();
                            self.orders.not_sent(service, request_id, why, now, out);
                        }
                    }
                    robot_orders::Output::GiveUp { .. }
                        if self.plant == Plant::RelayKeepsGivenUp => {}
                    robot_orders::Output::GiveUp { request_id, .. } => {
                        self.open.retain(|open| open.request_id != request_id);
                        robot.give_up(self.process, request_id);
                    }
                    robot_orders::Output::Answer { station, answer } => {
                        if let Some(station) = self.stations.get(&station) {
                            let answer = Message::Answer(answer);
                            network.carry(robot.index, *station, End::Station, answer);
                        }
                    }
                    robot_orders::Output::LinkLost { .. } => self.react(robot),
                }
            }
        }
    }

    fn send(&mut self, service: u64, request: &[u8], robot: &mut Robot) -> Result<(), NotSent> {
        if !robot.bridge_life.is_up() {
            return Err(NotSent::NoServer);
        }
        let open = self.open.iter().filter(|open| open.service == service);
        if open.count() >= OUTSTANDING {
            return Err(NotSent::Full);
        }
        let Some(request) = Request::read(service, request) else {
            robot.judge.fail("a request that cannot be read".to_owned());
            return Ok(());
        };
        let Some(order) = robot.judge.order_of(request.id()) else {
            let text = format!("request {} is for another robot", request.id());
            robot.judge.fail(text);
            return Ok(());
        };
        robot.judge.carried_by(order, self.process);
        // A moment of before a suspension is said to be earlier than it was.
        let ordered = &robot.judge.orders[order];
        let judged = judge_moment(&request, ordered);
        if let (Err(what), true) = (judged, ordered.slept_ms == robot.slept_ms) {
            robot.judge.fail(what);
        }
        self.open.push(Open {
            service,
            request_id: request.id(),
        });
        robot.send(robot.now_ms, order, self.process, request);
        Ok(())
    }

    /// A station is lost with a request open: the movement ends.
    fn react(&mut self, robot: &mut Robot) {
        self.next_id += 1;
        let what = match self.link_loss {
            LinkLoss::Land => MovementData::land(self.next_id).preempting(),
            _ => MovementData::hold(self.next_id),
        };
        let request = Request::Movement(MovementData {
            issued_ns: robot.host().0,
            ..what
        });
        if robot.bridge_life.is_up() {
            let order = robot
                .judge
                .own_order(self.next_id, self.link_loss == LinkLoss::Land);
            robot.send(robot.now_ms, order, self.process, request);
        }
    }
}

/// The true moment of an order lies within what its request says of it, by the robot's clock.
fn judge_moment(request: &Request, ordered: &Ordered) -> Result<(), String> {
    let (issued_ns, within_ns) = match request {
        Request::Movement(data) => (data.issued_ns, data.issued_within_ns),
        Request::Control(data) => (data.issued_ns, data.issued_within_ns),
        Request::Parameter(data) => (data.issued_ns, data.issued_within_ns),
    };
    let true_ns = (EPOCH_MS + ordered.true_ms - ordered.slept_ms) * MS;
    let is_within = issued_ns <= true_ns && true_ns <= issued_ns + u64::from(within_ns);
    match is_within || ordered.is_vague {
        true => Ok(()),
        false => Err(format!(
            "request {} was issued at {true_ns} ns, and says {issued_ns} + {within_ns}",
            request.id()
        )),
    }
}

/// A request of a program at a station.
struct Client {
    process: u32,
    request_id: u64,
    handle: u64,
}

/// One robot of a station.
struct Remote {
    link: RobotLink,
    orders: StationOrders,
    moments: Moments,
    receiver: SampleReceiver,
    inbox: VecDeque<Message>,
    clients: Vec<Client>,
    last_sample: u64,
    /// The robot has slept, and has not told so yet: its clock is not what is believed.
    is_stale: bool,
}

/// The machine of a station with its relay.
pub struct Station {
    pub index: usize,
    pub life: Life,
    plant: Plant,
    plan: StationPlan,
    instance: u64,
    remotes: Vec<Remote>,
    next_handle: u64,
}

impl Station {
    pub fn new(
        index: usize,
        plan: StationPlan,
        instance: u64,
        (robots, plant): (usize, Plant),
        now_ms: u64,
    ) -> Station {
        let mut station = Station {
            index,
            life: Life::default(),
            plant,
            plan,
            instance,
            remotes: Vec::new(),
            next_handle: 1,
        };
        let now = station.clock(now_ms);
        let link_instance = 1 + index as u64 + 100 * instance;
        station.remotes.extend((0..robots).map(|_| Remote {
            link: RobotLink::new(link_instance, SILENT_AFTER, now),
            orders: StationOrders::new(GIVE_UP),
            moments: Moments::default(),
            receiver: SampleReceiver::default(),
            inbox: VecDeque::new(),
            clients: Vec::new(),
            last_sample: 0,
            is_stale: false,
        }));
        station
    }

    /// The one that begins after it was killed.
    pub fn next(&self, now_ms: u64) -> Station {
        let world = (self.remotes.len(), self.plant);
        Station::new(self.index, self.plan, self.instance + 1, world, now_ms)
    }

    /// The monotonic clock of its machine.
    pub fn clock(&self, now_ms: u64) -> MonotonicNs {
        let gained = now_ms as i64 * self.plan.drift_ppb / 1_000;
        let at = (self.plan.clock_s * 1_000 + now_ms) * MS;
        MonotonicNs((at as i64 + gained) as u64)
    }

    pub fn receive(&mut self, robot: usize, message: Message) {
        self.remotes[robot].inbox.push_back(message);
    }

    /// The relay ends: its clients know.
    pub fn dies(&mut self, robots: &mut [Robot]) {
        for (remote, robot) in self.remotes.iter_mut().zip(robots) {
            for client in remote.clients.drain(..) {
                robot.judge.relay_gone(client.request_id);
            }
        }
    }

    /// A robot sleeps: until its next answer nobody here can know.
    pub fn robot_sleeps(&mut self, robot: usize) {
        self.remotes[robot].is_stale = true;
    }

    /// Whether the clock of a robot is believed to be what it is not.
    pub fn is_stale(&self, robot: usize) -> bool {
        self.remotes[robot].is_stale
    }

    /// The process of a program here has ended.
    pub fn client_died(&mut self, process: u32, robots: &mut [Robot], network: &mut Network) {
        for (index, robot) in robots.iter_mut().enumerate() {
            let mut out = Vec::new();
            let remote = &mut self.remotes[index];
            for client in remote
                .clients
                .extract_if(.., |client| client.process == process)
            {
                robot.judge.client_gone(client.request_id);
                if self.plant != Plant::StationKeepsClient {
                    remote.orders.give_up(client.handle, &mut out);
                }
            }
            self.carry_out(out, robot, network);
        }
    }

    /// A program here sends a request.
    pub fn request(
        &mut self,
        process: u32,
        request: Request,
        robot: &mut Robot,
        (network, layouts): (&mut Network, &Layouts),
    ) {
        if !self.life.is_up() {
            return robot.judge.client_gone(request.id());
        }
        let now = self.clock(robot.now_ms);
        let handle = self.next_handle;
        self.next_handle += 1;
        let remote = &mut self.remotes[robot.index];
        let service = request.service();
        let fields = layouts.fields[service as usize];
        let mut bytes = request.bytes();
        if self.plant == Plant::StationStamps {
            fields.set_issued(&mut bytes, now, 0);
        }
        if self.plant == Plant::StationDropsMoment {
            fields.set_begin_by(&mut bytes, now + Duration::from_secs(60));
        }
        let deadline = Duration::from_secs(2);
        let clock = remote.link.clock();
        let expires = remote
            .moments
            .translate(&mut bytes, &fields, clock, deadline, now);
        if self.plant == Plant::StationIsOld
            && let Some(at) = fields.issued(&bytes)
        {
            let before = MonotonicNs(at.0 - 6_000 * MS);
            fields.set_issued(&mut bytes, before, 0);
        }
        if self.plant == Plant::NoUncertainty
            && let Some(at) = fields.issued(&bytes)
        {
            fields.set_issued(&mut bytes, at, 0);
        }
        let is_up = remote.link.is_up() && expires.is_some();
        remote.clients.push(Client {
            process,
            request_id: request.id() % COPY,
            handle,
        });
        let path_id = fields.path_id(&bytes);
        let mut out = Vec::new();
        let client_request = ClientRequest {
            handle,
            path_id,
            service,
            expires: expires.unwrap_or_default(),
            bytes,
        };
        remote.orders.request(client_request, is_up, now, &mut out);
        self.carry_out(out, robot, network);
    }

    /// Its relay is awake: takes what has come, and does what is due.
    pub fn step(&mut self, robots: &mut [Robot], network: &mut Network, layouts: &Layouts) {
        for (index, robot) in robots.iter_mut().enumerate() {
            let now = self.clock(robot.now_ms);
            let mut out = Vec::new();
            let remote = &mut self.remotes[index];
            while let Some(message) = remote.inbox.pop_front() {
                match message {
                    Message::Pong(mut pong) => {
                        if self.plant == Plant::ClockIsWrong {
                            pong.received_ns += 300 * MS;
                            pong.sent_ns += 300 * MS;
                        }
                        remote.link.take(&pong, now, 0);
                        let is_of_robot = remote.link.is_of_robot(&pong);
                        let knows_all = pong.suspended_ns == robot.slept_ms * MS;
                        let tells = is_of_robot && knows_all && !robot.is_asleep();
                        remote.is_stale &= !tells;
                        if pong.session != NOT_PERMITTED && is_of_robot {
                            remote.orders.session(pong.session, now, &mut out);
                        }
                        remote.orders.round_trip(remote.link.round_trip());
                    }
                    Message::Answer(answer) => remote.orders.answer(&answer, now, &mut out),
                    Message::UnknownSession(session) if session == remote.link.session() => {}
                    Message::UnknownSession(session) => remote.orders.unknown_session(session),
                    Message::Sample(header, sample) => {
                        remote.sample(&header, sample, now, (robot, self.plant), layouts);
                    }
                    Message::Ping(_) | Message::Order(_) => {}
                }
            }
            remote.link.note_complete();
            remote.link.tick(now);
            remote.orders.tick(now, &mut out);
            if remote.orders.open() > OPEN_ORDERS {
                robot
                    .judge
                    .fail("a station has more orders open than its bound".to_owned());
            }
            if let Some(ping) = remote.link.ping(now, 0) {
                network.carry(index, self.index, End::Robot, Message::Ping(ping));
            }
            self.carry_out(out, robot, network);
        }
    }

    fn carry_out(
        &mut self,
        out: Vec<station_orders::Output>,
        robot: &mut Robot,
        network: &mut Network,
    ) {
        let now = self.clock(robot.now_ms);
        let remote = &mut self.remotes[robot.index];
        for output in out {
            match output {
                station_orders::Output::Send(order) => {
                    network.carry(robot.index, self.index, End::Robot, Message::Order(order));
                }
                station_orders::Output::Report {
                    handle,
                    mut report,
                    origin,
                } => {
                    if origin == station_orders::Origin::Robot {
                        translate_report(&mut report, remote.link.clock(), now);
                    }
                    let mut clients = remote.clients.iter();
                    let Some(place) = clients.position(|client| client.handle == handle) else {
                        continue;
                    };
                    let id = remote.clients[place].request_id;
                    if self.plant == Plant::StationInvents
                        && report.reason() == Some(Reason::RelayLinkLost)
                    {
                        report.stage = Stage::Done.code();
                    }
                    if report.is_final() {
                        remote.clients.remove(place);
                        if self.plant == Plant::StationSaysNothing && id.is_multiple_of(3) {
                            continue;
                        }
                    }
                    robot.judge.client_reported(id, &report);
                    if self.plant == Plant::StationSaysTwice && report.is_final() {
                        robot.judge.client_reported(id, &report);
                    }
                }
            }
        }
    }
}

impl Remote {
    fn sample(
        &mut self,
        header: &SampleHeader,
        mut sample: Vec<u8>,
        now: MonotonicNs,
        (robot, plant): (&mut Robot, Plant),
        layouts: &Layouts,
    ) {
        let is_of_link = self.link.robot_instance() == Some(header.robot_instance);
        if !self.link.is_up() || !is_of_link && plant != Plant::SampleOfFormer {
            return;
        }
        let is_new = self.receiver.take(header) || plant == Plant::SampleOvertakes;
        if !is_new {
            return;
        }
        self.link.note_sample();
        let clock = self.link.clock();
        translate_sample(&mut sample, &layouts.moments, clock, now);
        let Some(mut hero) = HeroTelemetry::from_bytes(&sample) else {
            return robot.judge.fail("a sample that cannot be read".to_owned());
        };
        match plant {
            Plant::SampleIsNew => hero.received_ns = now.0,
            Plant::SampleOfOther => hero.epoch_ns += 1,
            _ => {}
        }
        if hero.sequence < self.last_sample {
            let text = format!("sample {} comes after {}", hero.sequence, self.last_sample);
            robot.judge.fail(text);
        }
        self.last_sample = hero.sequence;
        let estimate = clock.estimate(MonotonicNs(hero.received_ns));
        let (Some(estimate), false) = (estimate, self.is_stale) else {
            return;
        };
        let within_ms = estimate.uncertainty_ns as f64 / MS as f64;
        let claimed_ms = before_ms(hero.received_ns, now);
        robot.judge.ran.samples += 1;
        let judged = robot
            .truth
            .judge_age(&hero, robot.host(), (claimed_ms, within_ms));
        if let Err(what) = judged {
            robot.judge.fail(what);
        }
    }
}
