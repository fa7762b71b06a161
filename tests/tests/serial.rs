//! The two ends of a real pseudo-terminal: the simulator's and the bridge's. Neither a byte nor a pair of bytes may be
//! echoed, changed or swallowed by the terminal between them.

use std::fs::File;
use std::io::{Read, Write};
use std::os::fd::{AsFd, BorrowedFd};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::Duration;

use bridge::BridgeConfig;
use bridge::config::SerialConfig;
use bridge::shell::serial::{OpenError, SerialPort};
use dsp_protocol::port;
use dsp_sim::port::Terminal;
use dsp_sim::pty::{Pty, PtyPort, SymbolicLink};
use dsp_sim::simulator::{Setup, Simulator};
use ipc_types::code::{LinkState, Stage};
use ipc_types::configuration::ConfigurationText;
use ipc_types::fresh_request_id;
use ipc_types::payload::{ModuleState, ParameterRequest};
use ril_tests::process::WAIT_LIMIT;
use ril_tests::{PtyFolder, TestDomain, Watchdog, pty};
use runtime::notify::Notifier;
use runtime::signal::Termination;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::ioctl::{Opcode, Setter, ioctl};
use rustix::termios::tcgetattr;

/// Bytes on the way at once: far less than the kernel's queue of 4096.
const PIECE: usize = 256;

/// All 256 byte values, alone and each before each other: some terminals only act on two in a row.
fn all_bytes_and_pairs() -> Vec<u8> {
    let all = 0..=u8::MAX;
    let pairs = all
        .clone()
        .flat_map(|first| all.clone().flat_map(move |second| [first, second]));
    all.clone().chain(pairs).collect()
}

fn await_readable(descriptor: BorrowedFd<'_>) {
    let limit = Timespec::try_from(WAIT_LIMIT).expect("a limit");
    let mut sources = [PollFd::from_borrowed_fd(descriptor, PollFlags::IN)];
    assert_eq!(poll(&mut sources, Some(&limit)), Ok(1), "no byte came");
}

/// Sends `bytes` piece by piece and compares each with what arrives.
fn carry(
    bytes: &[u8],
    mut send: impl FnMut(&[u8]) -> usize,
    receiver: &dyn AsFd,
    mut receive: impl FnMut(&mut [u8]) -> usize,
) {
    let mut buffer = [0; 4 * PIECE];
    for piece in bytes.chunks(PIECE) {
        assert_eq!(send(piece), piece.len(), "the queue is full");
        let mut arrived = Vec::new();
        while arrived.len() < piece.len() {
            await_readable(receiver.as_fd());
            let count = receive(&mut buffer);
            arrived.extend_from_slice(&buffer[..count]);
        }
        assert_eq!(arrived, piece);
    }
}

fn open(path: &Path) -> SerialPort {
    let config = SerialConfig {
        port: path.to_owned(),
        ..SerialConfig::default()
    };
    match SerialPort::open(&config) {
        Ok(port) => port,
        Err(error) => panic!("{error}"),
    }
}

fn nothing_is_left(port: &SerialPort, pty: &Pty) {
    let mut buffer = [0; PIECE];
    assert_eq!(port.read(&mut buffer).expect("a port"), 0, "an echo");
    assert_eq!(pty.read(&mut buffer).expect("a pty"), 0, "an echo");
}

#[test]
fn every_byte_and_every_pair_of_bytes_passes_both_ways() {
    let _watchdog = Watchdog::start();
    let mut pty = Pty::open().expect("a pty");
    let port = open(pty.path());
    // The newcomer is noticed before anything is said: whatever is said then is not thrown away.
    await_readable(pty.watch());
    pty.check_peer().expect("a watch");
    let bytes = all_bytes_and_pairs();
    carry(
        &bytes,
        |piece| port.write(piece).expect("a port"),
        &pty,
        |buffer| pty.read(buffer).expect("a pty"),
    );
    nothing_is_left(&port, &pty);
    let sender = pty;
    let descriptor = port.as_fd().try_clone_to_owned().expect("a descriptor");
    carry(
        &bytes,
        |piece| sender.write(piece).expect("a pty"),
        &descriptor,
        |buffer| port.read(buffer).expect("a port"),
    );
    nothing_is_left(&port, &sender);
}

