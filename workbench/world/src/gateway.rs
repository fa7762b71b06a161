//! The MAVLink gateway of a robot, around the core that runs in flight, and the ground stations that command through it
//! over links that lose, double and delay.

use std::collections::{BTreeMap, VecDeque};
use std::net::SocketAddr;
use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::Stage;
use ipc_types::payload::{HeroTelemetry, MovementData, ParameterRequest, RequestReport};
use mavlink_gateway::followed::SentOrders;
use mavlink_gateway::message::{
    COMMAND_ACK, COMMAND_INT, COMMAND_LONG, GLOBAL_POSITION_INT, HEARTBEAT, PARAM_ERROR,
    PARAM_REQUEST_READ, PARAM_SET, PARAM_VALUE,
};
use mavlink_gateway::wire::{MavFrame, MessageWriter, frames};
use mavlink_gateway::{Gateway, Order as GatewayOrder, OrderKind, Settings, StationLost, Task};
use operator::render::messages::Verb;

use crate::judge::{Ordered, is_same_value};
use crate::life::{Life, MS};
use crate::mission::{Missions, Upload};
use crate::plant::Plant;
use crate::request::{Request, Stamp};
use crate::robot::Robot;
use crate::script::{Dice, LinkLoss, MissionAct, Order, STATION_LOST_MS, What, station_of};

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
/// MAV_CMD_MISSION_START
const START: u16 = 300;
/// The name of the port, its number among the parameters, and the values that stations give it, m/s.
const CRUISE: &str = "DSP_CRUISE_MPS";
const SET_MPS: f64 = 6.0;
const SET_STEP_MPS: f64 = 0.001;
/// MAV_PARAM_TYPE_REAL32
const REAL32: u8 = 9;
/// A value that a station gives is answered within so long, ms.
const SET_WITHIN_MS: u64 = 12_000;

/// A command of a station.
struct Command {
    /// Where it goes to, degrees and m, if it is a goto.
    place: Option<(f64, f64, f64)>,
    message: MessageWriter,
    number: u16,
    begins_ms: u64,
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
    upload: Option<Upload>,
    /// When it has last done something about missions.
    acted_ms: u64,
    sets: Vec<Set>,
    /// Whether it asks for the value, and until when.
    reads_at: Option<u64>,
}

/// A value that a station gives the port.
struct Set {
    value: f64,
    message: MessageWriter,
    next_ms: u64,
    times: u32,
    is_answered: bool,
    /// How often it was ordered, and whether a newer one of the station was before.
    orders: u32,
    /// In which life of the gateway it came to it first, and when.
    came: Option<(u32, u64)>,
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
    /// Orders that have no final report.
    sent: SentOrders,
    pub missions: Missions,
    /// How many values stations have given.
    sets: u64,
    reports: VecDeque<RequestReport>,
    newest: Option<HeroTelemetry>,
    is_new: bool,
}

fn gateway(station_lost: LinkLoss, plant: Plant) -> Gateway {
    let settings = Settings {
        zero_above_sea_m: Some(0.0),
        lost_after: Duration::from_millis(LOST_AFTER_MS),
        station_lost: match station_lost {
            _ if plant == Plant::GatewayKeepsLost => StationLost::Continue,
            LinkLoss::Continue => StationLost::Continue,
            LinkLoss::Hold => StationLost::Hold,
            LinkLoss::Land => StationLost::Land,
        },
        station_lost_after: Duration::from_millis(STATION_LOST_MS),
        ..Settings::default()
    };
    Gateway::new(settings, 1)
}

