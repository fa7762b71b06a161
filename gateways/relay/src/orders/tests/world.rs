//! A virtual network: stations, one robot, its servers, and faults, in virtual time.

use std::collections::BTreeMap;
use std::time::Duration;

use fastrand::Rng;
use ipc_types::MonotonicNs;

use super::bridge::{Bridge, Kind, SERVICES, Step, traits_of};
use super::cases::{Cases, Counts};
use super::{MS, SECOND, around};
use crate::orders::message::{Answer, Order, WINDOW};
use crate::orders::robot::{self, ORPHANS, RobotOrders, SESSIONS};
use crate::orders::station::{self, OPEN_ORDERS, StationOrders};

/// What goes wrong. Times are means, ns; 0 means never.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Faults {
    /// Probability that a message is lost.
    pub(super) loss: f64,
    /// Probability that a message comes twice.
    pub(super) repetition: f64,
    /// Longest delay of most messages.
    pub(super) delay: u64,
    /// Probability of a delay that is a hundred times longer.
    pub(super) straggler: f64,
    /// Between two outages of one station.
    pub(super) outage_every: u64,
    pub(super) outage: u64,
    pub(super) station_restart_every: u64,
    pub(super) robot_restart_every: u64,
    pub(super) bridge_restart_every: u64,
    /// Probability that a client gives its request up.
    pub(super) give_up: f64,
    /// Between two requests of a station.
    pub(super) pause: u64,
}

const PING_PERIOD: u64 = 500 * MS;
/// A station that has received nothing for so long refuses requests.
const LINK_TIMEOUT: u64 = 3 * SECOND;
/// The clocks begin somewhere.
const ROBOT_CLOCK: u64 = 1_000_000 * SECOND;
const STATION_CLOCK: u64 = 77 * SECOND;

enum Event {
    ToRobot(usize, u64, Up),
    ToStation(usize, u64, Down),
    Ping(usize),
    Client(usize),
    ClientGone(u64),
    /// To this instance of the robot side.
    Report(u32, u64, ipc_types::payload::RequestReport),
    Step(Step),
    Outage(usize),
    StationRestart(usize),
    RobotRestart,
    RobotUp,
    BridgeRestart,
    BridgeUp,
}

#[derive(Clone)]
enum Up {
    Ping,
    Order(Order),
}

#[derive(Clone)]
enum Down {
    Pong(u64),
    Answer(Answer),
    UnknownSession(u64),
}

struct Slot {
    instance: u64,
    station: StationOrders,
    last_pong: Option<u64>,
    outage_until: u64,
    /// The station has ended for good.
    is_over: bool,
}

pub(super) struct World {
    now: u64,
    count: u64,
    events: BTreeMap<(u64, u64), Event>,
    random: Rng,
    faults: Faults,
    slots: Vec<Slot>,
    robot: Option<RobotOrders>,
    robot_instance: u32,
    bridge: Bridge,
    cases: Cases,
    requests_left: u64,
    next_id: u64,
    pub(super) links_lost: u32,
    /// Copies of orders that were asked for as repetitions.
    pub(super) repetitions: u32,
}

fn station_clock(now: u64) -> MonotonicNs {
    MonotonicNs(STATION_CLOCK + now)
}

fn robot_clock(now: u64) -> MonotonicNs {
    MonotonicNs(ROBOT_CLOCK + now)
}

impl World {
    pub(super) fn new(seed: u64, stations: usize, faults: Faults) -> World {
        let mut world = World {
            now: 0,
            count: 0,
            events: BTreeMap::new(),
            random: Rng::with_seed(seed),
            faults,
            slots: Vec::new(),
            robot: None,
            robot_instance: 0,
            bridge: Bridge::default(),
            cases: Cases::default(),
            requests_left: 0,
            next_id: 1,
            links_lost: 0,
            repetitions: 0,
        };
        world.bridge.start();
        world.start_robot();
        for slot in 0..stations {
            let instance = world.random.u64(..);
            world.slots.push(Slot {
                instance,
                station: StationOrders::new(Duration::from_secs(60)),
                last_pong: None,
                outage_until: 0,
                is_over: false,
            });
            world.at(0, Event::Ping(slot));
            world.at(2 * SECOND, Event::Client(slot));
            world.fault(faults.outage_every, Event::Outage(slot));
            world.fault(faults.station_restart_every, Event::StationRestart(slot));
        }
        world.fault(faults.robot_restart_every, Event::RobotRestart);
        world.fault(faults.bridge_restart_every, Event::BridgeRestart);
        world
    }

