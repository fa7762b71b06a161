//! At the end the helicopter does what was ordered last, and at no moment what was ordered before something that it has
//! done: several stations and a program on the robot, through loss, delay, repetition, reordering, outages, stalls and
//! clocks that are not known exactly.

use std::collections::BTreeMap;
use std::time::Duration;

use bridge::flight::request::{IssueMark, Issued};
use fastrand::Rng;
use ipc_types::MonotonicNs;
use ipc_types::code::{Reason, Stage};
use ipc_types::payload::RequestReport;

use super::{MS, SECOND, count};
use crate::clock::{Clock, Exchange, RemoteNs, Suspended};
use crate::orders::message::{Answer, Order, request_id};
use crate::orders::robot::{self, RobotOrders, Traits};
use crate::orders::station::{self, StationOrders};
use crate::station::moments::{Moments, earliest};

/// What the clocks of the robot and of the stations show at the true moment 0.
const ROBOT_CLOCK: u64 = 1_000 * SECOND;
const STATION_CLOCK: u64 = 5_000 * SECOND;
/// Until how long after its issue an order may begin.
const GOTO_WITHIN: u64 = 5 * SECOND;
const HOLD_WITHIN: u64 = 30 * SECOND;
/// When all orders were issued, and when all has come to rest.
const ISSUED_UNTIL: u64 = 20 * SECOND;
const END: u64 = 100 * SECOND;
/// An order has its id, whether it is a hold, and what the fields of the bridge's requests say.
const ID: std::ops::Range<usize> = 0..8;
const HOLD: usize = 8;
const ISSUED: std::ops::Range<usize> = 9..17;
const WITHIN: std::ops::Range<usize> = 17..21;
const ORIGIN: std::ops::Range<usize> = 21..25;
const BEGIN_BY: std::ops::Range<usize> = 25..33;

/// An order, and when it truly was issued.
struct Case {
    is_hold: bool,
    truth: u64,
    /// When it was issued as the bridge has read it, if it came in time.
    read: Option<Issued>,
    is_done: bool,
    is_superseded: bool,
}

#[derive(Default)]
struct Bridge {
    mark: IssueMark,
    waiting: Vec<Vec<u8>>,
    stalled_until: u64,
    /// The order that the helicopter carries out.
    doing: Option<usize>,
}

#[derive(Clone)]
enum Up {
    Ping(u64),
    Order(Order),
}

#[derive(Clone)]
enum Down {
    Pong(u64, u64, u64),
    Answer(Answer),
    UnknownSession(u64),
}

enum Event {
    ToRobot(usize, Up),
    ToStation(usize, Down),
    Ping(usize),
    /// An order is issued: 0 is the program on the robot, the others are stations.
    Decide(usize),
    /// The order has come to the relay of its station, or to the bridge.
    Ordered(usize, Vec<u8>),
    Read,
    Reported(RequestReport),
    Outage(usize),
    Stall,
}

struct Slot {
    station: StationOrders,
    clock: Clock,
    moments: Moments,
    last_pong: Option<u64>,
    outage_until: u64,
}

struct Sky {
    now: u64,
    count: u64,
    events: BTreeMap<(u64, u64), Event>,
    random: Rng,
    loss: f64,
    repetition: f64,
    delay: u64,
    slots: Vec<Slot>,
    robot: RobotOrders,
    robot_stalled_until: u64,
    bridge: Bridge,
    cases: Vec<Case>,
}

fn station_clock(now: u64) -> MonotonicNs {
    MonotonicNs(STATION_CLOCK + now)
}

fn robot_clock(now: u64) -> MonotonicNs {
    MonotonicNs(ROBOT_CLOCK + now)
}

fn word(bytes: &[u8], range: std::ops::Range<usize>) -> u64 {
    let mut word = [0; 8];
    word[..range.len()].copy_from_slice(&bytes[range]);
    u64::from_le_bytes(word)
}

