//! The demonstration's flight: it starts the processes, gives the operator's commands one after the other, watches the robot as a
//! consumer, and ends the processes. One wait serves all of that.

use std::fs;
use std::io;
use std::os::fd::AsFd;
use std::path::Path;
use std::time::{Duration, Instant};

use dsp_protocol::Waypoint;
use ipc_types::code::LinkState;
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState};
use ipc_types::{Descriptor, Domain, Ipc, MonotonicNs, RobotId, Source, Subscriber, Waiter};
use runtime::duration::DurationText;
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::signal::Termination;

use super::children::{ChildProcess, Readiness, Spawner};
use super::screen::Screen;
use super::seen::{Flown, LossCounts, Seen};

/// The whole demonstration ends within this, or something hangs. A flight takes less than 20 s; machines stall.
const TIME_LIMIT: Duration = Duration::from_secs(120);

/// Longest wait between two looks at the time limit.
const LONGEST_WAIT: Duration = Duration::from_millis(200);

/// The operator's commands: the name of each one's output, and its words behind `ril`.
pub(super) const SCRIPT: [(&str, &[&str]); 6] = [
    ("start", &["start"]),
    ("takeoff", &["takeoff", "5m"]),
    ("square", &["goto", "--file", PATHS[0].0]),
    ("second-path", &["goto", "--file", PATHS[1].0]),
    ("land", &["land"]),
    ("stop", &["stop"]),
];

/// The paths, each a file of waypoints: east, north and up of the place of take-off, m. The first is a square with one corner at the
/// start, so that it ends where it began.
const PATHS: [(&str, &[[f64; 3]]); 2] = [
    (
        "square.txt",
        &[
            [0.0, 8.0, 6.0],
            [8.0, 8.0, 7.0],
            [8.0, 0.0, 6.0],
            [0.0, 0.0, 5.0],
        ],
    ),
    ("second-path.txt", &[[-4.0, 3.0, 5.0], [-3.0, -2.0, 4.0]]),
];

/// The waypoints of each path around `home`.
pub(super) fn waypoints_of(home: &Waypoint) -> [Vec<Waypoint>; 2] {
    // Good for the few metres of the demonstration.
    const METRES_PER_DEGREE: f64 = 111_194.93;
    let east_metres_per_degree = METRES_PER_DEGREE * home.latitude_deg.to_radians().cos();
    let waypoint = |[east_m, north_m, up_m]: &[f64; 3]| Waypoint {
        latitude_deg: home.latitude_deg + north_m / METRES_PER_DEGREE,
        longitude_deg: home.longitude_deg + east_m / east_metres_per_degree,
        altitude_m: home.altitude_m + up_m,
    };
    PATHS.map(|(_, offsets)| offsets.iter().map(waypoint).collect())
}

/// Writes the paths to where the operator's commands find them.
pub(super) fn write_paths(folder: &Path, paths: &[Vec<Waypoint>; 2]) -> Result<(), Failure> {
    for ((file, _), path) in PATHS.iter().zip(paths) {
        let lines = path.iter().map(|place| {
            let (latitude, longitude) = (place.latitude_deg, place.longitude_deg);
            format!("{latitude:.9},{longitude:.9},{:.3}\n", place.altitude_m)
        });
        let written = fs::write(folder.join(file), lines.collect::<String>());
        written.or_fail(ExitCode::Internal)?;
    }
    Ok(())
}

/// How many processes the flight has.
pub(super) const PROCESSES: usize = ENDS.len();

/// Its processes in the order of the data, in which they end.
const ENDS: [&str; 4] = ["bridge", "status", "sim", "record"];

/// A flight that ended.
pub(super) struct DemoFlight {
    /// What is known of it.
    pub flown: Flown,
    /// From the first command to the end of the last.
    pub took: Duration,
}

