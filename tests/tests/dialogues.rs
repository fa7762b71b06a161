//! Plays the conversations of `crates/dsp-protocol/vectors/dialogues/` against the simulated DSP, against the DSP in C
//! of `examples/firmware`, and against the bridge's core.
//!
//! Each side is given what the other end says, at the stated times, and must say its own part byte by byte at the
//! stated times. The files were derived by hand from `docs/protocol.md`; their format stands in
//! `crates/dsp-protocol/vectors/README.md`. Time is virtual and moves in steps of 1 ms, because all times of the files
//! are whole milliseconds.

use std::collections::{BTreeMap, VecDeque};
use std::fmt::Write as _;
use std::fs;
use std::io::{BufRead, BufReader, Write as _};
use std::path::Path;
use std::process::{Child, ChildStdout, Command as Program, Stdio};
use std::time::Duration;

use bridge::{Bridge, BridgeConfig, Input, RequestKey, Sender};
use dsp_protocol::{
    Command, Decoded, Decoder, Direction, Downlink, Profile, Sequence, StatusMask, Uplink, port,
};
use dsp_sim::config::Config as SimulatorConfig;
use dsp_sim::helicopter::Phase;
use dsp_sim::simulator::Simulator;
use ipc_types::MonotonicNs;
use ipc_types::code::{ControlCommand, MovementKind};
use ipc_types::payload::{ModuleControl, MovementData};
use ril_tests::languages::{firmware, skip};

/// The host's clock at time 0 of a dialogue: far from zero, so that neither clock is taken for the other.
const HOST_EPOCH_NS: u64 = 86_400_000_000_000;
/// How long a helicopter may take to hover in virtual time.
const TAKE_OFF_LIMIT: Duration = Duration::from_secs(120);

#[test]
fn every_frame_of_every_dialogue_is_one_message() {
    for dialogue in dialogues() {
        for line in &dialogue.lines {
            let sound = match &line.step {
                Step::FromPc { bytes, .. } => is_message::<Uplink>(dialogue.pc, bytes),
                Step::FromDsp { bytes, .. } => is_message::<Downlink>(dialogue.dsp, bytes),
                Step::Event(_) => true,
            };
            assert!(sound, "{}: {line:?}", dialogue.name);
        }
    }
}

#[test]
fn the_simulated_dsp_plays_every_dialogue() {
    play_all(|dialogue| play(dialogue, &mut DspSide::new(dialogue)));
}

#[test]
fn the_dsp_in_c_plays_every_dialogue() {
    let folder = tempfile::tempdir().expect("a folder");
    let program = folder.path().join("dsp");
    let board = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/dialogues/board.c");
    if let Err(why) = firmware(&board, &program) {
        return skip("the DSP in C", &why);
    }
    play_all(|dialogue| match dialogue.header("dsp pc_timeout") {
        // It always has port 10004.
        Some("no") => Ok(()),
        _ => play(dialogue, &mut FirmwareSide::new(dialogue, &program)),
    });
}

#[test]
fn the_bridge_plays_every_dialogue() {
    play_all(|dialogue| match dialogue.header("pc") {
        Some("not played") => Ok(()),
        _ => play(dialogue, &mut PcSide::new(dialogue)),
    });
}

/// Plays all dialogues and names all that fail, not only of the first.
fn play_all(play: impl Fn(&Dialogue) -> Result<(), String>) {
    let mut failures = String::new();
    for dialogue in dialogues() {
        if let Err(failure) = play(&dialogue) {
            writeln!(failures, "{}: {failure}", dialogue.name).unwrap();
        }
    }
    assert!(failures.is_empty(), "\n{failures}");
}

/// Whether `bytes` are exactly one valid message of `profile`.
fn is_message<M: Direction>(profile: Profile, bytes: &[u8]) -> bool {
    let (taken, decoded) = Decoder::<M>::with_profile(profile).receive(bytes);
    taken == bytes.len() && matches!(decoded, Decoded::Message(_))
}

