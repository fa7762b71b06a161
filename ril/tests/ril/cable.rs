//! The simulator at a real serial port (`ril run sim --port`): a cable between two terminals, with `ril run bridge` at
//! its other end.

use ril_tests::{Sandbox, pty};
use std::fs::{self, File};
use std::io::{Read, Write};
use std::os::unix::fs::symlink;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::thread::{self, JoinHandle};
use std::time::Duration;

use crate::common::{FOR_SLOW_MACHINES, Flight, end, sandbox};
use dsp_protocol::{Command, Decoded, Decoder, Downlink, FlowControl, Uplink};
use ipc_types::code::{LinkState, Reason, Stage};
use ipc_types::payload::{MovementData, WaypointPosition};
use ipc_types::{Wake, fresh_request_id};
use ril_tests::process::{Signal, WAIT_LIMIT};
use rustix::event::{PollFd, PollFlags, Timespec, poll};

/// One end of a cable: what is written to the terminal at `path` can be read here, and the other way round.
struct CableEnd {
    master: File,
    path: PathBuf,
}

impl CableEnd {
    fn open() -> CableEnd {
        let (master, path) = pty::open();
        CableEnd { master, path }
    }

    /// Makes `name` in the folder of `rig` lead to the terminal.
    fn plug_in(&self, rig: &Sandbox, name: &str) {
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
fn plug_in(rig: &Sandbox) -> (CableEnd, CableEnd) {
    let ends = (CableEnd::open(), CableEnd::open());
    ends.0.plug_in(rig, "sim-port");
    ends.1.plug_in(rig, "bridge-port");
    ends
}

#[test]
fn a_simulator_at_a_serial_port_is_flown_over_a_cable_that_is_unplugged_in_between() {
    let rig = sandbox();
    let (at_sim, at_bridge) = plug_in(&rig);
    let mut sim = rig.start("sim --port sim-port --baud-rate 57600 --seed 1");
    sim.wait_for_text("ready");
    rig.write("bridge.toml", FOR_SLOW_MACHINES);
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

/// Waits until the bridge has said something at this end, and says whether it has.
fn has_said_something(end: &CableEnd, limit: Duration) -> bool {
    let mut sources = [PollFd::new(&end.master, PollFlags::IN)];
    let limit = Timespec::try_from(limit).expect("a time");
    poll(&mut sources, Some(&limit)).expect("a wait") > 0
}

/// The next command of the bridge at this end.
fn next_command(end: &mut CableEnd, decoder: &mut Decoder<Uplink>) -> Command {
    loop {
        assert!(has_said_something(end, WAIT_LIMIT), "no command came");
        let mut byte = [0];
        end.master.read_exact(&mut byte).expect("a byte");
        if let (_, Decoded::Message(received)) = decoder.receive(&byte)
            && let Uplink::Command(command) = received.message
        {
            return command;
        }
    }
}

#[test]
fn an_acknowledgement_behind_a_backlog_is_found_before_its_time_is_over() {
    let rig = sandbox();
    let mut dsp = CableEnd::open();
    dsp.plug_in(&rig, "dsp-1");
    // Longer than a stall of the machine between the command and the standstill.
    rig.write(
        "bridge.toml",
        "[link]\nack_timeout_ms = 2000\npc_timeout_ms = 30000\n",
    );
    let bridge = rig.bridge(1);
    let mut decoder = Decoder::new();
    let first = next_command(&mut dsp, &mut decoder);

    bridge.signal(Signal::STOP);
    let stop = Downlink::FlowControl(FlowControl::Stop).encode();
    let mut said = stop.as_bytes().repeat(3000);
    let acknowledgement = Downlink::Ack {
        command: first.code(),
    };
    said.extend_from_slice(acknowledgement.encode().as_bytes());
    dsp.master.write_all(&said).expect("room for it");
    assert!(!has_said_something(&dsp, Duration::from_millis(2400)));
    bridge.signal(Signal::CONT);
    let second = next_command(&mut dsp, &mut decoder);
    assert_ne!(second, first, "the start-up goes on");
    end(bridge, Signal::INT);
}

#[test]
fn a_request_after_a_standstill_is_judged_by_what_the_dsp_has_said_meanwhile() {
    let rig = sandbox();
    // Positions are known for less than the standstill, and for longer than a stall of the machine.
    let known = "silent_after_ms = 3000";
    rig.write(
        "bridge.toml",
        &FOR_SLOW_MACHINES.replace("silent_after_ms = 20000", known),
    );
    let flight = Flight::begin(&rig);
    let ipc = rig.domain.join("operator");
    let mut client = ipc.client::<MovementData>().expect("a client");
    let (latitude, longitude, altitude) = flight.place;
    let mut ask = |request: MovementData, standstill: Duration| {
        flight.bridge.signal(Signal::STOP);
        client.send(&request).expect("room for it");
        assert_eq!(client.wait(standstill).expect("a wait"), Wake::TimedOut);
        flight.bridge.signal(Signal::CONT);
        let mut first = None;
        while first.is_none() {
            client.wait(WAIT_LIMIT).expect("a wait");
            client.drain(|report| {
                if report.request_id == request.request_id {
                    first = first.or(report.stage().zip(report.reason()));
                }
            });
        }
        first
    };
    let far = WaypointPosition {
        latitude_deg: latitude + 0.01,
        longitude_deg: longitude,
        altitude_m: altitude,
    };
    let path = MovementData::waypoint(fresh_request_id(), 7, far, true, true);
    let standstill = Duration::from_millis(3500);
    let accepted = Some((Stage::Accepted, Reason::None));
    assert_eq!(ask(path, standstill), accepted);
    let land = MovementData::land(fresh_request_id()).preempting();
    assert_eq!(ask(land, standstill), accepted);
    drop(client);
    flight.end();
}
