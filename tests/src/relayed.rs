//! [`Rig`]: a robot and a ground station, each in a [`Sandbox`] of its own, and the relays between them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::time::Duration;

use ipc_types::code::{LinkState, RelayLinkState};
use ipc_types::payload::{DspTelemetry, ModuleState, RelayLink};

pub use crate::process::says;
use crate::process::{Finished, Process};
use crate::sandbox::{Robot, Sandbox, free_port};

/// The name of the station, which may command the robot.
pub const STATION: &str = "gcs";

/// A test with two relays that takes longer hangs. It lasts some 20 s alone, and all of them run at the same time.
const TEST_LIMIT: Duration = Duration::from_secs(300);

/// Twice the real clock: the relay's times are real ones, and a machine that is busy keeps up.
pub const SPEED: u32 = 2;

/// A machine of a test: its programs are `ril` and what lies beside it. `name` is printed when it hangs.
pub fn machine(ril: &Path, name: &str) -> Sandbox {
    Sandbox::new([ril], name, TEST_LIMIT)
}

/// Robot 1 with its processes and its relay, and a station that may command it.
#[derive(Debug)]
pub struct Rig {
    /// `None` after the end.
    pub processes: Option<Robot>,
    /// `None` while it is killed, and after the end.
    pub robot_relay: Option<Process>,
    /// `None` while it is killed, and after the end.
    pub station_relay: Option<Process>,
    /// The robot's machine.
    pub robot: Sandbox,
    /// The station's machine. Both come last: dropping them asserts that nothing is left.
    pub station: Sandbox,
    endpoint: String,
    connect: String,
}

impl Rig {
    /// Starts everything on two machines of a test, with this `relay.toml` beside the robot, and returns when the
    /// station shows the robot.
    #[track_caller]
    pub fn start(ril: &Path, name: &str, relay_toml: &str) -> Rig {
        let robot = machine(ril, name);
        robot.write("relay.toml", relay_toml);
        Rig::between(robot, machine(ril, name), free_endpoint(), SPEED)
    }

    /// Starts both machines with the robot's relay at `endpoint`, and a simulated clock that is `speed` times as fast.
    #[track_caller]
    pub fn between(robot: Sandbox, station: Sandbox, endpoint: String, speed: u32) -> Rig {
        let connect = endpoint.clone();
        Rig::over(robot, station, [endpoint, connect], speed)
    }

    /// Starts both machines; the robot's relay listens at the first endpoint, and the station's connects to the second
    /// one.
    #[track_caller]
    pub fn over(robot: Sandbox, station: Sandbox, endpoints: [String; 2], speed: u32) -> Rig {
        let [endpoint, connect] = endpoints;
        let mut rig = Rig {
            processes: Some(robot.start_robot(1, speed)),
            robot_relay: None,
            station_relay: None,
            robot,
            station,
            endpoint,
            connect,
        };
        rig.start_robot_relay();
        rig.start_station_relay();
        await_link(&rig.station, 1);
        rig
    }

    /// Kills the robot's relay.
    #[track_caller]
    pub fn kill_robot_relay(&mut self) -> Finished {
        self.robot.kill(self.robot_relay.take().expect("it runs"))
    }

    /// Kills the station's relay.
    #[track_caller]
    pub fn kill_station_relay(&mut self) -> Finished {
        let relay = self.station_relay.take().expect("it runs");
        self.station.kill(relay)
    }

    /// Starts the robot's relay.
    #[track_caller]
    pub fn start_robot_relay(&mut self) {
        self.robot_relay = Some(start_robot_relay(&self.robot, &self.endpoint));
    }

    /// Starts the station's relay.
    #[track_caller]
    pub fn start_station_relay(&mut self) {
        self.station_relay = Some(start_station_relay(&self.station, &self.connect));
    }

    /// Kills the bridge, starts another one, and returns what the killed one had printed.
    #[track_caller]
    pub fn restart_bridge(&mut self) -> Finished {
        let processes = self.processes.as_mut().expect("they run");
        processes.restart_bridge(&self.robot)
    }

    /// Where the robot's relay listens.
    pub fn endpoint(&self) -> &str {
        &self.endpoint
    }

    /// Brings the helicopter into the air by the station's verbs, and returns its place: latitude, longitude, altitude.
    #[track_caller]
    pub fn take_off(&self) -> [f64; 3] {
        self.station.run("start", 0);
        self.station.run("takeoff --altitude 5", 0);
        self.place()
    }

