//! `ril`: the operator's tool of the HERO's Robot Implementation Layer, and its one installed binary.
//!
//! * [`chart`]: fence and path of files, for maps;
//! * [`cli`]: the command line, with the exit codes;
//! * [`mod@alive`]: the robots of a domain that are alive;
//! * [`config`]: the file `ril.toml`;
//! * [`changes`]: what changes from one state of the bridge to the next, in words;
//! * [`commands`]: the operator's commands, thin shells around pure values;
//! * [`completion`]: what can follow on a command line in bash, zsh and fish;
//! * [`finding`]: what doctor, preflight, the demonstration and alarms find;
//! * [`geo`]: places on the Earth and the metres between them;
//! * [`keys`](mod@keys): the keys in the bytes of a terminal;
//! * [`live`]: a block of lines that a terminal shows anew;
//! * [`messages`]: reports as messages, as JSON and as exit codes;
//! * [`fields`]: the fields of samples by name, and which of them mean something;
//! * [`recorded`]: what is in a flight record;
//! * [`relay_link`]: the link of a relay to a robot on another machine;
//! * [`robots`]: the robots of a user, as a table;
//! * [`stamps`]: what a sample says of its publisher and of its times;
//! * [`pilot`]: what a pilot asks first, of the newest telemetry;
//! * [`track`]: where the robot was;
//! * [`verbs`]: the verbs, each in a folder;
//! * [`words`]: numbers, times and paragraphs as people read them.
//!
//! `ril run bridge`, `ril run status` and `ril run sim` are those crates' own command lines; `ril relay` is a program of its own,
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

pub mod alive;
pub mod changes;
pub mod chart;
pub mod cli;
pub mod commands;
pub mod completion;
pub mod config;
pub mod fields;
pub mod finding;
pub mod geo;
pub mod keys;
pub mod live;
pub mod messages;
pub mod pilot;
pub mod recorded;
pub mod relay_link;
pub mod robots;
pub mod stamps;
pub mod track;
pub mod verbs;
pub mod words;

use std::ffi::OsString;
use std::io::Write;
use std::process::ExitCode;

use cli::{RobotChoice, RunCommand};
use commands::{param, plan, request};
use messages::ErrorObject;
use runtime::exit::{self, Failure};
use verbs::check::{doctor, preflight};
use verbs::topic::{self, echo, measure};
use verbs::{demo, log, record, relay, replay, wait, watch};

/// The whole of the binary `ril`: reads the command line, of which the first is the program's name, and does it.
///
/// Programs that start the processes of the RIL may be one of them themselves with this.
pub fn main(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    if completion::is_asked() {
        completion::answer(args);
        return ExitCode::SUCCESS;
    }
    let args: Vec<OsString> = args.into_iter().collect();
    let json = cli::wants_json(&args);
    let (cli, choice) = match cli::Cli::read(args) {
        Ok(read) => read,
        Err(error) => {
            if json && error.use_stderr() {
                print_error(&ErrorObject::of_usage(&error.render().to_string()));
            }
            error.exit()
        }
    };
    let run = || {
        demo::end_with_parent().map_err(Failure::internal)?;
        run(cli.command, choice)
    };
    exit::main_and_report(run, |failure| {
        if json {
            print_error(&ErrorObject::of(failure));
        }
    })
}

/// Runs a process of the RIL, or prints its configuration.
fn process(command: RunCommand) -> Result<(), Failure> {
    use commands::resulting::print;
    match command {
        RunCommand::Bridge(args) if args.prints_config(&args.process.common) => {
            print("bridge", &bridge::cli::check_config(&args.process)?)
        }
        RunCommand::Status(args) if args.prints_config(&args.process.common) => {
            print("status", &status::cli::check_config(&args.process)?)
        }
        RunCommand::Sim(args) if args.prints_config(&args.process.common) => {
            print("sim", &dsp_sim::cli::check_config(&args.process)?)
        }
        RunCommand::Bridge(args) => bridge::cli::run(args.process),
        RunCommand::Status(args) => status::cli::run(args.process),
        RunCommand::Sim(args) => dsp_sim::cli::run(args.process),
    }
}

/// Prints a failure for programs. Standard output may be closed; the exit code still says enough.
fn print_error(error: &ErrorObject) {
    let mut out = std::io::stdout().lock();
    let _ = commands::json_line(&mut out, error);
    let _ = out.flush();
}

fn run(command: cli::Command, choice: RobotChoice) -> Result<(), Failure> {
    use cli::Command;
    match command {
        Command::Demo(args) => demo::run(&args),
        Command::Run(args) => process(args.command),
        Command::Bridge(args) => process(RunCommand::Bridge(args)),
        Command::Sim(args) => process(RunCommand::Sim(args)),
        Command::Relay(args) => relay::relay(&args),
        Command::Start(args) => request::start(&args, choice),
        Command::Stop(args) => request::stop(&args, choice),
        Command::Takeoff(args) => request::take_off(&args, choice),
        Command::Land(args) => request::land(&args, choice),
        Command::Hold(args) => request::hold(&args, choice),
        Command::Goto(args) => request::go_to(&args, choice),
        Command::Plan(args) => plan::plan(&args.command, choice),
        Command::Param(args) => param::param(&args.command, choice),
        Command::Fence(args) => request::fence(&args.command, choice),
        Command::Status(args) => verbs::status::status(&args),
        Command::Watch(args) => watch::watch(&args),
        Command::Echo(args) => echo::echo(&args),
        Command::Topic(args) => topic::topic(&args.command),
        Command::Doctor(args) => doctor::doctor(&args),
        Command::Preflight(args) => preflight::preflight(&args),
        Command::Wait(args) => wait::wait(&args),
        Command::Record(args) => record::record(&args),
        Command::Log(args) => log::log(&args, choice),
        Command::Replay(args) => replay::replay(&args, choice),
        Command::Robots(args) => commands::robots::robots(&args),
        Command::Hz(args) => measure::hz(&args),
        Command::Delay(args) => measure::delay(&args),
        Command::Bw(args) => measure::bw(&args),
        Command::Completions(args) => commands::shell::completions(&args),
        Command::Man(args) => commands::shell::man(&args),
    }
}
