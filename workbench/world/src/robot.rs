//! A robot: the simulated helicopter, the line to it, and the bridge's and status' cores on a machine whose clock and
//! processes stand still, sleep and die.

use std::collections::{BTreeMap, VecDeque};
use std::sync::OnceLock;
use std::time::Duration;

use bridge::journal::Snapshot;
use bridge::outputs::Notice;
use bridge::{Bridge, BridgeConfig, Input, Outputs, RequestKey, Sender};
use dsp_protocol::{Command, Decoded, Decoder, Uplink, port};
use dsp_sim::faults::HelicopterEvent;
use dsp_sim::helicopter::vector::Vector;
use dsp_sim::random::Random;
use dsp_sim::simulator::{Setup, Simulator};
use ipc_types::MonotonicNs;
use ipc_types::code::{
    ControlCommand, Functionality, LinkState, MovementKind, Reason, SenderLost, Stage,
};
use ipc_types::payload::{
    DspTelemetry, HeroTelemetry, ModuleControl, ModuleState, MovementData, ParameterRequest,
    RequestReport, WaypointPosition,
};
use status::core::{Input as StatusInput, Output as StatusOutput, Status};

use crate::beliefs::Truth;
use crate::judge::{Judge, RENEWALS};
use crate::life::{EPOCH_MS, Life, MS, QUEUE, TICK_MS};
use crate::plant::Plant;
use crate::request::{Request, Stamp};
use crate::script::{Script, What};

/// What the kernel keeps of the line for a bridge that stands still.
const KERNEL_BYTES: usize = 4095;
/// The kernel tells a bridge that is awake of the end of a process within this.
const TOLD_MS: u64 = 20;
/// How far the fence is, and the paths' height, m.
const FENCE_M: f64 = 30.0;
const HEIGHT_M: f64 = 15.0;
/// How late the bridge may find out about a boot of which it has heard nothing: no status has come for some seconds.
const BOOT_SEEN_MS: u64 = 4_000;
/// Each order has its own height, by which its first waypoint is known on the wire, m; its second one is half a step
/// higher.
const STEP_M: f64 = 0.02;
/// Each take-off, too: this height, and so much more for each order before it, m.
const TAKE_OFF_M: f64 = 4.0;
const TAKE_OFF_STEP_M: f64 = 0.01;
/// Each write, too: this cruise speed, and so much more for each order before it, m/s. The configuration's is less.
const CRUISE_MPS: f64 = 4.0;
const CRUISE_STEP_MPS: f64 = 0.001;

/// What the core said since the last look.
#[derive(Default)]
struct Said {
    reports: Vec<(u64, RequestReport)>,
    samples: Vec<DspTelemetry>,
    state: Option<ModuleState>,
}

impl Outputs for Said {
    fn telemetry(&mut self, fill: &mut dyn FnMut(&mut DspTelemetry)) {
        let mut sample = DspTelemetry::default();
        fill(&mut sample);
        self.samples.push(sample);
    }

    fn state(&mut self, state: &ModuleState) {
        self.state = Some(*state);
    }

    fn report(&mut self, to: RequestKey, report: &RequestReport) {
        let (RequestKey::Control(ticket)
        | RequestKey::Movement(ticket)
        | RequestKey::Parameter(ticket)) = to;
        self.reports.push((ticket, *report));
    }

    fn notice(&mut self, _: &Notice) {}
}

enum Letter {
    Request(usize, Request),
    /// A client has given up this request.
    GivenUp(u64),
}

struct Message {
    at_ms: u64,
    process: u32,
    letter: Letter,
}

/// An open request of a process at the bridge.
struct Ticket {
    process: u32,
    request_id: u64,
    key: fn(u64) -> RequestKey,
}