/// One conversation.
struct Dialogue {
    name: String,
    headers: BTreeMap<String, String>,
    pc: Profile,
    dsp: Profile,
    lines: Vec<Line>,
}

/// One line of it.
#[derive(Debug)]
struct Line {
    at_ms: u64,
    step: Step,
}

#[derive(Debug)]
enum Step {
    /// The PC sends; lost bytes never reach the DSP.
    FromPc { bytes: Vec<u8>, is_lost: bool },
    /// The DSP sends; lost bytes never reach the PC, and of sensors' values only length and time are compared.
    FromDsp {
        bytes: Vec<u8>,
        is_lost: bool,
        has_sensors: bool,
    },
    /// Something happens at either end.
    Event(String),
}

/// All dialogues, by name.
fn dialogues() -> Vec<Dialogue> {
    let folder =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates/dsp-protocol/vectors/dialogues");
    let mut files: Vec<_> = fs::read_dir(&folder)
        .expect("the folder of the dialogues")
        .map(|entry| entry.expect("an entry").path())
        .collect();
    files.sort();
    assert!(!files.is_empty());
    files.iter().map(|file| Dialogue::read(file)).collect()
}

impl Dialogue {
    fn read(file: &Path) -> Dialogue {
        let text = fs::read_to_string(file).expect("a dialogue");
        let (mut headers, mut lines) = (BTreeMap::new(), Vec::new());
        for line in text.lines().filter(|line| !line.starts_with('#')) {
            let line = line.split(';').next().unwrap_or_default().trim();
            if line.starts_with(|first: char| first.is_ascii_digit()) {
                lines.push(Line::parse(line));
            } else if let Some((key, value)) = line.split_once(" = ") {
                headers.insert(key.to_owned(), value.to_owned());
            } else {
                assert!(line.is_empty(), "{file:?}: {line}");
            }
        }
        let profile = |key: &str| Profile::from_name(&headers[key]).expect("a profile");
        Dialogue {
            name: file.file_stem().unwrap().to_string_lossy().into_owned(),
            pc: profile("pc profile"),
            dsp: profile("dsp profile"),
            headers,
            lines,
        }
    }

    fn header(&self, key: &str) -> Option<&str> {
        self.headers.get(key).map(String::as_str)
    }
}

impl Line {
    fn parse(line: &str) -> Line {
        let (at_ms, rest) = line.split_once(' ').expect("a time");
        let (direction, rest) = rest.trim_start().split_once(' ').expect("a direction");
        let rest = rest.trim_start();
        let bytes = || -> Vec<u8> {
            rest.split(' ')
                .map(|byte| u8::from_str_radix(byte, 16).expect(line))
                .collect()
        };
        let is_lost = direction.ends_with('x');
        let step = match direction {
            ">" | ">x" => Step::FromPc {
                bytes: bytes(),
                is_lost,
            },
            "<" | "<x" | "<~" => Step::FromDsp {
                bytes: bytes(),
                is_lost,
                has_sensors: direction == "<~",
            },
            "!" => Step::Event(rest.to_owned()),
            _ => panic!("no such direction: {line}"),
        };
        Line {
            at_ms: at_ms.parse().expect("a time in milliseconds"),
            step,
        }
    }
}

/// Bytes that a side has sent, with their times, which the dialogue has not yet named.
#[derive(Default)]
struct Sent(VecDeque<(u64, u8)>);

impl Sent {
    fn push(&mut self, at_ms: u64, bytes: &[u8]) {
        self.0.extend(bytes.iter().map(|byte| (at_ms, *byte)));
    }

