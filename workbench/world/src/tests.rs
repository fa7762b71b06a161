//! The short form: a thousand seeds, and every planted fault.

use crate::missions::seeds;
use crate::plant::{PLANTS, Plant};
use crate::script::Script;
use crate::world::{play, play_seed};

#[test]
fn whatever_happens_in_the_one_world_every_promise_is_kept() {
    let ran = seeds::fly_each(0..1000, play_seed);
    println!("{ran}");
    if ran.runs >= 1000 {
        let orders = [
            ran.began,
            ran.superseded,
            ran.too_late,
            ran.lost,
            ran.take_offs,
        ];
        assert!(orders.iter().all(|count| *count > 0), "{ran}");
        let others = [
            ran.copies,
            ran.restarts,
            ran.steps,
            ran.sleeps,
            ran.at_stations,
            ran.samples,
        ];
        assert!(others.iter().all(|count| *count > 0), "{ran}");
    }
}

/// Seeds beyond the first thousand in which a promise was broken once, or a judge was.
const ONCE_BROKEN: [u64; 10] = [
    3_927, 5_639, 10_017, 11_253, 17_906, 18_551, 23_277, 38_812, 39_918, 40_059,
];

#[test]
fn what_was_broken_once_is_not_any_more() {
    for seed in ONCE_BROKEN {
        play_seed(seed);
    }
}

#[test]
fn the_world_finds_what_is_planted_and_makes_it_short() {
    let only = std::env::var("RIL_PLANT").unwrap_or_default();
    let missed: Vec<String> = PLANTS
        .iter()
        .filter(|(plant, ..)| only.is_empty() || only == format!("{plant:?}"))
        .filter_map(|(plant, seed, promise)| {
            let found = find(*plant, *seed).err()?;
            Some(format!("{plant:?}, {promise}: {found}"))
        })
        .collect();
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}

/// Looks for a run in which the planted fault breaks something, first in that of a seed that did so once, and makes it
/// short.
fn find(plant: Plant, once: u64) -> Result<(), String> {
    let fails = |script: &Script| play(script, plant).is_err();
    let mut seeds = [once].into_iter().chain(0..2000);
    let script = seeds.find_map(|seed| Some(Script::draw(seed)).filter(fails));
    let script = script.ok_or("is never found")?;
    let (seed, before) = (script.seed, script.happenings.len());
    let shortest = script.shrink(fails);
    let failure = play(&shortest, plant).expect_err("it failed before");
    let after = shortest.happenings.len();
    println!(
        "{plant:?}: seed {seed}, {after} of {before} happenings: {}",
        failure.what
    );
    match play(&shortest, Plant::Nothing) {
        _ if after > 6 => Err(format!("is not made short: {shortest:#?}")),
        Ok(_) => Ok(()),
        Err(failure) => Err(format!("fails without it: {}", failure.what)),
    }
}
