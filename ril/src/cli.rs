//! The command line of `ril`: what can be asked for, and the reading of coordinates and times.
//!
//! Everything is checked here, once; the commands get typed values. [`waypoints`] reads a whole file of coordinates. Nothing
//! here talks to another process.

use std::ffi::OsString;
use std::path::PathBuf;
use std::time::Duration;

use clap::parser::ValueSource;
use clap::{ArgMatches, Args, CommandFactory, FromArgMatches, Parser, Subcommand, ValueEnum};
use ipc_types::ServiceId;
use ipc_types::payload::WaypointPosition;
use ipc_types::service::is_key;
use runtime::args::CommonArgs;

use crate::config::{MAX_DEADLINE_MS, MAX_TIMEOUT_S, MIN_TIMEOUT_S};
use crate::demo;

/// What each exit code means, for the end of the help.
pub const EXIT_CODES: &str = "\
Exit codes:
   0  done
   1  internal error
   2  usage error
   3  the process that should answer does not run
   4  no answer in time, or the DSP did not acknowledge
   5  refused, or ended early; the reason is printed
   6  the link to the DSP is down
   7  the outcome cannot be known
   8  something is not in order; the findings are printed
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

/// Whether the operator said which robot is meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RobotChoice {
    /// By `--robot` or `RIL_ROBOT`.
    Explicit,
    /// No: the robot is the built-in default.
    Default,
}

impl RobotChoice {
    /// How the robot of the innermost command came about.
    fn of(matches: &ArgMatches) -> RobotChoice {
        let mut innermost = matches;
        while let Some((_, inner)) = innermost.subcommand() {
            innermost = inner;
        }
        // A command without this option has no robot to choose.
        let is_known = innermost.try_contains_id("robot").unwrap_or(false);
        match is_known.then(|| innermost.value_source("robot")).flatten() {
            Some(ValueSource::DefaultValue) => RobotChoice::Default,
            _ => RobotChoice::Explicit,
        }
    }
}

impl Cli {
    /// Reads the command line, of which the first argument is the program's name.
    ///
    /// # Errors
    ///
    /// A usage error, or a text that was asked for, such as the help.
    pub fn read(
        args: impl IntoIterator<Item = OsString>,
    ) -> Result<(Cli, RobotChoice), clap::Error> {
        let mut command = Cli::command();
        let matches = command.try_get_matches_from_mut(protect_coordinates(args))?;
        let cli = Cli::from_arg_matches(&matches).map_err(|error| error.format(&mut command))?;
        Ok((cli, RobotChoice::of(&matches)))
    }
}

/// What to do.
#[derive(Clone, Debug, Subcommand)]
pub enum Command {
    /// Fly a whole simulated mission, with nothing else running, and check it
    Demo(demo::Args),
    /// Run the bridge between shared memory and the DSP's serial port, in the foreground
    Bridge(bridge::cli::Args),
    /// Run the process that turns raw telemetry into SI units and writes logs, in the foreground
    Status(status::cli::Args),
    /// Run the simulator of DSP and helicopter, in the foreground
    Sim(dsp_sim::cli::Args),
    /// Start the bridge's module, so that it takes movements; or another module
    Start(ControlArgs),
    /// Stop the bridge's module: the helicopter hovers, and everything that was planned is discarded; or another module
    Stop(ControlArgs),
    /// Take off and climb to an altitude over the point of take-off
    Takeoff(TakeoffArgs),
    /// Land on the spot
    Land(LandArgs),
    /// Hover on the spot and stay started; replaces a path that is under way
    Hold(RequestArgs),
    /// Fly a path of one or more waypoints
    Goto(GotoArgs),
    /// List, read or write the DSP's parameters (virtual ports)
    Param(ParamArgs),
    /// Manage the geofence
    Fence(FenceArgs),
    /// Show the state of the module, the link, the DSP, the safety rules and telemetry
    State(StateArgs),
    /// Print samples as they come
    Echo(EchoArgs),
    /// Measure how often samples come and how often they are published, and count the lost ones
    Hz(MeasureArgs),
    /// Measure how old samples are when they come
    Delay(MeasureArgs),
    /// Measure how many bytes the samples make
    Bw(MeasureArgs),
    /// List, describe, print and measure topics, those of modules included
    Topic(TopicArgs),
    /// Find what is wrong with shared memory, configuration and serial port, and what to do
    Doctor(DoctorArgs),
}

