//! Measures the relay on bad links: real processes of a robot and of a station, each with a network of its own, and the robot with
//! a monotonic clock that is seven hours ahead.
//!
//! ```sh
//! cargo build -p ril -p relay
//! cargo run -p relay --example field -- mission [--loss 10]
//! cargo run -p relay --example field -- requests [--count 1000] [--loss 20] [--seed 1]
//! cargo run -p relay --example field -- outages [--count 20] [--outage-s 10] [--loss 0]
//! cargo run -p relay --example field -- slow [--rate-kbps 100] [--queue 1000] [--duration-s 60]
//! ```
//!
//! `--over quic` and `--over tls` take these protocols, with certificates that are made for it, and `--relay-toml FILE` a configuration
//! for both sides, without `[security]`.
//!
//! The networks are namespaces with an interface each, between which this program carries the packets as `tc netem` would: it loses,
//! delays and paces them, by a seed. That needs root, `/dev/net/tun`, and the programs `ip`, `setpriv`, `unshare` and `nsenter`.
//! Where one of them is missing the program says so and ends with exit code 0. Everything goes when the program ends, even if it is
//! killed.
//!
//! Each measurement prints a row of a table. The exit code is 1 when a promise was broken. Times are printed and not judged. Ctrl+C
//! ends a measurement early and prints what there is.

mod ages;
mod air;
#[path = "../../tests/flight/bridge_log.rs"]
mod bridge_log;
#[path = "../../tests/flight/machine.rs"]
mod machine;
mod mission;
mod outages;
mod requests;
mod site;
mod slow;
mod tunnel;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::{Parser, ValueEnum};
use ril_tests::chain::beside_or_skip;
use runtime::signal::Termination;

use site::Plan;

/// A measurement that takes longer hangs.
const TIME_LIMIT: Duration = Duration::from_secs(4 * 3600);

/// Measures the relay on bad links
#[derive(Parser)]
struct Args {
    /// What to measure
    what: What,
    /// How many requests (1000) or outages (20)
    #[arg(long)]
    count: Option<u32>,
    /// Packets that are lost, percent: 10 for a mission, 20 for requests, 0 for outages if nothing else is said
    #[arg(long, value_parser = clap::value_parser!(u8).range(0..=90))]
    loss: Option<u8>,
    /// How long an outage lasts, s
    #[arg(long, default_value = "10")]
    outage_s: u64,
    /// Speed of the slow link, kbit/s
    #[arg(long, default_value = "100")]
    rate_kbps: u64,
    /// Packets that may wait for the slow link; more are dropped
    #[arg(long, default_value = "1000")]
    queue: usize,
    /// How long the slow link is watched, s
    #[arg(long, default_value = "60")]
    duration_s: u64,
    /// Protocol of the link: tcp, udp, tls or quic
    #[arg(long, default_value = "tcp")]
    over: String,
    /// Configuration of both relays, without `[security]`
    #[arg(long)]
    relay_toml: Option<PathBuf>,
    /// Seed of all chances
    #[arg(long, default_value = "1")]
    seed: u64,
    /// Filter of the log such as relay=debug; the logs of the relays are printed at the end
    #[arg(long)]
    log: Option<String>,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum What {
    /// The operator's verbs at the station, through loss
    Mission,
    /// Many requests, through loss, outages and restarts of everything
    Requests,
    /// What comes after an outage, and how old it is said to be
    Outages,
    /// Ages on a slow link
    Slow,
}

fn main() -> ExitCode {
    let args = Args::parse();
    let termination = Termination::install().expect("signals");
    let goes_on = || !termination.requested();
    let this = std::env::current_exe().expect("this program has a path");
    let Some(ril) = beside_or_skip(&this) else {
        return ExitCode::SUCCESS;
    };
    let plan = |name, default_toml: &str| Plan {
        name,
        ril,
        protocol: args.over.clone(),
        relay_toml: match &args.relay_toml {
            Some(path) => std::fs::read_to_string(path).expect("the file can be read"),
            None => default_toml.to_owned(),
        },
        limit: TIME_LIMIT,
        seed: args.seed,
        log: args.log.clone(),
    };
    let loss = |usual: u8| f64::from(args.loss.unwrap_or(usual)) / 100.0;
    let row = match args.what {
        What::Mission => mission::run(&plan("mission", ""), loss(10))
            .map(|outcome| (outcome.to_string(), outcome.is_good())),
        What::Requests => requests::run(
            &plan("requests", ""),
            args.count.unwrap_or(1000),
            loss(20),
            &goes_on,
        )
        .map(|outcome| (outcome.to_string(), outcome.is_good())),
        What::Outages => outages::run(
            &plan("outages", ""),
            args.count.unwrap_or(20),
            Duration::from_secs(args.outage_s),
            loss(0),
            &goes_on,
        )
        .map(|outcome| (outcome.to_string(), outcome.is_good())),
        What::Slow => slow::run(
            &plan("slow", slow::RELAY_TOML),
            args.rate_kbps * 1000,
            args.queue,
            Duration::from_secs(args.duration_s),
        )
        .map(|outcome| (outcome.to_string(), true)),
    };
    match row {
        Ok((row, is_good)) => {
            println!("| over {}, {row} |", args.over);
            ExitCode::from(u8::from(!is_good))
        }
        Err(reason) => {
            eprintln!("SKIPPED: {reason}");
            ExitCode::SUCCESS
        }
    }
}
