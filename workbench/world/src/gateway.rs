//! The MAVLink gateway of a robot, around the core that runs in flight, and the ground stations that command through it
//! over links that lose, double and delay.

use std::collections::{BTreeMap, VecDeque};
use std::net::SocketAddr;
use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::Stage;
use ipc_types::payload::{HeroTelemetry, RequestReport};
use mavlink_gateway::message::{
    COMMAND_ACK, COMMAND_INT, COMMAND_LONG, GLOBAL_POSITION_INT, HEARTBEAT,
};
use mavlink_gateway::wire::{MessageWriter, frames};
use mavlink_gateway::{Gateway, Order as GatewayOrder, OrderKind, Settings, StationLost};

use crate::judge::Ordered;
use crate::life::{Life, MS};
use crate::plant::Plant;
use crate::request::Stamp;
use crate::robot::Robot;
use crate::script::{Dice, LinkLoss, Order, STATION_LOST_MS, What, station_of};

/// A station says so often that it is there, and commands so often again what has no answer, so many times at most.
const HEARTBEAT_MS: u64 = 1_000;
const AGAIN_MS: u64 = 700;
const TIMES: u32 = 4;
/// For so long after the answer the same bits are a copy; they are none when another command of the station has come
/// in between (docs/mavlink.md, "At most once").
const COPY_MS: u64 = 2_500;
/// Nothing is sent of a helicopter whose newest sample is older.
const LOST_AFTER_MS: u64 = 2_000;
/// Most datagrams that wait for a gateway that stands still.
const SOCKET: usize = 200;
/// The processes of gateways have numbers from here on: a hundred for each robot.
const FIRST_PROCESS: u32 = 20_000;
/// The ports of the stations' addresses.
const FIRST_PORT: u16 = 14_550;

/// A command of a station.
struct Command {
    /// Where it goes to, degrees and m, if it is a goto.
    place: Option<(f64, f64, f64)>,
    message: MessageWriter,
    number: u16,
    next_ms: u64,
    times: u32,
    /// When its copies came to the gateway's socket, by the robot's clock.
    came: Vec<MonotonicNs>,
    /// As which orders of the judge the gateway has ordered it, and when the copies came that it did so for.
    ordered: Vec<(usize, MonotonicNs)>,
    /// When the gateway has answered it first, and refused it first.
    answered: Option<MonotonicNs>,
    refused: Option<MonotonicNs>,
    is_open: bool,
}

/// A ground station.
pub struct MavStation {
    sender: usize,
    frame: u8,
    next_heartbeat: u64,
    pub outage_until: u64,
    pub hangs_until: u64,
    commands: Vec<Command>,
}

enum Datagram {
    /// From the station of this sender.
    Up(usize, Vec<u8>),
    Down(usize, Vec<u8>),
}

/// The gateway of a robot, and its stations by their senders.
pub struct GatewayProcess {
    pub life: Life,
    pub process: u32,
    plant: Plant,
    gateway: Gateway,
    lives: u32,
    station_lost: LinkLoss,
    pub stations: BTreeMap<usize, MavStation>,
    datagrams: BTreeMap<(u64, u64), Datagram>,
    count: u64,
    socket: VecDeque<(usize, Vec<u8>, MonotonicNs)>,
    dice: Dice,
    /// Requests that have no final report: which order of the gateway they are.
    open: BTreeMap<u64, u64>,
    reports: VecDeque<RequestReport>,
    newest: Option<HeroTelemetry>,
    is_new: bool,
}

fn gateway(station_lost: LinkLoss) -> Gateway {
    let settings = Settings {
        zero_above_sea_m: Some(0.0),
        lost_after: Duration::from_millis(LOST_AFTER_MS),
        station_lost: match station_lost {
            LinkLoss::Continue => StationLost::Continue,
            LinkLoss::Hold => StationLost::Hold,
            LinkLoss::Land => StationLost::Land,
        },
        station_lost_after: Duration::from_millis(STATION_LOST_MS),
        ..Settings::default()
    };
    Gateway::new(settings, 1)
}

fn address(sender: usize) -> SocketAddr {
    ([127, 0, 0, 1], FIRST_PORT + sender as u16).into()
}

