//! [`Rig`]: a robot and a station, each in a domain of its own, and the relays between them.

use std::path::Path;

use ipc_types::payload::DspTelemetry;
use ril_tests::Process;
use ril_tests::chain::beside_or_skip;
use ril_tests::process::Finished;

use crate::machine::{Crew, Machine, end, free_endpoint, kill};

/// Path of the relay's program: `ril` lies beside it after `cargo test --workspace`.
pub const RELAY: &str = env!("CARGO_BIN_EXE_ril-relay");

/// Robot 1 with its crew and its relay, and a station that may command it. The machines come last, because they look
/// whether anything is left.
pub struct Rig {
    /// `None` after the end.
    pub crew: Option<Crew>,
    /// `None` while it is killed, and after the end.
    pub robot_relay: Option<Process>,
    /// `None` while it is killed, and after the end.
    pub station_relay: Option<Process>,
    pub robot: Machine,
    pub station: Machine,
    endpoint: String,
}

impl Rig {
    /// Starts everything, and returns when the station shows the robot. `relay_toml` is the configuration of the robot's relay.
    /// `None` if there is no `ril`: the test is skipped, and says so.
    #[track_caller]
    pub fn start(name: &str, relay_toml: &str) -> Option<Rig> {
        let ril = beside_or_skip(Path::new(RELAY))?;
        let robot = Machine::new(&ril, name);
        let station = Machine::new(&ril, name);
        robot.write("relay.toml", relay_toml);
        let crew = Crew::start(&robot, 1);
        let endpoint = free_endpoint();
        let robot_relay = start_robot(&robot, &endpoint);
        let station_relay = start_station(&station, &endpoint);
        station.await_link(1);
        Some(Rig {
            crew: Some(crew),
            robot_relay: Some(robot_relay),
            station_relay: Some(station_relay),
            robot,
            station,
            endpoint,
        })
    }

    /// Kills the robot's relay.
    #[track_caller]
    pub fn kill_robot_relay(&mut self) -> Finished {
        kill(&self.robot, self.robot_relay.take().expect("it runs"))
    }

    /// Kills the station's relay.
    #[track_caller]
    pub fn kill_station_relay(&mut self) -> Finished {
        kill(&self.station, self.station_relay.take().expect("it runs"))
    }

    /// Starts another relay of the robot in the place of one that was killed.
    #[track_caller]
    pub fn start_robot_relay(&mut self) {
        self.robot_relay = Some(start_robot(&self.robot, &self.endpoint));
    }

    /// Starts another relay of the station in the place of one that was killed, and returns when its link is up.
    #[track_caller]
    pub fn start_station_relay(&mut self) {
        self.station_relay = Some(start_station(&self.station, &self.endpoint));
        self.station.await_link(1);
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

    /// Where the helicopter is, as the station shows it.
    #[track_caller]
    pub fn place(&self) -> [f64; 3] {
        let geographic = self.station.subscribe::<DspTelemetry>(1).next().geographic;
        [
            geographic.latitude_deg,
            geographic.longitude_deg,
            geographic.altitude_m,
        ]
    }

    /// Flies far away, which takes minutes; the verb has shown progress.
    #[track_caller]
    pub fn far_away(&self) -> Process {
        let [latitude, longitude, altitude] = self.place();
        let mut path = self
            .station
            .start(&format!("goto {},{longitude},{altitude}", latitude + 0.02));
        path.wait_for_text("goto: progress");
        path
    }

    /// Ends all processes in order; the machines look whether anything is left when they are dropped. Returns the logs of bridge and simulator.
    #[track_caller]
    pub fn end(&mut self) -> [Finished; 2] {
        for relay in [self.station_relay.take(), self.robot_relay.take()]
            .into_iter()
            .flatten()
        {
            end(relay);
        }
        self.crew.take().expect("it runs").end()
    }
}

#[track_caller]
fn start_robot(machine: &Machine, endpoint: &str) -> Process {
    machine.start_ready(&format!(
        "relay robot --listen {endpoint} --may-command gcs"
    ))
}

#[track_caller]
fn start_station(machine: &Machine, endpoint: &str) -> Process {
    machine.start_ready(&format!("relay station --name gcs --connect {endpoint}"))
}
