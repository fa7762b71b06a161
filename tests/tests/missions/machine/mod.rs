//! The order machine: orders of several senders, with clocks that are not known exactly, late and double, while
//! everything goes wrong: senders die and hang, the bridge stands still or is killed, the machine is suspended, the
//! line is silent or noisy, the DSP reboots, the pilot takes over, the GPS loses its fix. The bridge's core and the
//! simulated DSP are the real ones; time is virtual.
//!
//! [`sequence`] is what happens, as data that a seed draws and that is made shorter when it fails. [`judge`] says what
//! must hold, by what was truly ordered, what the reports said and what went over the wire. This file plays a sequence.

pub mod judge;
pub mod sequence;

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
use ipc_types::code::{ControlCommand, Functionality, LinkState, MovementKind, SenderLost};
use ipc_types::payload::{
    DspTelemetry, ModuleControl, ModuleState, MovementData, RequestReport, WaypointPosition,
};

use judge::{Judge, RENEWALS, Ran};
use sequence::{Act, Order, Sequence, What};

const MS: u64 = 1_000_000;
/// The host's clock when the simulator's is 0.
const EPOCH_MS: u64 = 86_400_000;
/// One step of time.
const TICK_MS: u64 = 10;
/// How long after the last act everything is watched.
const QUIET_MS: u64 = 5000;
/// What the kernel keeps of the line for a bridge that stands still.
const KERNEL_BYTES: usize = 4095;
/// The kernel tells a bridge that is awake of the end of a process within this.
const TOLD_MS: u64 = 20;
/// How far the fence is, and the paths' height, m.
const FENCE_M: f64 = 30.0;
const HEIGHT_M: f64 = 15.0;
/// Each order has its own height, by which its first waypoint is known on the wire, m; its second one is half a step
/// higher.
const STEP_M: f64 = 0.02;
/// Each take-off, too: this height, and so much more for each order before it, m.
const TAKE_OFF_M: f64 = 4.0;
const TAKE_OFF_STEP_M: f64 = 0.01;
/// The process of the relay, by which the orders of stations come.
const RELAY: u32 = 999;
/// The requests of a sequence have greater ids.
const FIRST_ID: u64 = 100;

/// A fault that is planted between the world and the bridge, to see whether the judge finds it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Plant {
    /// None.
    Nothing,
    /// An order is as old as its arrival.
    StampedByReader,
    /// A copy is an order of its own.
    CopyIsNew,
    /// No step names the one before.
    NoStep,
    /// Nobody tells the bridge of the end of a process, and every lease is renewed.
    SendersLiveForEver,
    /// What may begin until a moment may begin a minute later.
    NoMoment,
    /// Only a take-off may.
    NoMomentOfTakeOff,
    /// A step whose predecessor was refused names none.
    AfterRefused,
    /// With any process the sender of the path ends.
    WrongProcess,
    /// Whose sender is to be followed by a landing is held.
    HoldsForLand,
    /// The bridge does not learn that the machine was suspended.
    SleepIsNothing,
    /// The bridge has no fence.
    NoFence,
}

impl Plant {
    pub const ALL: [Plant; 11] = [
        Plant::StampedByReader,
        Plant::CopyIsNew,
        Plant::NoStep,
        Plant::SendersLiveForEver,
        Plant::NoMoment,
        Plant::NoMomentOfTakeOff,
        Plant::AfterRefused,
        Plant::WrongProcess,
        Plant::HoldsForLand,
        Plant::SleepIsNothing,
        Plant::NoFence,
    ];
}

/// What a sequence broke, and all that happened.
#[derive(Debug)]
pub struct Failure {
    pub what: String,
    pub log: Vec<String>,
}

/// What the core said since the last look.
#[derive(Default)]
struct Said(Vec<RequestReport>);

impl Outputs for Said {
    fn telemetry(&mut self, fill: &mut dyn FnMut(&mut DspTelemetry)) {
        fill(&mut DspTelemetry::default());
    }

    fn state(&mut self, _: &ModuleState) {}