/// A robot with its machine, and what is judged of it.
pub struct Robot {
    pub index: usize,
    plant: Plant,
    config: BridgeConfig,
    pub simulator: Simulator,
    bridge: Bridge,
    said: Said,
    pub judge: Judge,
    pub truth: Truth,
    pub now_ms: u64,
    pub bridge_life: Life,
    messages: VecDeque<Message>,
    tickets: BTreeMap<u64, Ticket>,
    next_ticket: u64,
    /// Reports to processes, in order.
    pub reports: Vec<(u32, RequestReport)>,
    /// Ends of processes that the bridge has not been told of: when, and which.
    ended: Vec<(u64, u32)>,
    /// When each process was last awake, by the host's clock.
    alive: Vec<(u32, u64)>,
    pub asleep_until: u64,
    pub slept_ms: u64,
    unseen_sleep_ms: u64,
    silent_until: u64,
    noisy_until: u64,
    noise: Random,
    /// What the DSP said to a bridge that stands still.
    line: Vec<u8>,
    uplink: Decoder<Uplink>,
    /// The order whose take-off altitude was written last.
    take_off: usize,
    status: Option<Status>,
    pub status_life: Life,
    /// What the bridge has published, and status has not read.
    raw: VecDeque<DspTelemetry>,
    published: u64,
    translated: u64,
    last_raw: DspTelemetry,
    /// What was published in this step.
    pub samples: Vec<HeroTelemetry>,
    pub state: Option<ModuleState>,
}

/// Where runs begin: the simulator, the bridge, and when that is.
type Begin = (Simulator, Vec<u8>, u64);

/// A helicopter that stands, and one that hovers.
fn begins(has_fence: bool) -> &'static (BridgeConfig, [Begin; 2]) {
    static WITH: OnceLock<(BridgeConfig, [Begin; 2])> = OnceLock::new();
    static WITHOUT: OnceLock<(BridgeConfig, [Begin; 2])> = OnceLock::new();
    let cell = if has_fence { &WITH } else { &WITHOUT };
    cell.get_or_init(|| {
        let setup = Setup {
            baud: None,
            ..Setup::default()
        };
        let home = setup.model.home;
        let fence = format!(
            "[[fence.area]]\nname = \"field\"\nkind = \"inclusion\"\ncentre = [{:.9}, {:.9}]\nradius_m = {FENCE_M:.1}\n",
            home.latitude_deg, home.longitude_deg
        );
        let text = format!(
            "[safety]\nposition_lost_s = 1.0\n[parameters]\ncruise_speed_mps = {CRUISE_MPS:.1}\n{}",
            if has_fence { fence.as_str() } else { "" }
        );
        let config: BridgeConfig = runtime::config::parse(&text, "a test").expect("a configuration");
        let begin = (Simulator::new(setup), Bridge::new(&config), 0);
        let mut robot = Robot::with(0, Plant::Nothing, &config, begin, 0);
        robot.apply(Input::PortOpened(Default::default()));
        let until = |robot: &mut Robot, done: fn(&Robot) -> bool| {
            while !done(robot) {
                robot.tick(&[]);
                assert!(robot.now_ms < 60_000, "it never hovers");
            }
        };
        until(&mut robot, |robot| robot.bridge.link() == LinkState::Up);
        (0..50).for_each(|_| robot.tick(&[]));
        let standing = robot.begin();
        let stamp = |robot: &Robot| Stamp {
            issued: robot.host(),
            ..Stamp::default()
        };
        let start = Request::Control(ModuleControl::new(1, ControlCommand::Start));
        robot.ask(start.stamped(stamp(&robot)), 1);
        let take_off = Request::Movement(MovementData::take_off(2, HEIGHT_M));
        robot.ask(take_off.stamped(stamp(&robot)), 1);
        until(&mut robot, |robot| {
            robot.simulator.helicopter().is_flying()
                && robot.bridge.state().functionality() == Some(Functionality::AtRest)
        });
        // So that no order may have been issued before them.
        (0..50).for_each(|_| robot.tick(&[]));
        let hovering = robot.begin();
        (config, [standing, hovering])
    })
}

/// When runs begin, ms.
pub fn begin_ms(on_ground: bool) -> u64 {
    let (_, [standing, hovering]) = begins(true);
    if on_ground { standing.2 } else { hovering.2 }
}

