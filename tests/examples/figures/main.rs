//! Measures the figures of `docs/reliability.md` that need no process: missions, deliveries, random bytes, replays and
//! damaged frames, all of them in virtual time. Every mission is verified by replaying its journals. Prints the rows of
//! its table.
//!
//! ```sh
//! cargo run --release -p ril-tests --example figures -- missions [--seeds 0..10000] [--kind noise]
//! cargo run --release -p ril-tests --example figures -- delivery [--seeds 0..14000]
//! cargo run --release -p ril-tests --example figures -- boundaries [--seeds 0..100000]
//! cargo run --release -p ril-tests --example figures -- orders [--seeds 0..100000]
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
mod frames;
mod replays;

#[path = "../../tests/fleet.rs"]
mod fleet;
#[path = "../../tests/missions/mod.rs"]
mod missions;
#[path = "../../tests/plausible.rs"]
mod plausible;

use std::ops::Range;
use std::panic::catch_unwind;
use std::process::ExitCode;
use std::str::FromStr;
use std::thread;
use std::time::{Duration, Instant};

use bytes::heap::Counting;
use bytes::measure::{self, Tally};
use clap::Parser;
use dsp_protocol::Profile;
use missions::boundaries;
use missions::chance::{self, Seen};
use missions::delivery;
use missions::machine;
use missions::seeds::{self, sums};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Measures the figures of `docs/reliability.md` that need no process
#[derive(Parser)]
enum Measure {
    /// Missions of chance
    Missions {
        /// Seeds, such as `17` or `0..1000`
        #[arg(long, value_parser = range, default_value = "0..1000")]
        seeds: Range<u64>,
        /// One kind of missions; all of them otherwise
        #[arg(long, value_parser = KINDS.map(|(name, ..)| name))]
        kind: Option<String>,
    },
    /// Missions in which waypoints are lost, repeated and delayed
    Delivery {
        /// Seeds, such as `17` or `0..100`
        #[arg(long, value_parser = range, default_value = "0..100")]
        seeds: Range<u64>,
    },
    /// Flights along the boundaries of fences
    Boundaries {
        /// Seeds, such as `17` or `0..100`
        #[arg(long, value_parser = range, default_value = "0..1000")]
        seeds: Range<u64>,
    },
    /// Runs of the order machine: orders of several senders while everything goes wrong
    Orders {
        /// Seeds, such as `17` or `0..100`
        #[arg(long, value_parser = range, default_value = "0..10000")]
        seeds: Range<u64>,
    },
    /// Random and damaged bytes into the decoders and the bridge's core
    Bytes {
        /// How many for each
        #[arg(long, value_parser = number, default_value = "1e8")]
        bytes: u64,
        #[arg(long, default_value_t = 1)]
        seed: u64,
    },
    /// How fast a recorded flight is verified
    Replay {
        /// How long the flight takes at least
        #[arg(long, value_parser = number, default_value = "600")]
        seconds: u64,
    },
    /// Many robots that one operator flies over and over
    Fleet {
        /// How many
        #[arg(long, default_value_t = 100)]
        robots: u32,
        /// For how long
        #[arg(long, default_value_t = 24)]
        hours: u64,
    },
    /// Damaged frames that a receiver takes for good ones
    Undetected {
        /// Damaged frames for each profile, spread over all kinds of damage
        #[arg(long, value_parser = number, default_value = "1e7")]
        frames: u64,
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// One profile; both otherwise
        #[arg(long, value_parser = Profile::ALL.map(Profile::name))]
        profile: Option<String>,
    },
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
    let is_good = match Measure::parse() {
        Measure::Missions { seeds, kind } => missions(&seeds, kind.as_deref()),
        Measure::Delivery { seeds } => deliveries(seeds),
        Measure::Boundaries { seeds } => {
            println!("{}", seeds::fly_range(seeds, boundaries::fly_bounded));
            true
        }
        Measure::Orders { seeds } => {
            println!("{}", seeds::fly_range(seeds, machine::play_seed));
            true
        }
        Measure::Bytes { bytes, seed } => random_bytes(bytes, seed),
        Measure::Replay { seconds } => replays::measure(seconds),
        Measure::Fleet { robots, hours } => fly_fleet(robots, hours),
        Measure::Undetected {
            frames,
            seed,
            profile,
        } => {
            let is_chosen = |one: &Profile| profile.as_ref().is_none_or(|name| name == one.name());
            let profiles = Profile::ALL.into_iter().filter(is_chosen);
            // All are measured, whatever the first one gives.
            let good: Vec<bool> = profiles
                .map(|profile| frames::measure(profile, frames, seed))
                .collect();
            good.into_iter().all(|is_good| is_good)
        }
    };
    println!("\n{:.1} s", started.elapsed().as_secs_f64());
    ExitCode::from(u8::from(!is_good))
}