    fn report(&mut self, _: RequestKey, report: &RequestReport) {
        self.0.push(*report);
    }

    fn notice(&mut self, _: &Notice) {}
}

/// A request on its way to the bridge.
#[derive(Clone, Copy)]
enum Request {
    Movement(MovementData),
    Control(ModuleControl),
}

impl Request {
    fn id(&self) -> u64 {
        match self {
            Request::Movement(data) => data.request_id,
            Request::Control(data) => data.request_id,
        }
    }
}

struct Message {
    at_ms: u64,
    order: usize,
    process: u32,
    request: Request,
}

struct Machine {
    plant: Plant,
    config: BridgeConfig,
    simulator: Simulator,
    bridge: Bridge,
    said: Said,
    judge: Judge,
    now_ms: u64,
    messages: Vec<Message>,
    /// Ends of processes that the bridge has not been told of: when, and which.
    ended: Vec<(u64, u32)>,
    /// Each sender's present process, and until when that stands still.
    processes: Vec<u32>,
    hang_until: Vec<u64>,
    /// When each process was last awake, by the host's clock.
    alive: Vec<(u32, u64)>,
    stall_until: u64,
    /// Until when the machine is suspended, for how long it was, and for how long the bridge does not know of.
    asleep_until: u64,
    slept_ms: u64,
    unseen_sleep_ms: u64,
    away_until: Option<u64>,
    silent_until: u64,
    noisy_until: u64,
    noise: Random,
    /// What the DSP said to a bridge that stands still.
    line: Vec<u8>,
    uplink: Decoder<Uplink>,
    /// The order whose take-off altitude was written last.
    take_off: usize,
    next_id: u64,
    /// The last request of each sender's last order.
    last_step: Vec<u64>,
}

/// Plays the sequence, with a planted fault.
///
/// # Errors
/// What it broke.
pub fn play(sequence: &Sequence, plant: Plant) -> Result<Ran, Failure> {
    let mut machine = Machine::new(sequence, plant);
    let mut acts = sequence.acts.iter().peekable();
    let begin_ms = machine.now_ms;
    let end_ms = sequence.acts.last().map_or(0, |(at, _)| *at) + QUIET_MS;
    while machine.now_ms < begin_ms + end_ms {
        while let Some((_, act)) = acts.next_if(|(at, _)| begin_ms + at <= machine.now_ms) {
            machine.act(sequence, act);
        }
        machine.tick();
        if machine.judge.failure.is_some() {
            break;
        }
    }
    machine.finish()
}

/// Plays the sequence of a seed; one that fails is made shorter, and the shortest is told with its log.
///
/// # Panics
/// It fails.
pub fn play_seed(seed: u64) -> Ran {
    let sequence = Sequence::draw(seed);
    if let Ok(ran) = play(&sequence, Plant::Nothing) {
        return ran;
    }
    let shortest = sequence.shrink(|sequence| play(sequence, Plant::Nothing).is_err());
    let failure = play(&shortest, Plant::Nothing).expect_err("it failed before");
    let acts = shortest
        .acts
        .iter()
        .map(|(at, act)| format!("{at:>6} ms: {act:?}\n"));
    panic!(
        "seed {seed}: {}\n{:?}\n{}what happened:\n{}",
        failure.what,
        shortest.senders,
        acts.collect::<String>(),
        failure.log.join("\n")
    );
}