    /// Takes as many bytes as `expected` has; the first `compared` of them must be equal, and all must be in time.
    fn take(&mut self, at_ms: u64, expected: &[u8], compared: usize) -> Result<(), String> {
        let count = expected.len().min(self.0.len());
        let sent: Vec<(u64, u8)> = self.0.drain(..count).collect();
        let bytes: Vec<u8> = sent.iter().map(|(_, byte)| *byte).collect();
        let in_time = sent.iter().all(|(sent_ms, _)| *sent_ms == at_ms);
        let is_equal = bytes.len() == expected.len()
            && bytes[..compared.min(count)] == expected[..compared.min(count)];
        if is_equal && in_time {
            return Ok(());
        }
        let sent_ms = sent.first().map(|(sent_ms, _)| *sent_ms);
        Err(format!(
            "at {at_ms} ms expected {expected:02X?}, found {bytes:02X?} at {sent_ms:?} ms"
        ))
    }

    fn expect_none(&self, at_ms: u64) -> Result<(), String> {
        let bytes: Vec<u8> = self.0.iter().map(|(_, byte)| *byte).collect();
        if bytes.is_empty() {
            return Ok(());
        }
        Err(format!(
            "before {at_ms} ms something else was sent: {bytes:02X?}"
        ))
    }
}

/// An end of the link in virtual time.
trait Side {
    /// Goes on to `at_ms`.
    fn advance(&mut self, at_ms: u64);
    /// Does its own part of an event.
    fn event(&mut self, at_ms: u64, event: &str);
    /// Takes what the other end says.
    fn receive(&mut self, at_ms: u64, bytes: &[u8]);
    /// What this end has sent.
    fn sent(&mut self) -> &mut Sent;
    /// Whether this end is the PC.
    const IS_PC: bool;
}

/// Lets `side` play its part.
fn play<S: Side>(dialogue: &Dialogue, side: &mut S) -> Result<(), String> {
    let mut now_ms = 0;
    for Line { at_ms, step } in &dialogue.lines {
        while now_ms < *at_ms {
            now_ms += 1;
            side.advance(now_ms);
        }
        match step {
            Step::Event(event) => {
                side.sent().expect_none(*at_ms)?;
                side.event(*at_ms, event);
            }
            Step::FromPc { bytes, .. } if S::IS_PC => {
                side.sent().take(*at_ms, bytes, bytes.len())?
            }
            Step::FromDsp {
                bytes, has_sensors, ..
            } if !S::IS_PC => {
                let compared = if *has_sensors {
                    up_to_time(dialogue.dsp)
                } else {
                    bytes.len()
                };
                side.sent().take(*at_ms, bytes, compared)?;
            }
            Step::FromPc { bytes, is_lost } | Step::FromDsp { bytes, is_lost, .. } => {
                side.sent().expect_none(*at_ms)?;
                if !is_lost {
                    side.receive(*at_ms, bytes);
                }
            }
        }
    }
    side.sent().expect_none(now_ms)
}

/// Bytes of a status up to and with the DSP's time.
fn up_to_time(profile: Profile) -> usize {
    match profile {
        Profile::Classic => 10,
        Profile::Extended => 12,
    }
}

/// The simulated DSP.
struct DspSide {
    simulator: Simulator,
    /// When the dialogue began, on the simulator's clock.
    begin: Duration,
    sent: Sent,
}

impl DspSide {
    fn new(dialogue: &Dialogue) -> DspSide {
        let mut toml = format!(
            "[serial]\nbaud_rate = 0\nprofile = '{}'\n[wind]\nspeed_mps = 0\ngust_mps = 0\n[noise]\nlevel = 0\n",
            dialogue.dsp.name()
        );
        if dialogue.header("dsp pc_timeout") == Some("no") {
            toml.push_str("[dsp]\nhas_pc_timeout = false\n");
        }
        let config: SimulatorConfig =
            runtime::config::parse(&toml, "dialogue.toml").expect("the simulator's settings");
        let mut simulator = Simulator::new(config.setup());
        if dialogue.header("flying") == Some("yes") {
            hover(&mut simulator, dialogue.dsp);
            // A DSP that boots in flight hovers.
            simulator.reboot();
            simulator.discard_output();
        }
        DspSide {
            begin: simulator.now(),
            simulator,
            sent: Sent::default(),
        }
    }

    fn collect(&mut self, at_ms: u64) {
        let sent = &mut self.sent;
        self.simulator.transmit(|bytes| {
            sent.push(at_ms, bytes);
            bytes.len()
        });
    }
}

