//! Measures the figures of `docs/reliability.md` that need no process: missions, deliveries, random bytes, replays and
//! damaged frames, all of them in virtual time. Every mission is verified by replaying its journals. Prints the rows of
//! its table.
//!
//! ```sh
//! cargo run --release -p ril-tests --example figures -- missions [--seeds 0..10000] [--kind noise]
//! cargo run --release -p ril-tests --example figures -- delivery [--seeds 0..14000]
//! cargo run --release -p ril-tests --example figures -- boundaries [--seeds 0..100000]
//! cargo run --release -p ril-tests --example figures -- bytes [--bytes 1e9] [--seed 1]
//! cargo run --release -p ril-tests --example figures -- replay [--seconds 600]
//! cargo run --release -p ril-tests --example figures -- fleet [--robots 100] [--hours 24]
//! cargo run --release -p ril-tests --example figures -- undetected [--frames 1e8] [--seed 1] [--profile extended]
//! ```
//!
//! Equal seeds give equal figures. A failure prints its seed, and `--seeds 17` repeats it alone; the exit code is then
//! not 0. All cores are used.

// The tests use the rest of what they share with this program.
#![allow(dead_code)]

mod bytes;

#[path = "../../tests/fleet.rs"]
mod fleet;
#[path = "../../tests/missions/mod.rs"]
mod missions;
#[path = "../../tests/plausible.rs"]
mod plausible;

use std::ops::{AddAssign, Range};
use std::panic::catch_unwind;
use std::process::ExitCode;
use std::str::FromStr;
use std::thread;
use std::time::{Duration, Instant};

use bytes::heap::Counting;
use bytes::measure::{self as feed, Tally};
use bytes::undetected::damage::Damage;
use bytes::undetected::measure as damaged;
use clap::Parser;
use dsp_protocol::Profile;
use ipc_types::Topic;
use ipc_types::payload::SharedStruct;
use measure::{Measurement, Outcome, Table, named, row};
use missions::chance::{self, Seen};
use missions::config::WorldConfig;
use missions::operator::{Step, fly, triangle};
use missions::seeds::{self, sums};
use missions::world::World;
use missions::{boundaries, delivery};
use replay::Verifier;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// What a measurement is: it prints its rows.
type Measure = fn(&Plan, &mut Table);

/// All measurements.
#[rustfmt::skip]
const MEASUREMENTS: &[Measurement<Measure>] = &[
    row("missions", &[fly_missions as Measure], "Missions of chance, by seeds [default: 0..1000]"),
    row("delivery", &[|plan, _| sum(plan, 100, delivery::fly)],
        "Missions in which waypoints are lost, repeated and delayed, by seeds [default: 0..100]"),
    row("boundaries", &[|plan, _| sum(plan, 1_000, boundaries::fly_bounded)],
        "Flights along the boundaries of fences, by seeds [default: 0..1000]"),
    row("bytes", &[feed_bytes], "Random and damaged bytes into the decoders and the bridge's core"),
    row("replay", &[verify_flight], "How fast a recorded flight is verified, and how many bytes its journals have"),
    row("fleet", &[fly_fleet], "Many robots that one operator flies over and over"),
    row("undetected", &[damage_frames], "Damaged frames that a receiver takes for good ones"),
];

/// Measures the figures of `docs/reliability.md` that need no process
#[derive(Parser)]
struct Args {
    /// What to measure
    #[arg(value_parser = named(MEASUREMENTS))]
    what: &'static Measurement<Measure>,
    #[command(flatten)]
    plan: Plan,
}

/// How much of it; each measurement has options of its own.
#[derive(clap::Args)]
struct Plan {
    /// Seeds, such as `17` or `0..1000`
    #[arg(long, value_parser = range)]
    seeds: Option<Range<u64>>,
    /// Missions: one kind; all of them otherwise
    #[arg(long, value_parser = KINDS.map(|(name, ..)| name))]
    kind: Option<String>,
    /// Bytes: how many for each
    #[arg(long, value_parser = number, default_value = "1e8")]
    bytes: u64,
    /// Bytes and undetected: where chance begins
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Replay: how long the flight takes at least
    #[arg(long, value_parser = number, default_value = "600")]
    seconds: u64,
    /// Fleet: how many
    #[arg(long, default_value_t = 100)]
    robots: u32,
    /// Fleet: for how long
    #[arg(long, default_value_t = 24)]
    hours: u64,
    /// Undetected: damaged frames for each profile, spread over all kinds of damage
    #[arg(long, value_parser = number, default_value = "1e7")]
    frames: u64,
    /// Undetected: one profile; both otherwise
    #[arg(long, value_parser = Profile::ALL.map(Profile::name))]
    profile: Option<String>,
}