/// Starts the processes, gives the commands and ends the processes.
pub(super) fn fly(
    domain: &Domain,
    robot: RobotId,
    folder: &Path,
    speed: f64,
    termination: &Termination,
    screen: &mut Screen,
) -> Result<DemoFlight, Failure> {
    let readiness = Readiness::new().or_fail(ExitCode::Internal)?;
    let spawner = Spawner {
        domain,
        robot: robot.get(),
        folder,
        readiness: &readiness,
    };
    let ipc = Ipc::join(domain, robot, "demo").map_err(Failure::internal)?;
    let mut stage = DemoLoop::new(&ipc, termination, &readiness)?;
    let port = folder.join("dsp");
    let port_name = port.to_string_lossy();
    let speed = speed.to_string();
    screen.line(
        "starting the simulator, status, the recorder and the bridge as processes of their own",
    )?;
    for (name, config) in [
        ("sim", ""),
        ("status", &*status_config(folder)),
        ("bridge", BRIDGE_CONFIG),
    ] {
        let written = fs::write(spawner.config_file(name), config);
        written.or_fail(ExitCode::Internal)?;
    }
    let sim = spawner.start("sim", &["--link", &port_name, "--speed", &speed]);
    stage.await_ready("sim", sim)?;
    // Status and the recorder before the bridge, so that they miss no sample, and log and record can be compared to the last one.
    stage.await_ready("status", spawner.start("status", &[]))?;
    stage.await_ready("record", spawner.start_recorder())?;
    stage.await_ready("bridge", spawner.start("bridge", &["--port", &port_name]))?;
    stage.wait_until(screen, |stage| {
        let link = stage
            .seen
            .state
            .as_ref()
            .and_then(|state| state.link.state());
        stage.seen.home.is_some() && link == Some(LinkState::Up)
    })?;

    let Some(home) = stage.seen.home else {
        return Err(Failure::internal(
            "no telemetry has shown where the helicopter stands",
        ));
    };
    let paths = waypoints_of(&home);
    write_paths(folder, &paths)?;
    stage.seen.waypoints = paths.concat();
    let began = Instant::now();
    let mut flown = Flown::default();
    for (name, words) in SCRIPT {
        let command = format!("ril {}", words.join(" "));
        screen.order = Some(command.clone());
        screen.line(&format!(
            "{:6.2} s  {command}",
            began.elapsed().as_secs_f64()
        ))?;
        let (code, said) = stage.order(screen, spawner.order(name, words))?;
        let end = said.lines().last().unwrap_or("it ended without a word");
        screen.line(&format!("{:6.2} s  {end}", began.elapsed().as_secs_f64()))?;
        flown.order_ended(&command, code, end);
        if flown.order_failed.is_some() {
            break;
        }
    }
    let took = began.elapsed();
    flown.exits = stage.end_processes()?;
    flown.seen = std::mem::take(&mut stage.seen);
    Ok(DemoFlight { flown, took })
}

/// The bridge of the demonstration: a brisk helicopter, and an acceptance radius that fits its speed. A machine that is
/// busy with something else may stop the bridge or the simulator for seconds, which must not end the flight that it shows.
pub(super) const BRIDGE_CONFIG: &str = "\
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
pub(super) fn status_config(folder: &Path) -> String {
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

/// Everything that the demonstration's one wait serves.
struct DemoLoop<'a> {
    termination: &'a Termination,
    readiness: &'a Readiness,
    waiter: Waiter,
    processes: Vec<ChildProcess>,
    ready: usize,
    /// The operator's command that is under way.
    order: Option<ChildProcess>,
    dsp: Subscriber<DspTelemetry>,
    hero: Subscriber<HeroTelemetry>,
    state: Subscriber<ModuleState>,
    seen: Seen,
    deadline: Instant,
}