fn long(number: u16, params: [f32; 7]) -> MessageWriter {
    let message = params
        .iter()
        .fold(MessageWriter::new(COMMAND_LONG), |message, param| {
            message.f32(*param)
        });
    message.u16(number).u8(1).u8(1).u8(0)
}

impl GatewayProcess {
    pub fn new(
        robot: usize,
        senders: &[usize],
        (seed, station_lost): (u64, LinkLoss),
        plant: Plant,
    ) -> GatewayProcess {
        let station = |sender: &usize| MavStation {
            sender: *sender,
            frame: 0,
            next_heartbeat: 0,
            outage_until: 0,
            hangs_until: 0,
            commands: Vec::new(),
        };
        GatewayProcess {
            life: Life::default(),
            process: FIRST_PROCESS + 100 * robot as u32,
            plant,
            gateway: gateway(station_lost),
            lives: 0,
            station_lost,
            stations: senders
                .iter()
                .map(|sender| (*sender, station(sender)))
                .collect(),
            datagrams: BTreeMap::new(),
            count: 0,
            socket: VecDeque::new(),
            dice: Dice::new(seed, 13 + robot as u64),
            open: BTreeMap::new(),
            reports: VecDeque::new(),
            newest: None,
            is_new: false,
        }
    }

    /// It is killed.
    pub fn dies(&mut self, until: u64) {
        self.life.away_until = Some(until);
        self.gateway = gateway(self.station_lost);
        self.lives += 1;
        self.process += 1;
        self.socket.clear();
        self.open.clear();
        self.reports.clear();
        (self.newest, self.is_new) = (None, false);
    }

    pub fn report(&mut self, report: RequestReport) {
        self.reports.push_back(report);
    }

    pub fn sample(&mut self, hero: &HeroTelemetry) {
        (self.newest, self.is_new) = (Some(*hero), true);
    }