/// The kernel gives the terminal of a simulator that was killed to another program: here to this test.
#[test]
fn the_link_of_a_simulator_that_was_killed_is_not_opened() {
    let _watchdog = Watchdog::start();
    let folder = PtyFolder::new();
    let (link, kept) = (folder.path().join("dsp"), folder.path().join("kept"));
    let owner = folder.path().join("dsp.owner");
    let config = SerialConfig {
        port: link.clone(),
        ..SerialConfig::default()
    };
    let killed = PtyPort::new(&link).expect("a port");
    drop(open(&link));
    std::fs::copy(&owner, &kept).expect("the file of the simulator");
    drop(killed);
    // What a kill leaves: the file without its lock, and the link.
    std::fs::rename(&kept, &owner).expect("a folder");
    let other = Pty::open().expect("a pty");
    let left = SymbolicLink::create(&link, other.path()).expect("a link");
    let error = SerialPort::open(&config).expect_err("another one's terminal");
    assert!(matches!(error, OpenError::Stale(_)), "{error}");
    // A simulator that lives, but whose terminal is another one.
    let again = PtyPort::new(&link).expect("a port");
    open(&link);
    std::fs::remove_file(&link).expect("a link");
    let turned = SymbolicLink::create(&link, other.path()).expect("a link");
    let error = SerialPort::open(&config).expect_err("another one's terminal");
    assert!(matches!(error, OpenError::Stale(_)), "{error}");
    drop((left, turned, again));
    // Made by hand.
    let _by_hand = SymbolicLink::create(&link, other.path()).expect("a link");
    open(&link);
}

#[test]
fn a_bridge_may_come_and_go_and_hears_only_what_is_said_to_it() {
    let _watchdog = Watchdog::start();
    let folder = PtyFolder::new();
    let mut pty = Pty::open().expect("a pty");
    let link = SymbolicLink::create(&folder.link("dsp"), pty.path()).expect("a link");
    let settings = |path: &Path| {
        let terminal = File::open(path).expect("a terminal");
        let settings = tcgetattr(&terminal).expect("settings");
        (
            settings.input_modes,
            settings.output_modes,
            settings.control_modes,
            settings.local_modes,
        )
    };
    let before = settings(link.path());
    for visit in 0..3_u8 {
        pty.write(b"said to nobody").expect("a pty");
        let port = open(link.path());
        await_readable(pty.watch());
        pty.check_peer().expect("a watch");
        let hello = [0xE9, visit, 0x00, 0x11, 0x13, 0x0D, 0x0A, 0xFF];
        pty.write(&hello).expect("a pty");
        await_readable(port.as_fd());
        let mut buffer = [0; PIECE];
        let count = port.read(&mut buffer).expect("a port");
        assert_eq!(buffer[..count], hello, "visit {visit}");
        drop(port);
        await_readable(pty.watch());
        pty.check_peer().expect("a watch");
        assert_eq!(
            settings(link.path()),
            before,
            "the port was not given back as it was"
        );
    }
}

/// The DSP's end of a pseudo-terminal that says when its other end discards what was not sent: in *packet mode* a read
/// begins with a byte that is 0 before data, and else says what happened. The bytes themselves have arrived by then.
struct PacketLine(File);

impl PacketLine {
    fn open() -> (PacketLine, PathBuf) {
        const TIOCPKT: Opcode = 0x5420;
        let (master, path) = pty::open();
        // SAFETY: the request reads one `int`.
        #[allow(unsafe_code)]
        unsafe { ioctl(&master, Setter::<TIOCPKT, i32>::new(1)) }.expect("a pseudo-terminal");
        (PacketLine(master), path)
    }

