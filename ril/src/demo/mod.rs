//! `ril demo`: the main job with no hardware and no configuration.
//!
//! It starts the simulator, status and the bridge as three processes in a shared-memory domain of their own, acts as the
//! operator, and judges the flight by what a consumer saw in shared memory. Whatever happens, nothing that it started is
//! left running and nothing of it is left in shared memory. Its folder is removed, unless the operator chose it or the
//! demonstration failed.
//!
//! * `mission`: what the operator asks; `watch`: what a consumer sees; `verdict`: what is checked. All pure.
//! * `children`: the processes; `screen`: what is shown; here: the one wait that joins them.

mod children;
mod mission;
mod screen;
mod verdict;
mod watch;

use std::fs;
use std::io::{self, Write};
use std::num::NonZeroU32;
use std::os::fd::AsFd;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use ipc_types::payload::{
    DspTelemetry, HeroTelemetry, ModuleControl, ModuleState, MovementData, RequestReport,
};
use ipc_types::{
    Client, Descriptor, Domain, Ipc, MonotonicNs, RobotId, Source, Subscriber, Waiter,
    fresh_request_id,
};
use runtime::duration::Shown;
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::signal::Termination;
use serde::Serialize;

pub use children::end_with_parent;
use children::{Process, Readiness, Spawner};
use mission::{Mission, Request};
use screen::Screen;
use verdict::{Check, Evidence};
use watch::{Counts, Watch};

/// The whole demonstration ends within this, or something hangs. A flight takes less than 20 s; machines stall.
const TIME_LIMIT: Duration = Duration::from_secs(120);

/// Longest wait between two looks at the time limit.
const LONGEST_WAIT: Duration = Duration::from_millis(200);

/// Options of `ril demo`.
#[derive(clap::Args, Clone, Debug)]
#[command(after_help = crate::cli::EXIT_CODES)]
pub struct Args {
    /// Which robot to be: an integer greater than 0
    #[arg(long, value_name = "N", env = "RIL_ROBOT", default_value = "1")]
    pub robot: NonZeroU32,

    /// Print one JSON object on a line
    #[arg(long)]
    pub json: bool,

    /// Run the simulator's clock so many times faster
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = speed)]
    pub speed: f64,

    /// Where the log and the outputs of the processes go and stay; made if it is not there [default: a folder that is removed
    /// at the end]
    #[arg(long, value_name = "FOLDER")]
    pub folder: Option<PathBuf>,
}

fn speed(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(speed) if (0.1..=20.0).contains(&speed) => Ok(speed),
        _ => Err("the speed is a number from 0.1 to 20".to_owned()),
    }
}

/// The demonstration's result as JSON.
#[derive(Serialize)]
struct Report<'a> {
    schema: &'static str,
    passed: bool,
    flight_s: f64,
    telemetry_age_ms_p50: Option<f64>,
    telemetry_age_ms_p99: Option<f64>,
    checks: &'a [Check],
    log: Option<&'a Path>,
    folder: Option<&'a Path>,
}

/// Runs the demonstration.
///
/// # Errors
/// Exit code 1 when a check failed, a process could not be started or ended by itself; 4 when time ran out. A signal ends it by
/// itself, once everything is cleaned up.
pub fn run(args: &Args) -> Result<(), Failure> {
    let termination = Termination::install().map_err(Failure::internal)?;
    let folder = folder(args)?;
    let result = demonstrate(args, &folder, &termination);
    match result {
        // What the processes said shows the cause.
        Err(failure) if failure.signal().is_none() && failure.code() != ExitCode::Ok => {
            let next_step = format!("what the processes said is in {}", folder.display());
            Err(failure.with_next_step(next_step))
        }
        result if args.folder.is_some() => result,
        result => {
            let removed = fs::remove_dir_all(&folder);
            result?;
            let text = || format!("the folder {} cannot be removed", folder.display());
            removed.or_fail_with(ExitCode::Internal, text())
        }
    }
}

