//! The world: the bridge's core and the simulated DSP with its helicopter, the wire between them, and one clock that
//! jumps from deadline to deadline. No thread, no file, no sleep.

use std::time::Duration;

use bridge::Input;
use bridge::config::TrajectoryKind;
use bridge::journal::Journaled;
use bridge::{Bridge, BridgeConfig, RequestKey, Sender};
use dsp_protocol::Waypoint;
use dsp_sim::faults::PortState;
use dsp_sim::helicopter::vector::Vector;
use dsp_sim::simulator::Simulator;
use ipc_types::MonotonicNs;
use ipc_types::code::{ControlCommand, LinkState, MovementKind, Stage};
use ipc_types::payload::{
    BridgeJournal, ModuleControl, MovementData, ParameterRequest, StatusJournal, WaypointPosition,
};

use crate::missions::buffer::{Buffer, Look};
use crate::missions::chain::Chain;
use crate::missions::config::WorldConfig;
use crate::missions::recording::{self, Recording};
use crate::missions::truth::{Line, Movement};
use crate::missions::wire::{Noise, Probe};
use crate::missions::witness::{Outcome, Witness};

mod trouble;

pub use trouble::{Beside, Trouble};
use trouble::{Ending, Plan};

/// The host's clock when the world begins: far from zero, so that neither clock is taken for the other.
const HOST_EPOCH: MonotonicNs = MonotonicNs(86_400_000_000_000);

/// Longest virtual time to wait for anything: longer than any flight here, with the movements' time limit of
/// [`WorldConfig`].
const LONGEST_WAIT: Duration = Duration::from_secs(400);

/// How long the bridge's process takes to find a port that is back: its shortest pause between two attempts.
const REOPENING: Duration = Duration::from_millis(50);

/// Steps in which the clock may stand still: messages that go to and fro without taking time.
const MAX_STEPS_AT_ONCE: u32 = 1000;

/// The bridge's core, the simulated DSP and the wire between them, in virtual time.
pub struct World {
    pub simulator: Simulator,
    pub witness: Witness,
    pub probe: Probe,
    pub chain: Chain,
    pub buffer: Buffer,
    /// Free places of the DSP's path buffer when it was fullest.
    pub fewest_free_places: usize,
    /// How often the bridge was killed, or ended.
    pub deaths: u32,
    /// How often a stop was asked for while the link was silent.
    pub silent_stops: u64,
    /// Id of the last request that was sent before a bridge was killed or ended; 0 when none was.
    pub requests_of_the_dead: u64,
    bridge: Journaled,
    /// The journal of the bridge, which is verified while it is written.
    recording: Recording<BridgeJournal>,
    bridge_config: BridgeConfig,
    /// A bridge that was asked to end.
    ending: Option<Ending>,
    /// When a bridge that is gone is started again.
    bridge_starts: Option<Duration>,
    now: Duration,
    is_exact: bool,
    is_recorded: bool,
    sees_everything: bool,
    line: Line,
    /// When the last fault of the simulator's script is over.
    faults_end: Duration,
    /// Whether the DSP stops by itself when the bridge is gone, and nothing holds up what the bridge said last.
    stops_alone: bool,
    /// When the last bridge was gone.
    gone_since: Option<Duration>,
    /// When the port opens; `None` while it is open, and [`Duration::MAX`] while there is no device.
    port_opens: Option<Duration>,
    /// The device as it was last seen.
    device: PortState,
    noise: [Noise; 2],
    /// By how much the DSP flies beside where it is told to, m.
    pub beside: Option<Beside>,
    plan: Option<Plan>,
    /// Troubles and when they happen, the next one last.
    agenda: Vec<(Duration, Trouble)>,
    /// The movement under way, by its request.
    movement: Option<(u64, Movement)>,
    /// Requests that are done only when the DSP holds nothing, and what they are.
    watched: Vec<(u64, &'static str)>,
    /// The waypoints that were accepted since the last head of a path.
    open_path: Vec<MovementData>,
    next_request: u64,
    steps_at_once: u32,
}

impl World {
    pub fn new(config: &WorldConfig) -> World {
        let seed = config.simulator.model.seed;
        let mut probe = Probe::new(config.bridge.link.profile, config.is_sound);
        if config.bridge.trajectory.kind == TrajectoryKind::DivideLegs {
            probe.allow_divided_legs();
        }
        World {
            simulator: Simulator::new(config.simulator.clone()),
            witness: Witness::new(config.is_sound),
            probe,
            chain: Chain::new(config.is_recorded),
            buffer: Buffer::new(config.is_sound),
            fewest_free_places: usize::MAX,
            deaths: 0,
            silent_stops: 0,
            bridge: recording::bridge(&config.bridge, config.is_recorded),
            recording: Recording::default(),
            bridge_config: config.bridge.clone(),
            ending: None,
            bridge_starts: None,
            now: Duration::ZERO,
            is_exact: config.is_exact,
            is_recorded: config.is_recorded,
            sees_everything: config.is_sound && config.is_dense,
            line: config.line(),
            stops_alone: config.simulator.firmware.has_pc_timeout
                && config.simulator.faults.is_none(),
            gone_since: None,
            faults_end: config.faults_end,
            port_opens: Some(Duration::from_millis(10)),
            device: PortState::default(),
            noise: [Noise::new(seed, 101), Noise::new(seed, 102)],
            beside: None,
            plan: None,
            agenda: Vec::new(),
            movement: None,
            watched: Vec::new(),
            open_path: Vec::new(),
            next_request: 0,
            requests_of_the_dead: 0,
            steps_at_once: 0,
        }
    }