/// What every command takes that asks the bridge for something.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct AskArgs {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// How long to wait for the bridge's first answer, in seconds [default: 2, or ril.toml]
    #[arg(long, value_name = "S", env = "RIL_TIMEOUT_S", value_parser = seconds)]
    pub timeout: Option<Duration>,

    /// Within how many milliseconds the request must have reached the DSP; 0 leaves it to the bridge
    #[arg(long, value_name = "MS", env = "RIL_DEADLINE_MS",
        value_parser = clap::value_parser!(u32).range(0..=i64::from(MAX_DEADLINE_MS)))]
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
    /// Altitude over the point of take-off, in metres
    #[arg(long, value_name = "M", allow_hyphen_values = true, value_parser = altitude)]
    pub altitude: f64,

    /// What every request takes.
    #[command(flatten)]
    pub request: RequestArgs,
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
    /// Waypoints: latitude and longitude in degrees, altitude in metres with the zero of telemetry, such as
    /// -37.5,-6.25,20
    #[arg(required_unless_present = "file", value_name = "LAT,LON,ALT", value_parser = waypoint)]
    pub waypoints: Vec<WaypointPosition>,

    /// Read the waypoints from a file, one LAT,LON,ALT a line; `#` begins a comment, - is standard input
    #[arg(long, value_name = "FILE", conflicts_with = "waypoints")]
    pub file: Option<PathBuf>,

    /// Replace a path that is under way instead of being refused as busy
    #[arg(long)]
    pub preempt: bool,

    /// What every request takes.
    #[command(flatten)]
    pub request: RequestArgs,
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
    /// List all parameters with number, kind, range and whether a request may write them
    List(AskArgs),
    /// Read a parameter from the DSP
    Get(ParamGetArgs),
    /// Write a parameter, and print the value that the DSP then has
    Set(ParamSetArgs),
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
    #[arg(value_name = "VALUE", allow_negative_numbers = true, value_parser = value)]
    pub value: f64,

    /// What every request takes.
    #[command(flatten)]
    pub ask: AskArgs,
}

/// How a command names a port of the DSP.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PortKey {
    /// By the number of the port.
    Number(u16),
    /// By the name that the bridge gives it.
    Name(String),
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

/// `ril state`
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct StateArgs {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// How long to wait for a sample, in seconds [default: 2, or ril.toml]
    #[arg(long, value_name = "S", env = "RIL_TIMEOUT_S", value_parser = seconds)]
    pub timeout: Option<Duration>,

    /// Print one JSON object
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

    /// What every command takes that prints samples.
    #[command(flatten)]
    pub options: EchoOptions,
}

/// What every command takes that prints samples.
#[derive(Args, Clone, Debug)]
pub struct EchoOptions {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// End after so many samples
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub count: Option<u64>,

    /// End after so many seconds
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub duration: Option<Duration>,

    /// How long to wait for the first sample, and for a publisher that is gone, in seconds [default: 2, or ril.toml]
    #[arg(long, value_name = "S", env = "RIL_TIMEOUT_S", value_parser = seconds)]
    pub timeout: Option<Duration>,

    /// Print only this field, or group of fields, such as geographic.latitude_deg or geographic; can be repeated
    #[arg(long = "field", value_name = "NAME")]
    pub fields: Vec<String>,

    /// Print each sample as a JSON object on a line
    #[arg(long)]
    pub json: bool,
}

/// `ril topic`
#[derive(Args, Clone, Debug)]
pub struct TopicArgs {
    /// What to do with the topics.
    #[command(subcommand)]
    pub command: TopicCommand,
}

/// `ril topic …`
#[derive(Clone, Debug, Subcommand)]
pub enum TopicCommand {
    /// List the topics that somebody has open, with their types and sizes
    List(TopicListArgs),
    /// Describe a topic: its type, and each field with offset, type, unit and comment
    Info(TopicInfoArgs),
    /// Print samples of a topic as they come
    Echo(TopicEchoArgs),
    /// Measure how often samples of a topic come and how often they are published, and count the lost ones
    Hz(TopicMeasureArgs),
    /// Measure how old samples of a topic are when they come
    Delay(TopicMeasureArgs),
    /// Measure how many bytes the samples of a topic make
    Bw(TopicMeasureArgs),
}

