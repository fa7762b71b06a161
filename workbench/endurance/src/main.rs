//! Measures what the processes of the RIL survive.
//!
//! ```sh
//! cargo build --release -p ril -p relay
//! cargo run --release -p endurance -- kills --victim bridge [--count 1000] [--seed 1]
//! cargo run --release -p endurance -- --help
//! ```
//!
//! `ril` lies beside this program, or `RIL_BINARY` names it. `full` and `foreign-files` have a `/dev/shm` of their own, for which the
//! program starts itself again in a mount namespace; so does `namespaces` for its consumers, and the measurements of the relay have
//! networks of their own. What the kernel forbids is skipped with a word.
//!
//! Each prints a table. The exit code is 1 when something was left or lost, or a promise was broken; a process that does not come up, or
//! telemetry that does not come again, ends the program with the reason. Ctrl+C ends a measurement early and prints what there is. The
//! same seed draws the same moments.

use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

use clap::{Parser, ValueEnum};
use endurance::field::fleet::{self, Fleet};
use endurance::field::narrow::{self, Narrow};
use endurance::outcome::Outcome;
use endurance::plan::{Kind, Plan};
use endurance::site::Site;
use endurance::*;
use ril_tests::Sandbox;
use ril_tests::air::Weather;
use ril_tests::readers::readers_or_skip;
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
    /// Packets that are lost, percent [default: mission 10, requests and connect 20, outages and narrow 0]
    #[arg(long, value_parser = clap::value_parser!(u8).range(0..=90))]
    loss: Option<u8>,
    /// How long an outage lasts, s
    #[arg(long, default_value = "10")]
    outage_s: u64,
    /// Protocol between the relays: tcp, udp, tls or quic, with certificates that are made for it [default: tcp; narrow and connect
    /// take tcp and quic]
    #[arg(long)]
    over: Option<String>,
    /// Narrow: a link of this rate alone, kbit/s
    #[arg(long, value_parser = clap::value_parser!(u32).range(8..=100_000))]
    kbit_per_s: Option<u32>,
    /// Narrow with a rate, and connect: round trip of the link, ms [default: narrow 200, connect 600]
    #[arg(long, value_parser = clap::value_parser!(u32).range(..=10_000))]
    round_trip_ms: Option<u32>,
    #[command(flatten)]
    fleet: FleetArgs,
}

/// Of `fleet`
#[derive(clap::Args)]
struct FleetArgs {
    /// Fleet: how many robots, one row for each number and topology
    #[arg(long, value_delimiter = ',', default_values_t = [1, 5, 10, 20, 50, 100],
          value_parser = clap::value_parser!(u32).range(1..=400))]
    robots: Vec<u32>,
    /// Fleet: how many of the robots are whole; the others are played by this program
    #[arg(long, default_value = "3")]
    whole: u32,
    /// Fleet: samples of each kind of telemetry a second, of each robot
    #[arg(long, default_value = "10", value_parser = clap::value_parser!(u32).range(1..=50))]
    rate_hz: u32,
    /// Fleet: how many stations have all robots
    #[arg(long, default_value = "1", value_parser = clap::value_parser!(u32).range(1..=8))]
    stations: u32,
    /// Fleet: robots of one relay of a station, which starts as many relays as it takes
    #[arg(long, default_value = "32", value_parser = clap::value_parser!(u32).range(1..))]
    per_relay: u32,
    /// Fleet: how robots and station connect [default: both, one after the other]
    #[arg(long, value_parser = fleet::TOPOLOGIES)]
    through: Option<String>,
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
    /// Power cuts: all states, or so many of them, in which one leaves records, logs and what is kept
    PowerCut,
    /// Processes (2000) are stopped while they start
    Joiners,
    /// Process numbers (of 600 consumers), clocks and mounts of containers
    Namespaces,
    /// Pages and clients of Foxglove, slow ones and hostile ones among them (60 s each)
    Views,
    /// Stations that speak MAVLink, missions over a bad line, and a flood of hostile datagrams (60 s each; 200 commands)
    Mavlink,
    /// Relays: the operator's verbs at the station, through loss
    Mission,
    /// Relays: many requests (1000), through loss, outages and restarts of everything
    Requests,
    /// Relays: what comes after outages (20), and how old it is said to be
    Outages,
    /// Relays: how soon a station (12 times) is connected over a link with long round trips that loses much, over TCP and QUIC
    Connect,
    /// Relays: how soon orders (40) end over narrow links, and what comes of telemetry, over TCP and QUIC
    Narrow,
    /// Relays: what 1 to 100 robots cost and their station, with and without a router (15 s each)
    Fleet,
}