impl Robot {
    pub fn new(index: usize, script: &Script, plant: Plant) -> Robot {
        let (config, [standing, hovering]) = begins(plant != Plant::NoFence);
        let (simulator, snapshot, _) = match script.on_ground {
            true => standing,
            false => hovering,
        };
        let bridge = Snapshot::restore(snapshot).expect("a snapshot").bridge;
        let begin = (simulator.clone(), bridge, begin_ms(script.on_ground));
        Robot::with(index, plant, config, begin, script.seed)
    }

    fn with(
        index: usize,
        plant: Plant,
        config: &BridgeConfig,
        (simulator, bridge, now_ms): (Simulator, Bridge, u64),
        seed: u64,
    ) -> Robot {
        Robot {
            index,
            plant,
            config: config.clone(),
            simulator,
            bridge,
            said: Said::default(),
            judge: Judge::new(index, now_ms),
            truth: Truth::default(),
            now_ms,
            bridge_life: Life::default(),
            messages: VecDeque::new(),
            tickets: BTreeMap::new(),
            next_ticket: 1,
            reports: Vec::new(),
            ended: Vec::new(),
            alive: Vec::new(),
            asleep_until: 0,
            slept_ms: 0,
            unseen_sleep_ms: 0,
            silent_until: 0,
            noisy_until: 0,
            noise: Random::new(seed, 90 + index as u64),
            line: Vec::new(),
            uplink: Decoder::new(),
            take_off: 0,
            status: None,
            status_life: Life::default(),
            raw: VecDeque::new(),
            published: 0,
            translated: 0,
            last_raw: DspTelemetry::default(),
            samples: Vec::new(),
            state: None,
        }
    }

    /// A run may begin like this.
    fn begin(&self) -> Begin {
        let text = Snapshot::text_of(&self.config);
        let snapshot = Snapshot::take(&self.bridge, &self.config, &text);
        (self.simulator.clone(), snapshot, self.now_ms)
    }

    /// The monotonic clock of its machine.
    pub fn host(&self) -> MonotonicNs {
        MonotonicNs((EPOCH_MS + self.now_ms - self.slept_ms) * MS)
    }

    pub fn is_asleep(&self) -> bool {
        self.asleep_until > self.now_ms
    }

    fn apply(&mut self, input: Input<'_>) {
        let now = self.host();
        self.bridge.apply(now, input, &mut self.said);
    }

    /// The requests of an order that is the next one here; their ids begin behind `id`.
    pub fn requests(&self, what: &What, id: u64) -> Vec<Request> {
        let number = self.judge.orders.len();
        let control = |command| vec![Request::Control(ModuleControl::new(id + 1, command))];
        match what {
            What::Start => control(ControlCommand::Start),
            What::Stop => control(ControlCommand::Stop),
            What::Write => {
                let value = CRUISE_MPS + CRUISE_STEP_MPS * (number + 1) as f64;
                let write = ParameterRequest::write(id + 1, port::CRUISE_SPEED_MPS, value);
                vec![Request::Parameter(write)]
            }
            What::Read => {
                let read = ParameterRequest::read(id + 1, port::CRUISE_SPEED_MPS);
                vec![Request::Parameter(read)]
            }
            What::Hold => vec![Request::Movement(MovementData::hold(id + 1).preempting())],
            What::Land => vec![Request::Movement(MovementData::land(id + 1).preempting())],
            What::TakeOff => {
                let height_m = TAKE_OFF_M + TAKE_OFF_STEP_M * number as f64;
                let request = MovementData::take_off(id + 1, height_m);
                vec![Request::Movement(request)]
            }
            What::Path(places) => {
                let path_id = id + 1;
                let waypoint = |(index, place): (usize, &(f64, f64))| {
                    let position = self.waypoint(number, index, *place);
                    let (first, last) = (index == 0, index + 1 == places.len());
                    let id = path_id + index as u64;
                    let data = MovementData::waypoint(id, path_id, position, first, last);
                    Request::Movement(data.preempting())
                };
                places.iter().enumerate().map(waypoint).collect()
            }
        }
    }

