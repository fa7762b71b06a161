//! One simulated world for all cores of the RIL: robots with bridge, status and a simulated helicopter, the relays of
//! robots and stations, and programs that order, on machines whose clocks differ, over links that lose, in processes
//! that stand still and die. One seed is one run.
//!
//! * [`script`]: what happens, as data, which a seed draws and which is made shorter when it fails;
//! * [`robot`], [`relay`], [`gateway`], [`view`], [`record`]: what runs on the machines, around the cores that fly,
//!   in processes ([`life`]) with [`request`]s; [`mission`]: those of MAVLink; [`plan`]: that of a program; [`page`]:
//!   what a browser does, over a [`wire`]; [`world`] lets it happen;
//! * [`judge`]: the oracle of orders; [`beliefs`]: the oracle of what is shown, for each robot, outside all sides;
//! * [`mod@plant`]: the faults by which the oracles are tried.
//!
//! `--seed 17` plays one run and tells what happens; `--seeds 0..1000000` plays many on all cores, and prints what
//! they had in them. A failure prints its seed, its shortened list of happenings and what happened; the exit code is
//! then not 0.

mod beliefs;
mod gateway;
mod judge;
mod life;
mod mission;
mod missions;
mod page;
mod plan;
mod plant;
mod record;
mod relay;
mod request;
mod robot;
mod script;
#[cfg(test)]
mod tests;
mod view;
mod wire;
mod world;

use std::ops::Range;
use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use missions::seeds;
use plant::{PLANTS, Plant};
use script::Script;
use world::{play_seed, told, watch};

/// Plays runs of the one world: all cores, one seed each
#[derive(Parser)]
struct Args {
    /// One run, with what happens in it
    #[arg(long)]
    seed: Option<u64>,
    /// Many runs, such as `0..1000000`
    #[arg(long, value_parser = range, default_value = "0..1000")]
    seeds: Range<u64>,
    /// With this fault planted, such as `NoFence`, in the run of `--seed`
    #[arg(long, requires = "seed", value_parser = plant)]
    plant: Option<Plant>,
}

fn range(text: &str) -> Result<Range<u64>, String> {
    seeds::parse(text).ok_or_else(|| "neither `17` nor `17..20`".to_owned())
}

fn plant(text: &str) -> Result<Plant, String> {
    let mut plants = PLANTS.iter().map(|(plant, ..)| *plant);
    plants
        .find(|plant| format!("{plant:?}") == text)
        .ok_or_else(|| format!("none of {PLANTS:?}"))
}

fn main() -> ExitCode {
    let args = Args::parse();
    let Some(seed) = args.seed else {
        let started = Instant::now();
        println!("{}", seeds::fly_range(args.seeds, play_seed));
        println!("{:.1} s", started.elapsed().as_secs_f64());
        return ExitCode::SUCCESS;
    };
    let script = Script::draw(seed);
    let (ran, what, log) = watch(&script, args.plant.unwrap_or(Plant::Nothing));
    println!("{}\n{ran}", told(&script, &log));
    what.map_or(ExitCode::SUCCESS, |what| {
        println!("broken: {what}");
        ExitCode::FAILURE
    })
}
