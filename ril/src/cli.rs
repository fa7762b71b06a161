//! The command line of `ril`: the list of verbs, and the options that may stand before a verb as well as behind it.
//!
//! Everything is checked here, once; the verbs get typed values. The options of a verb are in the verb's own folder,
//! those that several take in [`options`](operator::options). Every verb has its own of the global ones, so that its
//! help says what they do there and a verb refuses what it has no use for; those that stand before the verb are written
//! behind it before the command line is read. Nothing here talks to another process.

#[cfg(test)]
mod tests;

use std::ffi::{OsStr, OsString};
use std::path::PathBuf;
use std::time::Duration;

use clap::error::ErrorKind;
use clap::{ArgAction, Args, CommandFactory, FromArgMatches, Parser, Subcommand, ValueEnum};
use conform::cli::ConformArgs;
use mavlink_gateway::cli::MavlinkArgs;
use operator::options::{EXIT_CODES, SampleArgs, duration};
use recorder::cli::RecordArgs;
use runtime::environment::without_empty_variables;
use runtime::manual::ManualArgs;
use view::cli::{RunViewArgs, ViewArgs};

use crate::verbs::check::{DoctorArgs, PreflightArgs};
use crate::verbs::demo;
use crate::verbs::log::options::LogArgs;
use crate::verbs::new::NewArgs;
use crate::verbs::order::{
    ControlArgs, FenceArgs, GotoArgs, HoldArgs, HolderArgs, LandArgs, RtlArgs, TakeoffArgs,
};
use crate::verbs::param::ParamArgs;
use crate::verbs::plan::options::PlanArgs;
use crate::verbs::relay::RelayArgs;
use crate::verbs::replay::options::ReplayArgs;
use crate::verbs::robots::RobotsArgs;
use crate::verbs::status::StatusArgs;
use crate::verbs::topic::TopicArgs;
use crate::verbs::topic::echo::EchoArgs;
use crate::verbs::topic::measure::MeasureArgs;
use crate::verbs::wait::WaitArgs;
use crate::verbs::watch::WatchArgs;

/// The operator's tool of the HERO helicopter's Robot Implementation Layer.
///
/// Data goes to standard output, everything else to standard error. With --json, data is one JSON object a line, and so
/// is a failure.
#[derive(Clone, Debug, Parser)]
#[command(name = "ril", version, after_help = EXIT_CODES)]
pub struct Cli {
    /// What may stand before the verb too.
    #[command(flatten)]
    pub global: GlobalArgs,

    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

impl Cli {
    /// Reads the command line, of which the first argument is the program's name.
    ///
    /// # Errors
    ///
    /// A usage error, or a text that was asked for, such as the help.
    pub fn read(args: impl IntoIterator<Item = OsString>) -> Result<Cli, clap::Error> {
        let mut command = without_empty_variables(Cli::command());
        let args = behind_the_verb(protect_coordinates(args), &command);
        let matches = command.try_get_matches_from_mut(args)?;
        let cli = Cli::from_arg_matches(&matches).map_err(|error| error.format(&mut command))?;
        if let Command::Goto(goto) = &cli.command {
            goto.targets().map_err(|text| {
                // With the usage of `ril goto`, not that of `ril`.
                if let Some(goto) = command.find_subcommand_mut("goto") {
                    return goto.error(ErrorKind::ValueValidation, text);
                }
                command.error(ErrorKind::ValueValidation, text)
            })?;
        }
        Ok(cli)
    }
}

/// Options that may stand before the verb too. Here they are for the help and for completion; the verb reads them.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Options of the verbs, before the verb or after it")]
pub struct GlobalArgs {
    /// Which robot: an integer greater than 0 [env: RIL_ROBOT] [default: 1]
    #[arg(long, value_name = "N")]
    robot: Option<String>,

    /// Print JSON, one object a line; a failure is the object ril.Error.v1
    #[arg(long)]
    json: bool,

    /// How long to wait for an answer or a sample, such as 5s or 200ms [env: RIL_TIMEOUT]
    #[arg(long, value_name = "DURATION", value_parser = duration)]
    timeout: Option<Duration>,

    /// Configuration file; it must exist when it is named here [env: RIL_CONFIG]
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,

    /// Log more: -v debug, -vv trace
    #[arg(short, long, action = ArgAction::Count)]
    verbose: u8,