/// Flies, judges and prints, with everything but the folder cleaned up in any case.
fn demonstrate(args: &Args, folder: &Path, termination: &Termination) -> Result<(), Failure> {
    let domain = Domain::isolated();
    let mut screen = Screen::new(args.json);
    let flown = fly(args, &domain, folder, termination, &mut screen);
    screen.end().map_err(Failure::output)?;
    // Every process and port is gone by now, also after an error.
    domain.remove_if_dead().map_err(Failure::internal)?;
    let flight = flown?;
    let log = find_log(folder);
    let checks = verdict::judge(&Evidence {
        outcomes: flight.mission.outcomes(),
        watch: &flight.watch,
        counts: flight.counts,
        log_rows: log.as_deref().and_then(rows),
        exits: &flight.exits,
        residue: domain.residue().len(),
    });
    tell(args, &flight, &checks, log.as_deref(), folder).map_err(Failure::output)?;
    match checks.iter().filter(|check| !check.passed).count() {
        0 => Ok(()),
        failed => Err(Failure::internal(format!(
            "{failed} of {} checks failed",
            checks.len()
        ))),
    }
}

/// A flight that ended.
struct Flight {
    mission: Mission,
    watch: Watch,
    counts: Counts,
    exits: Vec<(&'static str, Option<i32>)>,
    took: Duration,
}

fn fly(
    args: &Args,
    domain: &Domain,
    folder: &Path,
    termination: &Termination,
    screen: &mut Screen,
) -> Result<Flight, Failure> {
    let robot = RobotId::from(args.robot);
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
    let speed = args.speed.to_string();
    screen
        .say("starting the simulator, status and the bridge as processes of their own")
        .map_err(Failure::output)?;
    stage.start(
        &spawner,
        "sim",
        "",
        &["--link", &port_name, "--speed", &speed],
    )?;
    // Status before the bridge, so that it misses no sample and the log can be compared to the last row.
    stage.start(&spawner, "status", &status_config(folder), &[])?;
    stage.start(&spawner, "bridge", BRIDGE_CONFIG, &["--port", &port_name])?;
    stage.wait_until(screen, |stage| {
        stage.watch.home().is_some() && stage.link_is_up()
    })?;

    let began = Instant::now();
    let home = stage.watch.home().copied().unwrap_or_default();
    stage.watch.expect(Mission::waypoints(&home));
    stage.mission = Some(Mission::new(&home));
    stage.began = Some(began);
    stage.wait_until(screen, |stage| {
        stage.mission.as_ref().is_some_and(Mission::is_over)
    })?;
    let took = began.elapsed();
    let exits = stage.end_processes()?;
    Ok(Flight {
        mission: stage.mission.take().unwrap_or_else(|| Mission::new(&home)),
        counts: stage.counts(),
        watch: std::mem::take(&mut stage.watch),
        exits,
        took,
    })
}

/// The bridge of the demonstration: a brisk helicopter, and an acceptance radius that fits its speed. A machine that is
/// busy with something else may stop the bridge for seconds, which must not end the flight that it shows.
const BRIDGE_CONFIG: &str = "\
[link]
pc_timeout_ms = 30000

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

/// Everything that the demonstration's one wait serves.
struct Stage<'a> {
    termination: &'a Termination,
    readiness: &'a Readiness,
    waiter: Waiter,
    processes: Vec<Process>,
    ready: usize,
    control: Client<ModuleControl>,
    movement: Client<MovementData>,
    dsp: Subscriber<DspTelemetry>,
    hero: Subscriber<HeroTelemetry>,
    state: Subscriber<ModuleState>,
    watch: Watch,
    mission: Option<Mission>,
    began: Option<Instant>,
    deadline: Instant,
}

