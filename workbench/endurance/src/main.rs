//! Measures what the processes of the RIL survive: real processes, killed, disturbed and cut off at random moments.
//!
//! ```sh
//! cargo run --release -p ril --example endurance -- kills --victim bridge [--count 1000] [--seed 1]
//! cargo run --release -p ril --example endurance -- --help
//! ```
//!
//! `full` and `foreign-files` have a `/dev/shm` of their own, for which the program starts itself again in a mount namespace; so
//! does `namespaces` for its consumers. What the kernel forbids is skipped with a word.
//!
//! Each prints a table. The exit code is 1 when something was left or lost; a process that does not come up, or
//! telemetry that does not come again, ends the program with the reason. Ctrl+C ends a measurement early and prints what there is. The
//! same seed draws the same moments.
//!
//! The processes are this program itself: with the first argument `be-ril` it is `ril`.

mod clients;
mod crashes;
mod flood;
mod foreign_files;
mod full;
mod gap;
mod joiners;
mod kills;
mod listener;
mod memory;
mod namespaces;
mod outcome;
mod port;
mod records;
mod site;
mod starts;
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
use ril_tests::Sandbox;
use runtime::signal::Termination;

use environment::readers_or_skip;
use outcome::{Outcome, Plan};
use site::{Kind, Site};

/// First argument of this program when it is to be `ril` itself.
const BE_RIL: &str = "be-ril";

/// A measurement that takes longer hangs.
const TIME_LIMIT: Duration = Duration::from_secs(3600);

/// Measures what the processes of the RIL survive
#[derive(Parser)]
struct Args {
    /// What to measure
    what: What,
    #[command(flatten)]
    plan: Plan,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum What {
    /// Each kind of process is killed over and over (1000 times)
    Kills,
    /// Very many starts (10000), each after a kill, sometimes of everything at once
    Starts,
    /// Processes of every kind crash in a loop
    Crashes,
    /// The recorder is killed over and over (1000 times)
    Records,
    /// What a consumer misses when the bridge is killed and started again (200 times)
    Gap,
    /// The serial port goes and comes back (200 times)
    Port,
    /// Subscribers that misbehave
    Subscribers,
    /// Groups of clients (20000) end at the same moment
    Clients,
    /// Clients send without a pause, while all orders are given (20 times)
    Flood,
    /// No bytes or files are left in shared memory
    Full,
    /// Another user makes very many files (200000) in shared memory
    ForeignFiles,
    /// Processes (2000) are stopped while they start
    Joiners,
    /// Process numbers (of 600 consumers), clocks and mounts of containers
    Namespaces,
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
    let Args { what, plan } = Args::parse();
    let options = match what {
        What::Full => Some(full::Lack::Inodes.mount_options()),
        What::ForeignFiles => Some(foreign_files::MOUNT_OPTIONS),
        _ => None,
    };
    match options {
        Some(options) if !memory::is_own() => {
            let args: Vec<_> = std::env::args().skip(1).collect();
            let status = memory::run_again(options, &args).expect("this program can be started");
            let is_good = status.is_none_or(|status| status.success());
            ExitCode::from(u8::from(!is_good))
        }
        _ => ExitCode::from(u8::from(!measure(what, &plan))),
    }
}

/// Measures and prints; false when something was not as it must be.
fn measure(what: What, plan: &Plan) -> bool {
    let termination = Termination::install().expect("signals");
    let goes_on = || !termination.requested();
    let this = std::env::current_exe().expect("this program has a path");
    let site = || {
        let ril = [this.as_os_str(), BE_RIL.as_ref()];
        Site::new(Sandbox::new(ril, "endurance", TIME_LIMIT), plan)
    };
    let (mut is_good, mut last_head) = (true, String::new());
    let mut show = |outcome: Outcome| {
        let head = outcome.head();
        if head != last_head {
            println!("{head}");
            last_head = head;
        }
        println!("{outcome}");
        is_good &= outcome.is_good();
    };
    match what {
        What::Kills => {
            let chosen = |kind: &Kind| plan.victim.is_none_or(|victim| victim == *kind);
            for victim in Kind::ALL.into_iter().filter(chosen) {
                if victim.is_possible() {
                    show(kills::run(&site(), plan, victim, &goes_on));
                }
            }
        }
        What::Starts => show(starts::run(&site(), plan, &goes_on)),
        What::Crashes => show(crashes::run(&site(), plan, &goes_on)),
        What::Records => {
            let readers = readers_or_skip("files of killed recorders");
            show(records::run(&site(), plan, &readers, &goes_on));
        }
        What::Gap => show(gap::run(&site(), plan, &goes_on)),
        What::Port => show(port::run(&site(), plan, &goes_on)),
        What::Subscribers => show(subscribers::run(&site(), plan, &goes_on)),
        What::Clients => show(clients::run(&site(), plan, &goes_on)),
        What::Flood => show(flood::run(&site(), plan, &goes_on)),
        What::Full => {
            for lack in [full::Lack::Bytes, full::Lack::Inodes] {
                show(full::run(&site(), lack));
            }
        }
        What::ForeignFiles => {
            show(foreign_files::run(&site(), plan));
            if let Some(outcome) = namespaces::other_users(&site()) {
                show(outcome);
            }
        }
        What::Joiners => show(joiners::run(&site(), plan, &goes_on)),
        What::Namespaces => {
            let numbers = namespaces::same_numbers(&site(), plan, &goes_on);
            let clocks = namespaces::other_clocks(&site());
            let mounts = namespaces::other_mounts(&site());
            [numbers, clocks, mounts]
                .into_iter()
                .flatten()
                .for_each(show);
        }
    }
    is_good
}