    /// Where a waypoint of an order is, at its own height.
    pub fn waypoint(&self, number: usize, index: usize, place: (f64, f64)) -> WaypointPosition {
        let above_m = STEP_M * (number as f64 + index as f64 / 2.0);
        let at = Vector::new(place.0, place.1, HEIGHT_M + above_m);
        let at = self.simulator.helicopter().world().to_geographic(at);
        WaypointPosition {
            latitude_deg: at.latitude_deg,
            longitude_deg: at.longitude_deg,
            altitude_m: at.altitude_m,
        }
    }

    /// The waypoints of a path are at these places, at the heights of their order.
    pub fn go_to(&self, requests: &mut [Request], places: &[WaypointPosition]) {
        for (request, place) in requests.iter_mut().zip(places) {
            if let Request::Movement(data) = request {
                (data.latitude_deg, data.longitude_deg) = (place.latitude_deg, place.longitude_deg);
            }
        }
    }

    /// What the bridge runs with.
    pub fn config(&self) -> &BridgeConfig {
        &self.config
    }

    /// A process of the machine sends a request, which is there at this moment.
    pub fn send(&mut self, at_ms: u64, order: usize, process: u32, request: Request) {
        self.post(at_ms, process, Letter::Request(order, request));
    }

    /// A process gives up what it has asked for.
    pub fn give_up(&mut self, process: u32, request_id: u64) {
        self.judge.may_be_lost(request_id);
        let is_meant = |message: &Message| {
            let Letter::Request(_, request) = &message.letter else {
                return false;
            };
            message.process == process && request.id() == request_id
        };
        self.messages.retain(|message| !is_meant(message));
        let tickets = self.tickets.iter();
        let of_request = tickets
            .filter(|(_, ticket)| (ticket.process, ticket.request_id) == (process, request_id));
        for ticket in of_request.map(|(ticket, _)| *ticket).collect::<Vec<_>>() {
            self.post(self.now_ms, process, Letter::GivenUp(ticket));
        }
    }

    fn post(&mut self, at_ms: u64, process: u32, letter: Letter) {
        let place = self.messages.partition_point(|other| other.at_ms <= at_ms);
        let message = Message {
            at_ms,
            process,
            letter,
        };
        self.messages.insert(place, message);
    }

    /// A process ends: what it had not sent yet is not sent.
    pub fn process_ended(&mut self, process: u32) {
        let now_ms = self.now_ms;
        self.ended.push((now_ms, process));
        self.messages
            .retain(|message| message.process != process || message.at_ms <= now_ms);
        self.judge.process_ended(process);
    }

    /// A process stands still for so long.
    pub fn process_hangs(&mut self, process: u32, until_ms: u64) {
        self.judge.process_hangs(process, until_ms - self.slept_ms);
    }

    /// A process is awake in this step.
    fn lives(&mut self, process: u32) {
        let host_ms = self.now_ms - self.slept_ms;
        match self.alive.iter_mut().find(|(other, _)| *other == process) {
            Some((_, at_ms)) => *at_ms = host_ms,
            None => self.alive.push((process, host_ms)),
        }
    }

    pub fn sleep_until(&mut self, until_ms: u64) {
        self.truth.sleeps(self.now_ms, until_ms);
        self.asleep_until = self.asleep_until.max(until_ms);
        self.judge.sleeps();
    }

    pub fn kill_bridge(&mut self, until_ms: u64) {
        self.judge.bridge_killed();
        self.forget_bridge(until_ms);
    }

    /// No bridge is there, and those that have asked it are told.
    fn forget_bridge(&mut self, until_ms: u64) {
        self.bridge_life.away_until = Some(until_ms);
        self.line.clear();
        let unread = self.take_due();
        let unread = unread
            .into_iter()
            .filter_map(|message| match message.letter {
                Letter::Request(_, request) => Some((message.process, request.id())),
                Letter::GivenUp(_) => None,
            });
        let open = std::mem::take(&mut self.tickets).into_values();
        let open = open.map(|ticket| (ticket.process, ticket.request_id));
        for (process, request_id) in unread.chain(open) {
            self.bridge_gone(process, request_id);
        }
    }