impl<'a> Stage<'a> {
    fn new(
        ipc: &Ipc,
        termination: &'a Termination,
        readiness: &'a Readiness,
    ) -> Result<Stage<'a>, Failure> {
        Ok(Stage {
            termination,
            readiness,
            waiter: Waiter::new(),
            processes: Vec::new(),
            ready: 0,
            control: ipc.client().map_err(Failure::internal)?,
            movement: ipc.client().map_err(Failure::internal)?,
            dsp: ipc.subscriber().map_err(Failure::internal)?,
            hero: ipc.subscriber().map_err(Failure::internal)?,
            state: ipc.subscriber().map_err(Failure::internal)?,
            watch: Watch::default(),
            mission: None,
            began: None,
            deadline: Instant::now() + TIME_LIMIT,
        })
    }

    /// Starts a process and waits until it is ready.
    fn start(
        &mut self,
        spawner: &Spawner<'_>,
        name: &'static str,
        config: &str,
        args: &[&str],
    ) -> Result<(), Failure> {
        let process = spawner.start(name, config, args).or_fail_with(
            ExitCode::Internal,
            format!("`ril run {name}` cannot be started"),
        )?;
        self.processes.push(process);
        let expected = self.processes.len();
        self.wait_until(&mut Screen::new(true), |stage| stage.ready == expected)
    }

    fn link_is_up(&self) -> bool {
        let state = self.watch.last_state().and_then(|state| state.link.state());
        state == Some(ipc_types::code::LinkState::Up)
    }

    fn counts(&self) -> Counts {
        Counts {
            dsp: self.dsp.losses(),
            hero: self.hero.losses(),
            state: self.state.losses(),
        }
    }

    /// Serves everything until `done`. Ends early when a process does, a signal comes, or time runs out.
    fn wait_until(
        &mut self,
        screen: &mut Screen,
        done: impl Fn(&Stage<'_>) -> bool,
    ) -> Result<(), Failure> {
        loop {
            self.drain(screen)?;
            if done(self) {
                return Ok(());
            }
            if self.termination.requested() {
                let text = "interrupted; nothing is left running";
                return Err(match self.termination.signal() {
                    Some(signal) => Failure::interrupted(signal, text),
                    None => Failure::internal(text),
                });
            }
            if let Some(process) = self
                .processes
                .iter_mut()
                .find_map(|process| process.has_ended().then_some(process))
            {
                let (name, code) = (process.name(), process.end());
                return Err(Failure::internal(format!(
                    "`ril run {name}` ended by itself with code {code:?}; its last words:\n{}",
                    process.last_words()
                )));
            }
            if Instant::now() >= self.deadline {
                return Err(Failure::new(
                    ExitCode::Timeout,
                    format!("the demonstration took more than {}", Shown(TIME_LIMIT)),
                ));
            }
            self.sleep()?;
        }
    }

    fn drain(&mut self, screen: &mut Screen) -> Result<(), Failure> {
        self.ready += self.readiness.drain();
        self.drain_telemetry()?;
        let mut reports: Vec<RequestReport> = Vec::new();
        self.control.drain(|report| reports.push(*report));
        self.movement.drain(|report| reports.push(*report));
        if let (Some(mission), Some(began)) = (&mut self.mission, self.began) {
            for report in &reports {
                if let Some(outcome) = mission.report(report) {
                    screen
                        .outcome(outcome, began.elapsed())
                        .map_err(Failure::output)?;
                }
            }
            for request in mission.next_requests(fresh_request_id) {
                match request {
                    Request::Control(control) => self.control.send(&control),
                    Request::Movement(movement) => self.movement.send(&movement),
                }
                .map_err(Failure::internal)?;
            }
        }
        let counts = self.counts();
        screen
            .draw(self.mission.as_ref(), &self.watch, &counts)
            .map_err(Failure::output)
    }

    fn drain_telemetry(&mut self) -> Result<(), Failure> {
        let watch = &mut self.watch;
        self.dsp
            .drain(|sample| watch.dsp(sample))
            .map_err(Failure::internal)?;
        self.hero
            .drain(|sample| watch.hero(sample, MonotonicNs::now()))
            .map_err(Failure::internal)?;
        self.state
            .drain(|state| watch.state(state))
            .map_err(Failure::internal)?;
        Ok(())
    }

    fn sleep(&mut self) -> Result<(), Failure> {
        let mut signals = Descriptor::new(self.termination.as_fd());
        let mut readiness = Descriptor::new(self.readiness.as_fd());
        let processes = self.processes.iter();
        let mut processes: Vec<_> = processes
            .map(|process| Descriptor::new(process.as_fd()))
            .collect();
        let ports: [&mut dyn Source; 7] = [
            &mut signals,
            &mut readiness,
            &mut self.control,
            &mut self.movement,
            &mut self.dsp,
            &mut self.hero,
            &mut self.state,
        ];
        let processes = processes
            .iter_mut()
            .map(|process| process as &mut dyn Source);
        let mut sources: Vec<_> = ports
            .into_iter()
            .chain(processes)
            .map(|source| ((), source))
            .collect();
        self.waiter
            .wait(&mut sources, Some(LONGEST_WAIT))
            .map_err(Failure::internal)?;
        Ok(())
    }

    /// Ends the processes in the order of the data, so that nothing that was said is lost: what the bridge published
    /// last is translated, logged and seen here before status ends.
    fn end_processes(&mut self) -> Result<Vec<(&'static str, Option<i32>)>, Failure> {
        let mut exits = Vec::new();
        for name in ["bridge", "status", "sim"] {
            if let Some(process) = self
                .processes
                .iter_mut()
                .find(|process| process.name() == name)
            {
                exits.push((name, process.end()));
            }
            self.drain_telemetry()?;
        }
        self.processes.clear();
        Ok(exits)
    }
}

