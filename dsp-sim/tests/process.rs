//! The process from outside: a real pseudo-terminal, real signals, exit codes.

use std::fs::{self, File, OpenOptions};
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command as Process, Stdio};

use dsp_protocol::{
    Command, Decoded, Decoder, Downlink, DspErrorCode, Profile, Received, Sequence, Uplink, port,
};
use rustix::process::{Pid, Signal, kill_process};

/// A simulator in a process of its own, killed when the test ends early.
struct Sim {
    child: Child,
    link: PathBuf,
}

impl Sim {
    fn start(link: &Path, arguments: &[&str]) -> Sim {
        let mut child = process(arguments)
            .arg("--link")
            .arg(link)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        // The line on standard output means that the port is there.
        let mut line = String::new();
        let output = child.stdout.take().unwrap();
        BufReader::new(output).read_line(&mut line).unwrap();
        assert_eq!(Path::new(line.trim_end()), link);
        Sim {
            child,
            link: link.to_owned(),
        }
    }

    fn open(&self) -> File {
        let mut options = OpenOptions::new();
        options.read(true).write(true).open(&self.link).unwrap()
    }

    fn end(&mut self, signal: Signal) -> Option<i32> {
        let pid = Pid::from_child(&self.child);
        kill_process(pid, signal).unwrap();
        self.child.wait().unwrap().code()
    }
}

impl Drop for Sim {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn process(arguments: &[&str]) -> Process {
    let mut process = Process::new(env!("CARGO_BIN_EXE_dsp-sim"));
    process.env_remove("RIL_CONFIG").env_remove("RIL_ROBOT");
    process.env("RIL_LOG", "warn").args(arguments);
    process
}

/// Sends a command and reads until its acknowledgement.
fn order(port: &mut File, order: Command) {
    port.write_all(Uplink::Command(order).encode().as_bytes())
        .unwrap();
    read_until(
        port,
        |message| matches!(message, Downlink::Ack { command } if *command == order.code()),
    );
}

/// Reads until a message is the one that is waited for.
fn read_until(port: &mut File, wanted: impl Fn(&Downlink) -> bool) {
    let mut decoder = Decoder::<Downlink>::new();
    let mut byte = [0];
    loop {
        port.read_exact(&mut byte).unwrap();
        if let (_, Decoded::Message(message)) = decoder.decode(&byte)
            && wanted(&message)
        {
            return;
        }
    }
}

fn start_status(port: &mut File) {
    order(
        port,
        Command::Write16 {
            port: port::STATUS_MASK,
            value: u16::MAX,
        },
    );
    order(port, Command::ActivateStatus);
}

#[test]
fn both_signals_end_it_with_code_0_and_the_link_goes() {
    let folder = tempfile::tempdir().unwrap();
    for signal in [Signal::TERM, Signal::INT] {
        let mut sim = Sim::start(&folder.path().join("port"), &[]);
        start_status(&mut sim.open());
        assert_eq!(sim.end(signal), Some(0));
        assert!(
            fs::symlink_metadata(&sim.link).is_err(),
            "the link is still there"
        );
    }
}

/// Sends a frame of the extended profile and gives the first message that comes back in it.
fn ask_extended(port: &mut File, sequence: Sequence, command: Command) -> Received<Downlink> {
    let frame = Uplink::Command(command).encode_in(Profile::Extended, sequence);
    port.write_all(frame.as_bytes()).unwrap();
    let mut decoder = Decoder::with_profile(Profile::Extended);
    let mut byte = [0];
    loop {
        port.read_exact(&mut byte).unwrap();
        if let (_, Decoded::Message(received)) = decoder.receive(&byte) {
            return received;
        }
    }
}

#[test]
fn the_profile_is_chosen_on_the_command_line_and_the_other_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    let sim = Sim::start(
        &folder.path().join("port"),
        &["--profile", "extended", "--speed", "20"],
    );
    let mut port = sim.open();
    let sequence = Sequence::new(100);
    let expected = Received {
        message: Downlink::Ack { command: 4 },
        sequence: Some(Sequence::FIRST),
        acknowledges: Some(sequence),
    };
    assert_eq!(
        ask_extended(&mut port, sequence, Command::ClearErrors),
        expected
    );
    // A classic frame first: the error comes before the acknowledgement.
    let classic = Uplink::Command(Command::ClearErrors).encode();
    port.write_all(classic.as_bytes()).unwrap();
    let reported = ask_extended(&mut port, sequence.next(), Command::ClearErrors);
    assert_eq!(
        reported.message,
        Downlink::Error(DspErrorCode::UNKNOWN_HEADER)
    );
}

