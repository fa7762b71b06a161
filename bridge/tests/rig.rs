//! A test rig for the bridge's core: a scripted DSP in a few lines, a recorder of everything the core says, and time
//! that moves only when a test says so.

use std::collections::{HashMap, VecDeque};

use bridge::outputs::Notice;
use bridge::{Bridge, BridgeConfig, Input, Outputs, RequestKey, Sender};
use dsp_protocol::downlink::{Geographic, ServoPulses, Supply};
use dsp_protocol::{
    Command, DecodeError, Decoded, Decoder, Downlink, DspErrorCode, FlowControl, Frame, Profile,
    Sequence, Status, StatusMask, Uplink, Waypoint, port,
};
use ipc_types::MonotonicNs;
use ipc_types::code::{
    ControlCommand, Functionality, ImiError, LinkState, ModuleStatus, MovementKind, Reason, Stage,
};
use ipc_types::payload::{
    DspTelemetry, ModuleControl, ModuleState, MovementData, ParameterRequest, RequestReport,
};

/// Everything that the core said, in order.
#[derive(Default)]
pub struct Recorder {
    pub telemetry: Vec<DspTelemetry>,
    pub states: Vec<ModuleState>,
    pub reports: Vec<RequestReport>,
    pub notices: Vec<Notice>,
    /// Bytes to the DSP.
    pub sent: usize,
}

impl Outputs for Recorder {
    fn telemetry(&mut self, fill: &mut dyn FnMut(&mut DspTelemetry)) {
        let mut sample = DspTelemetry::default();
        fill(&mut sample);
        self.telemetry.push(sample);
    }

    fn state(&mut self, state: &ModuleState) {
        self.states.push(*state);
    }

    fn report(&mut self, to: RequestKey, report: &RequestReport) {
        let (RequestKey::Control(id) | RequestKey::Movement(id) | RequestKey::Parameter(id)) = to;
        assert_eq!(id, report.request_id, "a report must reach its own request");
        self.reports.push(*report);
    }

    fn sent(&mut self, bytes: &[u8]) {
        self.sent += bytes.len();
    }

    fn notice(&mut self, notice: &Notice) {
        self.notices.push(*notice);
    }
}

/// The DSP as a script: it acknowledges (or not), answers reads of the mask, and remembers its commands.
pub struct ScriptedDsp {
    pub acknowledges: bool,
    pub silent: bool,
    pub grants: bool,
    /// It sends status; a command switches it on.
    pub sends_status: bool,
    /// Time between two statuses.
    pub status_period_ms: u32,
    pub mask: u16,
    /// It has the port that counts waypoints.
    pub counts: bool,
    /// So many of the next waypoints are lost on their way.
    pub loses: u32,
    /// Places of its path buffer. It asks for waypoints while two are free, and discards one that finds none, with
    /// error 15.
    pub places: usize,
    /// It discards this waypoint with error 30.
    pub rejects: Option<Waypoint>,
    /// Errors that it has not sent yet: one goes out after each status.
    pub errors: VecDeque<DspErrorCode>,
    pub taken: u16,
    /// It carries out take-offs and landings.
    pub obeys: bool,
    /// Its rotor still runs after a landing.
    pub lands_until_told: bool,
    /// It has the time-out for a PC that is gone.
    pub has_pc_timeout: bool,
    /// It acknowledges writes to this port, and keeps its own value.
    pub refuses: Option<u16>,
    /// It loses so many of the next acknowledgements.
    pub loses_acks: u32,
    /// What was written to its ports.
    pub ports_16: HashMap<u16, u16>,
    pub ports_32: HashMap<u16, f32>,
    /// Waypoints in its path buffer.
    pub held: Vec<Waypoint>,
    pub time_ms: u32,
    pub status: Status,
    pub commands: Vec<Command>,
    pub waypoints: Vec<Waypoint>,
    /// The number of each waypoint that came, lost and repeated ones, too.
    pub numbers: Vec<Option<Sequence>>,
    /// How it frames what it says; it understands the same.
    profile: Profile,
    number: Sequence,
    decoder: Decoder<Uplink>,
}

