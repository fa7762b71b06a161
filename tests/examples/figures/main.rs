//! Measures the figures of `docs/reliability.md` that need no process: missions, deliveries, random bytes and replays,
//! all of them in virtual time. Every mission is verified by replaying its journals. Prints the rows of its table.
//!
//! ```sh
//! cargo run --release -p ril-tests --example figures -- missions [--seeds 0..10000] [--kind noise]
//! cargo run --release -p ril-tests --example figures -- delivery [--seeds 0..14000]
//! cargo run --release -p ril-tests --example figures -- bytes [--bytes 1e9] [--seed 1]
//! cargo run --release -p ril-tests --example figures -- replay [--seconds 600]
//! ```
//!
//! The same seeds give the same figures. A failure prints its seed, and `--seeds 17` repeats it alone; the exit code is
//! then not 0. All cores are used.

// The tests use the rest of what they share with this program.
#![allow(dead_code)]

mod bytes;
mod replays;

#[path = "../../tests/missions/buffer.rs"]
mod buffer;
#[path = "../../tests/missions/chain.rs"]
mod chain;
#[path = "../../tests/missions/chance.rs"]
mod chance;
#[path = "../../tests/missions/config.rs"]
mod config;
#[path = "../../tests/missions/delivery.rs"]
mod delivery;
#[path = "../../tests/missions/dice.rs"]
mod dice;
#[path = "../../tests/missions/operator.rs"]
mod operator;
#[path = "../../tests/missions/plausible.rs"]
mod plausible;
#[path = "../../tests/missions/recording.rs"]
mod recording;
#[path = "../../tests/missions/seeds.rs"]
mod seeds;
#[path = "../../tests/missions/truth.rs"]
mod truth;
#[path = "../../tests/missions/wire.rs"]
mod wire;
#[path = "../../tests/missions/witness.rs"]
mod witness;
#[path = "../../tests/missions/world.rs"]
mod world;

use std::ops::{AddAssign, Range};
use std::panic::catch_unwind;
use std::process::ExitCode;
use std::str::FromStr;
use std::thread;
use std::time::Instant;

use bytes::heap::Counting;
use bytes::measure::{self, Tally};
use chance::Seen;
use dsp_protocol::Profile;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const USAGE: &str = "figures missions [--seeds FIRST..END] [--kind KIND]\nfigures delivery [--seeds FIRST..END]\n\
     figures bytes [--bytes N] [--seed N]\nfigures replay [--seconds N]";

/// What is to be measured.
enum Measure {
    Missions {
        seeds: Range<u64>,
        kind: Option<String>,
    },
    Delivery(Range<u64>),
    Bytes {
        count: u64,
        seed: u64,
    },
    Replay {
        seconds: u64,
    },
}

impl Measure {
    fn parse(mut words: impl Iterator<Item = String>) -> Result<Measure, String> {
        let what = words.next().ok_or("nothing to measure")?;
        let (mut seeds, mut kind, mut count, mut seed) = (None, None, 100_000_000, 1);
        let mut seconds = 600;
        while let Some(option) = words.next() {
            let value = words.next().ok_or(format!("{option} wants a value"))?;
            let bad = || format!("{value} is no value of {option}");
            match option.as_str() {
                "--seeds" => seeds = Some(seeds::parse(&value).ok_or_else(bad)?),
                "--kind" => {
                    let is_known = KINDS.iter().any(|(name, ..)| *name == value);
                    kind = Some(is_known.then(|| value.clone()).ok_or_else(bad)?);
                }
                "--bytes" => count = number(&value).ok_or_else(bad)?,
                "--seconds" => seconds = number(&value).ok_or_else(bad)?,
                "--seed" => seed = number(&value).ok_or_else(bad)?,
                _ => return Err(format!("{option} is no option")),
            }
        }
        match what.as_str() {
            "missions" => Ok(Measure::Missions {
                seeds: seeds.unwrap_or(0..1_000),
                kind,
            }),
            "delivery" => Ok(Measure::Delivery(seeds.unwrap_or(0..100))),
            "bytes" => Ok(Measure::Bytes { count, seed }),
            "replay" => Ok(Measure::Replay { seconds }),
            _ => Err(format!("{what} is nothing to measure")),
        }
    }
}

/// A whole number; `1e9` is one too.
fn number(text: &str) -> Option<u64> {
    let value = f64::from_str(text).ok()?;
    (value.fract() == 0.0 && (0.0..1e15).contains(&value)).then_some(value as u64)
}

fn main() -> ExitCode {
    let started = Instant::now();
    let is_good = match Measure::parse(std::env::args().skip(1)) {
        Ok(Measure::Missions { seeds, kind }) => missions(&seeds, kind.as_deref()),
        Ok(Measure::Delivery(seeds)) => deliveries(seeds),
        Ok(Measure::Bytes { count, seed }) => random_bytes(count, seed),
        Ok(Measure::Replay { seconds }) => replays::measure(seconds),
        Err(reason) => {
            eprintln!("{reason}\n{USAGE}");
            return ExitCode::from(2);
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

/// What became of missions.
#[derive(Clone, Copy, Default)]
struct Flown {
    good: Seen,
    failed: u64,
}

impl AddAssign for Flown {
    fn add_assign(&mut self, other: Flown) {
        self.good += other.good;
        self.failed += other.failed;
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
        "| into | bytes | messages or samples | refusals or requests | allocations | growth in bytes |"
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
