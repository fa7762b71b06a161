//! The bridge as a process of its own; `ril run bridge` is the same.

use clap::Parser;

/// Bridge between the PC and the flight-control DSP of the HERO helicopter.
#[derive(Parser)]
#[command(name = "bridge", version)]
struct Cli {
    #[command(flatten)]
    args: bridge::cli::Args,
}

fn main() -> std::process::ExitCode {
    runtime::exit::main_of(|cli: Cli| bridge::cli::run(cli.args))
}