impl Default for ScriptedDsp {
    fn default() -> Self {
        ScriptedDsp {
            acknowledges: true,
            silent: false,
            grants: true,
            sends_status: true,
            status_period_ms: 20,
            mask: 0,
            counts: true,
            loses: 0,
            places: usize::MAX,
            rejects: None,
            errors: VecDeque::new(),
            taken: 0,
            obeys: true,
            lands_until_told: false,
            has_pc_timeout: true,
            refuses: None,
            loses_acks: 0,
            ports_16: HashMap::new(),
            ports_32: HashMap::new(),
            held: vec![],
            time_ms: 0,
            status: all_groups(),
            commands: vec![],
            waypoints: vec![],
            numbers: vec![],
            profile: Profile::Classic,
            number: Sequence::FIRST,
            decoder: Decoder::new(),
        }
    }
}

/// A status with every group, on the ground, with the pilot's switch on auto.
fn all_groups() -> Status {
    Status {
        geographic: Some(HOME),
        xy: Some(Default::default()),
        gps_velocity: Some(Default::default()),
        gps_quality: Some(1),
        attitude: Some(Default::default()),
        acceleration: Some(Default::default()),
        angular_rate: Some(Default::default()),
        pilot_pwm: Some(PULSES),
        sonar_adc: Some(0),
        supply: Some(Supply {
            battery_mv: 25_000,
            fuel_percent: 90,
            auto_switch: 1,
        }),
        pan_tilt: Some(Default::default()),
        rotor_rpm: Some(0),
        barometer_adc: Some(0),
        actuation: Some(PULSES),
        references: Some(Default::default()),
        ..Status::default()
    }
}

const PULSES: ServoPulses = ServoPulses {
    collective_us: 1500,
    roll_us: 1500,
    pitch_us: 1500,
    tail_us: 1500,
    throttle_us: 1500,
};

pub const HOME: Geographic = Geographic {
    latitude_deg: 37.0,
    longitude_deg: -6.0,
    altitude_m: 10.0,
};

/// The commands of a stop.
pub const STOP: [Command; 2] = [Command::InvalidatePath, Command::ClearErrors];

/// A refusal, as [`Rig::last`] gives it.
pub fn refused(reason: Reason) -> (Stage, Reason, ImiError) {
    (Stage::Refused, reason, ImiError::None)
}

/// An early end without an IMI error, as [`Rig::last`] gives it.
pub fn aborted(reason: Reason) -> (Stage, Reason, ImiError) {
    (Stage::Aborted, reason, ImiError::None)
}

/// A point north of home by so many hundred-thousandths of a degree (1.1 m each), 20 m high.
pub fn north(steps: i32) -> Waypoint {
    Waypoint {
        latitude_deg: HOME.latitude_deg + f64::from(steps) * 1e-5,
        longitude_deg: HOME.longitude_deg,
        altitude_m: 20.0,
    }
}

impl ScriptedDsp {
    /// Speaks another profile from now on.
    pub fn speak(&mut self, profile: Profile) {
        self.profile = profile;
        self.decoder = Decoder::with_profile(profile);
    }

    /// One message as a frame, with the number of the command that it acknowledges.
    pub fn frame(&mut self, message: &Downlink, acknowledges: Option<Sequence>) -> Frame {
        self.number = self.number.next();
        message.encode_in(self.profile, self.number, acknowledges.unwrap_or_default())
    }

    fn receive(&mut self, bytes: &[u8]) -> Vec<Frame> {
        let (mut rest, mut answers) = (bytes, vec![]);
        while !rest.is_empty() {
            let (used, decoded) = self.decoder.receive(rest);
            rest = &rest[used..];
            match decoded {
                Decoded::Message(received) => {
                    if let Uplink::Waypoint(_) = received.message {
                        self.numbers.push(received.sequence);
                    }
                    let answer = self.take(&received.message);
                    answers.extend(answer.map(|answer| self.frame(&answer, received.sequence)));
                }
                Decoded::Incomplete => {}
                Decoded::Rejected(DecodeError::OtherProfile) => {
                    let error = Downlink::Error(DspErrorCode::UNKNOWN_HEADER);
                    answers.push(self.frame(&error, None));
                }
                Decoded::Rejected(error) => panic!("the bridge sent garbage: {error:?}"),
            }
        }
        answers
    }

    fn take(&mut self, message: &Uplink) -> Option<Downlink> {
        match *message {
            Uplink::Command(command) => {
                self.commands.push(command);
                self.execute(command)
            }
            Uplink::Waypoint(_) if self.loses > 0 => {
                self.loses -= 1;
                None
            }
            Uplink::Waypoint(waypoint) if self.rejects == Some(waypoint) => {
                self.errors.push_back(DspErrorCode::INVALID_COMMAND);
                None
            }
            Uplink::Waypoint(_) if self.held.len() >= self.places => {
                self.errors.push_back(DspErrorCode::UART_QUEUE_FULL);
                None
            }
            Uplink::Waypoint(waypoint) => {
                if self.held.last() != Some(&waypoint) {
                    self.held.push(waypoint);
                    self.waypoints.push(waypoint);
                    self.taken += 1;
                }
                None
            }
        }
    }