impl Drop for Stage<'_> {
    /// After an error too: bridge first, the simulator last.
    fn drop(&mut self) {
        while let Some(process) = self.processes.pop() {
            drop(process);
        }
    }
}

fn folder(args: &Args) -> Result<PathBuf, Failure> {
    let folder = args
        .folder
        .clone()
        .unwrap_or_else(|| std::env::temp_dir().join(format!("hero-demo-{}", std::process::id())));
    fs::create_dir_all(&folder).or_fail_with(
        ExitCode::Usage,
        format!("the folder {} cannot be made", folder.display()),
    )?;
    folder.canonicalize().or_fail_with(
        ExitCode::Usage,
        format!("the folder {} cannot be used", folder.display()),
    )
}

/// The newest log in the folder.
fn find_log(folder: &Path) -> Option<PathBuf> {
    fs::read_dir(folder)
        .ok()?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.extension().is_some_and(|extension| extension == "tsv"))
        .max_by_key(|path| {
            fs::metadata(path)
                .and_then(|metadata| metadata.modified())
                .ok()
        })
}

/// Rows of a log without its first line.
fn rows(log: &Path) -> Option<u64> {
    let text = fs::read_to_string(log).ok()?;
    u64::try_from(text.lines().count()).ok()?.checked_sub(1)
}

fn tell(
    args: &Args,
    flight: &Flight,
    checks: &[Check],
    log: Option<&Path>,
    folder: &Path,
) -> io::Result<()> {
    let mut out = io::stdout().lock();
    let passed = checks.iter().all(|check| check.passed);
    let age_ms = |percent| flight.watch.age_us(percent).map(|us| f64::from(us) / 1e3);
    if args.json {
        let report = Report {
            schema: "ril.Demo.v1",
            passed,
            flight_s: flight.took.as_secs_f64(),
            telemetry_age_ms_p50: age_ms(50),
            telemetry_age_ms_p99: age_ms(99),
            checks,
            log: log.filter(|_| args.folder.is_some()),
            folder: args.folder.as_ref().map(|_| folder),
        };
        serde_json::to_writer(&mut out, &report)?;
        return writeln!(out);
    }
    writeln!(out)?;
    for check in checks {
        let mark = if check.passed { "ok    " } else { "FAILED" };
        writeln!(out, "{mark} {:33} {}", check.name, check.detail)?;
    }
    writeln!(out)?;
    writeln!(out, "flight    {:.1} s", flight.took.as_secs_f64())?;
    if let (Some(p50), Some(p99)) = (age_ms(50), age_ms(99)) {
        writeln!(
            out,
            "age       {p50:.3} ms median, {p99:.3} ms 99th percentile: serial byte to this consumer"
        )?;
    }
    match log {
        Some(log) if args.folder.is_some() => writeln!(out, "log       {}", log.display())?,
        _ => writeln!(out, "log       removed; --folder FOLDER keeps it")?,
    }
    writeln!(
        out,
        "{}",
        if passed {
            "all checks passed"
        } else {
            "not all checks passed"
        }
    )
}
