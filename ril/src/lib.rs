//! `ril`: the operator's tool of the HERO's Robot Implementation Layer, and its one installed binary.
//!
//! * [`cli`]: the command line; [`verbs`]: the verbs, each in a file or folder;
//! * [`completion`]: what can follow on a command line in bash, zsh and fish.
//!
//! What verbs share stands in the crate `operator`. The processes that `ril run` starts are rooms of their own: this
//! crate reads their command lines and starts them. `ril relay` is a program of its own, `ril-relay`. Nothing here
//! decides what the helicopter does: that is the bridge's.

pub mod cli;
pub mod completion;
mod new_file;
pub mod verbs;

use std::ffi::OsString;
use std::io::Write;
use std::process::ExitCode;

use clap::{Args, CommandFactory};
use cli::{MavlinkCommand, ProcessArgs, RunCommand};
use operator::render::messages::object::ErrorObject;
use operator::{options, render, session};
use runtime::args::SettingsArgs;
use runtime::config::resulting::Resulting;
use runtime::exit::{self, Failure, OrFail};
use runtime::manual;
use runtime::output::standard_output;
use runtime::signal::end_with_parent;
use verbs::check::{doctor, preflight};
use verbs::topic::meter::Quantity;
use verbs::topic::{self, echo, measure};
use verbs::{demo, log, new, order, param, plan, relay, replay, robots, wait, watch};

/// The whole of the binary `ril`: reads the command line, of which the first is the program's name, and does it.
///
/// Programs that start the processes of the RIL may be one of them themselves with this.
pub fn main(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    session::began();
    if completion::is_asked() {
        completion::answer(args);
        return ExitCode::SUCCESS;
    }
    let args: Vec<OsString> = args.into_iter().collect();
    let json = options::wants_json(&args);
    let cli = match cli::Cli::read(args) {
        Ok(read) => read,
        Err(error) => {
            if json && error.use_stderr() {
                print_error(&ErrorObject::of_usage(&error.render().to_string()), false);
            }
            return exit::usage(&error).into();
        }
    };
    let is_followed = follows_an_order(&cli.command);
    let run = || {
        end_with_parent().map_err(Failure::internal)?;
        run(cli.command)
    };
    exit::main_and_report(run, |failure| {
        if json {
            print_error(&ErrorObject::of(failure), is_followed);
        }
    })
}

/// Runs a process of the RIL, or prints its configuration.
fn process(command: RunCommand) -> Result<(), Failure> {
    match command {
        RunCommand::Bridge(args) => start(
            "bridge",
            args,
            |args| &args.common.settings,
            bridge::cli::check_config,
            bridge::cli::run,
        ),
        RunCommand::Status(args) => start(
            "status",
            args,
            |args| &args.common.settings,
            status::cli::check_config,
            status::cli::run,
        ),
        RunCommand::Sim(args) => start(
            "sim",
            args,
            |args| &args.common.settings,
            dsp_sim::cli::check_config,
            dsp_sim::cli::run,
        ),
        RunCommand::View(args) => start(
            "view",
            args,
            |args| &args.server.settings,
            |args| view::cli::check_config(&args.server),
            view::cli::run,
        ),
        RunCommand::Mavlink(args) => start(
            "mavlink",
            args,
            |args| &args.common.settings,
            mavlink_gateway::cli::check_config,
            mavlink_gateway::cli::run,
        ),
    }
}

/// Runs the process `name`, or prints its configuration as JSON. As text the process prints it itself.
fn start<A: Args>(
    name: &str,
    args: ProcessArgs<A>,
    settings: fn(&A) -> &SettingsArgs,
    check_config: fn(&A) -> Result<Resulting, Failure>,
    run: fn(A) -> Result<(), Failure>,
) -> Result<(), Failure> {
    match args.json && settings(&args.process).check_config {
        true => session::print_configuration(name, &check_config(&args.process)?),
        false => run(args.process),
    }
}

/// Whether the verb waits for something that a signal, or a reader that does not read, must not be held up by or hold
/// up.
fn follows_an_order(command: &cli::Command) -> bool {
    use cli::Command::*;
    match command {
        Plan(args) => matches!(args.command, plan::options::PlanCommand::Fly(_)),
        Start(_) | Stop(_) | Takeoff(_) | Land(_) | Hold(_) | Goto(_) | Rtl(_) | Param(_)
        | Fence(_) | Control(_) | Wait(_) => true,
        _ => false,
    }
}

/// Prints a failure for programs: of a verb that follows an order without waiting for a reader. Standard output may be
/// closed; the exit code still says enough.
fn print_error(error: &ErrorObject, is_followed: bool) {
    if is_followed {
        let _ = render::json_line(&mut standard_output(), error);
        return;
    }
    let mut out = std::io::stdout().lock();
    let _ = render::json_line(&mut out, error);
    let _ = out.flush();
}

fn run(command: cli::Command) -> Result<(), Failure> {
    use cli::Command;
    match command {
        Command::Demo(args) => demo::run(&args),
        Command::Run(args) => process(args.command),
        Command::Bridge(args) => process(RunCommand::Bridge(args)),
        Command::Sim(args) => process(RunCommand::Sim(args)),
        Command::Mavlink(args) => match args.command {
            Some(MavlinkCommand::Status(args)) => mavlink_gateway::shell::status::status(&args),
            None => process(RunCommand::Mavlink(args.run)),
        },
        Command::Relay(args) => relay::relay(&args),
        Command::Start(args) => order::start(&args, preflight::warn),
        Command::Stop(args) => order::stop(&args),
        Command::Takeoff(args) => order::take_off(&args),
        Command::Land(args) => order::land(&args),
        Command::Hold(args) => order::hold(&args),
        Command::Goto(args) => order::go_to(&args),
        Command::Rtl(args) => order::rtl(&args),
        Command::Plan(args) => plan::plan(&args.command),
        Command::Param(args) => param::param(&args.command),
        Command::Fence(args) => order::fence(&args.command),
        Command::Control(args) => order::command_of(&args.command),
        Command::Status(args) => verbs::status::status(&args),
        Command::Watch(args) => watch::watch(&args),
        Command::View(args) => view::start::view(&args, log::report_page),
        Command::Echo(args) => echo::echo(&args),
        Command::Topic(args) => topic::topic(&args.command),
        Command::Doctor(args) => doctor::doctor(&args),
        Command::Preflight(args) => preflight::preflight(&args),
        Command::Conform(args) => conform::cli::conform(&args),
        Command::Wait(args) => wait::wait(&args),
        Command::Record(args) => recorder::record(&args),
        Command::Log(args) => log::log(&args),
        Command::Replay(args) => replay::replay(&args),
        Command::Robots(args) => robots::robots(&args),
        Command::New(args) => new::new(&args.command),
        Command::Hz(args) => measure::measure(Quantity::Rate, &args),
        Command::Delay(args) => measure::measure(Quantity::Age, &args),
        Command::Bw(args) => measure::measure(Quantity::Bandwidth, &args),
        Command::Completions(args) => {
            let script = completion::script(args.shell).or_fail(exit::ExitCode::Internal)?;
            let mut out = std::io::stdout();
            out.write_all(script.as_bytes()).map_err(Failure::output)
        }
        Command::Man(args) => manual::write(cli::Cli::command(), &args),
    }
}