/// Where sequences begin: the simulator, the bridge, and when that is.
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
            "[safety]\nposition_lost_s = 1.0\n[parameters]\ncruise_speed_mps = 4.0\n{}",
            if has_fence { fence.as_str() } else { "" }
        );
        let config: BridgeConfig = runtime::config::parse(&text, "a test").expect("a configuration");
        let mut machine = Machine::with(
            Plant::Nothing,
            &config,
            (Simulator::new(setup), Bridge::new(&config), 0),
            &Sequence::default(),
        );
        machine.apply(Input::PortOpened);
        let until = |machine: &mut Machine, done: fn(&Machine) -> bool| {
            while !done(machine) {
                machine.tick();
                assert!(machine.now_ms < 60_000, "it never hovers");
            }
        };
        until(&mut machine, |machine| machine.bridge.link() == LinkState::Up);
        (0..50).for_each(|_| machine.tick());
        let standing = machine.begin();
        let start = ModuleControl {
            issued_ns: machine.host().0,
            ..ModuleControl::new(1, ControlCommand::Start)
        };
        machine.ask(Request::Control(start), 1);
        let take_off = MovementData {
            request_id: 2,
            issued_ns: machine.host().0,
            ..MovementData::take_off(2, HEIGHT_M)
        };
        machine.ask(Request::Movement(take_off), 1);
        until(&mut machine, |machine| {
            machine.simulator.helicopter().is_flying()
                && machine.bridge.state().functionality() == Some(Functionality::AtRest)
        });
        // So that no order may have been issued before them.
        (0..50).for_each(|_| machine.tick());
        let hovering = machine.begin();
        (config, [standing, hovering])
    })
}

impl Machine {
    fn new(sequence: &Sequence, plant: Plant) -> Machine {
        let (config, [standing, hovering]) = begins(plant != Plant::NoFence);
        let (simulator, snapshot, now_ms) = match sequence.on_ground {
            true => standing,
            false => hovering,
        };
        let bridge = Snapshot::restore(snapshot).expect("a snapshot").bridge;
        Machine::with(
            plant,
            config,
            (simulator.clone(), bridge, *now_ms),
            sequence,
        )
    }

    fn with(
        plant: Plant,
        config: &BridgeConfig,
        (simulator, bridge, now_ms): (Simulator, Bridge, u64),
        sequence: &Sequence,
    ) -> Machine {
        let senders = sequence.senders.len();
        Machine {
            plant,
            config: config.clone(),
            simulator,
            bridge,
            said: Said::default(),
            judge: Judge::new(now_ms),
            now_ms,
            messages: Vec::new(),
            ended: Vec::new(),
            processes: (0..senders).map(|sender| 1000 + sender as u32).collect(),
            hang_until: vec![0; senders],
            alive: Vec::new(),
            stall_until: 0,
            asleep_until: 0,
            slept_ms: 0,
            unseen_sleep_ms: 0,
            away_until: None,
            silent_until: 0,
            noisy_until: 0,
            noise: Random::new(sequence.acts.len() as u64, 9),
            line: Vec::new(),
            uplink: Decoder::new(),
            take_off: 0,
            next_id: FIRST_ID,
            last_step: vec![0; senders],
        }
    }

    /// A sequence may begin like this.
    fn begin(&self) -> Begin {
        let text = Snapshot::text_of(&self.config);
        let snapshot = Snapshot::take(&self.bridge, &self.config, &text);
        (self.simulator.clone(), snapshot, self.now_ms)
    }

    fn host(&self) -> MonotonicNs {
        MonotonicNs((EPOCH_MS + self.now_ms - self.slept_ms) * MS)
    }

    fn apply(&mut self, input: Input<'_>) {
        let now = self.host();
        self.bridge.apply(now, input, &mut self.said);
    }

