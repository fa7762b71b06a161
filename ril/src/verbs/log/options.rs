//! The arguments of `ril log`.

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Subcommand};
use operator::options::{EXIT_CODES, duration};
use runtime::args::CommonArgs;

/// Most rows that `ril log tail` begins with: what a person can read back.
const MAX_TAIL_ROWS: u32 = 10_000;

/// `ril log`
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct LogArgs {
    /// What to do with the logs.
    #[command(subcommand)]
    pub command: LogCommand,
}

/// `ril log …`
#[derive(Clone, Debug, Subcommand)]
pub enum LogCommand {
    /// List the files: when each began, how long it is, of which robot
    List(LogListArgs),
    /// Sum up a flight: duration, distance, altitude, speed, battery, losses, gaps
    Summary(LogFileArgs),
    /// Write a flight as a page with plots, for a browser
    Report(LogReportArgs),
    /// Print the last rows of a log, and follow it with -f
    Tail(LogTailArgs),
    /// Print a log as CSV: a row for each sample, with the time in UTC
    Csv(LogCsvArgs),
    /// Say what of a flight record is complete, and what is missing
    Check(LogFileArgs),
    /// Write a whole file of a flight record that was cut off or damaged
    Recover(LogRecoverArgs),
    /// Write a part of a flight record, by topic and time, as a record of its own
    Export(LogExportArgs),
}

/// Where logs are.
#[derive(Args, Clone, Debug)]
pub struct LogPlaceArgs {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// Folder of the logs; may be repeated [default: those of status.toml, else `log`]
    #[arg(long, value_name = "DIR")]
    pub dir: Vec<PathBuf>,

    /// Configuration of status, which names the folders [default: status.toml, if it is there]
    #[arg(long, value_name = "FILE")]
    pub status: Option<PathBuf>,
}

/// `ril log list`
///
/// The oldest file comes first. With --robot the files of that robot, else those of all.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct LogListArgs {
    /// Where logs are.
    #[command(flatten)]
    pub place: LogPlaceArgs,

    /// Print each file as a JSON object on a line
    #[arg(long)]
    pub json: bool,
}

/// `ril log summary`, `ril log check`
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct LogFileArgs {
    /// File of a log [default: that of the robot's last flight]
    #[arg(value_name = "FILE")]
    pub file: Option<PathBuf>,

    /// Where logs are.
    #[command(flatten)]
    pub place: LogPlaceArgs,

    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
}

/// `ril log report`
///
/// The page is one file that needs no server and no network. A page that is there already is replaced.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct LogReportArgs {
    /// File of a log [default: that of the robot's last flight]
    #[arg(value_name = "FILE")]
    pub file: Option<PathBuf>,

    /// Where logs are.
    #[command(flatten)]
    pub place: LogPlaceArgs,

    /// Write the page to this file [default: named after the log, in the working directory]
    #[arg(long, value_name = "FILE.html")]
    pub output: Option<PathBuf>,

    /// Configuration of the bridge, of which the geofence is drawn [default: bridge.toml, if it is there]
    #[arg(long, value_name = "FILE")]
    pub bridge: Option<PathBuf>,

    /// Draw the path of this plan on the map; a file as for `ril plan`
    #[arg(long, value_name = "FILE")]
    pub plan: Option<PathBuf>,

    /// Print one JSON object that says what was written
    #[arg(long)]
    pub json: bool,
}

/// `ril log recover`
///
/// The damaged file stays as it is.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct LogRecoverArgs {
    /// The record
    #[arg(value_name = "FILE")]
    pub file: PathBuf,

    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// The new file, which must not be there yet [default: FILE with .recovered.mcap or .part.mcap for .mcap]
    #[arg(long, value_name = "FILE")]
    pub output: Option<PathBuf>,

    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
}

/// `ril log export`
///
/// The record stays as it is. Metadata and files within it are in the part too.
#[derive(Args, Clone, Debug)]
pub struct LogExportArgs {
    /// Where from, where to.
    #[command(flatten)]
    pub file: LogRecoverArgs,

    /// This topic only, such as hero/telemetry or /robot1/hero/telemetry; may be repeated
    #[arg(long = "topic", value_name = "NAME")]
    pub topics: Vec<String>,

    /// From this time on since the first message, such as 30s
    #[arg(long, value_name = "DURATION", value_parser = duration)]
    pub from: Option<Duration>,

    /// Up to this time since the first message
    #[arg(long, value_name = "DURATION", value_parser = duration)]
    pub to: Option<Duration>,
}

/// `ril log csv`
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct LogCsvArgs {
    /// File of a log [default: that of the robot's last flight]
    #[arg(value_name = "FILE")]
    pub file: Option<PathBuf>,

    /// Where logs are.
    #[command(flatten)]
    pub place: LogPlaceArgs,

    /// Print this column only; may be repeated
    #[arg(long = "field", value_name = "NAME")]
    pub fields: Vec<String>,
}

/// `ril log tail`
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct LogTailArgs {
    /// File of a log [default: the newest one of the robot]
    #[arg(value_name = "FILE")]
    pub file: Option<PathBuf>,

    /// Where logs are.
    #[command(flatten)]
    pub place: LogPlaceArgs,

    /// How many rows to begin with
    #[arg(short = 'n', long, value_name = "N", default_value = "10",
        value_parser = clap::value_parser!(u32).range(0..=i64::from(MAX_TAIL_ROWS)))]
    pub rows: u32,

    /// Go on with the rows that come, also in the files that follow
    #[arg(short, long)]
    pub follow: bool,

    /// Print this column; may be repeated [default: flying, altitude_m, battery_mv; with --json all]
    #[arg(long = "field", value_name = "NAME")]
    pub fields: Vec<String>,

    /// Print each row as a JSON object on a line
    #[arg(long)]
    pub json: bool,
}