/// Takes off, and waits until the helicopter has come to rest.
fn hover(simulator: &mut Simulator, profile: Profile) {
    let take_off = Command::Write16 {
        port: port::TAKE_OFF,
        value: 1,
    };
    let mut number = Sequence::FIRST;
    for command in [Command::Following { on: true }, take_off] {
        let frame = Uplink::Command(command).encode_in(profile, number);
        number = number.next();
        simulator.receive(simulator.now(), frame.as_bytes());
    }
    let limit = simulator.now() + TAKE_OFF_LIMIT;
    while simulator.helicopter().phase() != Phase::Hovering {
        assert!(simulator.now() < limit, "the helicopter did not take off");
        simulator.advance(simulator.now() + Duration::from_millis(100));
    }
    simulator.advance(simulator.now() + Duration::from_secs(10));
}

impl Side for DspSide {
    const IS_PC: bool = false;

    fn advance(&mut self, at_ms: u64) {
        self.simulator
            .advance(self.begin + Duration::from_millis(at_ms));
        self.collect(at_ms);
    }

    fn event(&mut self, _: u64, event: &str) {
        if event == "reboot" {
            self.simulator.reboot();
        }
    }

    fn receive(&mut self, at_ms: u64, bytes: &[u8]) {
        let taken = self.simulator.receive(self.simulator.now(), bytes);
        assert_eq!(taken, bytes.len());
        self.collect(at_ms);
    }

    fn sent(&mut self) -> &mut Sent {
        &mut self.sent
    }
}

/// The DSP in C. It answers each line with the bytes that it sends.
struct FirmwareSide {
    child: Child,
    answers: BufReader<ChildStdout>,
    sent: Sent,
}

impl FirmwareSide {
    fn new(dialogue: &Dialogue, program: &Path) -> FirmwareSide {
        let is_flying = dialogue.header("flying") == Some("yes");
        let mut command = Program::new(program);
        command.arg(dialogue.dsp.name());
        command.arg(if is_flying { "flying" } else { "ground" });
        command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.spawn().expect("it was compiled a moment ago");
        let answers = BufReader::new(child.stdout.take().expect("it is piped"));
        FirmwareSide {
            child,
            answers,
            sent: Sent::default(),
        }
    }

    fn ask(&mut self, at_ms: u64, question: &str) {
        let questions = self.child.stdin.as_mut().expect("it is piped");
        writeln!(questions, "{question}").expect("it lives");
        let mut answer = String::new();
        self.answers.read_line(&mut answer).expect("it answers");
        assert!(answer.ends_with('\n'), "it died of `{question}`");
        let bytes: Vec<u8> = answer
            .split_whitespace()
            .map(|byte| u8::from_str_radix(byte, 16).expect("a byte"))
            .collect();
        self.sent.push(at_ms, &bytes);
    }
}

impl Drop for FirmwareSide {
    fn drop(&mut self) {
        // The end of its input ends it.
        drop(self.child.stdin.take());
        let _ = self.child.wait();
    }
}

impl Side for FirmwareSide {
    const IS_PC: bool = false;

    fn advance(&mut self, at_ms: u64) {
        self.ask(at_ms, &format!("advance {at_ms}"));
    }

    fn event(&mut self, at_ms: u64, event: &str) {
        if event == "reboot" {
            self.ask(at_ms, &format!("reboot {at_ms}"));
        }
    }

    fn receive(&mut self, at_ms: u64, bytes: &[u8]) {
        let bytes: String = bytes.iter().map(|byte| format!(" {byte:02X}")).collect();
        self.ask(at_ms, &format!("receive {at_ms}{bytes}"));
    }

    fn sent(&mut self) -> &mut Sent {
        &mut self.sent
    }
}

/// The bridge's core.
struct PcSide {
    bridge: Bridge,
    requests: u64,
    sent: Sent,
}