    fn act(&mut self, sequence: &Sequence, act: &Act) {
        self.judge.note(format!("{:?}", act));
        let now_ms = self.now_ms;
        let is_of_machine = matches!(
            act,
            Act::Order(_) | Act::Dies(_) | Act::Hangs(..) | Act::Stall(_) | Act::Restart(_)
        );
        match *act {
            _ if is_of_machine && self.asleep_until > now_ms => {}
            Act::Order(ref order) => self.order(sequence, order),
            Act::Dies(sender) => {
                let process = self.processes[sender];
                self.ended.push((now_ms, process));
                self.messages
                    .retain(|message| message.process != process || message.at_ms <= now_ms);
                self.judge.process_ended(process);
                self.processes[sender] += 100;
                self.hang_until[sender] = 0;
                self.last_step[sender] = 0;
            }
            Act::Hangs(sender, ms) => {
                self.hang_until[sender] = self.hang_until[sender].max(now_ms + ms);
                let until_ms = self.hang_until[sender] - self.slept_ms;
                self.judge.process_hangs(self.processes[sender], until_ms);
            }
            Act::Sleep(ms) => {
                self.asleep_until = self.asleep_until.max(now_ms + ms);
                self.judge.sleeps();
            }
            Act::Stall(ms) => self.stall_until = self.stall_until.max(now_ms + ms),
            Act::Silence(ms) => self.silent_until = self.silent_until.max(now_ms + ms),
            Act::Noise(ms) => self.noisy_until = self.noisy_until.max(now_ms + ms),
            Act::Reboot => {
                self.judge.trouble(now_ms);
                self.simulator.reboot();
            }
            Act::Restart(ms) => {
                self.away_until = Some(now_ms + ms);
                self.line.clear();
                self.judge.bridge_killed();
            }
            Act::Pilot(ms) => {
                let event = HelicopterEvent::PilotTakesOver(Duration::from_millis(ms));
                self.simulator.apply_to_helicopter(event);
                self.judge.pilot_until(now_ms, now_ms + ms);
            }
            Act::NoFix(ms) => {
                let event = HelicopterEvent::LoseFix(Duration::from_millis(ms));
                self.simulator.apply_to_helicopter(event);
            }
        }
    }

    /// A sender orders something: its requests are on their way.
    fn order(&mut self, sequence: &Sequence, order: &Order) {
        let plan = sequence.senders[order.sender];
        let number = self.judge.orders.len();
        let issued_ms = EPOCH_MS + self.now_ms - self.slept_ms - plan.error_ms;
        let begin_by_ms = order.within_ms.map(|within| issued_ms + within);
        let after = match order.is_step {
            true if self.plant != Plant::NoStep => self.last_step[order.sender],
            _ => 0,
        };
        let process = self.processes[order.sender];
        let mut at_ms = self.now_ms.max(self.hang_until[order.sender]) + order.late_ms;
        let requests: Vec<Request> = match &order.what {
            What::Start => vec![self.control(ControlCommand::Start)],
            What::Stop => vec![self.control(ControlCommand::Stop)],
            What::Hold => vec![Request::Movement(
                MovementData::hold(self.id()).preempting(),
            )],
            What::Land => vec![Request::Movement(
                MovementData::land(self.id()).preempting(),
            )],
            What::TakeOff => {
                let height_m = TAKE_OFF_M + TAKE_OFF_STEP_M * number as f64;
                vec![Request::Movement(MovementData::take_off(
                    self.id(),
                    height_m,
                ))]
            }
            What::Path(places) => {
                let path_id = self.next_id + 1;
                let count = places.len();
                let waypoint = |(index, place): (usize, &(f64, f64))| {
                    let above_m = STEP_M * (number as f64 + index as f64 / 2.0);
                    let at = Vector::new(place.0, place.1, HEIGHT_M + above_m);
                    let at = self.simulator.helicopter().world().to_geographic(at);
                    let position = WaypointPosition {
                        latitude_deg: at.latitude_deg,
                        longitude_deg: at.longitude_deg,
                        altitude_m: at.altitude_m,
                    };
                    let id = path_id + index as u64;
                    let (first, last) = (index == 0, index + 1 == count);
                    let data = MovementData::waypoint(id, path_id, position, first, last);
                    Request::Movement(MovementData {
                        lease_ms: order.lease_ms.unwrap_or_default(),
                        sender_lost: order.lost.map_or(0, SenderLost::code),
                        ..data.preempting()
                    })
                };
                let requests: Vec<Request> = places.iter().enumerate().map(waypoint).collect();
                self.next_id += count as u64;
                requests
            }
        };
        let is_station = plan.origin != 0;
        let ids: Vec<u64> = requests.iter().map(Request::id).collect();
        self.last_step[order.sender] = ids[ids.len() - 1];
        self.judge.ordered(judge::Ordered {
            order: order.clone(),
            ids,
            after: if order.is_step { after } else { 0 },
            true_ms: self.now_ms,
            begin_by_ms: begin_by_ms.map(|at| at - EPOCH_MS + self.slept_ms),
            issued_ms: issued_ms - EPOCH_MS + self.slept_ms,
            process,
            is_station,
            ..judge::Ordered::default()
        });
        if self.plant == Plant::NoStep && order.is_step {
            // The judge knows what the sender meant.
            self.judge
                .meant_after(number, self.judge.step_before(order.sender, number));
        }
        let process = if is_station { RELAY } else { process };
        for request in requests {
            let request = match request {
                Request::Control(data) => Request::Control(ModuleControl {
                    issued_ns: issued_ms * MS,
                    issued_within_ns: (plan.within_ms * MS) as u32,
                    origin: plan.origin,
                    begin_by_ns: begin_by_ms.unwrap_or_default() * MS,
                    after,
                    ..data
                }),
                Request::Movement(data) => Request::Movement(MovementData {
                    issued_ns: issued_ms * MS,
                    issued_within_ns: (plan.within_ms * MS) as u32,
                    origin: plan.origin,
                    begin_by_ns: begin_by_ms.unwrap_or_default() * MS,
                    after,
                    ..data
                }),
            };
            self.send(at_ms, number, process, request);
            if let (Some(copy_ms), Request::Movement(data)) = (order.copy_ms, request) {
                let copy = match self.plant {
                    Plant::CopyIsNew => MovementData {
                        request_id: data.request_id + 1_000_000,
                        path_id: data.path_id + u64::from(data.path_id > 0) * 1_000_000,
                        ..data
                    },
                    _ => MovementData { repeat: 1, ..data },
                };
                self.send(at_ms + copy_ms, number, process, Request::Movement(copy));
            }
            at_ms += TICK_MS;
        }
    }