    fn bridge_gone(&mut self, process: u32, request_id: u64) {
        let report = RequestReport {
            request_id,
            reported_ns: self.host().0,
            ..RequestReport::new(Stage::Unknown, Reason::BridgeGone)
        };
        self.reports.push((process, report));
    }

    pub fn silence(&mut self, until_ms: u64) {
        self.silent_until = self.silent_until.max(until_ms);
    }

    pub fn noise(&mut self, until_ms: u64) {
        self.noisy_until = self.noisy_until.max(until_ms);
        // A bridge that stands still reads later what came before.
        self.truth.noisy_until = self.noisy_until + 3_000;
    }

    pub fn reboot(&mut self) {
        self.judge.trouble(self.now_ms);
        self.judge.breach(self.now_ms + BOOT_SEEN_MS);
        self.simulator.reboot();
    }

    pub fn pilot(&mut self, ms: u64) {
        let event = HelicopterEvent::PilotTakesOver(Duration::from_millis(ms));
        self.simulator.apply_to_helicopter(event);
        self.judge.pilot_until(self.now_ms, self.now_ms + ms);
    }

    pub fn no_fix(&mut self, ms: u64) {
        self.judge.breach(self.now_ms + ms);
        let event = HelicopterEvent::LoseFix(Duration::from_millis(ms));
        self.simulator.apply_to_helicopter(event);
    }

    fn ask(&mut self, request: Request, process: u32) {
        let sender = Sender {
            process: Some(process),
            ..Sender::default()
        };
        let ticket = self.next_ticket;
        self.next_ticket += 1;
        let key = match request {
            Request::Movement(_) => RequestKey::Movement,
            Request::Control(_) => RequestKey::Control,
            Request::Parameter(_) => RequestKey::Parameter,
        };
        let open = Ticket {
            process,
            request_id: request.id(),
            key,
        };
        self.tickets.insert(ticket, open);
        match request {
            Request::Movement(request) => self.apply(Input::Movement {
                key: RequestKey::Movement(ticket),
                sender,
                request,
            }),
            Request::Control(request) => self.apply(Input::Control {
                key: RequestKey::Control(ticket),
                sender,
                request,
            }),
            Request::Parameter(request) => self.apply(Input::Parameter {
                key: RequestKey::Parameter(ticket),
                sender,
                request,
            }),
        }
        self.exchange();
    }

    /// One step of time for the helicopter, the bridge and status; `awake` are the other processes of its machine that
    /// are awake.
    pub fn tick(&mut self, awake: &[u32]) {
        self.now_ms += TICK_MS;
        self.judge.now_ms = self.now_ms;
        self.samples.clear();
        self.state = None;
        let now = Duration::from_millis(self.now_ms);
        self.simulator.advance(now);
        self.truth.note(self.now_ms, self.simulator.helicopter());
        let bytes = self.dsp_bytes();
        if self.is_asleep() {
            self.sleep();
            return self.look();
        }
        awake.iter().for_each(|process| self.lives(*process));
        if !self.bridge_life.is_up() {
            // What is sent to nobody is lost, and its sender knows.
            for message in self.take_due() {
                if let Letter::Request(_, request) = message.letter {
                    self.bridge_gone(message.process, request.id());
                }
            }
            if self.bridge_life.begins(self.now_ms) {
                self.bridge = Bridge::new(&self.config);
                self.uplink = Decoder::new();
                self.judge.bridge_began();
                self.apply(Input::PortOpened(Default::default()));
                self.exchange();
            }
        } else {
            self.line.extend_from_slice(&bytes);
            self.line.truncate(KERNEL_BYTES);
            match self.bridge_life.is_awake(self.now_ms) {
                true => self.wake(),
                false => self.judge.stalled(TICK_MS),
            }
        }
        self.look();
        self.publish();
    }