/// `ril topic list`
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct TopicListArgs {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// Print each topic as a JSON object on a line
    #[arg(long)]
    pub json: bool,
}

/// `ril topic info`
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct TopicInfoArgs {
    /// Topic, as `ril topic list` shows it, such as battery_watch/cell_voltages; or dsp, hero, state
    #[arg(value_name = "TOPIC", value_parser = topic_key)]
    pub topic: String,

    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
}

/// `ril topic echo`
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct TopicEchoArgs {
    /// Topic, as `ril topic list` shows it, such as battery_watch/cell_voltages; or dsp, hero, state
    #[arg(value_name = "TOPIC", value_parser = topic_key)]
    pub topic: String,

    /// What every command takes that prints samples.
    #[command(flatten)]
    pub options: EchoOptions,
}

/// `ril topic hz`, `ril topic delay`, `ril topic bw`
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct TopicMeasureArgs {
    /// Topic, as `ril topic list` shows it, such as battery_watch/cell_voltages; or dsp, hero, state
    #[arg(value_name = "TOPIC", value_parser = topic_key)]
    pub topic: String,

    /// What every command takes that measures samples.
    #[command(flatten)]
    pub options: MeasureOptions,
}

/// `ril doctor`
///
/// Without --repair nothing is joined or changed, and the serial port is not opened in any case.
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

    /// Remove what dead processes left, then examine
    #[arg(long)]
    pub repair: bool,

    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
}

/// `ril hz`, `ril delay`, `ril bw`
///
/// On a terminal the figures are shown anew each second; elsewhere once, at the end.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct MeasureArgs {
    /// Which samples
    #[arg(value_enum)]
    pub topic: Topic,

    /// What every command takes that measures samples.
    #[command(flatten)]
    pub options: MeasureOptions,
}

/// What every command takes that measures samples.
#[derive(Args, Clone, Debug)]
#[group(id = "end", multiple = true, args = ["count", "duration"])]
pub struct MeasureOptions {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// End after so many samples, of which a rate needs two
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(2..))]
    pub count: Option<u64>,

    /// End after so many seconds
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub duration: Option<Duration>,

    /// How long to wait for the first sample, and for a publisher that is gone, in seconds [default: 2, or ril.toml]
    #[arg(long, value_name = "S", env = "RIL_TIMEOUT_S", value_parser = seconds)]
    pub timeout: Option<Duration>,

    /// Print one JSON object at the end; needs --count, --duration or both
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

impl Topic {
    /// Key of the service.
    pub fn key(self) -> &'static str {
        let service = match self {
            Topic::Dsp => ServiceId::DspTelemetry,
            Topic::Hero => ServiceId::HeroTelemetry,
            Topic::State => ServiceId::ModuleState,
        };
        service.key()
    }
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

/// Reads the waypoints of a file: one `LAT,LON,ALT` a line, `#` begins a comment.
///
/// # Errors
///
/// The first line that is wrong, with its number and the reason; also when there is no waypoint at all.
pub fn waypoints(text: &str) -> Result<Vec<WaypointPosition>, String> {
    let mut waypoints = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default().trim();
        if !line.is_empty() {
            let read = waypoint(line).map_err(|reason| format!("line {}: {reason}", index + 1));
            waypoints.push(read?);
        }
    }
    match waypoints.is_empty() {
        true => Err("there is no waypoint".to_owned()),
        false => Ok(waypoints),
    }
}

/// Reads the name of a module.
fn module_name(text: &str) -> Result<String, String> {
    match is_key(text) && !text.contains('/') {
        true => Ok(text.to_owned()),
        false => Err("a module's name is one word in lower snake case".to_owned()),
    }
}

/// Reads the key of a topic; the short names of the robot's own stand for theirs.
fn topic_key(text: &str) -> Result<String, String> {
    let short = Topic::value_variants().iter().find(|topic| {
        let value = topic.to_possible_value();
        value.is_some_and(|value| value.get_name() == text)
    });
    match short {
        Some(topic) => Ok(topic.key().to_owned()),
        None if is_key(text) => Ok(text.to_owned()),
        None => Err("a topic is called such as battery_watch/cell_voltages".to_owned()),
    }
}