impl Sky {
    fn new(seed: u64) -> Sky {
        let mut random = Rng::with_seed(seed);
        let stations = 1 + random.u64(..3) as usize;
        let slot = |_| Slot {
            station: StationOrders::new(Duration::from_secs(60)),
            clock: Clock::new(),
            moments: Moments::default(),
            last_pong: None,
            outage_until: 0,
        };
        let mut sky = Sky {
            now: 0,
            count: 0,
            events: BTreeMap::new(),
            loss: random.u64(..40) as f64 / 100.0,
            repetition: random.u64(..30) as f64 / 100.0,
            delay: random.choice([20, 100, 400]).unwrap() * MS,
            slots: (0..stations).map(slot).collect(),
            robot: RobotOrders::new(robot::Config::default(), random.u64(..)),
            robot_stalled_until: 0,
            bridge: Bridge::default(),
            cases: Vec::new(),
            random,
        };
        for slot in 0..stations {
            sky.at(0, Event::Ping(slot));
            let outage = 3 * SECOND + sky.random.u64(..15 * SECOND);
            sky.at(outage, Event::Outage(slot));
        }
        for _ in 0..2 {
            let stall = 3 * SECOND + sky.random.u64(..15 * SECOND);
            sky.at(stall, Event::Stall);
        }
        for _ in 0..2 + sky.random.u64(..7) {
            let at = 3 * SECOND + sky.random.u64(..ISSUED_UNTIL - 3 * SECOND);
            let who = sky.random.u64(..stations as u64 + 1) as usize;
            // Often two of one sender within two seconds.
            sky.at(at, Event::Decide(who));
            if sky.random.f64() < 0.5 {
                let next = at + sky.random.u64(..2 * SECOND);
                sky.at(next, Event::Decide(who));
            }
        }
        sky
    }

    fn at(&mut self, at: u64, event: Event) {
        self.count += 1;
        self.events.insert((at, self.count), event);
    }

    /// Runs to the end. Says whether the helicopter does exactly what was ordered last, of what came in time.
    fn run(&mut self) -> bool {
        while self.now < END {
            let (&(at, _), _) = self.events.first_key_value().expect("pings never end");
            let stations = self.slots.iter().filter_map(|slot| slot.station.deadline());
            let stations = stations.map(|at| at.0 - STATION_CLOCK).min();
            let robot = self.robot.deadline().map(|at| at.0 - ROBOT_CLOCK);
            match stations.into_iter().chain(robot).min() {
                Some(due) if due < at => {
                    self.now = self.now.max(due);
                    for slot in 0..self.slots.len() {
                        self.with_station(slot, |station, now, out| station.tick(now, out));
                    }
                    self.with_robot(|robot, now, out| robot.tick(now, out));
                }
                _ => {
                    self.now = self.now.max(at);
                    let (_, event) = self.events.pop_first().expect("it was there");
                    self.handle(event);
                }
            }
        }
        self.judge()
    }

    fn judge(&self) -> bool {
        let came = self.cases.iter().enumerate();
        let came = came.filter(|(_, case)| case.read.is_some());
        let Some((last, case)) = came.max_by_key(|(_, case)| case.truth) else {
            return true;
        };
        let doing = self.bridge.doing.expect("an order came in time");
        if doing == last {
            return true;
        }
        // A hold that came late holds all the same. Else the last order was not surely the last one.
        if !self.cases[doing].is_hold {
            assert!(case.is_superseded, "the order {last} was not carried out");
            let low = case.read.expect("it came").at;
            let is_near =
                |other: &Case| other.is_done && other.read.is_some_and(|read| low < read.latest);
            assert!(self.cases.iter().any(is_near), "{last} was surely the last");
        }
        false
    }

    fn handle(&mut self, event: Event) {
        match event {
            Event::ToRobot(slot, up) if self.now < self.robot_stalled_until => {
                self.at(self.robot_stalled_until, Event::ToRobot(slot, up));
            }
            Event::ToRobot(slot, up) => self.arrive_at_robot(slot, &up),
            Event::ToStation(slot, down) => self.arrive_at_station(slot, &down),
            Event::Ping(slot) => {
                let sent = station_clock(self.now).0;
                self.carry(slot, || Event::ToRobot(slot, Up::Ping(sent)));
                self.at(self.now + 500 * MS, Event::Ping(slot));
            }
            Event::Decide(who) => self.decide(who),
            Event::Ordered(0, bytes) => self.hand_to_bridge(bytes),
            Event::Ordered(who, bytes) => self.order(who - 1, bytes),
            Event::Read => self.read(),
            Event::Reported(report) => {
                self.with_robot(|robot, now, out| robot.report(0, &report, now, out));
            }
            Event::Outage(slot) => {
                let outage = 300 * MS + self.random.u64(..6 * SECOND);
                self.slots[slot].outage_until = self.now + outage;
            }
            Event::Stall => {
                let until = self.now + self.random.u64(..8 * SECOND);
                match self.random.f64() < 0.5 {
                    true => self.bridge.stalled_until = until,
                    false => self.robot_stalled_until = until,
                }
            }
        }
    }