#[test]
fn the_pc_comes_and_goes_and_the_dsp_stays_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let mut sim = Sim::start(&folder.path().join("port"), &["--speed", "20"]);
    let mut port = sim.open();
    start_status(&mut port);
    order(&mut port, Command::Following { on: true });
    order(
        &mut port,
        Command::Write16 {
            port: port::TAKE_OFF,
            value: 1,
        },
    );
    drop(port);
    for _ in 0..3 {
        // No PC started it up again: the DSP goes on sending, and only of the present.
        let mut port = sim.open();
        read_until(&mut port, |message| matches!(message, Downlink::Status(_)));
    }
    let mut port = sim.open();
    read_until(
        &mut port,
        |message| matches!(message, Downlink::Status(status) if status.flying),
    );
    assert_eq!(sim.end(Signal::TERM), Some(0));
}

#[test]
fn a_simulator_that_was_killed_is_replaced_under_its_old_link() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("port");
    let mut killed = Sim::start(&link, &[]);
    assert_eq!(killed.end(Signal::KILL), None);
    assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    let mut sim = Sim::start(&link, &[]);
    start_status(&mut sim.open());
    assert_eq!(sim.end(Signal::TERM), Some(0));
}

#[test]
fn what_is_wrong_is_reported_with_its_exit_code() {
    let folder = tempfile::tempdir().unwrap();
    let precious = folder.path().join("precious");
    fs::write(&precious, "data").unwrap();
    let wrong = folder.path().join("wrong.toml");
    fs::write(&wrong, "[wind]\nspeed_mps = 99.0\n").unwrap();
    let faults = folder.path().join("faults.toml");
    fs::write(&faults, "[[fault]]\nkind = 'drop_bytes'\nrate = 2\n").unwrap();
    let [precious, wrong, faults] = [&precious, &wrong, &faults].map(|path| path.to_str().unwrap());
    #[rustfmt::skip]
    let cases = [
        (vec!["--link", precious], 2, "not a symbolic link"),
        (vec!["--link", "/nowhere/port"], 2, "--link"),
        (vec!["--config", wrong], 78, "wrong.toml:2: 99 is out of range"),
        (vec!["--config", "/nowhere.toml"], 78, "/nowhere.toml"),
        (vec!["--faults", faults], 78, "faults.toml:3: 2 is out of range"),
        (vec!["--check-config", "--faults", "/nowhere.toml"], 78, "/nowhere.toml"),
        (vec!["--robot", "0"], 2, "robot"),
        (vec!["--speed", "0"], 2, "0.01 to 100"),
    ];
    for (arguments, code, reported) in cases {
        let output = process(&arguments).output().unwrap();
        let error = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {error}");
        assert!(error.contains(reported), "{arguments:?}: {error}");
        assert!(output.stdout.is_empty());
    }
    assert_eq!(fs::read_to_string(precious).unwrap(), "data");
    let checked = process(&["--check-config"]).output().unwrap();
    assert_eq!(checked.status.code(), Some(0));
}

#[test]
fn the_port_is_hung_up_by_script_and_comes_back_as_another_device() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("port");
    let script = folder.path().join("faults.toml");
    let faults =
        "seed = 4711\n[[fault]]\nkind = 'hang_up'\nat_s = 0.3\nfor_s = 0.2\nelsewhere = true\n";
    fs::write(&script, faults).unwrap();
    let mut child = process(&["--faults", script.to_str().unwrap(), "--link"])
        .arg(&link)
        .env("RIL_LOG", "info")
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut reported = BufReader::new(child.stderr.take().unwrap()).lines();
    let mut sim = Sim { child, link };
    let mut wait_for = |what: &str| {
        let mut lines = reported.by_ref().map(Result::unwrap);
        lines.find(|line| line.contains(what)).expect(what)
    };
    assert!(wait_for("faults on purpose").contains("seed=4711"));
    let port_of = |line: String| line.rsplit_once("port=").unwrap().1.to_owned();
    let first = port_of(wait_for("the port is there"));
    assert_eq!(port_of(wait_for("the port is hung up")), first);
    let second = port_of(wait_for("the port is there"));
    assert_ne!(first, second);
    assert_eq!(fs::read_link(&sim.link).unwrap(), Path::new(&second));
    start_status(&mut sim.open());
    assert_eq!(sim.end(Signal::TERM), Some(0));
    let done = wait_for("faults on purpose");
    assert!(done.contains("1 port hang-ups"), "{done}");
}
