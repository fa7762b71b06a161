//! The command line of the bridge process.

use std::path::Path;

use clap::Args as ClapArgs;
use ipc_types::{Domain, Ipc, RobotId};
use runtime::args::CommonArgs;
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::notify::Notifier;
use runtime::signal::Termination;

use crate::config::BridgeConfig;
use crate::shell::{self, ShellError};

/// The configuration file that is read when none is named; it may be absent.
pub const DEFAULT_CONFIG_FILE: &str = "bridge.toml";

/// Options of the bridge.
#[derive(ClapArgs, Clone, Debug)]
pub struct Args {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// Serial port, instead of `serial.port` of the configuration
    #[arg(long, value_name = "PATH", env = "RIL_PORT")]
    pub port: Option<std::path::PathBuf>,
}

/// Runs the bridge in the foreground until SIGINT or SIGTERM.
///
/// # Errors
/// Exit code 78 when the configuration is wrong, 1 when shared memory cannot be used or another bridge of the robot runs.
pub fn run(args: Args) -> Result<(), Failure> {
    runtime::logging::init(args.common.verbosity())?;
    let loaded = runtime::config::load::<BridgeConfig>(
        args.common.config.as_deref(),
        Path::new(DEFAULT_CONFIG_FILE),
    )?;
    let mut config = loaded.value;
    if let Some(port) = args.port {
        config.serial.port = port;
    }
    if args.common.check_config {
        return Ok(());
    }
    tracing::debug!(file = ?loaded.file, ?config, "configuration");
    let robot = RobotId::from(args.common.robot);
    let termination = Termination::install().map_err(Failure::internal)?;
    let domain = Domain::from_environment().or_fail(ExitCode::Configuration)?;
    let ipc = Ipc::join(&domain, robot, "bridge").map_err(Failure::internal)?;
    let explicit = args.common.config.as_deref();
    let read_fence = || {
        runtime::config::load::<BridgeConfig>(explicit, Path::new(DEFAULT_CONFIG_FILE))
            .map(|loaded| loaded.value.fence)
            .map_err(|error| error.to_string())
    };
    shell::run(
        &config,
        &read_fence,
        &ipc,
        &termination,
        &Notifier::from_env(),
    )
    .map_err(|error| match error {
        ShellError::NotAPort(_) => Failure::new(ExitCode::Configuration, error),
        ShellError::Services(_) | ShellError::Wait(_) => Failure::internal(error),
    })
}