    /// So many requests through all faults, then time in which all goes well, and then the account.
    pub(super) fn run(&mut self, requests: u64) -> Counts {
        self.requests_left = requests;
        while self.requests_left > 0 {
            self.advance();
        }
        self.faults = Faults::default();
        self.end_those_that_are_too_many();
        let end = self.now + 400 * SECOND;
        while self.now < end {
            self.advance();
        }
        for slot in &self.slots {
            assert_eq!(slot.station.open(), 0, "all is settled");
        }
        self.cases.check(&self.bridge)
    }

    /// Ends the stations without a session: as long as all are there, those can settle nothing.
    fn end_those_that_are_too_many(&mut self) {
        for slot in SESSIONS..self.slots.len() {
            self.cases.station_gone(slot);
            self.slots[slot].station = StationOrders::new(Duration::from_secs(60));
            self.slots[slot].is_over = true;
        }
    }

    fn at(&mut self, at: u64, event: Event) {
        self.count += 1;
        self.events.insert((at, self.count), event);
    }

    fn fault(&mut self, every: u64, event: Event) {
        if every > 0 {
            let at = self.now + around(&mut self.random, every);
            self.at(at, event);
        }
    }

    /// The next thing that happens.
    fn advance(&mut self) {
        let (&(at, _), _) = self.events.first_key_value().expect("pings never end");
        let stations = self.slots.iter().map(|slot| slot.station.deadline());
        let stations = stations.flatten().map(|at| at.0 - STATION_CLOCK).min();
        let robot = self.robot.as_ref().and_then(RobotOrders::deadline);
        let robot = robot.map(|at| at.0 - ROBOT_CLOCK);
        let due = [stations, robot].into_iter().flatten().min();
        match due {
            Some(due) if due < at => {
                self.now = self.now.max(due);
                self.tick();
            }
            _ => {
                self.now = self.now.max(at);
                let (_, event) = self.events.pop_first().expect("it was there");
                self.handle(event);
            }
        }
    }

    fn tick(&mut self) {
        for slot in 0..self.slots.len() {
            self.with_station(slot, |station, now, out| station.tick(now, out));
        }
        self.with_robot(|robot, now, out| robot.tick(now, out));
        let late = |at: MonotonicNs, clock: MonotonicNs| at <= clock;
        for slot in &self.slots {
            let deadline = slot.station.deadline();
            assert!(!deadline.is_some_and(|at| late(at, station_clock(self.now))));
        }
        let deadline = self.robot.as_ref().and_then(RobotOrders::deadline);
        assert!(!deadline.is_some_and(|at| late(at, robot_clock(self.now))));
    }

    fn handle(&mut self, event: Event) {
        match event {
            Event::ToRobot(slot, instance, message) => {
                self.arrive_at_robot(slot, instance, &message)
            }
            Event::ToStation(slot, instance, message) => {
                self.arrive_at_station(slot, instance, &message)
            }
            Event::Ping(slot) if self.slots[slot].is_over => {}
            Event::Ping(slot) => {
                self.carry(slot, |instance| Event::ToRobot(slot, instance, Up::Ping));
                self.at(self.now + PING_PERIOD, Event::Ping(slot));
            }
            Event::Client(slot) => self.client(slot),
            Event::ClientGone(id) => {
                if self.cases.give_up(id) {
                    let slot = self.cases.of[&id].slot;
                    self.with_station(slot, |station, _, out| station.give_up(id, out));
                }
            }
            Event::Report(instance, service, report) => {
                if instance == self.robot_instance {
                    self.with_robot(|robot, now, out| robot.report(service, &report, now, out));
                }
            }
            Event::Step(step) => {
                self.bridge.step(&step, &mut self.random);
                self.drain_bridge(MS);
            }
            fault => self.break_something(fault),
        }
    }