    fn execute(&mut self, command: Command) -> Option<Downlink> {
        match command {
            Command::Write16 { port, .. } | Command::Write32 { port, .. }
                if self.refuses == Some(port) => {}
            Command::Write16 { port, value } => {
                if port == port::STATUS_MASK {
                    self.mask = value;
                }
                self.ports_16.insert(port, value);
            }
            Command::Write32 { port, value } => _ = self.ports_32.insert(port, value),
            Command::InvalidatePath => self.held.clear(),
            Command::Read16 { port } if port == port::WAYPOINT_COUNT && !self.counts => {
                self.errors.push_back(DspErrorCode::INVALID_COMMAND);
            }
            _ => {}
        }
        self.sends_status |= command == Command::ActivateStatus && !self.silent;
        let answer = match command {
            Command::Read16 { port } => Downlink::Ack16 {
                command: 0,
                value: self.read(port),
            },
            Command::Read32 { port } => Downlink::Ack32 {
                command: 2,
                value: self.ports_32.get(&port).copied().unwrap_or_default(),
            },
            _ => Downlink::Ack {
                command: command.code(),
            },
        };
        if self.loses_acks > 0 {
            self.loses_acks -= 1;
            return None;
        }
        (self.acknowledges && !self.silent).then_some(answer)
    }

    fn read(&self, port: u16) -> u16 {
        match port {
            port::STATUS_MASK => self.mask,
            port::TAKE_OFF => u16::from(self.obeys && !(self.status.flying && self.grants)),
            port::LAND => u16::from(self.lands_until_told || self.obeys && self.status.flying),
            port::WAYPOINT_COUNT if self.counts => 0x8000 | self.taken,
            port::PC_TIMEOUT_MS if !self.has_pc_timeout => 0,
            _ => self.ports_16.get(&port).copied().unwrap_or_default(),
        }
    }

    /// Forgets what a reboot makes a DSP forget.
    pub fn reboot(&mut self) {
        (self.mask, self.time_ms, self.sends_status, self.grants) = (0, 0, false, false);
        self.ports_16.clear();
        self.ports_32.clear();
        self.held.clear();
    }

    /// The commands so far, without the bridge's signs of life.
    pub fn asked(&self) -> Vec<Command> {
        let keep_alive = Command::Read16 {
            port: port::PC_TIMEOUT_MS,
        };
        let commands = self.commands.iter().copied();
        commands.filter(|command| *command != keep_alive).collect()
    }

    pub fn at(&mut self, waypoint: Waypoint) {
        self.status.geographic = Some(Geographic {
            latitude_deg: waypoint.latitude_deg,
            longitude_deg: waypoint.longitude_deg,
            altitude_m: waypoint.altitude_m,
        });
    }
}

/// Bridge, DSP, recorder and clock.
pub struct Rig {
    pub bridge: Bridge,
    pub dsp: ScriptedDsp,
    pub out: Recorder,
    pub now: MonotonicNs,
    /// What the DSP has said to a bridge that stands still.
    unread: Option<Vec<u8>>,
    next_request: u64,
    /// Who sends.
    pub sender: Sender,
}

impl Rig {
    /// A bridge whose port is closed.
    pub fn closed(config: &BridgeConfig) -> Rig {
        Rig::with(Bridge::new(config))
    }

    /// A bridge that is up and started, with the helicopter on the ground.
    pub fn started() -> Rig {
        let mut rig = Rig::up(&BridgeConfig::default());
        let start = rig.control(ControlCommand::Start);
        assert_eq!(rig.last(start).0, Stage::Done);
        rig
    }

    /// A bridge that is up, not started.
    pub fn up(config: &BridgeConfig) -> Rig {
        let mut rig = Rig::closed(config);
        rig.open();
        assert_eq!(rig.link(), LinkState::Up);
        rig
    }

    /// A started bridge with the helicopter in the air.
    pub fn flying() -> Rig {
        let mut rig = Rig::started();
        rig.lift_off();
        rig
    }
}

impl Rig {
    pub fn with(bridge: Bridge) -> Rig {
        Rig {
            bridge,
            dsp: ScriptedDsp::default(),
            out: Recorder::default(),
            now: MonotonicNs(1_000_000_000),
            unread: None,
            next_request: 1,
            sender: Sender::default(),
        }
    }

