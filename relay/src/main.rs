//! The relay as a process of its own; `ril relay` starts it.

use clap::Parser;

/// A robot's telemetry on other machines, and requests back, over Zenoh.
#[derive(Parser)]
#[command(name = "ril-relay", version)]
struct Cli {
    #[command(subcommand)]
    command: relay::cli::Command,
}

fn main() -> std::process::ExitCode {
    let cli = Cli::parse();
    runtime::exit::main_with(|| relay::cli::run(cli.command))
}