/// A mission of chance, by its seed.
type Fly = fn(u64) -> Seen;

/// The kinds of missions: name, what they are, and how one is flown.
const KINDS: [(&str, &str, Fly); 8] = [
    ("wind", "wind and noise of the sensors", chance::fly_in_wind),
    ("noise", "noise on the line", chance::fly_in_noise),
    (
        "reckless",
        "reckless operators, everything at once",
        chance::be_reckless,
    ),
    (
        "faults",
        "scripts of faults, bridges that are killed or end",
        chance::fly_through_faults,
    ),
    (
        "damaged",
        "a few bits damaged in both directions: every step is done",
        chance::fly_with_damaged_bytes,
    ),
    (
        "plans",
        "plans that change in mid-path: pre-emption, stops in silence, restarts, damaged bytes",
        chance::change_plans,
    ),
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

/// Flies missions of one kind or of all kinds with every seed; false when one has failed.
fn missions(seeds: &Range<u64>, only: Option<&str>) -> bool {
    println!("| missions | seeds | flown | failed |\n|---|---|---:|---:|");
    let mut sum = Flown::default();
    for (name, what, fly) in KINDS {
        if only.is_some_and(|only| only != name) {
            continue;
        }
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
        let count = flown.good.missions + flown.failed;
        println!(
            "| {name}: {what} | {seeds:?} | {count} | {} |",
            flown.failed
        );
        sum += flown;
    }
    println!(
        "| all | | {} | {} |\n\n{}",
        sum.good.missions + sum.failed,
        sum.failed,
        sum.good
    );
    sum.failed == 0
}

/// Flies the missions of the delivery row. What fails panics.
fn deliveries(seeds: Range<u64>) -> bool {
    let figures = seeds::fly_range(seeds, delivery::fly);
    println!("{figures}");
    true
}

/// Flies a fleet; false when its memory has grown. What else fails panics.
fn fly_fleet(robots: u32, hours: u64) -> bool {
    let figures = fleet::fly(robots, Duration::from_secs(3600 * hours));
    println!("| robots | hours | missions | requests, all done | samples | growth in bytes |");
    println!("|---:|---:|---:|---:|---:|---:|");
    let fleet::Figures {
        robots,
        missions,
        requests,
        samples,
        growth_bytes,
    } = figures;
    println!("| {robots} | {hours} | {missions} | {requests} | {samples} | {growth_bytes} |");
    growth_bytes == 0
}

/// Feeds decoders and core; false when one of them has grown.
fn random_bytes(count: u64, seed: u64) -> bool {
    type Feed = Box<dyn FnOnce() -> Tally + Send>;
    let mut runs: Vec<(String, Feed)> = vec![(
        "the four decoders".to_owned(),
        Box::new(move || measure::decoders(count, seed)),
    )];
    for profile in Profile::ALL {
        let name = profile.name();
        runs.push((
            format!("bridge, {name}, noise"),
            Box::new(move || measure::core_in_noise(profile, count / 2, seed)),
        ));
        runs.push((
            format!("bridge, {name}, damaged flights"),
            Box::new(move || measure::core_in_flight(profile, count / 2, seed)),
        ));
    }
    println!(
        "| into | bytes | messages or samples | refusals or requests | waypoints | allocations | growth in bytes |"
    );
    println!("|---|---:|---:|---:|---:|---:|---:|");
    let mut is_good = true;
    thread::scope(|scope| {
        let workers: Vec<_> = runs
            .into_iter()
            .map(|(name, feed)| (name, scope.spawn(feed)))
            .collect();
        for (name, worker) in workers {
            let Ok(tally) = worker.join() else {
                is_good = false;
                continue;
            };
            let Tally {
                bytes,
                heap,
                messages,
                others,
                waypoints,
            } = tally;
            println!(
                "| {name} | {bytes} | {messages} | {others} | {waypoints} | {} | {} |",
                heap.allocations, heap.live_bytes
            );
            is_good &= heap.live_bytes == 0;
        }
    });
    is_good
}
