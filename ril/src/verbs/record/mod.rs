//! `ril record`: every topic of the robot in files, until a signal.
//!
//! [`record`](crate::record) has what it decides. Here: `topics`, the ports; `sinks`, what is made of some topics; `disk`, the one thread
//! that writes; `shell`, the loop around them; `facts`, what the files say of the flight; `report`, what is printed.

mod disk;
mod facts;
mod gather;
mod journal;
mod log;
mod loss_events;
pub mod options;
mod report;
mod shell;
mod sinks;
mod topics;

use ipc_types::{Domain, Ipc, RobotId};
use module_kit::process;
use recording::{Recorder, Settings};
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::logging::LogLines;
use runtime::notify::Notifier;
use runtime::signal::Termination;
use status::log::config::Limits;
use status::log::file_name::Series;

use self::disk::Disk;
use self::disk::Place;
use self::facts::FactsOfRobot;
use self::options::RecordArgs;
use self::report::Reporter;
use self::shell::{Shell, anchor};
use self::sinks::Sinks;
use self::topics::Topics;
use crate::render::words::count;
use crate::session::configuration;

/// `ril record`
///
/// # Errors
///
/// Code 2 when the options do not fit together, 8 when the disk did not take every message, 1 when it did not answer at the end.
pub fn record(args: &RecordArgs) -> Result<(), Failure> {
    let max_total_bytes = args.max_total_bytes().map_err(Failure::usage)?;
    if configuration(&args.common)?.is_none() {
        return Ok(());
    }
    let lines = LogLines::claim().inspect(|lines| lines.want(true));
    let termination = Termination::install().or_fail(ExitCode::Internal)?;
    let domain = Domain::from_environment().or_fail(ExitCode::Configuration)?;
    let robot = RobotId::from(args.common.robot);
    let ipc = Ipc::join(&domain, robot, "record").or_fail(ExitCode::Internal)?;

    let disk = Disk::start(Place {
        folder: args.output.clone(),
        series: Series::of_records(robot),
        limits: Limits {
            max_file_bytes: args.max_file_bytes(),
            max_total_bytes,
            min_free_bytes: args.min_free_bytes(),
        },
    });
    let disk = disk.or_fail_with(ExitCode::Internal, "the disk cannot have a thread")?;
    let topics = Topics::open(ipc.clone())?;
    let start = anchor();
    let facts = FactsOfRobot::gather(ipc, args, start)?;
    let info = facts.flight_info(topics.layouts());
    let settings = Settings {
        split_duration: args.duration,
        split_bytes: Some(args.max_file_bytes()),
        ..Settings::default()
    };
    let mut shell = Shell::new(
        topics,
        facts,
        Recorder::new(settings, info, start),
        Sinks::new(robot, args.flights, start, lines),
        disk,
        Reporter::new(robot, args.json),
    );
    let supervisor = Notifier::from_env();
    process::run(&mut shell, &termination, &supervisor).or_fail(ExitCode::Internal)?;
    end(&shell)
}

/// Says what became of the recording.
fn end(shell: &Shell) -> Result<(), Failure> {
    let totals = shell.totals();
    shell.reporter().end(&totals, shell.counts());
    if !shell.is_ended() {
        return Err(Failure::internal(
            "the disk did not answer at the end: the last file is perhaps cut off",
        )
        .with_next_step(
            "`ril log check FILE` says what the file has, `ril log recover FILE` makes it whole",
        ));
    }
    let missing = totals.added - totals.written;
    let broken = shell.reporter().broken_files();
    if missing == 0 && broken == 0 {
        return Ok(());
    }
    let (messages, files) = (count(missing, "message"), count(broken, "file"));
    let text =
        format!("the disk did not take everything: {messages} dropped, {files} without an end");
    Err(Failure::new(ExitCode::NotInOrder, text).with_next_step(
        "make room, or take a faster disk; `ril log check FILE` says what a file has",
    ))
}
