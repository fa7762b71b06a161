//! The command line of `ril`: what can be asked for.
//!
//! Everything is checked here, once; the commands get typed values. `request` has the arguments of commands that ask a module
//! for something, `plan` those of plans, `relay` those of the relay, `topic` those of commands that watch topics; `value` reads
//! numbers, times and names, `length` altitudes and waypoints; `exit_codes` is the end of every help. Nothing here talks to
//! another process.

pub(crate) mod exit_codes;
mod global;
mod length;
mod plan;
mod request;
mod robots;
mod shell;
#[cfg(test)]
mod tests;
pub(crate) mod value;

use std::ffi::OsString;

use clap::error::ErrorKind;
use clap::parser::ValueSource;
use clap::{ArgMatches, Args, CommandFactory, FromArgMatches, Parser, Subcommand};
use runtime::args::CommonArgs;
use runtime::manual::ManualArgs;

use crate::verbs::check::options::{DoctorArgs, PreflightArgs};
use crate::verbs::demo;
pub use crate::verbs::log::options::{
    LogArgs, LogCommand, LogCsvArgs, LogFileArgs, LogListArgs, LogPlaceArgs, LogRecoverArgs,
    LogReportArgs, LogTailArgs,
};
pub use crate::verbs::record::options::RecordArgs;
pub use crate::verbs::relay::options::{RelayArgs, RelayCommand, RelayStatusArgs};
pub use crate::verbs::replay::options::ReplayArgs;
pub use crate::verbs::status::options::StatusArgs;
pub use crate::verbs::topic::options::{
    EchoArgs, EchoOptions, MeasureArgs, MeasureOptions, Topic, TopicArgs, TopicCommand,
    TopicEchoArgs, TopicInfoArgs, TopicListArgs, TopicMeasureArgs,
};
pub use crate::verbs::wait::options::WaitArgs;
pub use crate::verbs::watch::options::WatchArgs;
use exit_codes::EXIT_CODES;
pub use global::{GlobalArgs, wants_json};
pub use length::{Height, Target, waypoints};
pub use plan::{
    HomeArg, PlanArgs, PlanCheckArgs, PlanCommand, PlanFileArgs, PlanFlyArgs, PlanLookArgs,
    PlanShowArgs, ReferenceName,
};
pub use request::{
    AskArgs, ControlArgs, FenceArgs, FenceCommand, GotoArgs, LandArgs, ParamArgs, ParamCommand,
    ParamGetArgs, ParamListArgs, ParamSetArgs, RequestArgs, TakeoffArgs,
};
pub use robots::RobotsArgs;
pub use shell::{CompletionsArgs, Shell};
pub use value::PortKey;
use value::protect_coordinates;

/// The operator's tool of the HERO helicopter's Robot Implementation Layer.
///
/// Data goes to standard output, everything else to standard error. With --json, data is one JSON object a line, and so is
/// a failure.
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
        let args = global::behind_the_verb(protect_coordinates(args), &command);
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
        Ok((cli, RobotChoice::of(&matches)))
    }
}

/// What to do.
#[derive(Clone, Debug, Subcommand)]
pub enum Command {
    /// Fly a whole simulated mission, with nothing else running, and check it
    Demo(demo::Args),
    /// Run a process of the RIL in the foreground: bridge, status or sim
    Run(RunArgs),
    /// Run the bridge: short for `ril run bridge`
    Bridge(ProcessArgs<bridge::cli::Args>),
    /// Run the simulator: short for `ril run sim`
    Sim(ProcessArgs<dsp_sim::cli::Args>),
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
    Hold(RequestArgs),
    /// Fly a path of one or more waypoints
    Goto(GotoArgs),
    /// Check, show or fly a plan of QGroundControl, Mission Planner, GeoJSON, KML or GPX
    Plan(PlanArgs),
    /// List, read or write the DSP's parameters (virtual ports)
    Param(ParamArgs),
    /// Manage the geofence
    Fence(FenceArgs),
    /// Show the state of the module, the link, the DSP, the safety rules and telemetry
    #[command(visible_alias = "state")]
    Status(StatusArgs),
    /// Watch one or several robots on a terminal, and order hold, land and stop from it
    Watch(WatchArgs),
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

impl<A: Args> ProcessArgs<A> {
    /// Whether only the configuration is to be printed, as JSON.
    pub fn prints_config(&self, common: &CommonArgs) -> bool {
        self.json && common.check_config
    }
}

/// `ril run …`
#[derive(Clone, Debug, Subcommand)]
pub enum RunCommand {
    /// Run the bridge between shared memory and the DSP's serial port, in the foreground
    Bridge(ProcessArgs<bridge::cli::Args>),
    /// Run the process that turns raw telemetry into SI units and writes logs, in the foreground
    Status(ProcessArgs<status::cli::Args>),
    /// Run the simulator of DSP and helicopter, in the foreground
    Sim(ProcessArgs<dsp_sim::cli::Args>),
}