    fn send(&mut self, at_ms: u64, order: usize, process: u32, request: Request) {
        let message = Message {
            at_ms,
            order,
            process,
            request,
        };
        let place = self.messages.partition_point(|other| other.at_ms <= at_ms);
        self.messages.insert(place, message);
    }

    fn id(&mut self) -> u64 {
        self.next_id += 1;
        self.next_id
    }

    fn control(&mut self, command: ControlCommand) -> Request {
        Request::Control(ModuleControl::new(self.id(), command))
    }

    fn ask(&mut self, request: Request, process: u32) {
        let sender = Sender {
            process: Some(process),
            ..Sender::default()
        };
        match request {
            Request::Movement(request) => self.apply(Input::Movement {
                key: RequestKey::Movement(request.request_id),
                sender,
                request,
            }),
            Request::Control(request) => self.apply(Input::Control {
                key: RequestKey::Control(request.request_id),
                sender,
                request,
            }),
        }
        self.exchange();
    }

    /// One step of time for everybody.
    fn tick(&mut self) {
        self.now_ms += TICK_MS;
        self.judge.now_ms = self.now_ms;
        let now = Duration::from_millis(self.now_ms);
        self.simulator.advance(now);
        let bytes = self.dsp_bytes();
        if self.asleep_until > self.now_ms {
            self.sleep();
            return self.look();
        }
        self.live();
        if let Some(until) = self.away_until {
            // What is sent to nobody is lost, and its sender knows.
            let lost = self
                .messages
                .partition_point(|message| message.at_ms <= self.now_ms);
            self.messages.drain(..lost);
            if until <= self.now_ms {
                self.away_until = None;
                self.bridge = Bridge::new(&self.config);
                self.uplink = Decoder::new();
                self.judge.bridge_began();
                self.apply(Input::PortOpened);
                self.exchange();
            }
        } else {
            self.line.extend_from_slice(&bytes);
            self.line.truncate(KERNEL_BYTES);
            if self.stall_until <= self.now_ms {
                self.wake();
            } else {
                self.judge.stalled(TICK_MS);
            }
        }
        self.look();
    }