    fn break_something(&mut self, fault: Event) {
        let faults = self.faults;
        match fault {
            Event::Outage(slot) => {
                let outage = around(&mut self.random, faults.outage);
                self.slots[slot].outage_until = self.now + outage;
                self.fault(faults.outage_every, Event::Outage(slot));
            }
            Event::StationRestart(slot) => {
                self.cases.station_gone(slot);
                let station = &mut self.slots[slot];
                station.instance = self.random.u64(..);
                station.station = StationOrders::new(Duration::from_secs(60));
                station.last_pong = None;
                self.fault(faults.station_restart_every, Event::StationRestart(slot));
            }
            Event::RobotRestart => {
                self.robot = None;
                self.robot_instance += 1;
                self.bridge.client_gone(None);
                let back = self.now + self.random.u64(..3 * SECOND);
                self.at(back, Event::RobotUp);
                self.fault(faults.robot_restart_every, Event::RobotRestart);
            }
            Event::RobotUp => self.start_robot(),
            Event::BridgeRestart => {
                self.bridge.kill();
                self.drain_bridge(250 * MS);
                let back = self.now + self.random.u64(..4 * SECOND);
                self.at(back, Event::BridgeUp);
                self.fault(faults.bridge_restart_every, Event::BridgeRestart);
            }
            Event::BridgeUp if !self.bridge.is_up => self.bridge.start(),
            _ => {}
        }
    }

    fn start_robot(&mut self) {
        let config = robot::Config {
            link_loss: Some(Duration::from_secs(5)),
            still_open: Duration::from_secs(120),
        };
        self.robot = Some(RobotOrders::new(config, self.random.u64(..)));
    }

    fn client(&mut self, slot: usize) {
        if self.requests_left == 0 {
            return;
        }
        self.requests_left -= 1;
        let next = self.now + around(&mut self.random, self.faults.pause);
        self.at(next, Event::Client(slot));
        let id = self.next_id;
        self.next_id += 1;
        let mut bytes = id.to_le_bytes().to_vec();
        bytes.push(Kind::random(&mut self.random) as u8);
        let expires = self.now + 200 * MS + self.random.u64(..5 * SECOND);
        let request = station::ClientRequest {
            handle: id,
            path_id: id + 1,
            service: self.random.u64(..SERVICES),
            expires: robot_clock(expires),
            bytes,
        };
        self.cases.begin(id, slot, expires);
        if self.random.f64() < self.faults.give_up {
            let at = self.now + self.random.u64(..3 * SECOND);
            self.at(at, Event::ClientGone(id));
        }
        let last_pong = self.slots[slot].last_pong;
        let is_up = last_pong.is_some_and(|last_pong| self.now - last_pong < LINK_TIMEOUT);
        self.with_station(slot, |station, now, out| {
            station.request(request, is_up, now, out);
        });
    }

    fn arrive_at_robot(&mut self, slot: usize, instance: u64, message: &Up) {
        if self.robot.is_none() {
            return;
        }
        let mut down = None;
        self.with_robot(|robot, now, out| match message {
            Up::Ping => down = Some(Down::Pong(robot.session_for(instance, "gcs", now, out))),
            Up::Order(order) => {
                if !robot.order(order, traits_of(order), now, out) {
                    down = Some(Down::UnknownSession(order.session));
                }
            }
        });
        if let Some(down) = down {
            self.carry(slot, |_| Event::ToStation(slot, instance, down.clone()));
        }
    }