    pub fn bridge(&self) -> &Bridge {
        &self.bridge
    }

    pub fn now(&self) -> Duration {
        self.now
    }

    /// Whether every waypoint that is reached is seen to be.
    pub fn sees_everything(&self) -> bool {
        self.sees_everything
    }

    /// Whether nothing goes wrong any more: the bridge and its port are there, no trouble waits, and every fault of the
    /// script is over.
    pub fn is_calm(&self) -> bool {
        self.is_alive()
            && self.port_opens.is_none()
            && self.agenda.is_empty()
            && self.now >= self.faults_end
            && self.noise.iter().all(|noise| noise.is_over(self.now))
    }

    /// Keeps the journals from now on.
    pub fn keep_journals(&mut self) {
        self.recording.keep();
        self.chain.recording().keep();
    }

    /// The journals since then; the mission must be finished.
    pub fn journals(&mut self) -> (Vec<BridgeJournal>, Vec<StatusJournal>) {
        self.chain.finish();
        (self.recording.kept(), self.chain.recording().kept())
    }

    /// Runs until `done` holds.
    #[track_caller]
    pub fn run_until(&mut self, what: &str, done: impl Fn(&World) -> bool) {
        let end = self.now + LONGEST_WAIT;
        while !done(self) {
            assert!(
                self.now < end,
                "never: {what}; {:?}, {:?}, link {}",
                self.witness.phases.last(),
                self.simulator.helicopter().phase(),
                self.bridge.link(),
            );
            self.step(end);
        }
    }

    /// Runs for some time.
    pub fn run_for(&mut self, time: Duration) {
        let end = self.now + time;
        while self.now < end {
            self.step(end);
        }
    }

    /// Sends a control request and returns its id.
    pub fn control(&mut self, command: ControlCommand) -> u64 {
        let id = self.request_id();
        let request = ModuleControl {
            issued_ns: host(self.now).0,
            ..ModuleControl::new(id, command)
        };
        let (key, sender) = (RequestKey::Control(id), Sender::default());
        if command == ControlCommand::Stop {
            self.watched.push((id, "a stop"));
            self.silent_stops += u64::from(self.bridge.link() == LinkState::Silent);
        }
        if self.is_alive() {
            let input = Input::Control {
                key,
                sender,
                request,
            };
            self.bridge.apply(host(self.now), input, &mut self.witness);
            self.exchange();
        }
        id
    }

    /// Sends a movement request, with an id of the world's choice, and returns the id.
    pub fn movement(&mut self, request: MovementData) -> u64 {
        let request_id = self.request_id();
        let request = MovementData {
            request_id,
            issued_ns: host(self.now).0,
            ..request
        };
        if !self.is_alive() {
            return request_id;
        }
        let path = self.path_closed_by(&request);
        let allowed = path.as_deref().map(|path| self.probe.path_closes(path));
        let movement = Movement::of(&request, path.as_deref(), self.simulator.helicopter());
        if request.kind() != Some(MovementKind::GoToWaypoint) || path.is_some() {
            self.watched.push((request_id, "a movement"));
        }
        let input = Input::Movement {
            key: RequestKey::Movement(request_id),
            sender: Sender::default(),
            request,
        };
        self.bridge.apply(host(self.now), input, &mut self.witness);
        self.exchange();
        let is_accepted = self.witness.words(request_id)[0].stage() == Some(Stage::Accepted);
        if request.kind() == Some(MovementKind::GoToWaypoint) && is_accepted {
            if request.first == 1 {
                self.open_path.clear();
            }
            self.open_path.push(request);
        }
        match (movement, allowed) {
            (Some(movement), _) if is_accepted => {
                if path.is_none() {
                    // A path that it pre-empted is over.
                    self.probe.path_closes(&[]);
                }
                self.movement = Some((request_id, movement));
            }
            // The path that is being flown goes on.
            (_, Some(allowed)) if !is_accepted => self.probe.path_goes_on(allowed),
            _ => {}
        }
        request_id
    }