/// Reads the name or the number of a port.
fn port_key(text: &str) -> Result<PortKey, String> {
    match text.bytes().all(|byte| byte.is_ascii_digit()) {
        true => text
            .parse()
            .map(PortKey::Number)
            .map_err(|_| "the number of a port is from 0 to 65535".to_owned()),
        false => Ok(PortKey::Name(text.to_owned())),
    }
}

/// Reads the value of a parameter. Its range is the port's, which the bridge knows.
fn value(text: &str) -> Result<f64, String> {
    number("value", text, f64::MAX)
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
        read(arguments).map(|(cli, _)| cli.command)
    }

    fn read(arguments: &[&str]) -> Result<(Cli, RobotChoice), clap::Error> {
        Cli::read(std::iter::once(&"ril").chain(arguments).map(OsString::from))
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
        assert_eq!(goto.request.ask.common.robot.get(), 7);
        assert_eq!(goto.request.ask.deadline, Some(50));
    }

    #[test]
    fn only_waypoints_are_protected() {
        for text in ["-v", "--robot", "-1", "37,-6,2", "-x,1,2", "", "-"] {
            let protected = protect_coordinates([OsString::from(text)]);
            assert_eq!(protected, [text], "{text}");
        }
    }

    #[test]
    fn a_robot_is_chosen_by_the_option_of_the_innermost_command() {
        for (arguments, expected) in [
            (&["start"][..], RobotChoice::Default),
            (&["start", "--robot", "1"], RobotChoice::Explicit),
            (&["param", "list"], RobotChoice::Default),
            (&["param", "list", "--robot=2"], RobotChoice::Explicit),
            (&["fence", "reload"], RobotChoice::Default),
        ] {
            // The environment of whoever runs the tests may name a robot as well.
            let expected = match std::env::var_os("RIL_ROBOT") {
                Some(_) => RobotChoice::Explicit,
                None => expected,
            };
            assert_eq!(read(arguments).unwrap().1, expected, "{arguments:?}");
        }
    }

    #[test]
    fn parameters_are_named_or_numbered_and_take_negative_values() {
        let set = |arguments: &[&str]| match parse(arguments) {
            Ok(Command::Param(ParamArgs {
                command: ParamCommand::Set(args),
            })) => (args.port, args.value),
            other => panic!("{other:?}"),
        };
        assert_eq!(
            set(&["param", "set", "trim_tail_us", "-40"]),
            (PortKey::Name("trim_tail_us".to_owned()), -40.0)
        );
        assert_eq!(
            set(&["param", "set", "20000", "5.5"]),
            (PortKey::Number(20_000), 5.5)
        );
    }

    #[test]
    fn a_file_has_a_waypoint_a_line_and_comments() {
        let text = "# a square\n37,-6,20\n\n  -37.5 , .5,1e1 # the corner\n";
        let read = waypoints(text).unwrap();
        let altitudes: Vec<f64> = read.iter().map(|waypoint| waypoint.altitude_m).collect();
        assert_eq!(altitudes, [20.0, 10.0]);
        for (text, expected) in [
            (
                "37,-6,20\n\n91,0,0\n",
                "line 3: the latitude 91 is out of range",
            ),
            ("37,-6\n", "line 1: 2 numbers, three are needed"),
            ("# nothing\n", "there is no waypoint"),
            ("", "there is no waypoint"),
        ] {
            let error = waypoints(text).unwrap_err();
            assert!(error.contains(expected), "{text:?}: {error}");
        }
    }

    #[test]
    fn what_makes_no_sense_is_a_usage_error_that_says_why() {
        let cases: [(&[&str], &str); 31] = [
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
            (
                &["goto", "37,6,20", "--file", "path"],
                "cannot be used with",
            ),
            (&["takeoff"], "--altitude"),
            (&["takeoff", "--altitude", "5", "--preempt"], "--preempt"),
            (&["param"], "Usage: ril param"),
            (&["param", "set", "yaw_gain"], "<VALUE>"),
            (
                &["param", "set", "yaw_gain", "nan"],
                "the value `nan` is not finite",
            ),
            (&["param", "get", "70000"], "from 0 to 65535"),
            (&["fence", "relaod"], "reload"),
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