    /// Log less: -q warnings, -qq errors, -qqq nothing
    #[arg(short, long, action = ArgAction::Count)]
    quiet: u8,
}

/// The command line with the options that stand before the verb written behind it: before a `--`, or else at the end.
///
/// `command` says which options those are. What it does not know stays where it is, and so does everything when there
/// is no verb.
fn behind_the_verb(args: Vec<OsString>, command: &clap::Command) -> Vec<OsString> {
    let mut rest = args.iter().skip(1).peekable();
    let mut moved = Vec::new();
    while let Some(option) = rest.next_if(|arg| takes_value(arg, command).is_some()) {
        moved.push(option.clone());
        if takes_value(option, command) == Some(true) {
            moved.extend(rest.next().cloned());
        }
    }
    if moved.is_empty() || rest.peek().is_none() {
        return args;
    }
    let rest: Vec<OsString> = rest.cloned().collect();
    let end = rest
        .iter()
        .position(|arg| arg == "--")
        .unwrap_or(rest.len());
    let (verb, behind) = rest.split_at(end);
    [&args[..1], verb, &moved, behind].concat()
}

/// Whether an argument is an option of `command` of which the next argument is the value; `None` if it is none.
fn takes_value(arg: &OsStr, command: &clap::Command) -> Option<bool> {
    let text = arg.to_str()?;
    let options = || {
        command
            .get_arguments()
            .filter(|option| !option.is_positional())
    };
    if let Some(long) = text.strip_prefix("--") {
        let name = long.split('=').next()?;
        let option = options().find(|option| option.get_long() == Some(name))?;
        return Some(option.get_action().takes_values() && !long.contains('='));
    }
    let shorts = text.strip_prefix('-').filter(|shorts| !shorts.is_empty())?;
    let is_known = |short| options().any(|option| option.get_short() == Some(short));
    shorts.chars().all(is_known).then_some(false)
}

/// The command line as clap can read it: a waypoint that begins with a minus sign would be taken for an option.
///
/// Such an argument gets a space in front, which the reader of waypoints drops. No option of ours begins with a digit,
/// so nothing else is ever touched.
fn protect_coordinates(args: impl IntoIterator<Item = OsString>) -> Vec<OsString> {
    let protect = |arg: OsString| match arg.to_str() {
        Some(text) if is_negative_coordinate(text) => OsString::from(format!(" {text}")),
        _ => arg,
    };
    args.into_iter().map(protect).collect()
}

/// A minus sign, a number, and a comma somewhere or a unit of length at the end.
fn is_negative_coordinate(text: &str) -> bool {
    text.strip_prefix('-')
        .is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit() || c == '.'))
        && (text.contains(',') || text.ends_with('m') || text.ends_with("ft"))
}