    /// Gives the bridge an input.
    pub fn apply(&mut self, input: Input<'_>) {
        self.bridge.apply(self.now, input, &mut self.out);
    }

    pub fn open(&mut self) {
        self.apply(Input::PortOpened(Default::default()));
        self.run(100);
    }

    pub fn lift_off(&mut self) {
        self.dsp.status.flying = true;
        self.dsp.at(north(0));
        self.run(40);
    }

    /// Lets `ms` pass in steps of 10 ms: a status every 20 ms, flow control every 100 ms.
    pub fn run(&mut self, ms: u32) {
        for _ in 0..ms / 10 {
            self.exchange();
            self.now = MonotonicNs(self.now.0 + 10_000_000);
            self.dsp.time_ms += 10;
            if !self.dsp.silent && self.bridge.link() != LinkState::Gone {
                if self.dsp.time_ms.is_multiple_of(self.dsp.status_period_ms)
                    && self.dsp.mask != 0
                    && self.dsp.sends_status
                {
                    let mut status = self.dsp.status;
                    status.time_ms = Some(self.dsp.time_ms);
                    status.withdraw(StatusMask(!self.dsp.mask));
                    self.say(Downlink::Status(status));
                    if let Some(error) = self.dsp.errors.pop_front() {
                        self.say(Downlink::Error(error));
                    }
                }
                if self.dsp.time_ms.is_multiple_of(100) {
                    let has_room = self.dsp.held.len().saturating_add(2) <= self.dsp.places;
                    let grant = if self.dsp.grants && has_room {
                        FlowControl::Send
                    } else {
                        FlowControl::Stop
                    };
                    self.say(Downlink::FlowControl(grant));
                }
            }
            if self.unread.is_none() {
                self.apply(Input::Advance);
            }
        }
        self.exchange();
    }

    /// The bridge stands still for `ms`, and then gets all that the DSP has said meanwhile, in pieces that the kernel
    /// gives.
    pub fn stand_still(&mut self, ms: u32) {
        self.unread = Some(vec![]);
        self.run(ms);
        for piece in self.unread.take().unwrap_or_default().chunks(4095) {
            self.apply(Input::Received(piece));
            self.exchange();
        }
    }

    /// The machine is suspended for `ms`: the host's clock stands still, the DSP lives on, and nothing is read of what
    /// it says but the last few bytes, which the kernel still had.
    pub fn suspend(&mut self, ms: u32) {
        let now = self.now;
        self.unread = Some(vec![]);
        self.run(ms);
        self.now = now;
        let unread = self.unread.take().unwrap_or_default();
        self.apply(Input::Suspended(u64::from(ms) * 1_000_000));
        let kept = unread.len().saturating_sub(150);
        self.apply(Input::Received(&unread[kept..]));
        self.exchange();
    }

    /// Carries bytes both ways until neither side has any.
    pub fn exchange(&mut self) {
        while self.unread.is_none() {
            let bytes = self.bridge.transmit(self.now).to_vec();
            if bytes.is_empty() {
                return;
            }
            self.apply(Input::Transmitted(bytes.len()));
            for answer in self.dsp.receive(&bytes) {
                self.apply(Input::Received(answer.as_bytes()));
            }
        }
    }

    pub fn say(&mut self, message: Downlink) {
        let frame = self.dsp.frame(&message, None);
        match &mut self.unread {
            Some(unread) => unread.extend_from_slice(frame.as_bytes()),
            None => self.apply(Input::Received(frame.as_bytes())),
        }
    }

    /// A DSP that acknowledges nothing answers the last command that it got.
    pub fn answer_last(&mut self) {
        let last = *self.dsp.commands.last().expect("a command");
        self.dsp.acknowledges = true;
        let answer = self.dsp.execute(last).expect("an answer");
        self.dsp.acknowledges = false;
        self.say(answer);
        self.exchange();
    }

    pub fn dsp_error(&mut self, code: u16) {
        self.say(Downlink::Error(DspErrorCode(code)));
    }

    /// A control request as it is, and nothing else.
    pub fn ask_control(&mut self, request: ModuleControl) {
        let (key, sender) = (RequestKey::Control(request.request_id), self.sender);
        self.apply(Input::Control {
            key,
            sender,
            request,
        });
    }

    /// A movement request as it is.
    pub fn ask_movement(&mut self, request: MovementData) {
        let (key, sender) = (RequestKey::Movement(request.request_id), self.sender);
        self.apply(Input::Movement {
            key,
            sender,
            request,
        });
    }