    /// The operator of a station orders something.
    pub fn order(&mut self, order: &Order, robot: &Robot) {
        let mut place = None;
        let (number, message) = match &order.what {
            What::Start => (400, long(400, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])),
            What::Stop => (400, long(400, [0.0; 7])),
            What::Hold => (193, long(193, [0.0; 7])),
            What::Land => (21, long(21, [0.0; 7])),
            What::TakeOff => (22, long(22, [0.0; 7])),
            What::Path(places) => {
                let at = robot.waypoint(robot.judge.orders.len(), 0, places[0]);
                let degrees = |degrees: f64| (degrees * 1e7).round() as i32;
                let (x, y) = (degrees(at.latitude_deg), degrees(at.longitude_deg));
                let z = at.altitude_m as f32;
                place = Some((f64::from(x) * 1e-7, f64::from(y) * 1e-7, f64::from(z)));
                let message = MessageWriter::new(COMMAND_INT).f32(-1.0).f32(0.0).f32(0.0);
                let message = message.f32(f32::NAN).i32(x).i32(y).f32(z);
                (192, message.u16(192).u8(1).u8(1).u8(0).u8(0).u8(0))
            }
        };
        let station = self.stations.get_mut(&order.sender).expect("a station");
        for command in &mut station.commands {
            command.is_open &= command.number != number;
        }
        station.commands.push(Command {
            place,
            message,
            number,
            next_ms: robot.now_ms + order.late_ms,
            times: 0,
            came: Vec::new(),
            ordered: Vec::new(),
            answered: None,
            refused: None,
            is_open: true,
        });
    }

    fn carry(&mut self, now_ms: u64, sender: usize, datagram: impl Fn() -> Datagram) {
        let is_lost = self.stations[&sender].outage_until > now_ms;
        if is_lost || self.dice.once_in(12) {
            return;
        }
        for _ in 0..1 + u32::from(self.dice.once_in(12)) {
            let most = if self.dice.once_in(15) { 800 } else { 30 };
            let at_ms = now_ms + self.dice.count(1, most);
            self.count += 1;
            self.datagrams.insert((at_ms, self.count), datagram());
        }
    }

    /// What the stations send, and what comes to them and to the socket.
    pub fn run_stations(&mut self, robot: &mut Robot) {
        let now_ms = robot.now_ms;
        let senders: Vec<usize> = self.stations.keys().copied().collect();
        for sender in senders {
            let mut frames = Vec::new();
            let station = self.stations.get_mut(&sender).expect("a station");
            if station.hangs_until > now_ms {
                continue;
            }
            if station.next_heartbeat <= now_ms {
                station.next_heartbeat = now_ms + HEARTBEAT_MS;
                let heartbeat = MessageWriter::new(HEARTBEAT).u32(0).u8(6).u8(8);
                frames.push(heartbeat.u8(0).u8(4).u8(3));
            }
            for command in &mut station.commands {
                if command.is_open && command.next_ms <= now_ms && command.times < TIMES {
                    command.next_ms = now_ms + AGAIN_MS;
                    command.times += 1;
                    frames.push(command.message.clone());
                }
            }
            for message in frames {
                let station = self.stations.get_mut(&sender).expect("a station");
                station.frame = station.frame.wrapping_add(1);
                let system = 200 + station.sender as u8;
                let bytes = message.frame(station.frame, system, 190);
                self.carry(now_ms, sender, || Datagram::Up(sender, bytes.clone()));
            }
        }
        let later = self.datagrams.split_off(&(now_ms + 1, 0));
        for datagram in std::mem::replace(&mut self.datagrams, later).into_values() {
            match datagram {
                Datagram::Up(sender, bytes) => self.reach_socket(sender, bytes, robot),
                Datagram::Down(sender, bytes) => self.reach_station(sender, &bytes, robot),
            }
        }
    }

    fn reach_socket(&mut self, sender: usize, bytes: Vec<u8>, robot: &Robot) {
        if !self.life.is_up() || robot.is_asleep() || self.socket.len() >= SOCKET {
            return;
        }
        let station = self.stations.get_mut(&sender).expect("a station");
        for frame in frames(&bytes).flatten() {
            for command in &mut station.commands {
                let sent = command
                    .message
                    .frame(frame.sequence, frame.system, frame.component);
                if sent == bytes {
                    command.came.push(robot.host());
                }
            }
        }
        self.socket.push_back((sender, bytes, robot.host()));
    }

    fn reach_station(&mut self, sender: usize, bytes: &[u8], robot: &mut Robot) {
        for frame in frames(bytes).flatten() {
            if frame.kind == COMMAND_ACK {
                let payload = &frame.payload.0;
                let byte = |at: usize| payload.get(at).copied().unwrap_or(0);
                let number = u16::from_le_bytes([byte(0), byte(1)]);
                self.acknowledged(sender, number, byte(2), robot);
            }
        }
    }

    /// A station has an answer to its last command of this kind.
    fn acknowledged(&mut self, sender: usize, number: u16, result: u8, robot: &mut Robot) {
        let station = self.stations.get_mut(&sender).expect("a station");
        let of_kind = station.commands.iter().filter(|it| it.number == number);
        // An answer names the kind alone.
        let is_clear = of_kind.count() == 1;
        let mut commands = station.commands.iter_mut();
        let Some(command) = commands.find(|it| it.number == number && it.is_open) else {
            return;
        };
        command.is_open = false;
        robot.judge.note(format!(
            "sender {sender} gets the answer {result} to {number}"
        ));
        robot.judge.ran.acks += 1;
        if !is_clear || command.place.is_none() {
            return;
        }
        let accepted = |order: usize| robot.judge.orders[order].accepted.is_some();
        let is_accepted = command.ordered.iter().any(|(order, _)| accepted(*order));
        // A copy that came when the refusal was on its way is the station's wish to be told otherwise.
        // One that has ended since, or whose bridge has, is not done any more, and copies are told so.
        let is_contradicted = command.ordered.iter().any(|(order, came)| {
            let goes_on = robot.bridge_life.is_up() && robot.judge.goes_on(*order);
            goes_on && command.refused.is_none_or(|refused| *came <= refused)
        });
        let what = match result {
            0 if !is_accepted => "is told that a goto is accepted, which no bridge has accepted",
            1..=3 if is_contradicted => "is told that a goto is refused, which was accepted",
            _ => return,
        };
        robot.judge.fail(format!("sender {sender} {what}"));
    }

    /// It is awake: takes what has come, and does what is due.
    pub fn step(&mut self, robot: &mut Robot, next_id: &mut u64) {
        let now = robot.host();
        let mut is_due = self.gateway.deadline().is_none_or(|due| due <= now);
        if let Some(state) = robot.state {
            self.gateway.state(&state, now);
            is_due = true;
        }
        let is_young = self.plant == Plant::GatewayKeepsYoung;
        let is_new = std::mem::take(&mut self.is_new) || is_young;
        if let Some(mut newest) = self.newest.filter(|_| is_new) {
            if is_young {
                newest.received_ns = now.0;
            }
            self.gateway.telemetry(&newest, now);
            is_due = true;
        }
        while let Some((sender, bytes, came)) = self.socket.pop_front() {
            robot.judge.station_heard(station_of(sender));
            let came = match self.plant {
                Plant::GatewayStamps => now,
                _ => came,
            };
            let from = match self.plant {
                // Every copy is one of another station.
                Plant::GatewayCopies => address(sender + 10 * (self.count % 3) as usize),
                _ => address(sender),
            };
            self.gateway.datagram(from, &bytes, came, now);
            if self.plant == Plant::GatewayCopies {
                self.gateway.datagram(address(sender), &bytes, came, now);
            }
            is_due = true;
        }
        while let Some(report) = self.reports.pop_front() {
            let id = report.request_id;
            let Some(number) = self.open.get(&id).copied() else {
                continue;
            };
            if report.is_final() {
                self.open.remove(&id);
            }
            let report = match self.plant {
                Plant::GatewayFlatters if report.stage() == Some(Stage::Refused) => RequestReport {
                    request_id: id,
                    ..RequestReport::new(Stage::Accepted, ipc_types::code::Reason::None)
                },
                _ => report,
            };
            self.gateway.report(number, &report, "", now);
            is_due = true;
        }
        if !is_due {
            return;
        }
        self.gateway.advance(now);
        while let Some(order) = self.gateway.poll_order() {
            self.ask(&order, robot, next_id);
        }
        while self.gateway.poll_task().is_some() || self.gateway.poll_event().is_some() {}
        while let Some(datagram) = self.gateway.poll_datagram() {
            self.sent(&datagram.bytes, robot);
            self.note_answer(&datagram, now);
            let sender = usize::from(datagram.to.port() - FIRST_PORT);
            if self.stations.contains_key(&sender) {
                let bytes = datagram.bytes;
                self.carry(robot.now_ms, sender, || {
                    Datagram::Down(sender, bytes.clone())
                });
            }
        }
        if self.open.len() > 16 {
            robot
                .judge
                .fail("the gateway has more orders open than its bound".to_owned());
        }
    }

    /// When a command was answered and refused first.
    fn note_answer(&mut self, datagram: &mavlink_gateway::Datagram, now: MonotonicNs) {
        let sender = usize::from(datagram.to.port() - FIRST_PORT);
        let Some(station) = self.stations.get_mut(&sender) else {
            return;
        };
        for frame in frames(&datagram.bytes).flatten() {
            let payload = &frame.payload.0;
            if frame.kind != COMMAND_ACK {
                continue;
            }
            let is_refused = payload.get(2).is_some_and(|result| *result != 0);
            let number = u16::from_le_bytes([payload[0], payload[1]]);
            let commands = station.commands.iter_mut();
            for command in commands.filter(|it| it.number == number && it.is_open) {
                command.answered.get_or_insert(now);
                if is_refused {
                    command.refused.get_or_insert(now);
                }
            }
        }
    }

    /// A datagram of the gateway: what it says of the helicopter is heard of it.
    fn sent(&self, bytes: &[u8], robot: &mut Robot) {
        for frame in frames(bytes)
            .flatten()
            .filter(|it| it.kind == GLOBAL_POSITION_INT)
        {
            let newest = self.newest.map_or(0, |newest| newest.received_ns);
            let age_ms = (robot.host().0 - newest) / MS;
            if age_ms > LOST_AFTER_MS + 20 {
                let text = format!("a place is sent that is {age_ms} ms old");
                robot.judge.fail(text);
            }
            let word = |at: usize| {
                let bytes = frame.payload.0.get(at..at + 4).unwrap_or(&[0; 4]);
                i32::from_le_bytes(bytes.try_into().unwrap_or_default())
            };
            let mut latitude_deg = f64::from(word(4)) * 1e-7;
            if self.plant == Plant::GatewayPlace {
                latitude_deg += 1e-3;
            }
            if let Err(what) = robot.truth.judge_latitude(latitude_deg, robot.now_ms) {
                robot.judge.fail(what);
            }
        }
    }

    /// The gateway orders something of the bridge.
    fn ask(&mut self, order: &GatewayOrder, robot: &mut Robot, next_id: &mut u64) {
        let now_ms = robot.now_ms;
        let what = match order.kind {
            OrderKind::Start => What::Start,
            OrderKind::Stop => What::Stop,
            OrderKind::TakeOff(_) => What::TakeOff,
            OrderKind::Hold => What::Hold,
            OrderKind::Land => What::Land,
            OrderKind::GoTo(_) => What::Path(vec![(0.0, 0.0)]),
            _ => return,
        };
        if !robot.bridge_life.is_up() {
            return self.gateway.not_sent(order.number, "", robot.host());
        }
        let number = robot.judge.orders.len();
        let mut requests = robot.requests(&what, *next_id);
        *next_id += requests.len() as u64;
        let mut sender = None;
        if let OrderKind::GoTo(position) = order.kind {
            sender = self.ordered(order, number, robot);
            robot.go_to(&mut requests, number, position);
        }
        let host_ns = robot.host().0;
        let truly = |at: MonotonicNs| now_ms - (host_ns - at.0.min(host_ns)) / MS;
        let request = requests[0].stamped(Stamp {
            issued: order.issued,
            begin_by: order.begin_by,
            after: order.after,
        });
        robot.judge.ordered(Ordered {
            order: Order::at_once(sender.unwrap_or(usize::MAX), robot.index, what),
            ids: vec![request.id()],
            after: order.after,
            true_ms: truly(order.issued),
            issued_ms: truly(order.issued),
            begin_by_ms: order
                .begin_by
                .map(|by| truly(order.issued) + (by.0 - order.issued.0) / MS),
            process: self.process,
            station: sender.map(station_of),
            ..Ordered::default()
        });
        self.open.insert(request.id(), order.number);
        robot.send(now_ms, number, self.process, request);
    }

    /// A goto is ordered: that of a station, once, to its place, and as old as its arrival. Gives its sender.
    fn ordered(&mut self, order: &GatewayOrder, number: usize, robot: &mut Robot) -> Option<usize> {
        let OrderKind::GoTo(position) = order.kind else {
            return None;
        };
        let is_there = |command: &Command| {
            command
                .place
                .is_some_and(|(latitude_deg, longitude_deg, _)| {
                    (latitude_deg - position.latitude_deg).abs() < 5e-8
                        && (longitude_deg - position.longitude_deg).abs() < 5e-8
                })
        };
        let lives = self.lives;
        for (sender, station) in &mut self.stations {
            let Some(index) = station.commands.iter().position(is_there) else {
                continue;
            };
            let before = station.commands[index]
                .ordered
                .last()
                .map(|(_, came)| *came);
            let is_between = |came: &MonotonicNs| {
                before.is_some_and(|before| *came >= before) && *came <= order.issued
            };
            let mut others = station.commands.iter().enumerate();
            let is_another =
                others.any(|(other, it)| other != index && it.came.iter().any(is_between));
            let command = &mut station.commands[index];
            let is_late = command
                .answered
                .is_some_and(|answered| order.issued.since(answered).as_millis() >= COPY_MS.into());
            command.ordered.push((number, order.issued));
            let altitude_m = command.place.map_or(0.0, |(.., altitude_m)| altitude_m);
            if (altitude_m - position.altitude_m).abs() > 0.01 {
                let text = format!(
                    "a goto to {altitude_m} m becomes one to {} m",
                    position.altitude_m
                );
                robot.judge.fail(text);
            }
            if before.is_some() && !is_another && !is_late && lives == 0 {
                robot
                    .judge
                    .fail(format!("a command of sender {sender} is ordered twice"));
            }
            if !command.came.contains(&order.issued) {
                let text = format!("a command of sender {sender} is not as old as its arrival");
                robot.judge.fail(text);
            }
            return Some(*sender);
        }
        robot
            .judge
            .fail("a goto that no station has commanded".to_owned());
        None
    }
}
