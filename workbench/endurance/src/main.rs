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

use clap::Parser;
use endurance::field::{fleet, narrow, relays};
use endurance::plan::Plan;
use endurance::site::{Measure, Site};
use endurance::{attacks, crowds, kills, mavlink, port, power_cut, records, senders, views};
use measure::{Measurement, Outcome, named, row};
use ril_tests::sandbox::beside_or_skip;
use runtime::exit;
use runtime::signal::Termination;

/// A measurement that takes longer hangs.
const TIME_LIMIT: Duration = Duration::from_secs(4 * 3600);

/// Measures what the processes of the RIL survive
#[derive(Parser)]
struct Args {
    /// What to measure
    #[arg(value_parser = named(MEASUREMENTS))]
    what: &'static Measurement<Measure>,
    #[command(flatten)]
    plan: Plan,
}

/// All measurements. Those whose `/dev/shm` must be their own are in [`own_memory`], too.
#[rustfmt::skip]
const MEASUREMENTS: &[Measurement<Measure>] = &[
    row("kills", &[kills::run], "Each kind of process is killed over and over (1000 times)"),
    row("starts", &[kills::starts], "Very many starts (10000), each after a kill, sometimes of everything at once"),
    row("crashes", &[crowds::crashes], "Processes of every kind crash in a loop"),
    row("records", &[records::run], "The recorder is killed over and over (1000 times)"),
    row("senders", &[senders::run],
        "Who has ordered a path is killed or stopped (1000 times), in each language: it hovers, and no other order is touched"),
    row("gap", &[kills::gap], "What a consumer misses when the bridge is killed and started again (200 times)"),
    row("port", &[port::run], "The serial port goes and comes back (200 times)"),
    row("subscribers", &[crowds::subscribers], "Subscribers that misbehave"),
    row("clients", &[crowds::clients], "Groups of clients (20000) end at the same moment"),
    row("flood", &[attacks::flood], "Clients send without a pause, while all orders are given (20 times)"),
    row("full", &[attacks::no_bytes, attacks::no_files], "No bytes or files are left in shared memory"),
    row("foreign-files", &[attacks::foreign_files, attacks::other_users],
        "Another user makes very many files (200000) in shared memory"),
    row("power-cut", &[power_cut::run],
        "Power cuts: all states, or so many of them, in which one leaves records, logs and what is kept"),
    row("joiners", &[crowds::joiners], "Processes (2000) are stopped while they start"),
    row("namespaces", &[attacks::same_numbers, attacks::other_clocks, attacks::other_mounts],
        "Process numbers (of 600 consumers), clocks and mounts of containers"),
    row("views", &[views::run], "Pages and clients of Foxglove, slow ones and hostile ones among them (60 s each)"),
    row("mavlink", &[mavlink::run],
        "Stations that speak MAVLink, missions over a bad line, and a flood of hostile datagrams (60 s each; 200 commands)"),
    row("mission", &[relays::mission], "Relays: the operator's verbs at the station, through loss"),
    row("requests", &[relays::requests],
        "Relays: many requests (1000), through loss, outages and restarts of everything"),
    row("outages", &[relays::outages], "Relays: what comes after outages (20), and how old it is said to be"),
    row("connect", &[relays::connect],
        "Relays: how soon a station (12 times) is connected over a link with long round trips that loses much, over TCP and QUIC"),
    row("narrow", &[narrow::run],
        "Relays: how soon orders (40) end over narrow links, and what comes of telemetry, over TCP and QUIC"),
    row("roam", &[narrow::roam],
        "Relays: how long all telemetry is missed when round trips rise by 0.4 and 0.5 s for good, without loss, and fall again"),
    row("fleet", &[fleet::run],
        "Relays: what 1 to 100 robots cost and their station, with and without a router (15 s each)"),
];

/// Options of a `/dev/shm` of its own, if a measurement needs one.
fn own_memory(name: &str) -> Option<&'static str> {
    match name {
        "full" => Some(attacks::SMALL),
        "foreign-files" => Some(attacks::LARGE),
        _ => None,
    }
}

static TERMINATION: OnceLock<Termination> = OnceLock::new();

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    if words.first().is_some_and(|word| word == senders::AS_MODULE) {
        return exit::main_with(|| senders::be_module(&words));
    }
    let Args { what, mut plan } = Args::parse();
    if let Some(options) = own_memory(what.name).filter(|_| !attacks::is_own_memory()) {
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
    let mut is_good = true;
    for measure in what.functions {
        let site = Site::new(&ril, "endurance", plan.clone(), TIME_LIMIT);
        measure(&site);
        is_good &= site.rows().iter().all(Outcome::is_good);
    }
    ExitCode::from(u8::from(!is_good))
}