impl Args {
    /// One way of the link, whose round trip takes `usual_ms` unless another one was given.
    fn one_way(&self, usual_ms: u32) -> Duration {
        Duration::from_millis(self.round_trip_ms.unwrap_or(usual_ms).into()) / 2
    }

    fn protocols(&self) -> Vec<&str> {
        match &self.over {
            Some(protocol) => vec![protocol.as_str()],
            None => narrow::PROTOCOLS.to_vec(),
        }
    }
}

fn main() -> ExitCode {
    let args = Args::parse();
    let options = match args.what {
        What::Full => Some(full::Lack::Inodes.mount_options()),
        What::ForeignFiles => Some(foreign_files::MOUNT_OPTIONS),
        _ => None,
    };
    if let Some(options) = options.filter(|_| !memory::is_own()) {
        let args: Vec<_> = std::env::args().skip(1).collect();
        let status = memory::run_again(options, &args).expect("this program can be started");
        return ExitCode::from(u8::from(status.is_some_and(|status| !status.success())));
    }
    let this = std::env::current_exe().expect("this program has a path");
    let Some(ril) = beside_or_skip(&this) else {
        return ExitCode::SUCCESS;
    };
    let termination = Termination::install().expect("signals");
    let (mut is_good, mut last_head) = (true, String::new());
    measure(&args, &ril, &|| !termination.requested(), |outcome| {
        let head = outcome.head();
        if head != last_head {
            println!("{head}");
            last_head = head;
        }
        println!("{outcome}");
        is_good &= outcome.is_good();
    });
    ExitCode::from(u8::from(!is_good))
}

/// Measures, and shows each row of the table.
fn measure(args: &Args, ril: &Path, goes_on: &dyn Fn() -> bool, mut show: impl FnMut(Outcome)) {
    let plan = &args.plan;
    let site = || Site::new(Sandbox::new([ril], "endurance", TIME_LIMIT), plan);
    match args.what {
        What::Kills => {
            let chosen = |kind: &Kind| plan.victim.is_none_or(|victim| victim == *kind);
            for victim in Kind::ALL.into_iter().filter(chosen) {
                if victim.is_possible() {
                    show(kills::run(&site(), plan, victim, goes_on));
                }
            }
        }
        What::Starts => show(starts::run(&site(), plan, goes_on)),
        What::Crashes => show(crashes::run(&site(), plan, goes_on)),
        What::Records => {
            let readers = readers_or_skip("files of killed recorders");
            show(records::run(&site(), plan, &readers, goes_on));
        }
        What::Gap => show(gap::run(&site(), plan, goes_on)),
        What::Port => show(port::run(&site(), plan, goes_on)),
        What::Subscribers => show(subscribers::run(&site(), plan, goes_on)),
        What::Clients => show(clients::run(&site(), plan, goes_on)),
        What::Flood => show(flood::run(&site(), plan, goes_on)),
        What::Full => {
            for lack in [full::Lack::Bytes, full::Lack::Inodes] {
                show(full::run(&site(), lack));
            }
        }
        What::ForeignFiles => {
            show(foreign_files::run(&site(), plan));
            namespaces::other_users(&site()).into_iter().for_each(show);
        }
        What::PowerCut => match power_cut::run(&site(), plan, goes_on) {
            Ok(outcome) => show(outcome),
            Err(reason) => eprintln!("SKIPPED: {reason}"),
        },
        What::Joiners => show(joiners::run(&site(), plan, goes_on)),
        What::Namespaces => {
            let numbers = namespaces::same_numbers(&site(), plan, goes_on);
            let clocks = namespaces::other_clocks(&site());
            let mounts = namespaces::other_mounts(&site());
            let outcomes = [numbers, clocks, mounts];
            outcomes.into_iter().flatten().for_each(show);
        }
        What::Narrow => measure_narrow(args, ril, goes_on, show),
        What::Fleet => measure_fleets(args, ril, goes_on, show),
        What::Views => views::run(&site(), plan, goes_on, &mut show),
        What::Mavlink => mavlink::run(&site(), plan, goes_on, &mut show),
        What::Mission | What::Requests | What::Outages | What::Connect => {
            let protocols = match args.what {
                What::Connect => args.protocols(),
                _ => vec![args.over.as_deref().unwrap_or("tcp")],
            };
            for protocol in protocols {
                match measure_relays(args, ril, protocol, goes_on) {
                    Ok(outcome) => show(outcome),
                    Err(reason) => return eprintln!("SKIPPED: {reason}"),
                }
            }
        }
    }
}

