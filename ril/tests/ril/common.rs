//! What the end-to-end tests share: `ril` in a shared-memory domain and a folder of the test's own, and a helicopter in
//! the air.

use std::path::Path;

use ril_tests::languages::skip;
pub use ril_tests::process::says;
use ril_tests::process::{Finished, Signal};
pub use ril_tests::sandbox::FOR_SLOW_MACHINES;
use ril_tests::sandbox::Robot;
use ril_tests::{Process, Received, Sandbox};

use ipc_types::payload::MovementData;

/// A domain, a folder, and the `ril` of this build in both. The domain's guard checks at the end that nothing is left.
pub fn sandbox() -> Sandbox {
    Sandbox::of(env!("CARGO_BIN_EXE_ril"))
}

/// Whether the relay's program is there: cargo builds it with the whole workspace alone.
pub fn has_relay(what: &str) -> bool {
    let relay = Path::new(env!("CARGO_BIN_EXE_ril")).with_file_name("ril-relay");
    let has_relay = relay.is_file();
    if !has_relay {
        skip(what, "`ril-relay` is not built: test the whole workspace");
    }
    has_relay
}

/// What `ril status --json` shows of a robot. Its exit code says whether the link is up and the data is new, which a
/// machine that stalls decides as well.
#[track_caller]
pub fn shown_state(rig: &Sandbox, robot: u32) -> serde_json::Value {
    let finished = state_of(rig, &format!("state --json --robot {robot}"));
    json(&finished.stdout[0])
}

/// Runs `ril status` with these words, which must find a bridge. Unless they say how long, it waits a few seconds for
/// what is new: in some tests nothing new comes.
#[track_caller]
pub fn state_of(rig: &Sandbox, args: &str) -> Finished {
    let limit = match args.contains("--timeout") {
        true => "",
        false => "--timeout 5s",
    };
    let finished = rig.finish(&format!("{args} {limit}"));
    assert!(
        matches!(finished.code(), Some(0 | 4 | 6)),
        "ril {args}: {finished:#?}"
    );
    finished
}

/// Ends a process with `signal`; it must end with exit code 0.
#[track_caller]
pub fn end(mut process: Process, signal: Signal) -> Finished {
    process.signal(signal);
    process.exits(0)
}

/// Ends processes one after the other; each must end with exit code 0.
#[track_caller]
pub fn end_all(processes: impl IntoIterator<Item = Process>) {
    for process in processes {
        process.end();
    }
}

/// A line of JSON.
#[track_caller]
pub fn json(line: &str) -> serde_json::Value {
    serde_json::from_str(line).unwrap_or_else(|error| panic!("{line}: {error}"))
}

/// The movement that was received.
pub fn movement(received: Received) -> MovementData {
    match received {
        Received::Movement(movement) => movement,
        other => panic!("a movement was expected: {other:?}"),
    }
}

/// Simulator, bridge and status of robot 1, with the link up and a position, so that movements are possible.
#[track_caller]
pub fn start_robot(rig: &Sandbox, speed: u32) -> Robot {
    let robot = rig.start_robot(1, speed);
    rig.watch(1).until_ready();
    robot
}

/// Where the helicopter is: latitude and longitude, degrees, and altitude, m.
#[track_caller]
pub fn place(rig: &Sandbox, robot: u32) -> (f64, f64, f64) {
    let args = format!("echo dsp --robot {robot} --count 1 --json --field geographic");
    let sample = json(&rig.run(&args, 0).stdout[0]);
    let value = |name: &str| sample["geographic"][name].as_f64();
    let names = ["latitude_deg", "longitude_deg", "altitude_m"];
    names
        .map(|name| value(name).expect("a valid position"))
        .into()
}

/// A simulator and a bridge, started and in the air; the place as latitude and longitude, degrees, and the altitude, m.
pub struct Flight {
    pub sim: Process,
    pub bridge: Process,
    pub place: (f64, f64, f64),
}

impl Flight {
    pub fn begin(rig: &Sandbox) -> Flight {
        let sim = rig.sim(1, "--speed 10");
        let bridge = rig.bridge(1);
        rig.watch(1).until_ready();
        rig.run("start", 0);
        rig.run("takeoff --altitude 10", 0);
        Flight {
            place: place(rig, 1),
            sim,
            bridge,
        }
    }

    /// A path of 5 km, which takes minutes.
    pub fn far_away(&self, rig: &Sandbox) -> Process {
        let (latitude, longitude, altitude) = self.place;
        let remote = latitude + 0.045;
        let mut path = rig.start(&format!("goto {remote},{longitude},{altitude}"));
        path.wait_for_text("goto: progress");
        path
    }

    pub fn end(self) {
        end_all([self.bridge, self.sim]);
    }
}
