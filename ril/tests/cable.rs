//! The simulator at a real serial port (`ril run sim --port`): a cable between two terminals, with `ril run bridge` at its other end.

mod common;

use std::fs::{self, File};
use std::io::{Read, Write};
use std::os::unix::fs::symlink;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::thread::{self, JoinHandle};

use common::{PATIENT, Rig, end};
use ipc_types::code::LinkState;
use ril_tests::process::Signal;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

/// One end of a cable: what is written to the terminal at `path` can be read here, and the other way round.
struct CableEnd {
    master: File,
    path: PathBuf,
}

impl CableEnd {
    fn open() -> CableEnd {
        // A process that inherited it would keep the cable plugged in.
        let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
        let master = openpt(flags).expect("a pseudo-terminal");
        grantpt(&master).expect("a terminal of this user");
        unlockpt(&master).expect("a terminal that can be opened");
        let path = ptsname(&master, Vec::new()).expect("a name");
        CableEnd {
            master: File::from(master),
            path: path.into_string().expect("a path").into(),
        }
    }

    /// Makes `name` in the folder of `rig` lead to the terminal.
    fn plug_in(&self, rig: &Rig, name: &str) {
        let draft = rig.folder().join("draft");
        symlink(&self.path, &draft).expect("a link");
        fs::rename(&draft, rig.folder().join(name)).expect("a link");
    }

    /// Hands on what is there; false when this end is closed.
    fn hand_on(&mut self, other: &mut CableEnd) -> bool {
        let mut buffer = [0; 4_096];
        match self.master.read(&mut buffer) {
            Ok(count @ 1..) => other.master.write_all(&buffer[..count]).is_ok(),
            _ => false,
        }
    }
}

/// A cable that carries bytes both ways until it is unplugged.
struct Cable {
    carrier: JoinHandle<()>,
    unplug: UnixStream,
}

impl Cable {
    /// Joins two terminals that are open at their other ends.
    fn join(mut left: CableEnd, mut right: CableEnd) -> Cable {
        let (unplug, unplugged) = UnixStream::pair().expect("a pair of sockets");
        let carrier = thread::spawn(move || {
            loop {
                let mut sources = [
                    PollFd::new(&left.master, PollFlags::IN),
                    PollFd::new(&right.master, PollFlags::IN),
                    PollFd::new(&unplugged, PollFlags::IN),
                ];
                poll(&mut sources, None).expect("a wait");
                let [from_left, from_right, end] =
                    sources.map(|source| !source.revents().is_empty());
                if end
                    || (from_left && !left.hand_on(&mut right))
                    || (from_right && !right.hand_on(&mut left))
                {
                    return;
                }
            }
        });
        Cable { carrier, unplug }
    }

    /// Both ends are hung up when this returns.
    fn unplug(self) {
        drop(self.unplug);
        self.carrier.join().expect("a cable carries bytes");
    }
}

/// Puts a new cable at the ports of both processes.
fn plug_in(rig: &Rig) -> (CableEnd, CableEnd) {
    let ends = (CableEnd::open(), CableEnd::open());
    ends.0.plug_in(rig, "sim-port");
    ends.1.plug_in(rig, "bridge-port");
    ends
}

#[test]
fn a_simulator_at_a_serial_port_is_flown_over_a_cable_that_is_unplugged_in_between() {
    let rig = Rig::new();
    let (at_sim, at_bridge) = plug_in(&rig);
    let mut sim = rig.start("sim --port sim-port --baud-rate 57600 --seed 1");
    sim.wait_for_text("ready");
    rig.write("bridge.toml", PATIENT);
    let mut bridge = rig.start("bridge --port bridge-port");
    bridge.wait_for_text("port open");
    let cable = Cable::join(at_sim, at_bridge);
    let mut watch = rig.watch(1);
    watch.until_ready();
    rig.run("start", 0);
    rig.run("takeoff --altitude 2", 0);

    cable.unplug();
    watch.until("the link is down", |state| {
        state.link.state() != Some(LinkState::Up)
    });
    let (at_sim, at_bridge) = plug_in(&rig);
    sim.wait_for_text("the serial port is back");
    bridge.wait_for_text("port open");
    let cable = Cable::join(at_sim, at_bridge);
    watch.until_ready();
    // It has hovered in the meantime.
    rig.run("goto 37.41102,-6.001,13", 0);
    rig.run("land", 0);
    drop(watch);
    end(bridge, Signal::TERM);
    end(sim, Signal::TERM);
    cable.unplug();
}
