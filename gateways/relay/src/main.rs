//! The relay as a process of its own; `ril relay` starts it.

use clap::{CommandFactory, Parser, Subcommand};
use runtime::manual::{self, ManualArgs};

/// A robot's telemetry on other machines, and requests back, over Zenoh.
#[derive(Parser)]
#[command(name = "ril-relay", version)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    #[command(flatten)]
    Relay(relay::cli::Command),
    /// Write the pages of the manual, for packages
    #[command(hide = true)]
    Man(ManualArgs),
}

fn main() -> std::process::ExitCode {
    let cli = Cli::parse();
    runtime::exit::main_with(|| match cli.command {
        Command::Relay(command) => relay::cli::run(command),
        Command::Man(args) => manual::write(Cli::command(), &args),
    })
}