    /// Where the helicopter is, as the station shows it: latitude, longitude, altitude.
    #[track_caller]
    pub fn place(&self) -> [f64; 3] {
        let place = self
            .station
            .subscribe::<DspTelemetry>(1)
            .next_sample()
            .geographic;
        [place.latitude_deg, place.longitude_deg, place.altitude_m]
    }

    /// The words of a square of four waypoints of some ten metres around `place`, `up_m` above it and more.
    pub fn square([latitude, longitude, altitude]: [f64; 3], up_m: f64) -> String {
        let corners = [
            (7e-5, 0.0, 1.0),
            (7e-5, 9e-5, 2.0),
            (0.0, 9e-5, 1.0),
            (0.0, 0.0, 0.0),
        ];
        let point = |(north_deg, east_deg, more_m)| {
            let (latitude, longitude) = (latitude + north_deg, longitude + east_deg);
            format!("{latitude},{longitude},{}", altitude + up_m + more_m)
        };
        corners.map(point).join(" ")
    }

    /// Flies far away, which takes minutes; the verb has shown progress.
    #[track_caller]
    pub fn far_away(&self) -> Process {
        let [latitude, longitude, altitude] = self.place();
        let far = latitude + 0.02;
        let path = format!("goto {far},{longitude},{altitude}");
        let mut path = self.station.start(&path);
        path.wait_for_text("goto: progress");
        path
    }

    /// Ends all processes in order. Returns what the bridge and the simulator had printed.
    #[track_caller]
    pub fn end(&mut self) -> [Finished; 2] {
        let relays = [self.station_relay.take(), self.robot_relay.take()];
        for relay in relays.into_iter().flatten() {
            relay.end();
        }
        self.processes.take().expect("they run").end()
    }
}

/// Starts the relay of a robot that [`STATION`] may command.
#[track_caller]
pub fn start_robot_relay(machine: &Sandbox, endpoint: &str) -> Process {
    let args = format!("relay robot --listen {endpoint} --may-command {STATION}");
    machine.start_ready(&args)
}

/// Starts the relay of [`STATION`].
#[track_caller]
pub fn start_station_relay(machine: &Sandbox, endpoint: &str) -> Process {
    let args = format!("relay station --name {STATION} --connect {endpoint}");
    machine.start_ready(&args)
}

/// Waits until the link of a station to `robot` is up, and everything of a bridge and a status is provided there.
#[track_caller]
pub fn await_link(station: &Sandbox, robot: u32) {
    let mut links = station.subscribe::<RelayLink>(robot);
    links.until("the link is up", |link| {
        link.state == RelayLinkState::Up.code()
    });
    let mut states = station.subscribe::<ModuleState>(robot);
    states.until("the bridge's link is up", |state| {
        state.link.state() == Some(LinkState::Up) && state.link.telemetry_published > 0
    });
}

/// An endpoint on loopback that no other process has.
pub fn free_endpoint() -> String {
    format!("tcp/127.0.0.1:{}", free_port())
}

/// What bridges did, by what they logged about every request.
pub struct BridgeLog {
    /// The logs of all bridges of one robot, in their order.
    pub lines: Vec<String>,
}

impl BridgeLog {
    /// Of these processes.
    pub fn of<'a>(bridges: impl IntoIterator<Item = &'a Finished>) -> BridgeLog {
        let bridges = bridges.into_iter();
        let lines = bridges.flat_map(|bridge| bridge.stderr.iter().cloned());
        BridgeLog {
            lines: lines.collect(),
        }
    }

    /// How many requests of this command came that were no repetition.
    pub fn begun(&self, command: &str) -> usize {
        let command = format!("command=\"{command}\"");
        let is_it = |line: &&String| line.contains(&command) && !line.contains("repeat=");
        self.lines.iter().filter(is_it).count()
    }

    /// Requests that a bridge accepted.
    pub fn accepted(&self) -> BTreeSet<u64> {
        self.counts().into_keys().collect()
    }

    /// Requests that bridges accepted more than once.
    pub fn executed_twice(&self) -> Vec<u64> {
        let twice = self.counts().into_iter().filter(|(_, count)| *count > 1);
        twice.map(|(request, _)| request).collect()
    }

    fn counts(&self) -> BTreeMap<u64, usize> {
        let mut counts = BTreeMap::new();
        for line in &self.lines {
            if line.contains("stage=\"accepted\"")
                && let Some(request) = number_in(line, "request=")
            {
                *counts.entry(request).or_insert(0) += 1;
            }
        }
        counts
    }
}

/// The number behind `name` in a line of a log.
fn number_in(line: &str, name: &str) -> Option<u64> {
    let rest = line.split_once(name)?.1;
    let digits = rest.split(|letter: char| !letter.is_ascii_digit()).next();
    digits?.parse().ok()
}
