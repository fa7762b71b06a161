//! The command line of `ril`: what can be asked for, and the reading of coordinates and times.
//!
//! Everything is checked here, once; the commands get typed values. Nothing here talks to another process.

use std::ffi::OsString;
use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Parser, Subcommand, ValueEnum};
use ipc_types::payload::WaypointPosition;
use runtime::args::CommonArgs;

use crate::config::{MAX_DEADLINE_MS, MAX_TIMEOUT_S, MIN_TIMEOUT_S};
use crate::demo;

/// What each exit code means, for the end of the help.
pub const EXIT_CODES: &str = "\
Exit codes:
   0  done
   1  internal trouble
   2  the command line makes no sense
   3  the process that should answer is not there
   4  no answer in time, or the DSP did not acknowledge
   5  refused, or ended early; the reason is told
   6  the line to the DSP is down
   7  the outcome cannot be known
   8  something is not in order; the findings were told
  78  the configuration is wrong";

/// The operator's tool of the HERO helicopter's Robot Implementation Layer.
///
/// Data goes to standard output, everything else to standard error. With --json, data is one JSON object a line.
#[derive(Clone, Debug, Parser)]
#[command(name = "ril", version, after_help = EXIT_CODES)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Clone, Debug, Subcommand)]
pub enum Command {
    /// Flies a whole simulated mission, with nothing else running, and checks it
    Demo(demo::Args),
    /// Runs the bridge between shared memory and the DSP's serial port, in the foreground
    Bridge(bridge::cli::Args),
    /// Runs the process that turns raw telemetry into SI units and writes logs, in the foreground
    Status(status::cli::Args),
    /// Runs the simulator of DSP and helicopter behind a pseudo-terminal, in the foreground
    Sim(dsp_sim::cli::Args),
    /// Starts the module, so that it takes movements
    Start(RequestArgs),
    /// Stops the module: the helicopter hovers, and everything that was planned is discarded
    Stop(RequestArgs),
    /// Takes off and climbs to an altitude over the point of take-off
    Takeoff(TakeoffArgs),
    /// Lands on the spot
    Land(RequestArgs),
    /// Flies a path of one or more waypoints
    Goto(GotoArgs),
    /// Shows how the module, the line, the DSP and telemetry are
    State(StateArgs),
    /// Prints samples as they come
    Echo(EchoArgs),
    /// Measures how often samples come and how often they are published, and counts the lost ones
    Hz(MeasureArgs),
    /// Measures how old samples are when they come
    Delay(MeasureArgs),
    /// Measures how many bytes the samples make
    Bw(MeasureArgs),
    /// Says what is wrong with shared memory, configuration and serial port, and what to do
    Doctor(DoctorArgs),
}

/// What every request takes.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct RequestArgs {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// Returns once the request was accepted, instead of following it to its end
    #[arg(long)]
    pub no_wait: bool,

    /// How long the bridge has for its first answer, in seconds [default: 2, or ril.toml]
    #[arg(long, value_name = "S", env = "RIL_TIMEOUT_S", value_parser = seconds)]
    pub timeout: Option<Duration>,

    /// Within how many milliseconds the request must have reached the DSP; 0 leaves it to the bridge
    #[arg(long, value_name = "MS", env = "RIL_DEADLINE_MS",
        value_parser = clap::value_parser!(u32).range(0..=i64::from(MAX_DEADLINE_MS)))]
    pub deadline: Option<u32>,

    /// Prints each report as a JSON object on a line
    #[arg(long)]
    pub json: bool,
}

/// `ril takeoff`
#[derive(Args, Clone, Debug)]
pub struct TakeoffArgs {
    /// Altitude over the point of take-off, in metres
    #[arg(long, value_name = "M", allow_hyphen_values = true, value_parser = altitude)]
    pub altitude: f64,

    /// What every request takes.
    #[command(flatten)]
    pub request: RequestArgs,
}

/// `ril goto`
#[derive(Args, Clone, Debug)]
pub struct GotoArgs {
    /// Waypoints: latitude and longitude in degrees, altitude in metres with the zero of telemetry, such as
    /// -37.5,-6.25,20
    #[arg(required = true, value_name = "LAT,LON,ALT", value_parser = waypoint)]
    pub waypoints: Vec<WaypointPosition>,

    /// What every request takes.
    #[command(flatten)]
    pub request: RequestArgs,
}

/// What commands that watch take.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct StateArgs {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// How long to wait for a sample, in seconds [default: 2, or ril.toml]
    #[arg(long, value_name = "S", env = "RIL_TIMEOUT_S", value_parser = seconds)]
    pub timeout: Option<Duration>,

    /// Prints one JSON object
    #[arg(long)]
    pub json: bool,
}