    /// Sends a parameter request, with an id of the world's choice, and returns the id.
    pub fn parameter(&mut self, request: ParameterRequest) -> u64 {
        let request_id = self.request_id();
        let request = ParameterRequest {
            request_id,
            issued_ns: host(self.now).0,
            ..request
        };
        if self.is_alive() {
            let input = Input::Parameter {
                key: RequestKey::Parameter(request_id),
                sender: Sender::default(),
                request,
            };
            self.bridge.apply(host(self.now), input, &mut self.witness);
            self.exchange();
        }
        request_id
    }

    /// Sends a request that was sent before, under its id, and returns what is said at once.
    pub fn ask_again(&mut self, request: &MovementData) -> Outcome {
        self.witness.now = host(self.now);
        self.witness.expect(request.request_id);
        let input = Input::Movement {
            key: RequestKey::Movement(request.request_id),
            sender: Sender::default(),
            request: *request,
        };
        self.bridge.apply(host(self.now), input, &mut self.witness);
        self.exchange();
        let outcome = self.witness.outcome(request.request_id);
        outcome.expect("a final report at once")
    }

    /// Sends one waypoint of a path, given in the flat world, and returns the request's id. `path` is the whole path.
    pub fn waypoint(&mut self, path_id: u64, path: &[Vector], index: usize) -> u64 {
        let request = self.waypoint_request(path_id, path, index);
        self.movement(request)
    }

    /// The request of [`World::waypoint`].
    pub fn waypoint_request(&self, path_id: u64, path: &[Vector], index: usize) -> MovementData {
        let world = self.simulator.helicopter().world();
        let position = world.to_geographic(path[index]);
        let position = WaypointPosition {
            latitude_deg: position.latitude_deg,
            longitude_deg: position.longitude_deg,
            altitude_m: position.altitude_m,
        };
        let (first, last) = (index == 0, index + 1 == path.len());
        MovementData::waypoint(0, path_id, position, first, last)
    }

    /// The waypoints of the path that `request` would close, judged by the requests and what was said about them: those
    /// since the last head that are open or done, and this one. A waypoint is done when the next one has been accepted.
    fn path_closed_by(&self, request: &MovementData) -> Option<Vec<Waypoint>> {
        if request.kind() != Some(MovementKind::GoToWaypoint) || request.last != 1 {
            return None;
        }
        let is_open = |waypoint: &&MovementData| {
            let outcome = self.witness.outcome(waypoint.request_id);
            request.first == 0 && outcome.is_none_or(|outcome| outcome.is_done())
        };
        let path = self.open_path.iter().filter(is_open).chain([request]);
        let path = path.map(|waypoint| Waypoint {
            latitude_deg: waypoint.latitude_deg,
            longitude_deg: waypoint.longitude_deg,
            altitude_m: waypoint.altitude_m,
        });
        Some(path.collect())
    }

    /// Ends the bridge; every request must then have had its final report.
    pub fn finish(&mut self) {
        self.witness.now = host(self.now);
        if self.is_alive() {
            self.bridge
                .apply(host(self.now), Input::Close, &mut self.witness);
        }
        self.witness.assert_all_answered();
        self.recording.process_gone(self.bridge.writer());
    }

    fn request_id(&mut self) -> u64 {
        self.witness.now = host(self.now);
        self.next_request += 1;
        self.witness.expect(self.next_request);
        if !self.is_alive() {
            self.witness.bridge_gone();
        }
        self.next_request
    }

    fn is_alive(&self) -> bool {
        self.bridge_starts.is_none()
    }

