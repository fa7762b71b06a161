//! `ril`: the operator's tool of the HERO's Robot Implementation Layer, and its one installed binary.
//!
//! * [`cli`]: the command line, with the exit codes;
//! * [`config`]: the file `ril.toml`;
//! * [`commands`]: the operator's commands, thin shells around pure values;
//! * [`completion`]: what can follow on a command line in bash, zsh and fish;
//! * [`demo`]: a whole simulated mission with one command;
//! * [`measure`]: rates, ages and bytes of samples, with their histograms;
//! * [`live`]: a block of lines that a terminal shows anew;
//! * [`messages`]: reports as messages, as JSON and as exit codes;
//! * [`fields`]: the fields of samples by name, and which of them mean something.
//!
//! `ril bridge`, `ril status` and `ril sim` are those crates' own command lines; `ril relay` is a program of its own,
//! `ril-relay`, which it starts. Nothing here decides what the helicopter
//! does: that is the bridge's.
//!
//! # Example
//!
//! ```
//! use ipc_types::code::{Reason, Stage};
//! use ipc_types::payload::RequestReport;
//! use ril::messages::{self, FinalReport, Verb};
//!
//! let report = RequestReport::new(Stage::Refused, Reason::LinkDown);
//! assert_eq!(messages::line(Verb::Start, 0, 1, &report).as_deref(), Some("start: refused (link-down)"));
//! let end = FinalReport::of(&report).expect("a refusal is final");
//! assert_eq!(end.exit_code().code(), 6);
//! ```

pub mod cli;
pub mod commands;
pub mod completion;
pub mod config;
pub mod demo;
pub mod fields;
pub mod live;
pub mod measure;
pub mod messages;

use std::ffi::OsString;
use std::process::ExitCode;

use cli::RobotChoice;
use commands::{doctor, echo, param, relay, request, state, topic};
use runtime::exit::{self, Failure};

/// The whole of the binary `ril`: reads the command line, of which the first is the program's name, and does it.
///
/// Programs that start the processes of the RIL may be one of them themselves with this.
pub fn main(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    if completion::is_asked() {
        completion::answer(args);
        return ExitCode::SUCCESS;
    }
    let (cli, choice) = cli::Cli::read(args).unwrap_or_else(|error| error.exit());
    exit::main_with(|| {
        demo::end_with_parent().map_err(Failure::internal)?;
        run(cli.command, choice)
    })
}

fn run(command: cli::Command, choice: RobotChoice) -> Result<(), Failure> {
    use cli::Command;
    match command {
        Command::Demo(args) => demo::run(&args),
        Command::Bridge(args) => bridge::cli::run(args),
        Command::Status(args) => status::cli::run(args),
        Command::Sim(args) => dsp_sim::cli::run(args),
        Command::Relay(args) => relay::relay(&args),
        Command::Start(args) => request::start(&args, choice),
        Command::Stop(args) => request::stop(&args, choice),
        Command::Takeoff(args) => request::take_off(&args, choice),
        Command::Land(args) => request::land(&args, choice),
        Command::Hold(args) => request::hold(&args, choice),
        Command::Goto(args) => request::go_to(&args, choice),
        Command::Param(args) => param::param(&args.command, choice),
        Command::Fence(args) => request::fence(&args.command, choice),
        Command::State(args) => state::state(&args),
        Command::Echo(args) => echo::echo(&args),
        Command::Topic(args) => topic::topic(&args.command),
        Command::Doctor(args) => doctor::doctor(&args),
        Command::Hz(args) => commands::measure::hz(&args),
        Command::Delay(args) => commands::measure::delay(&args),
        Command::Bw(args) => commands::measure::bw(&args),
        Command::Completions(args) => commands::shell::completions(&args),
        Command::Man(args) => commands::shell::man(&args),
    }
}