    /// All that is on the machine stands still, and what the DSP says meanwhile is lost.
    fn sleep(&mut self) {
        self.slept_ms += TICK_MS;
        self.unseen_sleep_ms += TICK_MS;
        self.judge.slept(TICK_MS);
        let moments = self.messages.iter_mut().map(|message| &mut message.at_ms);
        let moments = moments.chain(self.ended.iter_mut().map(|(at_ms, _)| at_ms));
        moments.for_each(|at_ms| *at_ms += TICK_MS);
        self.bridge_life.sleeps();
        self.status_life.sleeps();
    }

    fn take_due(&mut self) -> Vec<Message> {
        let now_ms = self.now_ms;
        let due = self
            .messages
            .partition_point(|message| message.at_ms <= now_ms);
        self.messages.drain(..due).collect()
    }

    /// Before its deadlines pass: the lease of the path was renewed last at this moment. That wakes nobody.
    fn look_at_lease(&mut self) {
        let now = self.host();
        let Some((path_id, _)) = self.bridge.lease().filter(|(_, until)| *until <= now) else {
            return;
        };
        let Some((process, lease_ms)) = self.judge.leased(path_id) else {
            return;
        };
        let mut alive = self.alive.iter().filter(|(other, _)| *other == process);
        let renewed_ms = match self.plant {
            Plant::SendersLiveForEver => Some(self.now_ms - self.slept_ms),
            _ => alive.next().map(|(_, at)| at - at % (lease_ms / RENEWALS)),
        };
        if let Some(at_ms) = renewed_ms {
            let at = MonotonicNs((EPOCH_MS + at_ms) * MS);
            self.apply(Input::LeaseRenewed(at));
        }
    }

    /// The bridge reads the line, the requests and what else has come, and then its deadlines pass.
    fn wake(&mut self) {
        self.judge.awake();
        let slept_ms = std::mem::take(&mut self.unseen_sleep_ms);
        if slept_ms > 0 && self.plant != Plant::SleepIsNothing {
            self.apply(Input::Suspended(slept_ms * MS));
            self.exchange();
        }
        let line = std::mem::take(&mut self.line);
        if !line.is_empty() {
            self.apply(Input::Received(&line));
            self.exchange();
        }
        for message in self.take_due() {
            match message.letter {
                Letter::Request(order, request) => {
                    let told = self.planted(request);
                    self.judge.delivered(order, request.id(), told.id());
                    self.ask(told, message.process);
                }
                Letter::GivenUp(ticket) => self.given_up(ticket),
            }
            self.hear();
        }
        let live_for_ever = self.plant == Plant::SendersLiveForEver;
        let told = self
            .ended
            .partition_point(|(at, _)| at + TOLD_MS <= self.now_ms);
        for (_, process) in self.ended.drain(..told).collect::<Vec<_>>() {
            let process = match (self.plant, self.bridge.path_sender()) {
                (Plant::WrongProcess, Some(sender)) => sender,
                _ => process,
            };
            if !live_for_ever {
                self.apply(Input::ProcessEnded(process));
                self.exchange();
            }
        }
        self.look_at_lease();
        self.apply(Input::Advance);
        self.exchange();
    }

    fn given_up(&mut self, ticket: u64) {
        let Some(Ticket {
            request_id, key, ..
        }) = self.tickets.remove(&ticket)
        else {
            return;
        };
        self.judge.given_up(request_id);
        self.apply(Input::SenderGone(key(ticket)));
        self.exchange();
    }

