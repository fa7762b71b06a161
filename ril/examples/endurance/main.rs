//! Measures what the processes of the RIL survive: real processes, killed, disturbed and cut off at random moments.
//!
//! ```sh
//! cargo run --release -p ril --example endurance -- kills --victim bridge [--count 1000] [--seed 1]
//! cargo run --release -p ril --example endurance -- starts [--count 10000] [--seed 1]
//! cargo run --release -p ril --example endurance -- crashes [--per-second 50] [--duration-s 600] [--seed 1]
//! cargo run --release -p ril --example endurance -- records [--count 1000] [--seed 1] [--speed 1] [--keep FOLDER]
//! cargo run --release -p ril --example endurance -- gap [--count 200] [--period-ms 20] [--seed 1]
//! cargo run --release -p ril --example endurance -- port [--count 200] [--seed 1]
//! cargo run --release -p ril --example endurance -- subscribers [--duration-s 120] [--period-ms 2] [--seed 1]
//! cargo run --release -p ril --example endurance -- clients [--count 20000] [--seed 1]
//! cargo run --release -p ril --example endurance -- flood [--count 20]
//! cargo run --release -p ril --example endurance -- full
//! cargo run --release -p ril --example endurance -- strangers [--count 200000]
//! cargo run --release -p ril --example endurance -- joiners [--count 2000] [--seed 1]
//! cargo run --release -p ril --example endurance -- namespaces [--count 600]
//! ```
//!
//! `full` and `strangers` have a `/dev/shm` of their own, for which the program starts itself again in a mount namespace; so
//! does `namespaces` for its consumers. What the kernel forbids is skipped with a word.
//!
//! Each prints a row of a table. The exit code is 1 when something was left or lost; a process that does not come up, or
//! telemetry that does not come again, ends the program with the reason. Times are printed and judged by nobody. Ctrl+C
//! ends a measurement early and prints what there is. The same seed draws the same moments.
//!
//! The processes are this program itself: with the first argument `be-ril` it is `ril`.

mod clients;
mod crashes;
mod crew;
mod flood;
mod full;
mod gap;
mod healthy;
mod joiners;
mod kills;
mod memory;
mod namespaces;
mod opened;
mod port;
mod records;
mod spread;
mod starts;
mod strangers;
mod subscribers;

// What the tests share with this program.
#[path = "../../tests/stock_readers/environment.rs"]
mod environment;
#[path = "../../tests/stock_readers/expected.rs"]
#[allow(dead_code)]
mod expected;
#[path = "../../tests/stock_readers/readers.rs"]
#[allow(dead_code)]
mod readers;
#[path = "../../tests/stock_readers/sums.rs"]
mod sums;

use std::process::ExitCode;
use std::time::Duration;

use clap::{Parser, ValueEnum};
use runtime::signal::Termination;

