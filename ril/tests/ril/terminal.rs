//! A port that another process uses: a person who sits at the terminal to which the link of a killed simulator leads,
//! or the bridge of another domain. Neither is disturbed, the bridge says who it is, and has telemetry when the port is
//! its own.

use std::fs::{self, File};
use std::io::{self, ErrorKind, Read, Write};
use std::path::Path;

use crate::common::{end, sandbox};
use ipc_types::code::LinkState;
use ril_tests::process::Signal;
use ril_tests::{Process, Sandbox, pty};
use rustix::io::ioctl_fionbio;
use rustix::termios::{Termios, tcgetattr};

/// A pseudo-terminal, and a shell-like process of which it is the controlling terminal: it reads a line and tells it.
struct Person {
    master: File,
    shell: Process,
}

/// Opening a terminal makes it the controlling one of a process that leads a session without one.
const SHELL: &str =
    r#"exec 3<>"$0"; echo "process $$ sits at $0"; read line <&3; echo "it read $line""#;

impl Person {
    /// Sits down at the terminal of this master.
    fn sit_down(rig: &Sandbox, master: File, slave: &Path) -> Person {
        let mut command = std::process::Command::new("setsid");
        command.args(["--wait", "/bin/sh", "-c", SHELL]).arg(slave);
        let mut shell = Process::spawn(&rig.domain, command);
        shell.wait_for_text("sits at");
        ioctl_fionbio(&master, true).unwrap();
        Person { master, shell }
    }

    /// The shell's process.
    fn pid(&mut self) -> u32 {
        let lines = self.shell.lines();
        let pid = lines[0].text.split(' ').nth(1).unwrap();
        pid.parse().unwrap()
    }

    /// Settings of the terminal; those of the master are the slave's.
    fn settings(&self) -> Termios {
        tcgetattr(&self.master).unwrap()
    }

    /// What was written into the terminal.
    fn sees(&self) -> io::Result<Vec<u8>> {
        let mut buffer = [0; 4096];
        match (&self.master).read(&mut buffer) {
            Ok(count) => Ok(buffer[..count].to_vec()),
            Err(error) if error.kind() == ErrorKind::WouldBlock => Ok(vec![]),
            Err(error) => Err(error),
        }
    }

    fn types(mut self, line: &str) {
        writeln!(self.master, "{line}").unwrap();
        self.shell.wait_for_text(&format!("it read {line}"));
        assert!(self.shell.wait_exit().status.success());
    }
}

/// A new pseudo-terminal with the name `wanted`, which is free. The kernel gives the lowest number, so those below it
/// have to be in use.
fn master_of(wanted: &Path) -> File {
    let mut others = Vec::new();
    while others.len() < 200 {
        let (master, slave) = pty::open();
        if slave == wanted {
            return master;
        }
        others.push(master);
    }
    panic!("{} is in use again, or was never free", wanted.display());
}

/// What makes the two settings differ, if they do.
fn differences(before: &Termios, after: &Termios) -> String {
    let [before, after] = [before, after].map(|settings| format!("{settings:?}"));
    match before == after {
        true => String::new(),
        false => format!("{before}\n{after}"),
    }
}

#[test]
fn a_person_who_got_the_terminal_of_a_killed_simulator_notices_nothing() {
    let rig = sandbox();
    // The simulator gets a high number, which no other process on this machine gets in the moment when it is free.
    let lower: Vec<File> = (0..40).map(|_| pty::open().0).collect();
    let sim = rig.sim(1, "");
    drop(lower);
    let terminal = fs::read_link(rig.folder().join("dsp-1")).unwrap();
    let mut bridge = rig.start("bridge -v --port dsp-1");
    rig.watch(1).until_ready();

    sim.signal(Signal::KILL);
    bridge.wait_for_text("does not exist");
    // Until a person sits there.
    bridge.signal(Signal::STOP);
    let mut person = Person::sit_down(&rig, master_of(&terminal), &terminal);
    assert_eq!(
        fs::read_link(rig.folder().join("dsp-1")).unwrap(),
        terminal,
        "the link leads to the person's terminal"
    );
    let before = person.settings();
    bridge.signal(Signal::CONT);
    bridge.wait_for_text("was made by a simulator that has ended");
    // As if the link had been made by hand.
    fs::remove_file(rig.folder().join("dsp-1.owner")).unwrap();
    let told = bridge
        .wait_for_line(|line| {
            line.text.contains("is the terminal of") && line.text.contains("ERROR")
        })
        .text;
    let owner = format!(
        "dsp-1 leads to {}, which is the terminal of `sh` (process {})",
        terminal.display(),
        person.pid()
    );
    assert!(told.contains(&owner), "{told}");
    for _ in 0..5 {
        bridge.wait_for_text("still not open");
    }
    assert_eq!(person.sees().unwrap(), b"");
    assert_eq!(differences(&before, &person.settings()), "");

    // The simulator is started again, at another terminal.
    let sim = rig.sim(1, "");
    rig.watch(1).until_ready();
    assert_eq!(person.sees().unwrap(), b"");
    assert_eq!(differences(&before, &person.settings()), "");
    person.types("hello");
    let finished = end(bridge, Signal::TERM);
    let told = |line: &&String| line.contains("trying again");
    let told = finished.stderr.iter().filter(told).count();
    assert_eq!(told, 3, "each was told once: {finished:#?}");
    end(sim, Signal::TERM);
}

#[test]
fn a_bridge_that_is_given_a_persons_terminal_at_first_waits_as_well() {
    let rig = sandbox();
    let (master, slave) = pty::open();
    let mut person = Person::sit_down(&rig, master, &slave);
    let before = person.settings();
    let mut bridge = rig.start(&format!("bridge -v --port {}", slave.display()));
    let owner = format!("the terminal of `sh` (process {})", person.pid());
    bridge.wait_for_text(&owner);
    bridge.wait_for_text("still not open");
    let finished = rig.run(&format!("doctor --port {}", slave.display()), 6);
    let told = finished.stdout.iter().find(|line| line.contains(&owner));
    assert!(told.is_some(), "{finished:#?}");
    assert_eq!(person.sees().unwrap(), b"");
    assert_eq!(differences(&before, &person.settings()), "");
    person.types("hello");
    end(bridge, Signal::TERM);
}

#[test]
fn bridges_of_two_domains_never_share_a_simulator() {
    let (ours, theirs) = (sandbox(), sandbox());
    let sim = ours.sim(1, "");
    let port = ours.folder().join("dsp-1");
    let first = ours.bridge(1);
    let mut watch = ours.watch(1);
    let before = watch.until_ready().link;

    let mut second = theirs.start(&format!("bridge -v --port {}", port.display()));
    second.wait_for_text(&format!("is in use by `ril` (process {})", first.id()));
    for _ in 0..2 {
        second.wait_for_text("still not open");
    }
    let after = watch.until("telemetry goes on", |state| {
        state.link.telemetry_published > before.telemetry_published + 5
    });
    assert_eq!(after.link.state(), Some(LinkState::Up));
    assert_eq!(after.link.port_openings, before.port_openings);
    assert_eq!(
        after.refused,
        Default::default(),
        "no byte of a frame was lost to the other"
    );

    drop(watch);
    end(first, Signal::TERM);
    theirs.watch(1).until_ready();
    end(second, Signal::TERM);
    end(sim, Signal::TERM);
}