    fn planted(&self, request: Request) -> Request {
        let now = self.host().0;
        match (self.plant, request) {
            (Plant::StampedByReader, Request::Movement(data)) => Request::Movement(MovementData {
                issued_ns: now,
                ..data
            }),
            (Plant::NoMomentOfTakeOff, Request::Movement(data))
                if data.kind() != Some(MovementKind::TakeOff) =>
            {
                request
            }
            (Plant::NoMoment | Plant::NoMomentOfTakeOff, Request::Movement(data)) => {
                Request::Movement(MovementData {
                    begin_by_ns: now + 60_000 * MS,
                    ..data
                })
            }
            (Plant::NoMomentOfWrite, Request::Parameter(data)) => {
                Request::Parameter(ParameterRequest {
                    begin_by_ns: now + 60_000 * MS,
                    ..data
                })
            }
            (Plant::HoldsForLand, Request::Movement(data)) => Request::Movement(MovementData {
                sender_lost: data.sender_lost.min(SenderLost::Hold.code()),
                ..data
            }),
            (Plant::AfterRefused, Request::Movement(data)) if self.judge.is_refused(data.after) => {
                Request::Movement(MovementData { after: 0, ..data })
            }
            _ => request,
        }
    }

    /// Carries bytes both ways until neither side has any.
    fn exchange(&mut self) {
        let now = self.host();
        loop {
            self.bridge.take_discard_unsent();
            let mut bytes = self.bridge.transmit(now).to_vec();
            if bytes.is_empty() {
                return;
            }
            self.apply(Input::Transmitted(bytes.len()));
            self.overhear(&bytes);
            if self.silent_until > self.now_ms {
                continue;
            }
            self.damage(&mut bytes);
            self.simulator
                .receive(Duration::from_millis(self.now_ms), &bytes);
            let answer = self.dsp_bytes();
            if !answer.is_empty() {
                self.apply(Input::Received(&answer));
            }
        }
    }

    fn dsp_bytes(&mut self) -> Vec<u8> {
        let mut bytes = Vec::new();
        self.simulator.transmit(|piece| {
            bytes.extend_from_slice(piece);
            piece.len()
        });
        if self.silent_until > self.now_ms {
            bytes.clear();
        }
        self.damage(&mut bytes);
        bytes
    }

    fn damage(&mut self, bytes: &mut [u8]) {
        if self.noisy_until <= self.now_ms {
            return;
        }
        for byte in bytes {
            if self.noise.next_u64().is_multiple_of(100) {
                *byte ^= 1 << (self.noise.next_u64() % 8);
            }
        }
    }

    /// Which waypoints the bridge sends.
    fn overhear(&mut self, bytes: &[u8]) {
        // What it has said of its requests comes before.
        self.hear();
        let mut rest = bytes;
        while !rest.is_empty() {
            let (used, decoded) = self.uplink.receive(rest);
            rest = &rest[used..];
            let Decoded::Message(received) = decoded else {
                continue;
            };
            match received.message {
                Uplink::Waypoint(waypoint) => {
                    let world = self.simulator.helicopter().world();
                    let home_m = world.to_geographic(Vector::ZERO).altitude_m;
                    let half_steps = (waypoint.altitude_m - home_m - HEIGHT_M) / STEP_M * 2.0;
                    let half_steps = half_steps.round().max(0.0) as usize;
                    self.judge
                        .sent(half_steps / 2, half_steps.is_multiple_of(2));
                }
                Uplink::Command(Command::Write32 {
                    port: port::TAKE_OFF_ALTITUDE_M,
                    value,
                }) => {
                    let steps = (f64::from(value) - TAKE_OFF_M) / TAKE_OFF_STEP_M;
                    self.take_off = steps.round().max(0.0) as usize;
                }
                Uplink::Command(Command::Write32 {
                    port: port::CRUISE_SPEED_MPS,
                    value,
                }) => self.judge.written(f64::from(value)),
                Uplink::Command(Command::Write16 { port, value: 1 }) => match port {
                    port::TAKE_OFF if !self.judge.orders.is_empty() => {
                        self.judge.sent(self.take_off, true);
                    }
                    port::LAND => self.judge.path_invalidated(true),
                    _ => {}
                },
                Uplink::Command(Command::InvalidatePath) => self.judge.path_invalidated(false),
                Uplink::Command(_) => {}
            }
        }
    }

