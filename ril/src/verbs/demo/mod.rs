//! `ril demo`: the main job with no hardware and no configuration.
//!
//! It starts the simulator, status, the recorder and the bridge as processes in a shared-memory domain of their own,
//! acts as the operator, and judges the flight by what a consumer saw in shared memory. Whatever happens, nothing that
//! it started is left running and nothing of it is left in shared memory. Its folder is removed, unless the operator
//! chose it or the demonstration failed.
//!
//! * `script`: the operator's commands; `fleet`: the flight of one robot or of many, and the one wait;
//! * `craft`: a robot; `children`: its processes;
//! * `seen`: what a consumer sees; `checks`: the judgement. Both pure;
//! * `files`: the log and the record as evidence, and the judgement with them;
//! * `screen`: what is shown meanwhile; `result`: what is shown in the end.

mod checks;
mod children;
mod craft;
mod files;
mod fleet;
pub mod options;
mod result;
mod screen;
mod script;
mod seen;

use std::fs;
use std::path::{Path, PathBuf};

use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::signal::Termination;

use checks::check;
use fleet::Fleet;
use options::DemoArgs;

/// Runs the demonstration.
///
/// # Errors
/// Exit code 1 when a check failed, a process could not be started or ended by itself; 4 when time ran out. A signal
/// ends it by itself, once everything is cleaned up.
pub fn run(args: &DemoArgs) -> Result<(), Failure> {
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

/// Flies, judges and prints.
fn demonstrate(args: &DemoArgs, folder: &Path, termination: &Termination) -> Result<(), Failure> {
    let fleet = Fleet::new(args, folder, termination)?;
    let kept = args.folder.as_ref().map(|_| folder);
    let Some(robots) = args.robots else {
        let (result, _) = fleet.demonstrate(Fleet::fly_one)?;
        result.print(kept, args.json)?;
        return match result.failed() {
            0 => Ok(()),
            failed => {
                let text = format!("{failed} of {} checks failed", result.checks.len());
                Err(Failure::internal(text))
            }
        };
    };
    let (mut result, residue) = fleet.demonstrate(|fleet| fleet.fly_many(robots))?;
    result.checks.push(check(
        "nothing left at the station",
        residue == 0,
        format!("{residue} files and segments left"),
    ));
    result.print(kept, args.json)?;
    match result.failed() {
        0 => Ok(()),
        failed => Err(Failure::internal(format!("{failed} checks failed"))),
    }
}

fn folder(args: &DemoArgs) -> Result<PathBuf, Failure> {
    let folder = args
        .folder
        .clone()
        .unwrap_or_else(|| std::env::temp_dir().join(format!("hero-demo-{}", std::process::id())));
    fs::create_dir_all(&folder)
        .or_fail_with(
            ExitCode::Usage,
            format!("the folder {} cannot be made", folder.display()),
        )
        .map_err(|failure| {
            failure.with_next_step("name one with --folder, which keeps the files")
        })?;
    folder.canonicalize().or_fail_with(
        ExitCode::Usage,
        format!("the folder {} cannot be used", folder.display()),
    )
}