    /// Issues an order. Its sender may be held up before it sends it.
    fn decide(&mut self, who: usize) {
        let is_hold = self.random.f64() < 0.4;
        self.cases.push(Case {
            is_hold,
            truth: self.now,
            read: None,
            is_done: false,
            is_superseded: false,
        });
        let clock = match who {
            0 => robot_clock(self.now),
            _ => station_clock(self.now),
        };
        let within = if is_hold { HOLD_WITHIN } else { GOTO_WITHIN };
        let mut bytes = vec![0; BEGIN_BY.end];
        bytes[ID].copy_from_slice(&(self.cases.len() as u64).to_le_bytes());
        bytes[HOLD] = is_hold.into();
        bytes[ISSUED].copy_from_slice(&clock.0.to_le_bytes());
        bytes[BEGIN_BY].copy_from_slice(&(clock.0 + within).to_le_bytes());
        let held_up = match self.random.f64() < 0.1 {
            true => self.random.u64(..8 * SECOND),
            false => self.random.u64(..20 * MS),
        };
        self.at(self.now + held_up, Event::Ordered(who, bytes));
    }

    /// Makes an order of a request as the station's relay does, and sends it.
    fn order(&mut self, slot: usize, mut bytes: Vec<u8>) {
        let now = station_clock(self.now);
        let Slot {
            clock,
            moments,
            last_pong,
            ..
        } = &mut self.slots[slot];
        let is_up = last_pong.is_some_and(|last_pong| self.now - last_pong < 2_500 * MS);
        let begin_by = earliest(MonotonicNs(word(&bytes, BEGIN_BY)), clock);
        let issued = moments.issued(MonotonicNs(word(&bytes, ISSUED)), clock, now);
        let (Some(begin_by), Some(issued)) = (begin_by, issued) else {
            return;
        };
        bytes[ISSUED].copy_from_slice(&issued.earliest.0.to_le_bytes());
        bytes[WITHIN].copy_from_slice(&issued.within_ns.to_le_bytes());
        bytes[ORIGIN].copy_from_slice(&(slot as u32 + 1).to_le_bytes());
        bytes[BEGIN_BY].copy_from_slice(&begin_by.0.to_le_bytes());
        let request = station::ClientRequest {
            handle: request_id(&bytes),
            path_id: 0,
            service: 0,
            expires: begin_by,
            bytes,
        };
        self.with_station(slot, |station, now, out| {
            station.request(request, is_up, now, out);
        });
    }

    fn arrive_at_robot(&mut self, slot: usize, up: &Up) {
        let received = robot_clock(self.now).0;
        let mut down = None;
        self.with_robot(|robot, now, out| match up {
            Up::Ping(sent) => {
                let session = robot.session_for(slot as u64 + 1, "gcs", now, out);
                down = Some(Down::Pong(session, *sent, received));
            }
            Up::Order(order) => {
                let traits = Traits {
                    is_repeatable: true,
                    ends_movement: order.request[HOLD] == 1,
                };
                if !robot.order(order, traits, now, out) {
                    down = Some(Down::UnknownSession(order.session));
                }
            }
        });
        if let Some(down) = down {
            self.carry(slot, || Event::ToStation(slot, down.clone()));
        }
    }