    /// Jumps to the next deadline of anybody, `end` at the latest, and does what is due.
    fn step(&mut self, end: Duration) {
        let bridge = self.is_alive().then(|| {
            Duration::from_nanos(self.bridge.deadline().since(HOST_EPOCH).as_nanos() as u64)
        });
        let next = [
            bridge,
            self.bridge_starts,
            self.ending.map(|ending| ending.latest),
            self.simulator.next_deadline(),
            self.port_opens,
            self.agenda.last().map(|(when, _)| *when),
            Some(end),
        ]
        .into_iter()
        .flatten()
        .min()
        .unwrap_or(end);
        if next > self.now {
            self.now = next;
            self.steps_at_once = 0;
        }
        self.steps_at_once += 1;
        assert!(
            self.steps_at_once < MAX_STEPS_AT_ONCE,
            "time stands still at {:?}",
            self.now
        );
        let now = host(self.now);
        self.witness.now = now;
        self.simulator.advance(self.now);
        self.bridge_starts.take_if(|starts| *starts <= self.now);
        self.follow_device();
        if self.port_opens.is_some_and(|opens| opens <= self.now) {
            self.port_opens = None;
            // What was said meanwhile was said to nobody.
            self.simulator.transmit(|bytes| bytes.len());
            self.bridge.apply(
                now,
                Input::PortOpened(Default::default()),
                &mut self.witness,
            );
        }
        self.exchange();
        if self.is_alive() {
            self.bridge.apply(now, Input::Advance, &mut self.witness);
            self.exchange();
        }
        self.look();
        self.end_bridge_if_wound_down();
        self.trouble();
        self.recording.take(self.bridge.writer(), now);
    }

    /// Carries bytes both ways until neither side has any.
    fn exchange(&mut self) {
        let now = host(self.now);
        loop {
            let mut from_dsp = Vec::new();
            self.simulator.transmit(|bytes| {
                from_dsp.extend_from_slice(bytes);
                bytes.len()
            });
            if self.port_opens.is_some() {
                return;
            }
            // A real line would drop what was given up; here it has been sent.
            self.bridge.take_discard_unsent(now);
            let mut to_dsp = self.bridge.transmit(now).to_vec();
            if !to_dsp.is_empty() {
                let taken = Input::Transmitted(to_dsp.len());
                self.bridge.apply(now, taken, &mut self.witness);
            }
            if from_dsp.is_empty() && to_dsp.is_empty() {
                return;
            }
            self.probe.hear_dsp(&from_dsp);
            let paths = self.probe.paths;
            self.probe.hear_bridge(&to_dsp);
            if self.probe.paths != paths {
                self.buffer.path_begins(self.simulator.held_waypoints());
            }
            if let Some(beside) = &mut self.beside {
                to_dsp = beside.bend(&to_dsp, self.simulator.helicopter().world());
            }
            self.noise[0].damage(self.now, &mut from_dsp);
            self.noise[1].damage(self.now, &mut to_dsp);
            self.bridge
                .apply(now, Input::Received(&from_dsp), &mut self.witness);
            let taken = self.simulator.receive(self.now, &to_dsp);
            assert_eq!(taken, to_dsp.len(), "the line to the DSP is full");
        }
    }

    /// Looks at the truth, and compares what the consumers got to it.
    fn look(&mut self) {
        self.look_at_buffer();
        let helicopter = self.simulator.helicopter();
        self.fewest_free_places = self.fewest_free_places.min(helicopter.free_places());
        if let Some((id, movement)) = &mut self.movement {
            movement.follow(helicopter);
            if let Some(outcome) = self.witness.outcome(*id) {
                if outcome.is_done() {
                    movement.assert_done(helicopter, self.line);
                }
                self.movement = None;
            }
        }
        for sample in self.witness.fresh.drain(..) {
            self.chain.take(&sample, host(self.now));
            if self.is_exact {
                self.chain.compare(helicopter);
            }
        }
    }

    /// Compares what the DSP holds with what the bridge says about it.
    fn look_at_buffer(&mut self) {
        let held = self.simulator.held_waypoints();
        let (buffer, witness) = (&mut self.buffer, &self.witness);
        self.watched.retain(|(id, what)| {
            let Some(outcome) = witness.outcome(*id) else {
                return true;
            };
            if outcome.is_done() {
                buffer.done(what, held);
            } else if outcome.stage != Stage::Refused {
                buffer.ended_early(held);
            }
            false
        });
        self.buffer.look(&Look {
            now: self.now,
            held,
            state: self.bridge_starts.is_none().then_some(&self.witness.state),
            attempts: self.probe.path_emptyings,
            without_bridge: match self.gone_since {
                Some(since) if !self.is_alive() && self.stops_alone => self.now - since,
                _ => Duration::ZERO,
            },
        });
    }
}

fn host(now: Duration) -> MonotonicNs {
    HOST_EPOCH + now
}