/// Measures relays on narrow links, one after the other.
fn measure_narrow(
    args: &Args,
    ril: &Path,
    goes_on: &dyn Fn() -> bool,
    mut show: impl FnMut(Outcome),
) {
    let delay = args.one_way(200);
    let links = match args.kbit_per_s {
        Some(kbit_per_s) => vec![(kbit_per_s, delay)],
        None => narrow::LINKS.to_vec(),
    };
    let protocols = args.protocols();
    let links = links.into_iter();
    let cases = links.flat_map(|link| protocols.iter().map(move |protocol| (link, *protocol)));
    for ((kbit_per_s, delay), protocol) in cases {
        if goes_on() {
            let narrow = Narrow {
                ril,
                protocol,
                kbit_per_s,
                delay,
                lost_of: args
                    .loss
                    .filter(|loss| *loss > 0)
                    .map(|loss| 100 / usize::from(loss)),
                orders: args.plan.count.unwrap_or(40),
                limit: TIME_LIMIT,
            };
            show(narrow::run(&narrow, goes_on));
        }
    }
}

/// Measures fleets, one after the other.
fn measure_fleets(
    args: &Args,
    ril: &Path,
    goes_on: &dyn Fn() -> bool,
    mut show: impl FnMut(Outcome),
) {
    let FleetArgs {
        robots,
        whole,
        rate_hz,
        stations,
        per_relay,
        through,
    } = &args.fleet;
    for topology in fleet::TOPOLOGIES {
        let is_chosen = through.as_ref().is_none_or(|chosen| chosen == topology);
        for robots in robots.iter().filter(|_| is_chosen) {
            if goes_on() {
                show(fleet::run(&Fleet {
                    ril,
                    robots: *robots,
                    whole: *whole,
                    rate_hz: *rate_hz,
                    through: topology,
                    stations: *stations,
                    per_relay: *per_relay,
                    duration: args.plan.duration(15),
                    limit: TIME_LIMIT,
                }));
            }
        }
    }
}

/// Measures relays on a bad link. An error is why this machine cannot do it.
fn measure_relays(
    args: &Args,
    ril: &Path,
    protocol: &str,
    goes_on: &dyn Fn() -> bool,
) -> Result<Outcome, String> {
    let (name, usual_loss) = match args.what {
        What::Mission => ("mission", 10),
        What::Requests => ("requests", 20),
        What::Connect => ("connect", 20),
        _ => ("outages", 0),
    };
    let plan = field::site::Plan {
        name,
        ril: ril.to_owned(),
        protocol: protocol.to_owned(),
        weather: Weather::far(match args.what {
            What::Connect => args.one_way(600),
            _ => Duration::ZERO,
        }),
        loss: f64::from(args.loss.unwrap_or(usual_loss)) / 100.0,
        limit: TIME_LIMIT,
        seed: args.plan.seed,
    };
    let count = |usual| args.plan.count.unwrap_or(usual);
    match args.what {
        What::Mission => field::mission::run(&plan),
        What::Requests => field::requests::run(&plan, count(1000), goes_on),
        What::Connect => field::connect::run(&plan, count(12), goes_on),
        _ => {
            let outage = Duration::from_secs(args.outage_s);
            field::outages::run(&plan, count(20), outage, goes_on)
        }
    }
}