use crew::{BE_RIL, Kind, Program, Site, has};
use environment::readers_or_skip;

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
    /// How often, or how many; each measurement has a number of its own. Port no more than 256
    #[arg(long)]
    count: Option<u32>,
    /// How long subscribers disturb (120 s), or processes crash (600 s)
    #[arg(long)]
    duration_s: Option<u64>,
    /// How many processes start, and crash, a second
    #[arg(long, default_value = "50", value_parser = clap::value_parser!(u32).range(1..))]
    per_second: u32,
    /// Period of telemetry: gap 20 ms, subscribers 2 ms if nothing else is said
    #[arg(long)]
    period_ms: Option<u16>,
    /// Simulated seconds for one of the host: records
    #[arg(long, default_value = "1", value_parser = clap::value_parser!(u32).range(1..=10))]
    speed: u32,
    /// Where the files of `records` go, to be opened with other programs; it must be there
    #[arg(long)]
    keep: Option<std::path::PathBuf>,
    /// Seed of all moments
    #[arg(long, default_value = "1")]
    seed: u64,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum What {
    /// Each kind of process is killed over and over
    Kills,
    /// Very many starts, each after a kill, sometimes of everything at once
    Starts,
    /// Processes of every kind crash in a loop
    Crashes,
    /// The recorder is killed over and over
    Records,
    /// What a consumer misses when the bridge is killed and started again
    Gap,
    /// The serial port goes and comes back
    Port,
    /// Subscribers that misbehave
    Subscribers,
    /// Groups of clients end at the same moment
    Clients,
    /// Clients send without a pause
    Flood,
    /// No bytes or files are left in shared memory
    Full,
    /// Somebody else makes very many files in shared memory
    Strangers,
    /// Processes are stopped while they start
    Joiners,
    /// Process numbers, clocks and mounts of containers
    Namespaces,
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
            let chosen =
                |kind: &Kind| args.victim.is_none_or(|victim| victim == *kind) && has(*kind);
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
        What::Records => {
            let plan = records::Plan {
                kills: args.count.unwrap_or(1000),
                seed: args.seed,
                speed: args.speed,
                readers: readers_or_skip("files of killed recorders"),
                keep: args.keep,
            };
            let outcome = records::run(&site("records"), &plan, &goes_on);
            println!("{outcome}");
            outcome.is_kept()
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
        What::Starts => {
            let plan = starts::Plan {
                starts: args.count.unwrap_or(10_000),
                together: 250,
                robots: 12,
                seed: args.seed,
            };
            println!(
                "| ready | killed while they started | each | all at once |\n|---|---|---|---|"
            );
            println!("{}", starts::run(&site("starts"), &plan, &goes_on));
            true
        }
        What::Crashes => {
            let plan = crashes::Plan {
                per_second: args.per_second,
                duration: Duration::from_secs(args.duration_s.unwrap_or(600)),
                seed: args.seed,
            };
            println!(
                "| crashes | healthy consumers | new generations | files and segments | survivors |"
            );
            println!("|---|---|---|---|---|");
            let outcome = crashes::run(&site("crashes"), &plan, &goes_on);
            println!("{outcome}");
            outcome.is_clean()
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
                duration: Duration::from_secs(args.duration_s.unwrap_or(120)),
                period_ms: args.period_ms.unwrap_or(2),
                seed: args.seed,
            };
            println!("| telemetry | line | healthy consumers | the others |\n|---|---|---|---|");
            let outcome = subscribers::run(&site("subscribers"), &plan, &goes_on);
            println!("{outcome}");
            outcome.damaged() == 0 && outcome.lost() == 0
        }
        What::Clients => {
            let plan = clients::Plan {
                clients: args.count.unwrap_or(20_000),
                seed: args.seed,
            };
            println!("| clients | bridge | what it holds |\n|---|---|---|");
            let outcome = clients::run(&site("clients"), &plan, &goes_on);
            println!("{outcome}");
            outcome.is_clean()
        }
        What::Flood => {
            let plan = flood::Plan {
                rounds: args.count.unwrap_or(20),
            };
            println!("| requests of the flood | orders | answered | not done |\n|---|---|---|---|");
            let outcome = flood::run(&site("flood"), &plan, &goes_on);
            println!("{outcome}");
            outcome.failures.is_empty()
        }
        What::Full => in_own_memory(full::Lack::Inodes.mount_options(), || {
            println!("| nothing left | processes | consumers | answers |\n|---|---|---|---|");
            let mut is_good = true;
            for lack in [full::Lack::Bytes, full::Lack::Inodes] {
                let outcome = full::run(&site("full"), lack);
                println!("{outcome}");
                is_good &= outcome.flies_on() && outcome.is_landed();
            }
            is_good
        }),
        What::Strangers => in_own_memory(strangers::MOUNT_OPTIONS, || {
            let plan = strangers::Plan {
                files: args.count.unwrap_or(200_000),
            };
            println!(
                "| files | between samples, before | among them | starts |\n|---|---|---|---|"
            );
            println!("{}", strangers::run(&site("strangers"), &plan));
            let users = namespaces::other_users(&site("users"));
            users.is_none_or(|outcome| {
                println!("{outcome}");
                outcome.failures.is_empty()
            })
        }),
        What::Joiners => {
            let plan = joiners::Plan {
                joiners: args.count.unwrap_or(2000),
                seed: args.seed,
            };
            println!("| stopped | done meanwhile | ended meanwhile |\n|---|---|---|");
            println!("{}", joiners::run(&site("joiners"), &plan, &goes_on));
            true
        }
        What::Namespaces => {
            let plan = namespaces::Plan {
                starts: args.count.unwrap_or(600),
            };
            println!("| consumers | failures |\n|---|---|");
            let numbers = namespaces::same_numbers(&site("numbers"), &plan, &goes_on);
            let clocks = namespaces::other_clocks(&site("clocks"));
            let mounts = namespaces::other_mounts(&site("mounts"));
            let mut is_good = true;
            for outcome in [numbers, clocks, mounts].into_iter().flatten() {
                println!("{outcome}");
                is_good &= outcome.failures.is_empty();
            }
            is_good
        }
    };
    ExitCode::from(u8::from(!is_good))
}

/// Runs `measure` in a `/dev/shm` that is mounted with `options` and nobody else has: this program again.
fn in_own_memory(options: &str, measure: impl FnOnce() -> bool) -> bool {
    if memory::is_own() {
        return measure();
    }
    let args: Vec<_> = std::env::args().skip(1).collect();
    let status = memory::run_again(options, &args).expect("this program can be started");
    status.is_none_or(|status| status.success())
}