    fn arrive_at_station(&mut self, slot: usize, instance: u64, message: &Down) {
        if self.slots[slot].instance != instance || self.slots[slot].is_over {
            return;
        }
        self.slots[slot].last_pong = Some(self.now);
        self.with_station(slot, |station, now, out| match message {
            Down::Pong(session) => station.session(*session, now, out),
            Down::Answer(answer) => station.answer(answer, now, out),
            Down::UnknownSession(session) => station.unknown_session(*session),
        });
    }

    fn with_station(
        &mut self,
        slot: usize,
        act: impl FnOnce(&mut StationOrders, MonotonicNs, &mut Vec<station::Output>),
    ) {
        let mut out = Vec::new();
        let station = &mut self.slots[slot].station;
        act(station, station_clock(self.now), &mut out);
        assert!(station.open() <= OPEN_ORDERS, "bounded");
        for output in out {
            match output {
                station::Output::Send(order) => {
                    self.repetitions += u32::from(order.is_repeat);
                    self.carry(slot, |instance| {
                        Event::ToRobot(slot, instance, Up::Order(order.clone()))
                    });
                }
                station::Output::Report { handle, report, .. } => {
                    self.cases.report(handle, &report, &self.bridge);
                }
            }
        }
    }

    fn with_robot(
        &mut self,
        act: impl FnOnce(&mut RobotOrders, MonotonicNs, &mut Vec<robot::Output>),
    ) {
        let Some(mut robot) = self.robot.take() else {
            return;
        };
        let now = robot_clock(self.now);
        let mut out = Vec::new();
        act(&mut robot, now, &mut out);
        while !out.is_empty() {
            for output in std::mem::take(&mut out) {
                self.robot_output(output, &mut robot, &mut out);
            }
        }
        let bound = SESSIONS * WINDOW as usize + ORPHANS;
        assert!(robot.remembered() <= bound, "bounded");
        self.robot = Some(robot);
    }

    fn robot_output(
        &mut self,
        output: robot::Output,
        robot: &mut RobotOrders,
        out: &mut Vec<robot::Output>,
    ) {
        match output {
            robot::Output::Send {
                service,
                request_id,
                is_repeat,
                request,
                ..
            } => {
                let before = self.bridge.executions.len();
                let random = &mut self.random;
                let sent = self
                    .bridge
                    .send(service, &request, is_repeat, self.now, random);
                if self.bridge.executions.len() > before {
                    self.cases.executed(request_id, self.now);
                }
                self.drain_bridge(MS);
                if let Err(why) = sent {
                    robot.not_sent(service, request_id, why, robot_clock(self.now), out);
                }
            }
            robot::Output::GiveUp { request_id, .. } => self.bridge.client_gone(Some(request_id)),
            robot::Output::Answer { station, answer } => {
                let mut slots = self.slots.iter();
                if let Some(slot) = slots.position(|slot| slot.instance == station) {
                    let down = Down::Answer(answer);
                    self.carry(slot, |instance| {
                        Event::ToStation(slot, instance, down.clone())
                    });
                }
            }
            robot::Output::LinkLost { .. } => self.links_lost += 1,
        }
    }

    fn drain_bridge(&mut self, delay: u64) {
        let instance = self.robot_instance;
        for (service, report) in std::mem::take(&mut self.bridge.reports) {
            self.at(self.now + delay, Event::Report(instance, service, report));
        }
        for step in std::mem::take(&mut self.bridge.steps) {
            self.at(step.at, Event::Step(step));
        }
    }

    /// A message on the link of this station.
    fn carry(&mut self, slot: usize, message: impl Fn(u64) -> Event) {
        let faults = self.faults;
        if self.now < self.slots[slot].outage_until || self.random.f64() < faults.loss {
            return;
        }
        let copies = 1 + u32::from(self.random.f64() < faults.repetition);
        for _ in 0..copies {
            let mut delay = MS + self.random.u64(..faults.delay + 1);
            if self.random.f64() < faults.straggler {
                delay *= 100;
            }
            self.at(self.now + delay, message(self.slots[slot].instance));
        }
    }
}
