//! The binary `ril`: reads the command line and hands over; see the library.

use clap::Parser;
use ril::cli::{Cli, Command, protect_coordinates};
use ril::commands::{echo, request, state};
use ril::demo;
use runtime::exit;

fn main() -> std::process::ExitCode {
    let cli = Cli::parse_from(protect_coordinates(std::env::args_os()));
    exit::main_with(|| {
        demo::end_with_parent().map_err(exit::Failure::internal)?;
        run(cli.command)
    })
}

fn run(command: Command) -> Result<(), exit::Failure> {
    match command {
        Command::Demo(args) => demo::run(&args),
        Command::Bridge(args) => bridge::cli::run(args),
        Command::Status(args) => status::cli::run(args),
        Command::Sim(args) => dsp_sim::cli::run(args),
        Command::Start(args) => request::start(&args),
        Command::Stop(args) => request::stop(&args),
        Command::Takeoff(args) => request::take_off(&args),
        Command::Land(args) => request::land(&args),
        Command::Goto(args) => request::go_to(&args),
        Command::State(args) => state::state(&args),
        Command::Echo(args) => echo::echo(&args),
    }
}