    /// Takes what the bridge says: reports go to the processes that asked.
    fn hear(&mut self) {
        let ports = self.simulator.dsp().ports();
        if let Some(value) = ports.read_32(port::CRUISE_SPEED_MPS) {
            self.judge.has_value(value.into());
        }
        for (ticket, report) in std::mem::take(&mut self.said.reports) {
            let is_final = report.is_final();
            if is_final && self.plant == Plant::ReportIsLost && ticket.is_multiple_of(7) {
                continue;
            }
            let report = match self.plant {
                Plant::ParameterInvents if report.port.number != 0 => RequestReport {
                    value: report.value + 0.5,
                    ..report
                },
                _ => report,
            };
            self.judge.reported(&report);
            if is_final && self.plant == Plant::ReportIsTwice && ticket.is_multiple_of(7) {
                self.judge.reported(&report);
            }
            let Some(open) = self.tickets.get(&ticket) else {
                continue;
            };
            self.reports.push((open.process, report));
            if is_final {
                self.tickets.remove(&ticket);
            }
        }
    }

    fn look(&mut self) {
        self.hear();
        if self.silent_until > self.now_ms || self.noisy_until > self.now_ms {
            self.judge.trouble(self.now_ms);
        }
        let helicopter = self.simulator.helicopter();
        let at = helicopter.body().position_m;
        if helicopter.is_flying() && at.horizontal_norm() > FENCE_M {
            self.judge.fail(format!("outside the fence: {at:?}"));
        }
        if self.bridge_life.is_up() {
            let state = self.bridge.state();
            let follows = state.functionality() == Some(Functionality::FollowingPath);
            let is_awake = self.bridge_life.is_awake(self.now_ms) && !self.is_asleep();
            self.judge
                .look(follows.then_some(state.movement.path_id), is_awake);
        }
    }

    /// What the bridge has said comes to status, and from there to everybody.
    fn publish(&mut self) {
        let host = self.host();
        if let Some(state) = self.said.state.take() {
            self.state = Some(ModuleState {
                published_ns: host.0,
                ..state
            });
        }
        for mut sample in std::mem::take(&mut self.said.samples) {
            self.published += 1;
            (sample.sequence, sample.epoch_ns) = (self.published, 1 + self.index as u64);
            if let Err(what) = self.truth.published(&sample, host) {
                self.judge.fail(what);
            }
            if self.raw.len() == QUEUE {
                self.raw.pop_front();
            }
            self.raw.push_back(sample);
        }
        if self.status_life.begins(self.now_ms) || !self.status_life.is_up() {
            self.status = None;
        }
        if !self.status_life.is_awake(self.now_ms) {
            return;
        }
        let status = self.status.get_or_insert_with(|| {
            let calibration = status::calibration::Calibration::default();
            Status::new(calibration, status::log::Logs::default(), host)
        });
        for raw in self.raw.drain(..) {
            let given = match self.plant {
                Plant::StatusIsLate => DspTelemetry {
                    received_ns: raw.received_ns,
                    sequence: raw.sequence,
                    ..self.last_raw
                },
                Plant::StatusStamps => DspTelemetry {
                    received_ns: host.0,
                    ..raw
                },
                _ => raw,
            };
            self.last_raw = raw;
            let output = status.apply(host, StatusInput::Sample(given));
            let Some(StatusOutput::Telemetry(mut hero)) = output else {
                self.judge.fail("a sample without a translation".to_owned());
                return;
            };
            status.apply(host, StatusInput::Published(Ok(())));
            status.take_events();
            self.translated += 1;
            (hero.sequence, hero.epoch_ns) = (self.translated, 1 + self.index as u64);
            if let Err(what) = self.truth.read(&hero) {
                self.judge.fail(what);
            }
            self.samples.push(hero);
        }
    }

    /// The bridge ends, and every request has its final report.
    pub fn close(&mut self) {
        if self.bridge_life.is_up() && self.judge.failure.is_none() {
            self.apply(Input::Close);
            self.hear();
            self.judge.closed();
        }
        self.forget_bridge(u64::MAX);
    }
}