/// `17` or `17..20`.
fn range(text: &str) -> Result<Range<u64>, String> {
    seeds::parse(text).ok_or_else(|| "neither `17` nor `17..20`".to_owned())
}

/// A whole number; `1e9` is one too.
fn number(text: &str) -> Result<u64, String> {
    let value = f64::from_str(text).unwrap_or(-1.0);
    match value.fract() == 0.0 && (0.0..1e15).contains(&value) {
        true => Ok(value as u64),
        false => Err("no whole number below 1e15".to_owned()),
    }
}

fn main() -> ExitCode {
    let started = Instant::now();
    let Args { what, plan } = Args::parse();
    let mut table = Table::default();
    what.functions.iter().for_each(|run| run(&plan, &mut table));
    println!("\n{:.1} s", started.elapsed().as_secs_f64());
    ExitCode::from(u8::from(!table.is_good()))
}

/// Flies each seed, and prints what all of them saw. What fails panics, and names its seed.
fn sum<T: AddAssign + Default + Send + std::fmt::Display>(
    plan: &Plan,
    usual: u64,
    fly: fn(u64) -> T,
) {
    let seeds = plan.seeds.clone().unwrap_or(0..usual);
    println!("{}", seeds::fly_range(seeds, fly));
}

/// A mission of chance, by its seed.
type Fly = fn(u64) -> Seen;

/// The kinds of missions: name, what they are, and how one is flown.
#[rustfmt::skip]
const KINDS: [(&str, &str, Fly); 8] = [
    ("wind", "wind and noise of the sensors", chance::fly_in_wind),
    ("noise", "noise on the line", chance::fly_in_noise),
    ("reckless", "reckless operators, everything at once", chance::be_reckless),
    ("faults", "scripts of faults, bridges that are killed or end", chance::fly_through_faults),
    ("damaged", "a few bits damaged in both directions: every step is done", chance::fly_with_damaged_bytes),
    ("plans", "plans that change in mid-path: pre-emption, stops in silence, restarts, damaged bytes", chance::change_plans),
    ("fences", "geofences", chance::fly_fenced),
    ("slow", "slow status", chance::fly_with_slow_status),
];

sums! {
    /// What became of missions.
    pub struct Flown {
        /// What those saw in which nothing failed.
        pub good: Seen,
        /// How many failed.
        pub failed: u64,
    }
}

/// Flies missions of one kind or of all kinds with every seed; none may fail.
fn fly_missions(plan: &Plan, table: &mut Table) {
    let seeds = plan.seeds.clone().unwrap_or(0..1_000);
    let mut all = Flown::default();
    let is_chosen = |name: &str| plan.kind.as_deref().is_none_or(|only| only == name);
    let of = |name: &str, flown: &Flown| {
        let mut row = Outcome::default();
        row.cell("missions", name);
        row.cell("seeds", format!("{seeds:?}"));
        row.cell("flown", flown.good.missions + flown.failed);
        row.none("failed", flown.failed as usize);
        row
    };
    for (name, what, fly) in KINDS.into_iter().filter(|(name, ..)| is_chosen(name)) {
        let flown = seeds::fly_range(seeds.clone(), |seed| match catch_unwind(|| fly(seed)) {
            Ok(good) => Flown { good, failed: 0 },
            Err(_) => {
                eprintln!("failed: missions --kind {name} --seeds {seed}");
                Flown {
                    failed: 1,
                    ..Flown::default()
                }
            }
        });
        table.show(of(&format!("{name}: {what}"), &flown));
        all += flown;
    }
    let mut row = of("all", &all);
    row.note(format!("\n{}", all.good));
    table.show(row);
}

/// Flies a fleet, whose memory must not grow. What else fails panics.
fn fly_fleet(plan: &Plan, table: &mut Table) {
    let figures = fleet::fly(plan.robots, Duration::from_secs(3600 * plan.hours));
    let mut row = Outcome::default();
    row.cell("robots", figures.robots);
    row.cell("hours", plan.hours);
    row.cell("missions", figures.missions);
    row.cell("requests, all done", figures.requests);
    row.cell("samples", figures.samples);
    row.cell("growth in bytes", figures.growth_bytes);
    row.require(figures.growth_bytes == 0, "memory has grown");
    table.show(row);
}

