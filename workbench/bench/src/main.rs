//! Measures the RIL side by side with what its users would use otherwise.
//!
//! Six commands, each of which prints its tables and writes them into `docs/performance.md`:
//!
//! * `hop`: one sample of telemetry from one process to another;
//! * `codec`: the decoder of the serial line;
//! * `end-to-end`: from a byte on the serial line to a consumer, and a request and its answer;
//! * `cost`: processor time, wake-ups, highest rate, losses;
//! * `record`: how old telemetry is while it is recorded, and what the recorder takes;
//! * `relay`: telemetry on another machine, beside plain Zenoh.
//!
//! What is compared is always measured in the same run, in rounds that take turns, so that whatever else the machine
//! does falls upon all alike. A ratio is that of one round; the median over the rounds is what counts. Every process
//! that is measured is one of its own: this program starts itself again (`child`).

mod by_hand;
mod child;
mod commands;
mod consumer;
mod dsp;
mod harness;
mod measured;
mod pace;
mod peers;
mod plot;
#[cfg(feature = "peers")]
mod relayed;
mod report;
mod requests;
mod stream;
mod usage;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Measures the RIL side by side with what its users would use otherwise.
#[derive(Parser)]
#[command(name = "bench", version)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// One sample of telemetry from one process to another, over everything that could carry it
    Hop(commands::hop::Args),
    /// The decoder of the serial line against other parsers
    Codec(commands::codec::Args),
    /// From a byte on the serial line to a consumer, and from a request to its report
    EndToEnd(commands::end_to_end::Args),
    /// Processor time, wake-ups, highest rate, losses
    Cost(commands::cost::Args),
    /// How old telemetry is while it is recorded, and what the recorder takes
    Record(commands::record::Args),
    /// Telemetry on another machine, beside plain Zenoh
    #[cfg(feature = "peers")]
    Relay(commands::relay::Args),
    /// A process that another command measures
    #[command(hide = true)]
    Child(child::Args),
}

fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Hop(args) => commands::hop::run(&args),
        Command::Codec(args) => commands::codec::run(&args),
        Command::EndToEnd(args) => commands::end_to_end::run(&args),
        Command::Cost(args) => commands::cost::run(&args),
        Command::Record(args) => commands::record::run(&args),
        #[cfg(feature = "peers")]
        Command::Relay(args) => commands::relay::run(&args),
        Command::Child(args) => return child::run(args),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error:?}");
            ExitCode::FAILURE
        }
    }
}
