//! The command line, for the binary `status` and for the command `ril status`.

use std::path::Path;

use ipc_types::{Domain, RobotId};
use runtime::args::CommonArgs;
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::notify::Notifier;
use runtime::signal::Termination;
use runtime::{config, logging};

use crate::config::{Config, DEFAULT_FILE};
use crate::core::Summary;
use crate::shell::Shell;

/// Translates the DSP's raw telemetry into SI units, publishes it, and writes logs.
#[derive(Clone, Debug, clap::Parser)]
#[command(name = "status", version)]
pub struct Args {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,
}

/// Runs the process until SIGINT or SIGTERM.
///
/// # Errors
/// The configuration is wrong (exit code 78), or the process cannot start (1); the failure says what to do.
pub fn run(args: Args) -> Result<(), Failure> {
    let common = args.common;
    logging::init(common.verbosity())?;
    let loaded = config::load::<Config>(common.config.as_deref(), Path::new(DEFAULT_FILE))?;
    let file = match &loaded.file {
        Some(file) => file.display().to_string(),
        None => "built-in defaults".to_owned(),
    };
    tracing::debug!(%file, config = ?loaded.value, "configuration");
    if common.check_config {
        tracing::info!(%file, "the configuration is right");
        return Ok(());
    }
    // Before anything that must be left in order.
    let termination = Termination::install().or_fail(ExitCode::Internal)?;
    let domain = Domain::from_environment().or_fail(ExitCode::Configuration)?;
    let robot = RobotId::new(common.robot.get())
        .ok_or_else(|| Failure::usage("a robot id is greater than 0"))?;
    let shell = Shell::open(&domain, robot, &loaded.value, Notifier::from_env())?;
    let summary = shell.run(&termination)?;
    tell(&summary);
    Ok(())
}

/// Says in one line what the process did, and in one more for each log what it holds.
fn tell(summary: &Summary) {
    let logs: Vec<_> = summary
        .logs
        .iter()
        .map(|log| {
            let end = if log.failed { ", ended early" } else { "" };
            format!("{}: {} rows{end}", log.file.display(), log.rows)
        })
        .collect();
    tracing::info!(
        received = summary.received,
        lost = summary.lost,
        published = summary.published,
        logs = ?logs,
        "ended"
    );
}
