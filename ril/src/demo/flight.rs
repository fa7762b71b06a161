//! The demonstration's flight, from the start of the processes to their end.

use std::path::Path;
use std::time::{Duration, Instant};

use ipc_types::{Domain, Ipc, RobotId};
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::signal::Termination;

use super::children::{Readiness, Spawner};
use super::mission::Mission;
use super::screen::Screen;
use super::stage::Stage;
use super::watch::{Counts, Watch};

/// A flight that ended.
pub(super) struct Flight {
    /// What was asked, and how it ended.
    pub mission: Mission,
    /// What a consumer saw.
    pub watch: Watch,
    /// Lost samples.
    pub counts: Counts,
    /// The processes with their exit codes; nothing for one that a signal ended.
    pub exits: Vec<(&'static str, Option<i32>)>,
    /// From the first request to the end of the last.
    pub took: Duration,
}

/// Starts the processes, flies the mission and ends them.
pub(super) fn fly(
    robot: RobotId,
    speed: f64,
    domain: &Domain,
    folder: &Path,
    termination: &Termination,
    screen: &mut Screen,
) -> Result<Flight, Failure> {
    let readiness = Readiness::new().or_fail(ExitCode::Internal)?;
    let spawner = Spawner {
        domain,
        robot: robot.get(),
        folder,
        readiness: &readiness,
    };
    let ipc = Ipc::join(domain, robot, "demo").map_err(Failure::internal)?;
    let mut stage = Stage::new(&ipc, termination, &readiness)?;
    let port = folder.join("dsp");
    let port_name = port.to_string_lossy();
    let speed = speed.to_string();
    screen
        .say(
            "starting the simulator, status, the recorder and the bridge as processes of their own",
        )
        .map_err(Failure::output)?;
    for (name, config) in [
        ("sim", ""),
        ("status", &*status_config(folder)),
        ("bridge", BRIDGE_CONFIG),
    ] {
        spawner
            .configure(name, config)
            .or_fail(ExitCode::Internal)?;
    }
    let sim = spawner.start("sim", &["--link", &port_name, "--speed", &speed]);
    stage.await_ready("sim", sim)?;
    // Status and the recorder before the bridge, so that they miss no sample, and log and record can be compared to the last one.
    stage.await_ready("status", spawner.start("status", &[]))?;
    stage.await_ready("record", spawner.start_recorder())?;
    stage.await_ready("bridge", spawner.start("bridge", &["--port", &port_name]))?;
    stage.wait_until(screen, |stage| {
        stage.watch.home().is_some() && stage.link_is_up()
    })?;

    let began = Instant::now();
    let home = stage.watch.home().copied().unwrap_or_default();
    stage.watch.expect(Mission::waypoints(&home));
    stage.begin(Mission::new(&home), began);
    stage.wait_until(screen, |stage| {
        stage.mission().is_some_and(Mission::is_over)
    })?;
    let took = began.elapsed();
    let exits = stage.end_processes()?;
    Ok(Flight {
        mission: stage.take_mission().unwrap_or_else(|| Mission::new(&home)),
        counts: stage.counts(),
        watch: std::mem::take(&mut stage.watch),
        exits,
        took,
    })
}

/// The bridge of the demonstration: a brisk helicopter, and an acceptance radius that fits its speed. A machine that is
/// busy with something else may stop the bridge or the simulator for seconds, which must not end the flight that it shows.
const BRIDGE_CONFIG: &str = "\
[link]
pc_timeout_ms = 60000
ack_timeout_ms = 2000
silent_after_ms = 10000

[parameters]
cruise_speed_mps = 8.0
climb_speed_mps = 4.0
acceptance_radius_m = 1.0

[arrival]
latitude_deg = 0.00002
longitude_deg = 0.00002
altitude_m = 1.5
";

/// Status with a log of everything.
fn status_config(folder: &Path) -> String {
    let groups: Vec<String> = ipc_types::TelemetryGroup::ALL
        .iter()
        .map(|group| format!("\"{group}\""))
        .collect();
    format!(
        // A few megabytes, however full the disk is.
        "[[log]]\ndirectory = {:?}\nmin_free_mib = 0\ngroups = [{}]\n",
        folder,
        groups.join(", ")
    )
}
