//! The two ends of a real pseudo-terminal: the simulator's and the bridge's. Neither a byte nor a pair of bytes may be
//! echoed, changed or swallowed by the terminal between them.

use std::fs::File;
use std::os::fd::{AsFd, BorrowedFd};
use std::path::Path;

use bridge::config::SerialConfig;
use bridge::shell::serial::{OpenError, SerialPort};
use dsp_sim::port::Terminal;
use dsp_sim::pty::{Pty, PtyPort, SymbolicLink};
use ril_tests::process::WAIT_LIMIT;
use ril_tests::{PtyFolder, Watchdog};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
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
