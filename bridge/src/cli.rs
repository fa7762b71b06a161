//! The command line of the bridge process.

use std::path::Path;

use clap::Args as ClapArgs;
use module_kit::SetUp;
use runtime::args::CommonArgs;
use runtime::config::resulting::{Resulting, given, value_of};
use runtime::exit::{ExitCode, Failure};

use crate::config::BridgeConfig;
use crate::shell::{self, PortError, ShellError};

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

/// What the bridge would run with.
///
/// # Errors
///
/// Exit code 78 when the configuration is wrong.
pub fn check_config(args: &Args) -> Result<Resulting, Failure> {
    let (file, default) = (
        args.common.settings.config.as_deref(),
        Path::new(DEFAULT_CONFIG_FILE),
    );
    let loaded = runtime::config::load::<BridgeConfig>(file, default)?;
    let fits = loaded.value.check_line();
    fits.map_err(|fault| loaded.refuse(&fault))?;
    let resulting = Resulting::load::<BridgeConfig>(file, default, include_str!("../bridge.toml"))?;
    let port = given("--port", "RIL_PORT").filter(|_| args.port.is_some());
    let port = port.map(|(text, origin)| (value_of(&text), origin));
    Ok(resulting.with("serial.port", port))
}

/// Runs the bridge in the foreground until SIGINT or SIGTERM.
///
/// # Errors
/// Exit code 78 when the configuration is wrong, 1 when shared memory cannot be used or another bridge of the robot
/// runs.
pub fn run(args: Args) -> Result<(), Failure> {
    if args.common.settings.check_config {
        return check_config(&args)?.print();
    }
    let check = |config: &mut BridgeConfig| {
        if let Some(port) = args.port {
            config.serial.port = port;
        }
        config.check_line()
    };
    let set_up = SetUp::begin_with(&args.common, DEFAULT_CONFIG_FILE, check)?;
    let Some(set_up) = set_up else {
        return Ok(());
    };
    let ipc = set_up.join("bridge")?;
    let explicit = args.common.settings.config.clone();
    let read_fence = move || {
        runtime::config::load::<BridgeConfig>(explicit.as_deref(), Path::new(DEFAULT_CONFIG_FILE))
            .map(|loaded| loaded.value.fence)
            .map_err(|error| error.to_string())
    };
    shell::run(
        &set_up.config,
        read_fence,
        &ipc,
        &set_up.termination,
        &set_up.supervisor,
    )
    .map_err(|error| match error {
        ShellError::Port(PortError::NotAPort(_)) => Failure::new(ExitCode::Configuration, error),
        _ => Failure::internal(error),
    })
}
