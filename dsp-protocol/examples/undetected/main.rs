//! Measures how many damaged frames a receiver takes for good ones, in both profiles (`docs/protocol.md` sections 10, 11).
//!
//! ```sh
//! cargo run --release -p dsp-protocol --example undetected -- [--frames N] [--seed N] [--profile NAME]
//! ```
//!
//! N damaged frames for each profile, spread over all kinds of damage; only frames that were really hit count. The same
//! seed gives the same figures. The exit code is 1 when a frame of the extended profile was taken for good, or when a
//! good frame behind a damaged one was lost.
//!
//! | column | content |
//! |---|---|
//! | damaged | frames that were hit |
//! | judged | what had the bounds of a frame afterwards, so that its sum or CRC was judged |
//! | right check | those whose sum or CRC was right all the same |
//! | accepted | those that also had no wrong padding or field, and were taken for a message |
//! | one in | damaged frames for one that was accepted |
//! | implausible | accepted messages with a value that cannot be, which is not published |
//! | next lost | good frames right behind a damaged one that did not arrive |

mod damage;
mod measure;
mod random;
mod traffic;

use std::fmt::Display;
use std::process::ExitCode;
use std::str::FromStr;
use std::time::Instant;

use dsp_protocol::Profile;

use damage::Damage;
use measure::{Tally, measure};

/// Damaged frames for each profile when nothing else is said: some seconds.
const FRAMES: u64 = 10_000_000;
const SEED: u64 = 1;

struct Args {
    frames: u64,
    seed: u64,
    profiles: Vec<Profile>,
}

impl Args {
    fn parse(mut words: impl Iterator<Item = String>) -> Result<Args, String> {
        let mut args = Args {
            frames: FRAMES,
            seed: SEED,
            profiles: Profile::ALL.to_vec(),
        };
        while let Some(option) = words.next() {
            let value = words.next().ok_or(format!("{option} wants a value"))?;
            match option.as_str() {
                "--frames" => args.frames = number(&value)?,
                "--seed" => args.seed = number(&value)?,
                "--profile" => {
                    let profile = Profile::from_name(&value);
                    args.profiles = vec![profile.ok_or(format!("{value} is no profile"))?];
                }
                _ => return Err(format!("{option} is no option")),
            }
        }
        Ok(args)
    }
}

/// A whole number; `1e8` is one too.
fn number(text: &str) -> Result<u64, String> {
    let float = f64::from_str(text).ok();
    let whole = float.filter(|value| value.fract() == 0.0 && (0.0..1e15).contains(value));
    whole
        .map(|value| value as u64)
        .ok_or(format!("{text} is no whole number below 1e15"))
}

fn main() -> ExitCode {
    match Args::parse(std::env::args().skip(1)) {
        Ok(args) => {
            let mut is_good = true;
            for profile in &args.profiles {
                let total = table(*profile, &args);
                is_good &= total.lost == 0;
                is_good &= *profile == Profile::Classic || total.accepted == 0;
            }
            ExitCode::from(u8::from(!is_good))
        }
        Err(reason) => {
            eprintln!("{reason}\nundetected [--frames N] [--seed N] [--profile classic|extended]");
            ExitCode::from(2)
        }
    }
}

/// Measures and prints one profile; gives the sum of all rows.
fn table(profile: Profile, args: &Args) -> Tally {
    println!("\n{} profile, seed {}\n", profile.name(), args.seed);
    row(&[
        &"damage",
        &"damaged",
        &"judged",
        &"right check",
        &"accepted",
        &"one in",
        &"implausible",
        &"next lost",
    ]);
    println!("|---|---:|---:|---:|---:|---:|---:|---:|");
    let started = Instant::now();
    let mut total = Tally::default();
    let kinds = Damage::ALL.len() as u64;
    for (index, damage) in (0..).zip(Damage::ALL) {
        // What does not divide goes to the first kinds.
        let frames = args.frames / kinds + u64::from(index < args.frames % kinds);
        let tally = measure(profile, damage, frames, args.seed.wrapping_add(index));
        total += tally;
        tell(&damage.name(), &tally);
    }
    tell("all", &total);
    println!("\n{:.1} s", started.elapsed().as_secs_f64());
    total
}

fn tell(name: &str, tally: &Tally) {
    let one_in = match tally.accepted {
        0 => "-".to_owned(),
        accepted => format!("{:.0}", tally.damaged as f64 / accepted as f64),
    };
    row(&[
        &name,
        &tally.damaged,
        &tally.judged,
        &tally.passed,
        &tally.accepted,
        &one_in,
        &tally.implausible,
        &tally.lost,
    ]);
}

fn row(cells: &[&dyn Display; 8]) {
    let cells = cells.map(|cell| cell.to_string());
    println!("| {} |", cells.join(" | "));
}