    /// A parameter request as it is.
    pub fn ask_parameter(&mut self, request: ParameterRequest) {
        let (key, sender) = (RequestKey::Parameter(request.request_id), self.sender);
        self.apply(Input::Parameter {
            key,
            sender,
            request,
        });
    }

    pub fn control(&mut self, command: ControlCommand) -> u64 {
        let request_id = self.request_id();
        let control = ModuleControl {
            request_id,
            issued_ns: self.now.0,
            command: command.code(),
            ..ModuleControl::default()
        };
        self.ask_control(control);
        self.exchange();
        request_id
    }

    /// A movement that is issued now.
    pub fn movement(&mut self, data: MovementData) -> u64 {
        let issued_ns = self.now.0;
        self.ordered(MovementData { issued_ns, ..data })
    }

    /// A movement that was issued when it says.
    pub fn ordered(&mut self, data: MovementData) -> u64 {
        let request_id = self.request_id();
        let data = MovementData { request_id, ..data };
        self.ask_movement(data);
        self.exchange();
        request_id
    }

    pub fn parameter(&mut self, request: ParameterRequest) -> u64 {
        let request_id = self.request_id();
        let request = ParameterRequest {
            request_id,
            issued_ns: self.now.0,
            ..request
        };
        self.ask_parameter(request);
        self.exchange();
        request_id
    }

    pub fn take_off(&mut self) -> u64 {
        self.movement(MovementData {
            kind: MovementKind::TakeOff.code(),
            altitude_m: 10.0,
            ..MovementData::default()
        })
    }

    pub fn land(&mut self) -> u64 {
        self.movement(MovementData {
            kind: MovementKind::Land.code(),
            ..MovementData::default()
        })
    }

    pub fn hold(&mut self) -> u64 {
        self.movement(MovementData::hold(0))
    }

    pub fn waypoint(&mut self, path_id: u64, first: u16, last: u16, point: Waypoint) -> u64 {
        self.movement(MovementData {
            path_id,
            first,
            last,
            ..go_to(point)
        })
    }

    /// A whole path; the requests of its waypoints.
    pub fn path(&mut self, path_id: u64, points: &[Waypoint]) -> Vec<u64> {
        let last = points.len() - 1;
        (0..=last)
            .map(|i| self.waypoint(path_id, u16::from(i == 0), u16::from(i == last), points[i]))
            .collect()
    }

    /// A path of one waypoint that may replace another one.
    pub fn preempting(&mut self, path_id: u64, point: Waypoint) -> u64 {
        self.movement(MovementData {
            path_id,
            first: 1,
            last: 1,
            ..go_to(point).preempting()
        })
    }

    /// The last report to a request: stage, reason, IMI error.
    pub fn last(&self, request: u64) -> (Stage, Reason, ImiError) {
        let report = self.last_report(request);
        (
            Stage::from_code(report.stage).unwrap(),
            Reason::from_code(report.reason).unwrap(),
            match report.imi_error {
                0 => ImiError::None,
                code => ImiError::from_code(code).unwrap(),
            },
        )
    }

    pub fn last_report(&self, request: u64) -> &RequestReport {
        self.out
            .reports
            .iter()
            .rfind(|report| report.request_id == request)
            .unwrap_or_else(|| panic!("nothing was said about request {request}"))
    }

    /// All stages said about a request.
    pub fn stages(&self, request: u64) -> Vec<Stage> {
        self.out
            .reports
            .iter()
            .filter(|report| report.request_id == request)
            .map(|report| Stage::from_code(report.stage).unwrap())
            .collect()
    }

    pub fn link(&self) -> LinkState {
        self.bridge.link()
    }

    pub fn module(&self) -> ModuleStatus {
        ModuleStatus::from_code(self.bridge.state().status).unwrap()
    }

    pub fn functionality(&self) -> Functionality {
        Functionality::from_code(self.bridge.state().functionality).unwrap()
    }

    pub fn imi_error(&self) -> ImiError {
        ImiError::from_code(self.bridge.state().imi_error).unwrap()
    }

    pub fn request_id(&mut self) -> u64 {
        self.next_request += 1;
        self.next_request
    }
}

pub fn go_to(point: Waypoint) -> MovementData {
    MovementData {
        kind: MovementKind::GoToWaypoint.code(),
        latitude_deg: point.latitude_deg,
        longitude_deg: point.longitude_deg,
        altitude_m: point.altitude_m,
        ..MovementData::default()
    }
}
