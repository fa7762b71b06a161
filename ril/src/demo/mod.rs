//! `ril demo`: the main job with no hardware and no configuration.
//!
//! It starts the simulator, status, the recorder and the bridge as processes in a shared-memory domain of their own, acts as the
//! operator, and judges the flight by what a consumer saw in shared memory. Whatever happens, nothing that it started is
//! left running and nothing of it is left in shared memory. Its folder is removed, unless the operator chose it or the
//! demonstration failed.
//!
//! * `mission`: what the operator asks; `watch`: what a consumer sees; `verdict`: what is checked. All pure.
//! * `children`: the processes; `screen`: what is shown meanwhile; `stage`: the one wait that joins them; `flight`: from their
//!   start to their end; `result`: what is printed then.

mod children;
mod flight;
mod mission;
mod result;
mod screen;
mod stage;
mod verdict;
mod watch;

use std::fs;
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};

use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState};
use ipc_types::{Domain, RobotId, Topic};
use recording::read::{self, Bytes};
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::signal::Termination;
use status::log::file_name::{FileKind, recognize};

use crate::cli::exit_codes::EXIT_CODES;
use crate::recorded::check::FileCheck;
use crate::recorded::topic_of;
pub use children::end_with_parent;
use flight::fly;
use result::{Kept, tell};
use screen::Screen;
use verdict::{Evidence, RecordEvidence};

/// Options of `ril demo`.
#[derive(clap::Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
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

    /// Where log, record and the outputs of the processes go and stay; made if it is not there [default: a folder that is removed
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
    let robot = RobotId::from(args.robot);
    let flown = fly(robot, args.speed, &domain, folder, termination, &mut screen);
    screen.end().map_err(Failure::output)?;
    // Every process and port is gone by now, also after an error.
    domain.remove_if_dead().map_err(Failure::internal)?;
    let flight = flown?;
    let log = find_log(folder, FileKind::Tsv);
    let record = find_log(folder, FileKind::Mcap);
    let checks = verdict::judge(&Evidence {
        outcomes: flight.mission.outcomes(),
        watch: &flight.watch,
        counts: flight.counts,
        log_rows: log.as_deref().and_then(rows),
        record: record.as_deref().and_then(|file| recorded(file, robot)),
        exits: &flight.exits,
        residue: domain.residue().len(),
    });
    let kept = args.folder.is_some().then_some(Kept {
        folder,
        log: log.as_deref(),
        record: record.as_deref(),
    });
    tell(&flight, &checks, kept, args.json).map_err(Failure::output)?;
    match checks.iter().filter(|check| !check.passed).count() {
        0 => Ok(()),
        failed => Err(Failure::internal(format!(
            "{failed} of {} checks failed",
            checks.len()
        ))),
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

/// The newest log or record in the folder.
fn find_log(folder: &Path, kind: FileKind) -> Option<PathBuf> {
    fs::read_dir(folder)
        .ok()?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| {
            let name = path.file_name().and_then(|name| recognize(name.to_str()?));
            name.is_some_and(|(series, _)| series.kind() == kind)
        })
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

/// What the flight record of the robot has.
fn recorded(file: &Path, robot: RobotId) -> Option<RecordEvidence> {
    let bytes = Bytes::open(file).ok()?;
    let check = FileCheck::new(file.display().to_string(), read::check(&bytes));
    let messages = |key: &str| {
        let topic = check.topics.get(&topic_of(robot, key));
        topic.map_or(0, |topic| topic.messages)
    };
    let keys = [DspTelemetry::KEY, HeroTelemetry::KEY, ModuleState::KEY];
    let topics = keys.map(|key| topic_of(robot, key));
    let [dsp, hero, states] = keys.map(messages);
    Some(RecordEvidence {
        is_in_order: check.is_in_order(),
        dsp,
        hero,
        states,
        told: check.told(&topics),
    })
}
