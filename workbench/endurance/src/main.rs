//! Measures what the processes of the RIL survive.
//!
//! ```sh
//! cargo build --release -p ril -p relay
//! cargo run --release -p endurance -- kills --victim bridge [--count 1000] [--seed 1]
//! cargo run --release -p endurance -- --help
//! ```
//!
//! `ril` lies beside this program, or `RIL_BINARY` names it. `full` and `foreign-files` have a `/dev/shm` of their own,
//! for which the program starts itself again in a mount namespace; so does `namespaces` for its consumers, and the
//! measurements of the relay have networks of their own. What the kernel forbids is skipped with a word.
//!
//! Each prints a table. The exit code is 1 when something was left or lost, or a promise was broken; a process that
//! does not come up, or telemetry that does not come again, ends the program with the reason. Ctrl+C ends a measurement
//! early and prints what there is. The same seed draws the same moments.

use std::process::ExitCode;
use std::sync::OnceLock;
use std::time::Duration;

use clap::{Parser, ValueEnum};
use endurance::field::{fleet, narrow, relays};
use endurance::outcome::Outcome;
use endurance::plan::{Kind, Plan};
use endurance::site::{Measure, Site};
use endurance::{attacks, crowds, kills, mavlink, port, power_cut, records, views};
use ril_tests::sandbox::beside_or_skip;
use runtime::signal::Termination;

/// A measurement that takes longer hangs.
const TIME_LIMIT: Duration = Duration::from_secs(4 * 3600);

/// Measures what the processes of the RIL survive
#[derive(Parser)]
struct Args {
    /// What to measure
    what: What,
    #[command(flatten)]
    plan: Plan,
}

#[derive(Clone, Copy, ValueEnum)]
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
    /// Power cuts: all states, or so many of them, in which one leaves records, logs and what is kept
    PowerCut,
    /// Processes (2000) are stopped while they start
    Joiners,
    /// Process numbers (of 600 consumers), clocks and mounts of containers
    Namespaces,
    /// Pages and clients of Foxglove, slow ones and hostile ones among them (60 s each)
    Views,
    /// Stations that speak MAVLink, missions over a bad line, and a flood of hostile datagrams (60 s each; 200
    /// commands)
    Mavlink,
    /// Relays: the operator's verbs at the station, through loss
    Mission,
    /// Relays: many requests (1000), through loss, outages and restarts of everything
    Requests,
    /// Relays: what comes after outages (20), and how old it is said to be
    Outages,
    /// Relays: how soon a station (12 times) is connected over a link with long round trips that loses much, over TCP
    /// and QUIC
    Connect,
    /// Relays: how soon orders (40) end over narrow links, and what comes of telemetry, over TCP and QUIC
    Narrow,
    /// Relays: what 1 to 100 robots cost and their station, with and without a router (15 s each)
    Fleet,
}

impl What {
    /// One after the other.
    fn measurements(self) -> Vec<Measure> {
        match self {
            What::Kills => vec![kills::run],
            What::Starts => vec![kills::starts],
            What::Crashes => vec![crowds::crashes],
            What::Records => vec![records::run],
            What::Gap => vec![kills::gap],
            What::Port => vec![port::run],
            What::Subscribers => vec![crowds::subscribers],
            What::Clients => vec![crowds::clients],
            What::Flood => vec![attacks::flood],
            What::Full => vec![attacks::no_bytes, attacks::no_files],
            What::ForeignFiles => vec![attacks::foreign_files, attacks::other_users],
            What::PowerCut => vec![power_cut::run],
            What::Joiners => vec![crowds::joiners],
            What::Namespaces => vec![
                attacks::same_numbers,
                attacks::other_clocks,
                attacks::other_mounts,
            ],
            What::Views => vec![views::run],
            What::Mavlink => vec![mavlink::run],
            What::Mission => vec![relays::mission],
            What::Requests => vec![relays::requests],
            What::Outages => vec![relays::outages],
            What::Connect => vec![relays::connect],
            What::Narrow => vec![narrow::run],
            What::Fleet => vec![fleet::run],
        }
    }

    /// Options of a `/dev/shm` of its own, if it needs one.
    fn own_memory(self) -> Option<&'static str> {
        match self {
            What::Full => Some(attacks::SMALL),
            What::ForeignFiles => Some(attacks::LARGE),
            _ => None,
        }
    }
}

static TERMINATION: OnceLock<Termination> = OnceLock::new();

fn main() -> ExitCode {
    let Args { what, mut plan } = Args::parse();
    if let Some(options) = what.own_memory().filter(|_| !attacks::is_own_memory()) {
        let args: Vec<_> = std::env::args().skip(1).collect();
        let status = attacks::run_again(options, &args).expect("this program can be started");
        return ExitCode::from(u8::from(status.is_some_and(|status| !status.success())));
    }
    let this = std::env::current_exe().expect("this program has a path");
    let Some(ril) = beside_or_skip(&this) else {
        return ExitCode::SUCCESS;
    };
    let _ = TERMINATION.set(Termination::install().expect("signals"));
    plan.is_over = Some(|| TERMINATION.get().is_some_and(Termination::requested));
    if matches!(what, What::Crashes | What::Starts) {
        Kind::possible();
    }
    let mut is_good = true;
    for measure in what.measurements() {
        let site = Site::new(&ril, "endurance", plan.clone(), TIME_LIMIT);
        measure(&site);
        is_good &= site.rows().iter().all(Outcome::is_good);
    }
    ExitCode::from(u8::from(!is_good))
}
