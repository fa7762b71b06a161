//! `ril record`: every topic of the robot in files, until a signal.
//!
//! The crate [`recording`] decides what becomes of a message and of its file. Here is the process around it. Pure:
//! `sinks`, what is made of some topics, with `journal`, `log` and `paths`; `publisher`, what becomes of the processes
//! behind topics; `gather`, when the loop looks at them. `shell`: the loop, with the ports, the one thread that writes,
//! what the files say of the flight, and what is printed.

pub mod cli;
mod gather;
mod journal;
mod log;
mod paths;
mod publisher;
mod shell;
mod sinks;

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::Path;

use ipc_types::{Domain, Ipc, RobotId, files};
use module_kit::process;
use operator::session::configuration;
use recording::{Recorder, Settings};
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::logging::LogLines;
use runtime::notify::Notifier;
use runtime::signal::Termination;
use rustix::fs::Access;
use status::log::config::LogLimits;
use status::log::file_name::Series;

use crate::cli::RecordArgs;
use crate::shell::disk::{Disk, RecordFolder, ViewerLayout};
use crate::shell::facts::FactsOfRobot;
use crate::shell::report::Reporter;
use crate::shell::topics::RecordedTopics;
use crate::shell::{RecorderShell, anchor};
use crate::sinks::Sinks;

/// `ril record`
///
/// # Errors
///
/// Code 2 when the options do not fit together or the folder may not be written, 8 when the disk did not take every
/// message, 1 when it did not answer at the end.
pub fn record(args: &RecordArgs) -> Result<(), Failure> {
    let max_total_bytes = args.max_total_bytes().map_err(Failure::usage)?;
    configuration(&args.common)?;
    refuse_unwritable(&args.output)?;
    let lines = LogLines::claim().inspect(|lines| lines.want(true));
    let termination = Termination::install().or_fail(ExitCode::Internal)?;
    let domain = Domain::from_environment().or_fail(ExitCode::Configuration)?;
    let robot = RobotId::from(args.common.robot());
    let ipc = Ipc::join(&domain, robot, "record").or_fail(ExitCode::Internal)?;

    let disk = Disk::start(RecordFolder {
        folder: args.output.clone(),
        series: Series::of_records(robot),
        limits: LogLimits {
            max_file_bytes: args.max_file_bytes(),
            max_total_bytes,
            min_free_bytes: args.min_free_bytes(),
        },
        layout: ViewerLayout {
            name: format!("hero{robot}_layout.json"),
            text: ros_messages::layout(robot),
        },
    });
    let disk = disk.or_fail_with(ExitCode::Internal, "the disk cannot have a thread")?;
    let topics = RecordedTopics::open(ipc.clone())?;
    let start = anchor();
    let facts = FactsOfRobot::gather(ipc, args, start)?;
    let info = facts.flight_info(topics.layouts(), &BTreeMap::new());
    let settings = Settings {
        split_duration: args.split,
        split_bytes: Some(args.max_file_bytes()),
        ..Settings::default()
    };
    let mut shell = RecorderShell::new(
        topics,
        facts,
        Recorder::new(settings, info, start),
        Sinks::new(robot, args.flights, start, lines),
        disk,
        Reporter::new(robot, args.json),
        args.duration.map(|duration| start.monotonic + duration),
    );
    let supervisor = Notifier::from_env();
    process::run(&mut shell, &termination, &supervisor).or_fail(ExitCode::Internal)?;
    shell.conclude()
}

/// Refuses a folder that this user may not write: that does not get better by waiting, as a full disk does.
fn refuse_unwritable(folder: &Path) -> Result<(), Failure> {
    let access = Access::WRITE_OK | Access::EXEC_OK;
    let usable =
        files::create_dir_all(folder).and_then(|()| Ok(rustix::fs::access(folder, access)?));
    match usable {
        Err(error)
            if matches!(
                error.kind(),
                ErrorKind::PermissionDenied
                    | ErrorKind::NotFound
                    | ErrorKind::ReadOnlyFilesystem
                    | ErrorKind::NotADirectory
                    | ErrorKind::AlreadyExists
            ) =>
        {
            let text = format!("{} cannot be written: {error}", folder.display());
            Err(Failure::usage(text).with_next_step("name another folder with --output"))
        }
        _ => Ok(()),
    }
}