/// What to do.
#[derive(Clone, Debug, Subcommand)]
pub enum Command {
    /// Fly a whole simulated mission, with nothing else running, and check it
    Demo(demo::options::DemoArgs),
    /// Run a process of the RIL in the foreground: bridge, status, sim, view or mavlink
    Run(RunArgs),
    /// Run the bridge: short for `ril run bridge`
    Bridge(ProcessArgs<bridge::cli::Args>),
    /// Run the simulator: short for `ril run sim`
    Sim(ProcessArgs<dsp_sim::cli::SimArgs>),
    /// Show the robot to ground stations that speak MAVLink: short for `ril run mavlink`; or show which there are
    /// (`ril mavlink status`)
    Mavlink(MavlinkVerb),
    /// Bring a robot to other machines, or show the links of the relay that does so (`ril relay status`)
    Relay(RelayArgs),
    /// Start the bridge's module, so that it takes movements; or another module
    Start(ControlArgs),
    /// Stop the bridge's module: the helicopter hovers, and everything that was planned is discarded; or another module
    Stop(ControlArgs),
    /// Take off and climb to a height above take-off
    Takeoff(TakeoffArgs),
    /// Land on the spot
    Land(LandArgs),
    /// Hover on the spot and stay started; replaces a path that is under way
    Hold(HoldArgs),
    /// Fly a path of one or more waypoints
    Goto(GotoArgs),
    /// Return to home: fly to where the helicopter was switched on, and hover or land there
    Rtl(RtlArgs),
    /// Check, show or fly a plan of QGroundControl, Mission Planner, GeoJSON, KML or GPX
    Plan(PlanArgs),
    /// List, read or write the DSP's parameters (virtual ports)
    Param(ParamArgs),
    /// Manage the geofence
    Fence(FenceArgs),
    /// Show who commands the bridge; take, release or pass control
    Control(HolderArgs),
    /// Show the state of the module, the link, the DSP, the safety rules and telemetry
    // Hidden: two names of one verb would be one offer of the completion, and that the alias.
    #[command(alias = "state")]
    Status(StatusArgs),
    /// Watch one or several robots on a terminal, and order hold, land and stop from it
    Watch(WatchArgs),
    /// Watch robots in a browser, and order from it
    View(ViewArgs),
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
    /// Check whether the robot is ready to take off: each check with its value, its limit and what to do
    Preflight(PreflightArgs),
    /// Play the PC against a DSP on the bench: which sentences of docs/protocol.md does it keep?
    Conform(ConformArgs),
    /// Wait until the robot is up, flies, hovers or has landed, or a value of its telemetry is reached
    Wait(WaitArgs),
    /// Record everything that a robot publishes, as MCAP files
    Record(RecordArgs),
    /// List, sum up, print, convert, check and recover the logs and records of flights
    Log(LogArgs),
    /// Play a recorded flight as if its robot were there
    Replay(ReplayArgs),
    /// List all robots of this user, with processes, link and phase
    Robots(RobotsArgs),
    /// Begin a module of your own, with its test
    New(NewArgs),
    /// Print the script that completes command lines of ril in a shell
    Completions(CompletionsArgs),
    /// Write the pages of the manual, for packages
    #[command(hide = true)]
    Man(ManualArgs),
}

/// `ril run`
#[derive(Args, Clone, Debug)]
pub struct RunArgs {
    /// Which process.
    #[command(subcommand)]
    pub command: RunCommand,
}

/// A process of the RIL, with what `ril` adds.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct ProcessArgs<A: Args> {
    /// The process's own arguments.
    #[command(flatten)]
    pub process: A,

    /// Print a failure, or with --check-config the configuration, as one JSON object
    #[arg(long)]
    pub json: bool,
}

/// `ril mavlink`
#[derive(Args, Clone, Debug)]
#[command(args_conflicts_with_subcommands = true)]
pub struct MavlinkVerb {
    /// What to do beside running it.
    #[command(subcommand)]
    pub command: Option<MavlinkCommand>,

    /// The arguments of `ril run mavlink`.
    #[command(flatten)]
    pub run: ProcessArgs<MavlinkArgs>,
}

/// `ril mavlink …`
#[derive(Clone, Debug, Subcommand)]
pub enum MavlinkCommand {
    /// Show the stations of the gateway that runs here, what it did not take of them, and why it sends nothing
    Status(SampleArgs),
}

/// `ril run …`
#[derive(Clone, Debug, Subcommand)]
pub enum RunCommand {
    /// Run the bridge between shared memory and the DSP's serial port, in the foreground
    Bridge(ProcessArgs<bridge::cli::Args>),
    /// Run the process that turns raw telemetry into SI units and writes logs, in the foreground
    Status(ProcessArgs<status::cli::Args>),
    /// Run the simulator of DSP and helicopter, in the foreground
    Sim(ProcessArgs<dsp_sim::cli::SimArgs>),
    /// Run the server of `ril view`, the page of robots in a browser, in the foreground
    View(ProcessArgs<RunViewArgs>),
    /// Run the gateway to ground stations and scripts that speak MAVLink, in the foreground
    Mavlink(ProcessArgs<MavlinkArgs>),
}

/// `ril completions`
///
/// Each press of the key then asks `ril` itself, so robots, topics, fields, modules and parameters are those that there
/// are now. The package installs these scripts; without it: source <(ril completions bash) in ~/.bashrc, the same in
/// ~/.zshrc after compinit, and `ril completions fish | source` in ~/.config/fish/config.fish.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct CompletionsArgs {
    /// Which shell the script is for
    #[arg(value_enum)]
    pub shell: CompletionShell,
}

/// Shells whose command lines can be completed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum CompletionShell {
    /// bash 4.4 or later
    Bash,
    /// zsh
    Zsh,
    /// fish
    Fish,
}