/// Whether a value is that of the port.
fn is_cruise(frame: &MavFrame<'_>) -> bool {
    let name = frame.payload.0.get(8..8 + CRUISE.len());
    name == Some(CRUISE.as_bytes())
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
            upload: None,
            acted_ms: 0,
            sets: Vec::new(),
            reads_at: None,
        };
        GatewayProcess {
            life: Life::default(),
            process: FIRST_PROCESS + 100 * robot as u32,
            plant,
            gateway: gateway(station_lost, plant),
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
            sent: SentOrders::default(),
            missions: Missions::default(),
            sets: 0,
            reports: VecDeque::new(),
            newest: None,
            is_new: false,
        }
    }

    /// Its disk takes what waits, while the process stands still, too.
    pub fn runs_disk(&mut self, now_ms: u64) {
        self.missions.write(now_ms, &mut self.dice);
    }

    /// It begins again, with what was on the disk.
    pub fn begins(&mut self) {
        let (mission, progress) = self.missions.kept();
        self.gateway.restore(mission);
        if let Some(progress) = progress.filter(|_| self.plant != Plant::MissionForgets) {
            self.gateway.restore_progress(progress);
        }
    }

    /// It is killed.
    pub fn dies(&mut self, now_ms: u64, until: u64) {
        self.missions.dies(now_ms);
        self.life.away_until = Some(until);
        self.gateway = gateway(self.station_lost, self.plant);
        self.lives += 1;
        self.process += 1;
        self.socket.clear();
        self.sent = SentOrders::default();
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
            What::Write => return self.set(order, robot.now_ms),
            What::Read => {
                let station = self.stations.get_mut(&order.sender).expect("a station");
                station.reads_at = Some(robot.now_ms + order.late_ms);
                return;
            }
        };
        let begins_ms = robot.now_ms + order.late_ms;
        self.command(order.sender, (number, message, place), begins_ms);
    }

    /// The operator of a station does something about missions.
    pub fn act(&mut self, sender: usize, act: &MissionAct, robot: &Robot) {
        let begins_ms = robot.now_ms;
        let station = self.stations.get_mut(&sender).expect("a station");
        station.acted_ms = begins_ms;
        let places: &[_] = match act {
            MissionAct::Upload(places) => places,
            MissionAct::Clear => &[],
            MissionAct::Start => {
                return self.command(sender, (START, long(START, [0.0; 7]), None), begins_ms);
            }
            MissionAct::Continue => {
                let goes_on = long(193, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
                return self.command(sender, (193, goes_on, None), begins_ms);
            }
        };
        let mut upload = station.upload.iter();
        if upload.any(|it| it.is_busy(begins_ms)) {
            return;
        }
        let upload = Upload::new(places, robot, &mut self.missions);
        let station = self.stations.get_mut(&sender).expect("a station");
        station.upload = Some(upload);
    }

    /// The operator of a station gives the port a value.
    fn set(&mut self, order: &Order, now_ms: u64) {
        self.sets += 1;
        let value = SET_MPS + SET_STEP_MPS * self.sets as f64;
        let message = MessageWriter::new(PARAM_SET).f32(value as f32).u8(1).u8(1);
        let station = self.stations.get_mut(&order.sender).expect("a station");
        station
            .sets
            .iter_mut()
            .for_each(|set| set.is_answered = true);
        station.sets.push(Set {
            value,
            message: message.text(CRUISE, 16).u8(REAL32),
            next_ms: now_ms + order.late_ms,
            times: 0,
            is_answered: false,
            orders: 0,
            came: None,
        });
    }

    fn command(
        &mut self,
        sender: usize,
        (number, message, place): (u16, MessageWriter, Option<(f64, f64, f64)>),
        next_ms: u64,
    ) {
        let station = self.stations.get_mut(&sender).expect("a station");
        for command in &mut station.commands {
            command.is_open &= command.number != number;
        }
        station.commands.push(Command {
            place,
            message,
            number,
            begins_ms: next_ms,
            next_ms,
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
            for set in &mut station.sets {
                if !set.is_answered && set.next_ms <= now_ms && set.times < TIMES {
                    set.next_ms = now_ms + AGAIN_MS;
                    set.times += 1;
                    frames.push(set.message.clone());
                }
            }
            if station.reads_at.take_if(|at| *at <= now_ms).is_some() {
                let message = MessageWriter::new(PARAM_REQUEST_READ).i16(-1).u8(1).u8(1);
                frames.push(message.text(CRUISE, 16));
            }
            frames.extend(
                station
                    .upload
                    .as_mut()
                    .and_then(|upload| upload.say(now_ms)),
            );
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
            let (lives, now_ms) = (self.lives, robot.now_ms);
            for set in &mut station.sets {
                let sent = set
                    .message
                    .frame(frame.sequence, frame.system, frame.component);
                if sent == bytes {
                    set.came.get_or_insert((lives, now_ms));
                }
            }
        }
        self.socket.push_back((sender, bytes, robot.host()));
    }

    fn reach_station(&mut self, sender: usize, bytes: &[u8], robot: &mut Robot) {
        for frame in frames(bytes).flatten() {
            let station = self.stations.get_mut(&sender).expect("a station");
            let upload = station.upload.as_mut();
            if let Some(answer) = upload.and_then(|upload| upload.answer(&frame, robot.now_ms)) {
                station.frame = station.frame.wrapping_add(1);
                let bytes = answer.frame(station.frame, 200 + sender as u8, 190);
                self.carry(robot.now_ms, sender, || Datagram::Up(sender, bytes.clone()));
            }
            let station = self.stations.get_mut(&sender).expect("a station");
            if matches!(frame.kind, PARAM_VALUE | PARAM_ERROR)
                && let Some(set) = station.sets.last_mut()
            {
                let is_it = is_same_value(frame.payload.f32(0).into(), set.value);
                set.is_answered |= is_it || frame.kind == PARAM_ERROR;
            }
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
            let goes_on = robot.bridge_life.is_up()
                && robot.judge.goes_on(*order)
                && !robot.judge.is_overtaken(*order);
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
            if self.plant == Plant::GatewayWritesOld
                && let Some(old) = self.old_value(sender, &bytes)
            {
                self.gateway.datagram(from, &old, came, now);
            }
            if self.plant == Plant::GatewayCopies {
                self.gateway.datagram(address(sender), &bytes, came, now);
            }
            is_due = true;
        }
        let process = self.process;
        let reports = std::mem::take(&mut self.reports);
        let mut send = |data: &MovementData| {
            let order = robot.judge.order_of(data.request_id);
            let order = order.filter(|_| robot.bridge_life.is_up());
            order.is_some_and(|order| {
                robot.send(robot.now_ms, order, process, Request::Movement(*data));
                true
            })
        };
        for report in reports {
            let report = match self.plant {
                Plant::GatewayFlatters if report.stage() == Some(Stage::Refused) => RequestReport {
                    request_id: report.request_id,
                    ..RequestReport::new(Stage::Accepted, ipc_types::code::Reason::None)
                },
                _ => report,
            };
            self.sent.report(&report, &mut self.gateway, &mut send, now);
            is_due = true;
        }
        self.sent.advance(&mut self.gateway, &mut send, now);
        for mission in self.missions.take_saved() {
            self.gateway.saved(mission, Ok(()), now);
            is_due = true;
        }
        if !is_due {
            return;
        }
        self.gateway.advance(now);
        while let Some(order) = self.gateway.poll_order() {
            self.ask(&order, robot, next_id);
        }
        self.do_tasks(robot, next_id);
        if let Some(progress) = self.gateway.poll_progress(now) {
            self.missions.keep_progress(progress);
        }
        while let Some(event) = self.gateway.poll_event() {
            robot.judge.note(format!("the gateway: {event:?}"));
        }
        while let Some(datagram) = self.gateway.poll_datagram() {
            self.judge_sent(&datagram, robot);
            self.note_answer(&datagram, now);
            let sender = usize::from(datagram.to.port() - FIRST_PORT);
            if self.stations.contains_key(&sender) {
                let bytes = datagram.bytes;
                self.carry(robot.now_ms, sender, || {
                    Datagram::Down(sender, bytes.clone())
                });
            }
        }
        if self.sent.count() > 16 {
            robot
                .judge
                .fail("the gateway has more orders open than its bound".to_owned());
        }
    }

    fn do_tasks(&mut self, robot: &mut Robot, next_id: &mut u64) {
        let now = robot.host();
        while let Some(task) = self.gateway.poll_task() {
            match task {
                Task::Rules => {
                    let rules = robot.bridge_life.is_up().then(|| robot.config());
                    self.gateway.rules(rules, now);
                }
                Task::Save(mission) if self.plant == Plant::MissionAcksEarly => {
                    self.gateway.saved(mission, Ok(()), now);
                }
                Task::Save(mission) => self.missions.save(mission, robot.now_ms, &mut self.dice),
                Task::PutFence(_) | Task::RestoreFence => {}
            }
            self.gateway.advance(now);
            while let Some(order) = self.gateway.poll_order() {
                self.ask(&order, robot, next_id);
            }
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
    fn judge_sent(&mut self, datagram: &mavlink_gateway::Datagram, robot: &mut Robot) {
        let sender = usize::from(datagram.to.port() - FIRST_PORT);
        for frame in frames(&datagram.bytes).flatten() {
            let station = self.stations.get(&sender);
            let upload = station.and_then(|station| station.upload.as_ref());
            self.missions.judge_sent(&frame, upload, robot);
            if frame.kind == PARAM_VALUE && is_cruise(&frame) {
                robot.judge.judge_value(frame.payload.f32(0).into());
            }
            if frame.kind != GLOBAL_POSITION_INT {
                continue;
            }
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
            OrderKind::WritePort(..) => What::Write,
            OrderKind::ReadPort(_) => What::Read,
            OrderKind::Path => What::Path(vec![(0.0, 0.0); self.gateway.path(order.number).len()]),
            _ => return,
        };
        if !robot.bridge_life.is_up() {
            return self.gateway.not_sent(order.number, "", robot.host());
        }
        let number = robot.judge.orders.len();
        let mut requests = robot.requests(&what, *next_id);
        *next_id += requests.len() as u64;
        let ids: Vec<u64> = requests.iter().map(Request::id).collect();
        let starter = self.starter(order);
        let (mut sender, mut after) = (None, order.after);
        match order.kind {
            OrderKind::GoTo(position) => {
                sender = self.ordered(order, number, robot);
                robot.go_to(&mut requests, &[position]);
            }
            OrderKind::Path => {
                let path = self.gateway.path(order.number).to_vec();
                let last = (number, ids[ids.len() - 1]);
                let flown = self
                    .missions
                    .flies(&path, last, (order.after, starter), robot);
                (after, sender) = flown.map_or((0, None), |(meant, sender)| (meant, Some(sender)));
                robot.go_to(&mut requests, &path);
            }
            OrderKind::WritePort(port, value) => {
                self.writes(value, number, robot);
                let write = ParameterRequest::write(ids[0], port, value);
                requests = vec![Request::Parameter(write)];
            }
            OrderKind::ReadPort(port) => {
                requests = vec![Request::Parameter(ParameterRequest::read(ids[0], port))];
            }
            OrderKind::Start | OrderKind::TakeOff(_) => {
                self.missions.starts(starter, order.after, ids[0]);
            }
            _ => {}
        }
        let true_ms = robot.judge.true_ms_of(order.issued);
        let stamp = Stamp {
            issued: order.issued,
            begin_by: order.begin_by,
            after: match self.plant {
                Plant::MissionForgetsStep => 0,
                _ => order.after,
            },
        };
        robot.judge.ordered(Ordered {
            order: Order::at_once(sender.unwrap_or(usize::MAX), robot.index, what),
            ids,
            after,
            true_ms,
            issued_ms: true_ms,
            begin_by_ms: order
                .begin_by
                .map(|by| true_ms + (by.0 - order.issued.0) / MS),
            process: self.process,
            station: sender.map(station_of),
            ..Ordered::default()
        });
        let requests = requests.into_iter().map(|request| request.stamped(stamp));
        let requests: Vec<Request> = requests.collect();
        let path = requests.iter().filter_map(Request::movement).collect();
        let first = requests[0];
        self.sent
            .begin(order, Verb::GoTo, first.id(), path, robot.host());
        robot.send(now_ms, number, self.process, first);
    }

    /// A value of a station is ordered: once, and not over a newer one of it.
    fn writes(&mut self, value: f64, number: usize, robot: &mut Robot) {
        robot.judge.writes(number, value);
        let lives = self.lives;
        for (sender, station) in &mut self.stations {
            let is_it = |set: &Set| is_same_value(set.value, value);
            let Some(place) = station.sets.iter().position(is_it) else {
                continue;
            };
            station.sets[place].orders += 1;
            let is_old = station.sets[place + 1..].iter().any(|set| set.orders > 0);
            // A station that has no answer repeats it.
            let is_twice = station.sets[place].orders > station.sets[place].times && lives == 0;
            if is_old || is_twice {
                let how = if is_old { "over a newer one" } else { "twice" };
                let text = format!("the value {value} of sender {sender} is written {how}");
                robot.judge.fail(text);
            }
            return;
        }
        robot
            .judge
            .fail(format!("the value {value} is of no station"));
    }

    /// A planted fault: after a value of a station, the one before it as a newer frame.
    fn old_value(&self, sender: usize, bytes: &[u8]) -> Option<Vec<u8>> {
        let frame = frames(bytes).flatten().find(|it| it.kind == PARAM_SET)?;
        let sets = &self.stations[&sender].sets;
        let is_it = |set: &Set| is_same_value(set.value, frame.payload.f32(0).into());
        let place = sets.iter().position(is_it)?;
        let old = &sets[place.checked_sub(1)?].message;
        Some(old.frame(
            frame.sequence.wrapping_add(1),
            frame.system,
            frame.component,
        ))
    }

    /// Every value that came was answered by now.
    pub fn all_answered(&self, robot: &mut Robot) {
        let sets = self.stations.values().flat_map(|station| &station.sets);
        for set in sets {
            let is_late = |(lives, at_ms): (u32, u64)| {
                lives == self.lives && robot.now_ms > at_ms + SET_WITHIN_MS
            };
            if set.came.is_some_and(is_late) && set.orders == 0 && !set.is_answered {
                robot
                    .judge
                    .fail(format!("the value {} has no answer", set.value));
            }
        }
    }

    /// The station whose command to fly the mission came at the moment of an order.
    fn starter(&self, order: &GatewayOrder) -> Option<usize> {
        let starts = |command: &Command| {
            // One that was chosen on the ground waits for the arming.
            let is_start = matches!(command.number, START | 193 | 400);
            is_start && command.came.contains(&order.issued)
        };
        let mut stations = self.stations.iter();
        stations
            .find_map(|(sender, station)| station.commands.iter().any(starts).then_some(*sender))
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
            let orders = &robot.judge.orders;
            let is_taken = |(order, _): &(usize, MonotonicNs)| {
                orders.get(*order).is_some_and(|it| it.accepted.is_some())
            };
            let is_again = !is_another
                && !is_late
                && command.ordered.len() > 1
                && command.ordered.iter().any(is_taken);
            // After its own mission a station's command is another one.
            let is_twice = is_again && station.acted_ms < command.begins_ms;
            if is_twice && lives == 0 {
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
