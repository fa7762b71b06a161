//! The relay as a process of its own; `ril relay` starts it.

use clap::{CommandFactory, Parser, Subcommand};
use runtime::manual::{self, ManualArgs};

/// A robot's telemetry on other machines, and requests back, over Zenoh.
#[derive(Parser)]
#[command(name = "ril-relay", version)]
struct Cli {
    #[command(subcommand)]
    command: Program,
}

#[derive(Subcommand)]
enum Program {
    #[command(flatten)]
    Relay(relay::cli::RelayCommand),
    /// Write the pages of the manual, for packages
    #[command(hide = true)]
    Man(ManualArgs),
}

fn main() -> std::process::ExitCode {
    runtime::exit::main_of(|cli: Cli| match cli.command {
        Program::Relay(command) => relay::cli::run(command),
        Program::Man(args) => manual::write(Cli::command(), &args),
    })
}