    /// What came within `wait`, and whether the other end has discarded anything.
    fn read(&mut self, wait: Duration) -> (Vec<u8>, bool) {
        const FLUSHED: u8 = 2;
        let wait = Timespec::try_from(wait).expect("a time");
        let (mut bytes, mut has_discarded, mut packet) = (Vec::new(), false, [0; 4096]);
        while poll(&mut [PollFd::new(&self.0, PollFlags::IN)], Some(&wait)) == Ok(1) {
            let count = self.0.read(&mut packet).expect("a terminal");
            match packet[0] {
                0 => bytes.extend_from_slice(&packet[1..count]),
                control => has_discarded |= control & FLUSHED != 0,
            }
            if !bytes.is_empty() {
                break;
            }
        }
        (bytes, has_discarded)
    }
}

/// A DSP that stands still in the start-up, and when it has a request to carry out: what the bridge gives up, the
/// kernel must not send later. What it does not give up it leaves alone.
#[test]
fn what_the_bridge_gives_up_is_taken_from_the_kernel_and_nothing_else() {
    let domain = TestDomain::new();
    let (mut line, port) = PacketLine::open();
    let mut config = BridgeConfig::default();
    config.serial.port = port;
    // Longer than a stall of the machine.
    config.link.ack_timeout_ms = 1_000;
    config.link.start_up_retry_ms = 1_000;
    config.link.pc_timeout_ms = 30_000;
    config.link.silent_after_ms = 100_000;
    let (end, to_end) = Termination::by_hand().expect("a pair of sockets");
    thread::scope(|scope| {
        scope.spawn(|| {
            let ipc = domain.join("bridge");
            let no_fence = || Err("there is no file".to_owned());
            let text = ConfigurationText::new(config.to_toml());
            bridge::shell::run(&config, text, no_fence, &ipc, &end, &Notifier::from_env())
                .expect("a bridge");
        });
        let _to_end = to_end;
        let ipc = domain.join("consumer");
        let mut states = ipc.subscriber::<ModuleState>().expect("a subscriber");
        let mut parameters = ipc.client::<ParameterRequest>().expect("a client");
        // It says nothing, and the start-up begins again.
        let mut has_discarded = false;
        while !has_discarded {
            has_discarded = line.read(WAIT_LIMIT).1;
        }

        let (mut simulator, mut now) = (Simulator::new(Setup::default()), Duration::ZERO);
        let mut round = |line: &mut PacketLine| {
            now += Duration::from_millis(10);
            simulator.advance(now);
            simulator.transmit(|bytes| line.0.write(bytes).expect("a terminal"));
            let (bytes, has_discarded) = line.read(Duration::from_millis(2));
            simulator.receive(now, &bytes);
            has_discarded
        };
        let mut link = None;
        while link != Some(LinkState::Up) {
            round(&mut line);
            states
                .drain(|state| link = state.link.state())
                .expect("samples");
        }
        for (value, is_answered, expected) in
            [(3.0, true, Stage::Done), (4.0, false, Stage::Unknown)]
        {
            let write = ParameterRequest::write(fresh_request_id(), port::CRUISE_SPEED_MPS, value);
            parameters.send(&write).expect("room for it");
            let (mut end, mut has_discarded) = (None, false);
            while end.is_none() {
                match is_answered {
                    true => has_discarded |= round(&mut line),
                    false => _ = parameters.wait(WAIT_LIMIT).expect("a wait"),
                }
                parameters.drain(|report| end = report.stage().filter(|stage| stage.is_final()));
            }
            if !is_answered {
                has_discarded |= line.read(WAIT_LIMIT).1;
            }
            assert_eq!(
                (end, has_discarded),
                (Some(expected), !is_answered),
                "{value}"
            );
        }
    });
}
