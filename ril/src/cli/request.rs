//! The arguments of commands that ask a module for something: start and stop, movements, parameters, the geofence.

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Subcommand};
use runtime::args::CommonArgs;

use super::exit_codes::EXIT_CODES;
use super::length::{GotoWord, Target, goto_word, take_off_height, targets};
use super::value::{PortKey, deadline_ms, duration, finite, module_name, port_key};

/// What every command takes that asks the bridge for something.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct AskArgs {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// How long to wait for the bridge's first answer, such as 5s or 200ms [default: 2s, or ril.toml]
    #[arg(long, value_name = "DURATION", env = "RIL_TIMEOUT", value_parser = duration)]
    pub timeout: Option<Duration>,

    /// Until how long after its issue the order may begin, such as 500ms; 0s leaves it to the bridge
    #[arg(long, value_name = "DURATION", env = "RIL_DEADLINE", value_parser = deadline_ms)]
    pub deadline: Option<u32>,

    /// Print each report as a JSON object on a line
    #[arg(long)]
    pub json: bool,
}

/// What every command takes whose request goes on for a while.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct RequestArgs {
    /// What every request takes.
    #[command(flatten)]
    pub ask: AskArgs,

    /// Return once the request was accepted, instead of following it to its end
    #[arg(long)]
    pub no_wait: bool,
}

/// `ril start`, `ril stop`
#[derive(Args, Clone, Debug)]
pub struct ControlArgs {
    /// Name of a module with a control service of its own, such as battery_watch [default: the bridge]
    #[arg(long, value_name = "NAME", value_parser = module_name)]
    pub module: Option<String>,

    /// What every request takes.
    #[command(flatten)]
    pub request: RequestArgs,
}

/// `ril takeoff`
#[derive(Args, Clone, Debug)]
pub struct TakeoffArgs {
    /// Height above take-off, such as 20m, 60ft, or 20 for metres
    #[arg(value_name = "ALTITUDE", required_unless_present = "altitude", conflicts_with = "altitude",
        allow_negative_numbers = true, value_parser = take_off_height)]
    pub to: Option<f64>,

    /// The same as an option
    #[arg(long, value_name = "ALTITUDE", allow_hyphen_values = true, value_parser = take_off_height)]
    pub altitude: Option<f64>,

    /// What every request takes.
    #[command(flatten)]
    pub request: RequestArgs,
}

impl TakeoffArgs {
    /// Height above take-off, m. clap makes sure that there is one.
    pub fn height_m(&self) -> f64 {
        self.to.or(self.altitude).unwrap_or_default()
    }
}

/// `ril land`
#[derive(Args, Clone, Debug)]
pub struct LandArgs {
    /// Replace a path that is under way instead of being refused as busy
    #[arg(long)]
    pub preempt: bool,

    /// What every request takes.
    #[command(flatten)]
    pub request: RequestArgs,
}

/// `ril goto`
#[derive(Args, Clone, Debug)]
pub struct GotoArgs {
    /// Waypoints, each LAT,LON,ALT without spaces, or one as LAT LON ALT: degrees, and a telemetry altitude (20m, 60ft, or 20 for
    /// metres) or a height above take-off (+20m), such as -37.5,-6.25,20m
    #[arg(required_unless_present = "file", value_name = "LAT,LON,ALT", allow_negative_numbers = true,
        value_parser = goto_word)]
    pub words: Vec<GotoWord>,

    /// Read the waypoints from a file, one LAT,LON,ALT a line; `#` begins a comment, - is standard input
    #[arg(long, value_name = "FILE", conflicts_with = "words")]
    pub file: Option<PathBuf>,

    /// Replace a path that is under way instead of being refused as busy
    #[arg(long)]
    pub preempt: bool,

    /// Hover instead of flying on when this command ends before the path: by Ctrl+C, by SIGTERM, with its terminal, or when
    /// the reader of its output ends. SIGKILL leaves no time for that
    #[arg(long, conflicts_with = "no_wait")]
    pub hold_on_exit: bool,

    /// What every request takes.
    #[command(flatten)]
    pub request: RequestArgs,
}

impl GotoArgs {
    /// The waypoints of the command line.
    ///
    /// # Errors
    ///
    /// Words that are no waypoints together, as a clause.
    pub fn targets(&self) -> Result<Vec<Target>, String> {
        targets(&self.words)
    }
}

/// `ril param`
#[derive(Args, Clone, Debug)]
pub struct ParamArgs {
    /// What to do with the parameters.
    #[command(subcommand)]
    pub command: ParamCommand,
}

/// `ril param …`
#[derive(Clone, Debug, Subcommand)]
pub enum ParamCommand {
    /// List all parameters with value, unit, range and whether a request may write them
    List(ParamListArgs),
    /// Read a parameter from the DSP
    Get(ParamGetArgs),
    /// Write a parameter, and print the value that the DSP then has and the one that it had
    Set(ParamSetArgs),
}

/// `ril param list`
///
/// The values are read from the DSP one after the other. When the DSP does not answer, the list has none, and the exit code says
/// why.
#[derive(Args, Clone, Debug)]
pub struct ParamListArgs {
    /// Do not read the values from the DSP
    #[arg(long)]
    pub no_values: bool,

    /// What every request takes.
    #[command(flatten)]
    pub ask: AskArgs,
}

/// `ril param get`
#[derive(Args, Clone, Debug)]
pub struct ParamGetArgs {
    /// Name of the parameter, as `ril param list` shows it, or number of its port
    #[arg(value_name = "NAME", value_parser = port_key)]
    pub port: PortKey,

    /// What every request takes.
    #[command(flatten)]
    pub ask: AskArgs,
}

/// `ril param set`
#[derive(Args, Clone, Debug)]
pub struct ParamSetArgs {
    /// Name of the parameter, as `ril param list` shows it, or number of its port
    #[arg(value_name = "NAME", value_parser = port_key)]
    pub port: PortKey,

    /// Value to write
    #[arg(value_name = "VALUE", allow_negative_numbers = true, value_parser = finite)]
    pub value: f64,

    /// What every request takes.
    #[command(flatten)]
    pub ask: AskArgs,
}

/// `ril fence`
#[derive(Args, Clone, Debug)]
pub struct FenceArgs {
    /// What to do with the geofence.
    #[command(subcommand)]
    pub command: FenceCommand,
}

/// `ril fence …`
#[derive(Clone, Debug, Subcommand)]
pub enum FenceCommand {
    /// Read the geofence in bridge.toml again; the bridge checks a path that is under way against it
    Reload(RequestArgs),
}