    /// All that is on the machine stands still, and what the DSP says meanwhile is lost.
    fn sleep(&mut self) {
        self.slept_ms += TICK_MS;
        self.unseen_sleep_ms += TICK_MS;
        self.judge.slept(TICK_MS);
        let moments = self.messages.iter_mut().map(|message| &mut message.at_ms);
        let moments = moments.chain(self.ended.iter_mut().map(|(at_ms, _)| at_ms));
        let others = [&mut self.stall_until]
            .into_iter()
            .chain(&mut self.away_until)
            .chain(&mut self.hang_until);
        let now_ms = self.now_ms;
        moments
            .chain(others.filter(|until| **until >= now_ms))
            .for_each(|at_ms| *at_ms += TICK_MS);
    }

    /// The processes of the senders that are alive and awake.
    fn live(&mut self) {
        let host_ms = self.now_ms - self.slept_ms;
        for (process, hang_until) in self.processes.iter().zip(&self.hang_until) {
            if *hang_until > self.now_ms {
                continue;
            }
            match self.alive.iter_mut().find(|(other, _)| other == process) {
                Some((_, at_ms)) => *at_ms = host_ms,
                None => self.alive.push((*process, host_ms)),
            }
        }
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
        while self
            .messages
            .first()
            .is_some_and(|message| message.at_ms <= self.now_ms)
        {
            let message = self.messages.remove(0);
            let request = self.planted(message.request);
            self.judge
                .delivered(message.order, message.request.id(), request.id());
            self.ask(request, message.process);
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
                    let home_m = self
                        .simulator
                        .helicopter()
                        .world()
                        .to_geographic(Vector::ZERO)
                        .altitude_m;
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
                Uplink::Command(Command::Write16 { port, value: 1 }) => match port {
                    port::TAKE_OFF if self.next_id > FIRST_ID => {
                        self.judge.sent(self.take_off, true)
                    }
                    port::LAND => self.judge.path_invalidated(true),
                    _ => {}
                },
                Uplink::Command(Command::InvalidatePath) => self.judge.path_invalidated(false),
                Uplink::Command(_) => {}
            }
        }
    }

    fn hear(&mut self) {
        for report in self.said.0.drain(..) {
            self.judge.reported(&report);
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
        if self.away_until.is_none() {
            let state = self.bridge.state();
            let follows = state.functionality() == Some(Functionality::FollowingPath);
            self.judge.look(
                follows.then_some(state.movement.path_id),
                self.stall_until.max(self.asleep_until) <= self.now_ms,
            );
        }
    }

    /// The bridge ends, and every request has its final report.
    fn finish(mut self) -> Result<Ran, Failure> {
        if self.away_until.is_none() && self.judge.failure.is_none() {
            self.apply(Input::Close);
            self.hear();
            self.judge.closed();
        }
        self.judge.verdict()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::missions::seeds;

    #[test]
    fn whatever_happens_the_helicopter_does_what_was_ordered_last() {
        let ran = seeds::fly_each(0..1000, play_seed);
        println!("{ran}");
        if ran.sequences >= 1000 {
            assert!(
                ran.began > 0 && ran.superseded > 0 && ran.too_late > 0 && ran.lost > 0,
                "{ran}"
            );
            assert!(ran.take_offs > 0 && ran.sleeps > 0, "{ran}");
            assert!(ran.copies > 0 && ran.restarts > 0 && ran.steps > 0, "{ran}");
        }
    }

    #[test]
    fn the_machine_finds_what_is_planted_and_makes_it_short() {
        for plant in Plant::ALL {
            let found = (0..2000)
                .map(Sequence::draw)
                .find(|sequence| play(sequence, plant).is_err());
            let sequence = found.unwrap_or_else(|| panic!("{plant:?} is never found"));
            let before = sequence.acts.len();
            let shortest = sequence.shrink(|sequence| play(sequence, plant).is_err());
            let failure = play(&shortest, plant).expect_err("it failed before");
            println!(
                "{plant:?}: {} of {before} acts: {}",
                shortest.acts.len(),
                failure.what
            );
            assert!(shortest.acts.len() <= 4, "{plant:?}: {shortest:#?}");
            assert!(
                play(&shortest, Plant::Nothing).is_ok(),
                "{plant:?}: {shortest:#?}"
            );
        }
    }
}
