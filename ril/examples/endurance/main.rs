//! Measures what the processes of the RIL survive: real processes, killed, disturbed and cut off at random moments.
//!
//! ```sh
//! cargo run --release -p ril --example endurance -- kills --victim bridge [--count 1000] [--seed 1]
//! cargo run --release -p ril --example endurance -- gap [--count 200] [--period-ms 20] [--seed 1]
//! cargo run --release -p ril --example endurance -- port [--count 200] [--seed 1]
//! cargo run --release -p ril --example endurance -- subscribers [--duration-s 120] [--period-ms 2] [--seed 1]
//! ```
//!
//! Each prints a row of a table. The exit code is 1 when something was left or lost; a process that does not come up, or
//! telemetry that does not come again, ends the program with the reason. Times are printed and judged by nobody. Ctrl+C
//! ends a measurement early and prints what there is. The same seed draws the same moments.
//!
//! The processes are this program itself: with the first argument `be-ril` it is `ril`.

mod crew;
mod gap;
mod kills;
mod port;
mod spread;
mod subscribers;

use std::process::ExitCode;
use std::time::Duration;

use clap::{Parser, ValueEnum};
use runtime::signal::Termination;

use crew::{BE_RIL, Kind, Program, Site};

/// A measurement that takes longer hangs.
const TIME_LIMIT: Duration = Duration::from_secs(3600);

/// Measures what the processes of the RIL survive
#[derive(Parser)]
struct Args {
    /// What to measure
    what: What,
    /// Who is killed [default: each, one after the other]
    #[arg(long, value_parser = kind)]
    victim: Option<Kind>,
    /// How often: kills 1000, gap and port 200 if nothing else is said; port no more than 256
    #[arg(long)]
    count: Option<u32>,
    /// How long the subscribers disturb
    #[arg(long, default_value = "120")]
    duration_s: u64,
    /// Period of telemetry: gap 20 ms, subscribers 2 ms if nothing else is said
    #[arg(long)]
    period_ms: Option<u16>,
    /// Seed of all moments
    #[arg(long, default_value = "1")]
    seed: u64,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum What {
    /// Each kind of process is killed over and over
    Kills,
    /// What a consumer misses when the bridge is killed and started again
    Gap,
    /// The serial port goes and comes back
    Port,
    /// Subscribers that misbehave
    Subscribers,
}

fn kind(name: &str) -> Result<Kind, String> {
    let found = Kind::ALL.into_iter().find(|kind| kind.name() == name);
    found.ok_or_else(|| format!("the kinds are {}", Kind::ALL.map(Kind::name).join(", ")))
}

fn main() -> ExitCode {
    let mut words = std::env::args_os();
    let name = words.next();
    if std::env::args_os()
        .nth(1)
        .is_some_and(|word| word == BE_RIL)
    {
        return ril::main(name.into_iter().chain(words.skip(1)));
    }
    let args = Args::parse();
    let termination = Termination::install().expect("signals");
    let goes_on = || !termination.requested();
    let program = Program::this().expect("this program has a path");
    let site = |name| Site::new(&program, name, TIME_LIMIT);
    let is_good = match args.what {
        What::Kills => {
            println!(
                "| killed | kills | ready again | telemetry again | files and segments | survivors |"
            );
            println!("|---|---|---|---|---|---|");
            let chosen = |kind: &Kind| args.victim.is_none_or(|victim| victim == *kind);
            let outcome = |victim| {
                let plan = kills::Plan {
                    victim,
                    kills: args.count.unwrap_or(1000),
                    seed: args.seed,
                };
                let outcome = kills::run(&site("kills"), &plan, &goes_on);
                println!("{outcome}");
                outcome.is_clean()
            };
            let mut is_good = true;
            for victim in Kind::ALL.into_iter().filter(chosen) {
                is_good &= outcome(victim);
            }
            is_good
        }
        What::Gap => {
            let plan = gap::Plan {
                kills: args.count.unwrap_or(200),
                period_ms: args.period_ms.unwrap_or(20),
                seed: args.seed,
            };
            println!("| period | gap | from the start of the new bridge |\n|---|---|---|");
            println!("{}", gap::run(&site("gap"), &plan, &goes_on));
            true
        }
        What::Port => {
            let plan = port::Plan {
                times: args.count.unwrap_or(200),
                seed: args.seed,
            };
            println!("| port gone and back | telemetry again | openings |\n|---|---|---|");
            println!("{}", port::run(&site("port"), &plan, &goes_on));
            true
        }
        What::Subscribers => {
            let plan = subscribers::Plan {
                duration: Duration::from_secs(args.duration_s),
                period_ms: args.period_ms.unwrap_or(2),
                seed: args.seed,
            };
            println!("| telemetry | line | healthy consumers | the others |\n|---|---|---|---|");
            let outcome = subscribers::run(&site("subscribers"), &plan, &goes_on);
            println!("{outcome}");
            outcome.damaged() == 0 && outcome.lost() == 0
        }
    };
    ExitCode::from(u8::from(!is_good))
}