impl PcSide {
    fn new(dialogue: &Dialogue) -> PcSide {
        let mask = dialogue.headers["mask"].trim_start_matches("0x");
        let mask = StatusMask(u16::from_str_radix(mask, 16).expect("a mask"));
        let groups: Vec<String> = mask
            .groups()
            .map(|group| format!("'{}'", group.name()))
            .collect();
        let parameters = dialogue.header("parameters").unwrap_or_default();
        let toml = format!(
            "[link]\nprofile = '{}'\n[status]\ngroups = [{}]\n[parameters]\n{}\n",
            dialogue.pc.name(),
            groups.join(", "),
            parameters.replace(", ", "\n")
        );
        let config: BridgeConfig =
            runtime::config::parse(&toml, "dialogue.toml").expect("the bridge's settings");
        PcSide {
            bridge: Bridge::new(&config),
            requests: 0,
            sent: Sent::default(),
        }
    }

    fn apply(&mut self, at_ms: u64, input: Input<'_>) {
        self.bridge.apply(host(at_ms), input, &mut ());
    }

    fn collect(&mut self, at_ms: u64) {
        loop {
            let bytes = self.bridge.transmit(host(at_ms)).to_vec();
            if bytes.is_empty() {
                return;
            }
            self.apply(at_ms, Input::Transmitted(bytes.len()));
            self.sent.push(at_ms, &bytes);
        }
    }

    fn movement(&mut self, at_ms: u64, data: MovementData) {
        self.requests += 1;
        let data = MovementData {
            request_id: self.requests,
            issued_ns: host(at_ms).0,
            ..data
        };
        self.apply(
            at_ms,
            Input::Movement {
                key: RequestKey::Movement(self.requests),
                sender: Sender::default(),
                request: data,
            },
        );
    }
}

/// A time of the dialogue on the host's clock.
fn host(at_ms: u64) -> MonotonicNs {
    MonotonicNs(HOST_EPOCH_NS + at_ms * 1_000_000)
}

impl Side for PcSide {
    const IS_PC: bool = true;

    fn advance(&mut self, at_ms: u64) {
        self.apply(at_ms, Input::Advance);
        self.collect(at_ms);
    }

    fn event(&mut self, at_ms: u64, event: &str) {
        let (name, rest) = event.split_once(' ').unwrap_or((event, ""));
        let numbers: Vec<f64> = rest
            .split_whitespace()
            .map(|number| number.parse().expect("a number"))
            .collect();
        match (name, numbers.as_slice()) {
            ("open", []) => self.apply(at_ms, Input::PortOpened(Default::default())),
            ("start", []) => {
                self.requests += 1;
                let control = ModuleControl {
                    request_id: self.requests,
                    issued_ns: host(at_ms).0,
                    command: ControlCommand::Start.code(),
                    ..ModuleControl::default()
                };
                self.apply(
                    at_ms,
                    Input::Control {
                        key: RequestKey::Control(self.requests),
                        sender: Sender::default(),
                        request: control,
                    },
                );
            }
            ("takeoff", [altitude_m]) => self.movement(
                at_ms,
                MovementData {
                    kind: MovementKind::TakeOff.code(),
                    altitude_m: *altitude_m,
                    ..MovementData::default()
                },
            ),
            ("path", [latitude_deg, longitude_deg, altitude_m]) => self.movement(
                at_ms,
                MovementData {
                    kind: MovementKind::GoToWaypoint.code(),
                    path_id: 1,
                    first: 1,
                    last: 1,
                    latitude_deg: *latitude_deg,
                    longitude_deg: *longitude_deg,
                    altitude_m: *altitude_m,
                    ..MovementData::default()
                },
            ),
            ("reboot", []) => {}
            other => panic!("no such event: {other:?}"),
        }
        self.collect(at_ms);
    }

    fn receive(&mut self, at_ms: u64, bytes: &[u8]) {
        self.apply(at_ms, Input::Received(bytes));
        self.collect(at_ms);
    }

    fn sent(&mut self) -> &mut Sent {
        &mut self.sent
    }
}