impl<'a> DemoLoop<'a> {
    /// Takes part in the robot that the processes will be.
    fn new(
        ipc: &Ipc,
        termination: &'a Termination,
        readiness: &'a Readiness,
    ) -> Result<DemoLoop<'a>, Failure> {
        Ok(DemoLoop {
            termination,
            readiness,
            waiter: Waiter::new(),
            processes: Vec::new(),
            ready: 0,
            order: None,
            dsp: ipc.subscriber().map_err(Failure::internal)?,
            hero: ipc.subscriber().map_err(Failure::internal)?,
            state: ipc.subscriber().map_err(Failure::internal)?,
            seen: Seen::default(),
            deadline: Instant::now() + TIME_LIMIT,
        })
    }

    /// Waits until a process is ready that was just started.
    fn await_ready(
        &mut self,
        name: &str,
        started: io::Result<ChildProcess>,
    ) -> Result<(), Failure> {
        self.processes.push(begun(name, started)?);
        let expected = self.processes.len();
        self.wait_until(&mut Screen::new(true), |stage| stage.ready == expected)
    }

    /// Waits for the end of a command that was just given: its exit code, and what it said.
    fn order(
        &mut self,
        screen: &mut Screen,
        given: io::Result<ChildProcess>,
    ) -> Result<(Option<i32>, String), Failure> {
        self.order = Some(begun("ril", given)?);
        self.wait_until(screen, |stage| {
            stage.order.as_mut().is_none_or(ChildProcess::has_ended)
        })?;
        let mut order = self.order.take();
        let code = order.as_mut().and_then(ChildProcess::end);
        let said = order.map(|order| order.last_words());
        Ok((code, said.unwrap_or_default()))
    }

    /// Serves everything until `done`. Ends early when a process does, a signal comes, or time runs out.
    fn wait_until(
        &mut self,
        screen: &mut Screen,
        done: impl Fn(&mut DemoLoop<'_>) -> bool,
    ) -> Result<(), Failure> {
        loop {
            self.ready += self.readiness.drain();
            self.drain()?;
            screen.draw(&self.seen)?;
            // First of all: a signal to the process group may have ended a command that had no group of its own yet.
            goes_on(self.termination)?;
            if done(self) {
                return Ok(());
            }
            let mut processes = self.processes.iter_mut();
            if let Some(process) = processes.find_map(|one| one.has_ended().then_some(one)) {
                let (name, code) = (process.name(), process.end());
                return Err(Failure::internal(format!(
                    "the process {name} ended by itself with code {code:?}; its last words:\n{}",
                    process.last_words()
                )));
            }
            if Instant::now() >= self.deadline {
                return Err(Failure::new(
                    ExitCode::Timeout,
                    format!(
                        "the demonstration took more than {}",
                        DurationText(TIME_LIMIT)
                    ),
                ));
            }
            self.sleep()?;
        }
    }

    /// Takes every sample that came.
    fn drain(&mut self) -> Result<(), Failure> {
        let seen = &mut self.seen;
        self.dsp
            .drain(|sample| seen.dsp(sample))
            .map_err(Failure::internal)?;
        self.hero
            .drain(|sample| seen.hero(sample, MonotonicNs::now()))
            .map_err(Failure::internal)?;
        self.state
            .drain(|state| seen.state(state))
            .map_err(Failure::internal)?;
        seen.counts = LossCounts {
            dsp: self.dsp.losses(),
            hero: self.hero.losses(),
            state: self.state.losses(),
        };
        Ok(())
    }

    fn sleep(&mut self) -> Result<(), Failure> {
        let mut descriptors = vec![
            Descriptor::new(self.termination.as_fd()),
            Descriptor::new(self.readiness.as_fd()),
        ];
        let processes = self.processes.iter().chain(&self.order);
        descriptors.extend(processes.map(|process| Descriptor::new(process.as_fd())));
        let ports: [&mut dyn Source; 3] = [&mut self.dsp, &mut self.hero, &mut self.state];
        let descriptors = descriptors.iter_mut().map(|one| one as &mut dyn Source);
        let mut sources: Vec<_> = ports
            .into_iter()
            .chain(descriptors)
            .map(|source| ((), source))
            .collect();
        self.waiter
            .wait(&mut sources, Some(LONGEST_WAIT))
            .map_err(Failure::internal)?;
        Ok(())
    }

    /// Ends the processes in the order of the data, so that nothing that was said is lost: what the bridge published
    /// last is translated, logged, recorded and seen here before status and the recorder end.
    fn end_processes(&mut self) -> Result<Vec<(&'static str, Option<i32>)>, Failure> {
        let mut exits = Vec::new();
        for name in ENDS {
            let mut processes = self.processes.iter_mut();
            if let Some(process) = processes.find(|process| process.name() == name) {
                exits.push((name, process.end()));
            }
            self.drain()?;
        }
        self.processes.clear();
        Ok(exits)
    }
}

/// Ends a demonstration early when a signal has come.
pub(super) fn goes_on(termination: &Termination) -> Result<(), Failure> {
    if !termination.requested() {
        return Ok(());
    }
    let text = "interrupted; nothing is left running";
    Err(match termination.signal() {
        Some(signal) => Failure::interrupted(signal, text),
        None => Failure::internal(text),
    })
}

/// The process, or the failure that it cannot be started.
pub(super) fn begun(
    name: &str,
    started: io::Result<ChildProcess>,
) -> Result<ChildProcess, Failure> {
    let text = || format!("the process {name} cannot be started");
    started.or_fail_with(ExitCode::Internal, text())
}

impl Drop for DemoLoop<'_> {
    /// After an error too: the command first, then the bridge, and the simulator last.
    fn drop(&mut self) {
        self.order = None;
        while let Some(process) = self.processes.pop() {
            drop(process);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_path_ends_above_the_place_of_take_off() {
        let home = Waypoint {
            latitude_deg: 37.0,
            longitude_deg: -6.0,
            altitude_m: 10.0,
        };
        let [first, second] = waypoints_of(&home);
        assert_eq!((first.len(), second.len()), (4, 2));
        let above = Waypoint {
            altitude_m: 15.0,
            ..home
        };
        assert_eq!(first[3], above);
    }
}