/// `ril echo`
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct EchoArgs {
    /// Which samples
    #[arg(value_enum)]
    pub topic: Topic,

    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// Ends after so many samples
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub count: Option<u64>,

    /// Ends after so many seconds
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub duration: Option<Duration>,

    /// How long to wait for the first sample, and for a publisher that is gone, in seconds [default: 2, or ril.toml]
    #[arg(long, value_name = "S", env = "RIL_TIMEOUT_S", value_parser = seconds)]
    pub timeout: Option<Duration>,

    /// Prints only this field, or group of fields, such as geographic.latitude_deg or geographic; can be repeated
    #[arg(long = "field", value_name = "NAME")]
    pub fields: Vec<String>,

    /// Prints each sample as a JSON object on a line
    #[arg(long)]
    pub json: bool,
}

/// `ril doctor`
///
/// Without --repair nothing is joined, opened or changed.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct DoctorArgs {
    /// What every process takes; the configuration is that of the operator's commands.
    #[command(flatten)]
    pub common: CommonArgs,

    /// Configuration of the bridge [default: bridge.toml, if it is there]
    #[arg(long, value_name = "FILE")]
    pub bridge: Option<PathBuf>,

    /// Configuration of status [default: status.toml, if it is there]
    #[arg(long, value_name = "FILE")]
    pub status: Option<PathBuf>,

    /// Configuration of the simulator [default: dsp-sim.toml, if it is there]
    #[arg(long, value_name = "FILE")]
    pub sim: Option<PathBuf>,

    /// Serial port, instead of `serial.port` of the bridge's configuration
    #[arg(long, value_name = "PATH", env = "RIL_PORT")]
    pub port: Option<PathBuf>,

    /// Mends what is provably dead, and looks then
    #[arg(long)]
    pub repair: bool,

    /// Prints one JSON object
    #[arg(long)]
    pub json: bool,
}

/// `ril hz`, `ril delay`, `ril bw`
///
/// On a terminal the figures are shown anew each second; elsewhere once, at the end.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
#[group(id = "end", multiple = true, args = ["count", "duration"])]
pub struct MeasureArgs {
    /// Which samples
    #[arg(value_enum)]
    pub topic: Topic,

    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// Ends after so many samples, of which a rate needs two
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(2..))]
    pub count: Option<u64>,

    /// Ends after so many seconds
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub duration: Option<Duration>,

    /// How long to wait for the first sample, and for a publisher that is gone, in seconds [default: 2, or ril.toml]
    #[arg(long, value_name = "S", env = "RIL_TIMEOUT_S", value_parser = seconds)]
    pub timeout: Option<Duration>,

    /// Prints one JSON object at the end; needs --count, --duration or both
    #[arg(long, requires = "end")]
    pub json: bool,
}

/// What can be watched.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Topic {
    /// Telemetry as the DSP sends it
    Dsp,
    /// Telemetry in SI units
    Hero,
    /// State of the module
    State,
}

/// The command line as clap can read it: a waypoint that begins with a minus sign would be taken for an option.
///
/// Such an argument gets a space in front, which the reader of waypoints drops. No option of ours begins with a digit, so
/// nothing else is ever touched.
pub fn protect_coordinates(args: impl IntoIterator<Item = OsString>) -> Vec<OsString> {
    let protect = |arg: OsString| match arg.to_str() {
        Some(text) if is_negative_coordinate(text) => OsString::from(format!(" {text}")),
        _ => arg,
    };
    args.into_iter().map(protect).collect()
}

/// A minus sign, a number, and a comma somewhere.
fn is_negative_coordinate(text: &str) -> bool {
    text.strip_prefix('-')
        .is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit() || c == '.'))
        && text.contains(',')
}

/// Reads `LAT,LON,ALT`.
fn waypoint(text: &str) -> Result<WaypointPosition, String> {
    const EXPECTED: &str = "a waypoint is LAT,LON,ALT, such as 37.41,-6.01,20";
    let parts: Vec<&str> = text.split(',').map(str::trim).collect();
    let [latitude, longitude, altitude] = parts[..] else {
        return Err(format!(
            "{} numbers, three are needed: {EXPECTED}",
            parts.len()
        ));
    };
    Ok(WaypointPosition {
        latitude_deg: number("latitude", latitude, 90.0)?,
        longitude_deg: number("longitude", longitude, 180.0)?,
        altitude_m: number("altitude", altitude, f64::MAX)?,
    })
}

/// Reads a finite number of at most `limit`, either way.
fn number(what: &str, text: &str, limit: f64) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if !number.is_finite() => Err(format!("the {what} `{text}` is not finite")),
        Ok(number) if number.abs() > limit => Err(format!(
            "the {what} {text} is out of range: it must be from -{limit} to {limit}"
        )),
        Ok(number) => Ok(number),
        Err(_) => Err(format!("the {what} `{text}` is not a number")),
    }
}

/// Reads the altitude of a take-off. Its upper limit is the DSP's, which the bridge knows.
fn altitude(text: &str) -> Result<f64, String> {
    match number("altitude", text, f64::MAX)? {
        altitude if altitude > 0.0 => Ok(altitude),
        _ => Err("the altitude of a take-off is greater than 0".to_owned()),
    }
}