    fn arrive_at_station(&mut self, slot: usize, down: &Down) {
        let now = self.now;
        self.slots[slot].last_pong = Some(now);
        if let Down::Pong(_, sent, remote) = *down {
            let exchange = Exchange {
                sent: MonotonicNs(sent),
                remote_received: RemoteNs(remote),
                remote_sent: RemoteNs(remote),
                received: station_clock(now),
                suspended: Suspended::default(),
            };
            let _ = self.slots[slot].clock.take(&exchange);
        }
        self.with_station(slot, |station, now, out| match down {
            Down::Pong(session, ..) => station.session(*session, now, out),
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
        act(
            &mut self.slots[slot].station,
            station_clock(self.now),
            &mut out,
        );
        for output in out {
            if let station::Output::Send(order) = output {
                self.carry(slot, || Event::ToRobot(slot, Up::Order(order.clone())));
            }
        }
    }

    fn with_robot(
        &mut self,
        act: impl FnOnce(&mut RobotOrders, MonotonicNs, &mut Vec<robot::Output>),
    ) {
        let mut out = Vec::new();
        act(&mut self.robot, robot_clock(self.now), &mut out);
        for output in out {
            match output {
                robot::Output::Send {
                    request, is_repeat, ..
                } => {
                    assert!(!is_repeat, "one instance of all");
                    self.hand_to_bridge(request);
                }
                robot::Output::Answer { station, answer } => {
                    let slot = station as usize - 1;
                    let down = Down::Answer(answer);
                    self.carry(slot, || Event::ToStation(slot, down.clone()));
                }
                _ => {}
            }
        }
    }

    fn hand_to_bridge(&mut self, bytes: Vec<u8>) {
        self.bridge.waiting.push(bytes);
        let at = self.now.max(self.bridge.stalled_until);
        self.at(at, Event::Read);
    }

    fn read(&mut self) {
        if self.now < self.bridge.stalled_until {
            let at = self.bridge.stalled_until;
            return self.at(at, Event::Read);
        }
        for bytes in std::mem::take(&mut self.bridge.waiting) {
            let id = word(&bytes, ID);
            let reason = self.carry_out(id as usize - 1, &bytes);
            let stage = match reason {
                Reason::None => Stage::Done,
                _ => Stage::Refused,
            };
            let report = RequestReport {
                request_id: id,
                ..RequestReport::new(stage, reason)
            };
            self.at(self.now + MS, Event::Reported(report));
        }
    }

    /// Judges and executes an order as the bridge does.
    fn carry_out(&mut self, index: usize, bytes: &[u8]) -> Reason {
        let at = MonotonicNs(word(bytes, ISSUED));
        let issued = Issued {
            origin: word(bytes, ORIGIN) as u32,
            at,
            latest: MonotonicNs(at.0 + word(bytes, WITHIN)),
        };
        if word(bytes, BEGIN_BY) < robot_clock(self.now).0 {
            return Reason::TooLate;
        }
        let truth = self.cases[index].truth;
        let is_true = issued.at <= robot_clock(truth) && robot_clock(truth) <= issued.latest;
        assert!(is_true, "when {index} was issued");
        let case = &mut self.cases[index];
        case.read = Some(issued);
        if !case.is_hold {
            if self.bridge.mark.supersedes(&issued) {
                case.is_superseded = true;
                return Reason::Superseded;
            }
            assert!(self.now <= truth + GOTO_WITHIN, "{index} began late");
            let later = |other: &Case| other.is_done && other.truth > truth;
            assert!(!self.cases.iter().any(later), "{index} began after another");
        }
        self.cases[index].is_done = true;
        self.bridge.mark.take(&issued);
        self.bridge.doing = Some(index);
        Reason::None
    }

    /// A message on the link of this station.
    fn carry(&mut self, slot: usize, message: impl Fn() -> Event) {
        if self.now < self.slots[slot].outage_until || self.random.f64() < self.loss {
            return;
        }
        for _ in 0..1 + u32::from(self.random.f64() < self.repetition) {
            let mut delay = MS + self.random.u64(..self.delay);
            if self.random.f64() < 0.02 {
                delay *= 20;
            }
            self.at(self.now + delay, message());
        }
    }
}

#[test]
fn at_the_end_the_helicopter_does_what_was_ordered_last() {
    let sequences = count("RELAY_LAST_ORDER_SEQUENCES", 2_000);
    let mut exact = 0;
    for seed in 0..sequences {
        exact += u64::from(Sky::new(seed).run());
    }
    println!(
        "{exact} of {sequences} end with what was ordered last, the others with a hold, or an order as near"
    );
    assert!(exact > sequences * 3 / 4, "{exact} of {sequences}");
}