/// Feeds decoders and core, none of which may grow.
fn feed_bytes(plan: &Plan, table: &mut Table) {
    type Feed = Box<dyn FnOnce() -> Tally + Send>;
    let (count, seed) = (plan.bytes, plan.seed);
    let all: Feed = Box::new(move || feed::decoders(count, seed));
    let mut runs = vec![("the four decoders".to_owned(), all)];
    for profile in Profile::ALL {
        let name = profile.name();
        let noise: Feed = Box::new(move || feed::core_in_noise(profile, count / 2, seed));
        let flights: Feed = Box::new(move || feed::core_in_flight(profile, count / 2, seed));
        runs.push((format!("bridge, {name}, noise"), noise));
        runs.push((format!("bridge, {name}, damaged flights"), flights));
    }
    thread::scope(|scope| {
        let start = |(name, feed): (String, Feed)| (name, scope.spawn(feed));
        let workers: Vec<_> = runs.into_iter().map(start).collect();
        for (name, worker) in workers {
            let mut row = Outcome::default();
            row.cell("into", &name);
            match worker.join() {
                Ok(tally) => {
                    row.cell("bytes", tally.bytes);
                    row.cell("messages or samples", tally.messages);
                    row.cell("refusals or requests", tally.others);
                    row.cell("waypoints", tally.waypoints);
                    row.cell("allocations", tally.heap.allocations);
                    row.cell("growth in bytes", tally.heap.live_bytes);
                    row.require(tally.heap.live_bytes == 0, "memory has grown");
                }
                Err(_) => row.require(false, "it has panicked"),
            }
            table.show(row);
        }
    });
}

/// Flies a path, hovers and lands, and verifies the journals, which must not differ.
fn verify_flight(plan: &Plan, table: &mut Table) {
    let mut world = World::new(&WorldConfig::new().wind(3.0, 200.0, 1.0));
    world.keep_journals();
    let steps = [
        Step::Start,
        Step::TakeOff(10.0),
        Step::Path(triangle()),
        Step::Wait(Duration::from_secs(plan.seconds)),
        Step::Land,
        Step::Stop,
    ];
    fly(&mut world, &steps);
    world.finish();
    let flown = world.now().as_secs_f64();
    let (bridge, status) = world.journals();
    table.show(verified("bridge", &bridge, flown));
    table.show(verified("status", &status, flown));
}

fn verified<P: Topic + SharedStruct>(name: &str, pieces: &[P], flown: f64) -> Outcome {
    let begin = Instant::now();
    let mut verifier = Verifier::new();
    for piece in pieces {
        verifier.take(P::KEY, piece.bytes());
    }
    let verdict = verifier.finish();
    let speed = flown / begin.elapsed().as_secs_f64();
    let bytes = verdict.bridge.bytes + verdict.status.bytes;
    let mut row = Outcome::default();
    row.cell("journal", name);
    let bytes_per_s = format!("{:.0}", bytes as f64 / flown);
    row.cell("bytes a second at 50 samples a second", bytes_per_s);
    row.cell("verified", format!("{speed:.0} times real time"));
    let difference = verdict.difference().map(|found| found.to_string());
    row.require(verdict.is_verified(), difference.unwrap_or_default());
    row
}

/// Damages frames in each way. None of the extended profile may be taken for good, and no good one behind a damaged one
/// may be lost.
fn damage_frames(plan: &Plan, table: &mut Table) {
    let is_chosen = |one: &Profile| plan.profile.as_ref().is_none_or(|name| name == one.name());
    for profile in Profile::ALL.into_iter().filter(is_chosen) {
        let mut total = damaged::Tally::default();
        let kinds = Damage::ALL.len() as u64;
        for (index, damage) in (0..).zip(Damage::ALL) {
            // What does not divide goes to the first kinds.
            let frames = plan.frames / kinds + u64::from(index < plan.frames % kinds);
            let seed = plan.seed.wrapping_add(index);
            let tally = damaged::measure(profile, damage, frames, seed);
            total += tally;
            table.show(damaged_row(profile, &damage.name(), &tally));
        }
        table.show(damaged_row(profile, "all", &total));
    }
}

/// What became of damaged frames: those that were hit; of them those with the bounds of a frame, so that their sum or
/// CRC was judged, and those whose sum or CRC was right; those that were taken for a message; of these, those with a
/// value that cannot be, which is not published; and good frames behind a damaged one that did not arrive.
fn damaged_row(profile: Profile, name: &str, tally: &damaged::Tally) -> Outcome {
    let one_in = match tally.accepted {
        0 => "-".to_owned(),
        accepted => format!("{:.0}", tally.damaged as f64 / accepted as f64),
    };
    let mut row = Outcome::default();
    row.cell("damage", format!("{name}, {}", profile.name()));
    row.cell("damaged", tally.damaged);
    row.cell("judged", tally.judged);
    row.cell("right check", tally.passed);
    row.cell("accepted", tally.accepted);
    row.cell("one in", one_in);
    row.cell("implausible", tally.implausible);
    row.none("next lost", tally.lost as usize);
    let is_safe = profile == Profile::Classic || tally.accepted == 0;
    row.require(is_safe, format!("{} taken for good", tally.accepted));
    row
}