/// Reads a time in seconds.
fn seconds(text: &str) -> Result<Duration, String> {
    match text.parse::<f64>() {
        Ok(seconds) if (MIN_TIMEOUT_S..=MAX_TIMEOUT_S).contains(&seconds) => {
            Ok(Duration::from_secs_f64(seconds))
        }
        _ => Err(format!(
            "a time is a number of seconds from {MIN_TIMEOUT_S} to {MAX_TIMEOUT_S}"
        )),
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;
    use runtime::exit::ExitCode;

    use super::*;

    fn parse(arguments: &[&str]) -> Result<Command, clap::Error> {
        let arguments = std::iter::once(&"ril").chain(arguments).map(OsString::from);
        Cli::try_parse_from(protect_coordinates(arguments)).map(|cli| cli.command)
    }

    #[test]
    fn the_command_line_is_sound() {
        Cli::command().debug_assert();
    }

    #[test]
    fn the_help_documents_every_exit_code() {
        let help = Cli::command().render_help().to_string();
        for code in ExitCode::ALL {
            let line = format!("\n{:>4}  ", code.code());
            assert!(help.contains(&line), "{code:?} is missing in\n{help}");
        }
    }

    #[test]
    fn negative_coordinates_and_options_after_them_are_both_understood() {
        let command = parse(&[
            "goto",
            "-37.1,-6.0,20",
            "37,-.5,-3",
            "-.5,0,1e1",
            "--no-wait",
            "--robot",
            "7",
            "--deadline",
            "50",
        ]);
        let Ok(Command::Goto(goto)) = command else {
            panic!("{command:?}");
        };
        let position = |latitude_deg, longitude_deg, altitude_m| WaypointPosition {
            latitude_deg,
            longitude_deg,
            altitude_m,
        };
        let expected = [
            position(-37.1, -6.0, 20.0),
            position(37.0, -0.5, -3.0),
            position(-0.5, 0.0, 10.0),
        ];
        assert_eq!(goto.waypoints, expected);
        assert!(goto.request.no_wait);
        assert_eq!(goto.request.common.robot.get(), 7);
        assert_eq!(goto.request.deadline, Some(50));
    }

    #[test]
    fn only_waypoints_are_protected() {
        for text in ["-v", "--robot", "-1", "37,-6,2", "-x,1,2", "", "-"] {
            let protected = protect_coordinates([OsString::from(text)]);
            assert_eq!(protected, [text], "{text}");
        }
    }

    #[test]
    fn what_makes_no_sense_is_a_usage_error_that_says_why() {
        let cases: [(&[&str], &str); 24] = [
            (&["goto"], "LAT,LON,ALT"),
            (&["goto", "37,-6"], "2 numbers, three are needed"),
            (&["goto", "37,-6,20,1"], "4 numbers"),
            (&["goto", "37,", "-6,", "20"], "2 numbers"),
            (
                &["goto", "north,-6,20"],
                "the latitude `north` is not a number",
            ),
            (
                &["goto", "-90.1,-6,20"],
                "the latitude -90.1 is out of range: it must be from -90 to 90",
            ),
            (
                &["goto", "37,180.1,20"],
                "the longitude 180.1 is out of range",
            ),
            (&["goto", "37,6,nan"], "the altitude `nan` is not finite"),
            (
                &["goto", "37,-inf,20"],
                "the longitude `-inf` is not finite",
            ),
            (&["goto", "-nan,6,20"], "unexpected argument"),
            (&["goto", "37,6,20", "-37,6"], "2 numbers"),
            (&["takeoff"], "--altitude"),
            (&["takeoff", "--altitude", "-5"], "greater than 0"),
            (
                &["takeoff", "--altitude", "high"],
                "the altitude `high` is not a number",
            ),
            (&["start", "--timeout", "0"], "seconds from 0.01"),
            (&["start", "--deadline=-1"], "-1 is not in 0..=86400000"),
            (&["echo", "gps"], "[possible values: dsp, hero, state]"),
            (&["echo", "dsp", "--count", "0"], "count"),
            (&["hz"], "<TOPIC>"),
            (&["delay", "gps"], "[possible values: dsp, hero, state]"),
            (&["hz", "hero", "--count", "1"], "1 is not in 2.."),
            (&["bw", "hero", "--duration", "0"], "seconds from 0.01"),
            (
                &["bw", "hero", "--json"],
                "not provided:\n  <--count <N>|--duration <S>>",
            ),
            (
                &["strat"],
                "some similar subcommands exist: 'status', 'state', 'start'",
            ),
        ];
        for (arguments, expected) in cases {
            let error = parse(arguments).unwrap_err();
            assert_eq!(error.exit_code(), 2, "{arguments:?}: {error}");
            assert!(
                error.to_string().contains(expected),
                "{arguments:?}: {error}"
            );
        }
    }
}
