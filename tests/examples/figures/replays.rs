//! How fast a recorded flight is verified, and how many bytes its journals have.

use std::time::{Duration, Instant};

use ipc_types::Topic;
use ipc_types::payload::SharedStruct;
use replay::{Comparison, Verifier};

use crate::missions::config::WorldConfig;
use crate::missions::operator::{Step, fly, triangle};
use crate::missions::world::World;

/// Flies a path, hovers and lands for `seconds` in all at least, and verifies the journals; false when they differ.
pub fn measure(seconds: u64) -> bool {
    let mut world = World::new(&WorldConfig::new().wind(3.0, 200.0, 1.0));
    world.keep_journals();
    let steps = [
        Step::Start,
        Step::TakeOff(10.0),
        Step::Path(triangle()),
        Step::Wait(Duration::from_secs(seconds)),
        Step::Land,
        Step::Stop,
    ];
    fly(&mut world, &steps);
    world.finish();
    let flown = world.now().as_secs_f64();
    let (bridge, status) = world.journals();

    println!("| journal | bytes a second at 50 samples a second | verified |\n|---|---:|---:|");
    let of_bridge = verify("bridge", &bridge, flown);
    let of_status = verify("status", &status, flown);
    for verdict in [&of_bridge, &of_status] {
        if let Some(difference) = verdict.difference() {
            println!("{difference}");
        }
    }
    of_bridge.is_verified() && of_status.is_verified()
}

fn verify<P: Topic + SharedStruct>(name: &str, pieces: &[P], flown: f64) -> Comparison {
    let begin = Instant::now();
    let mut verifier = Verifier::new();
    for piece in pieces {
        verifier.take(P::KEY, piece.bytes());
    }
    let verdict = verifier.finish();
    let took = begin.elapsed().as_secs_f64();
    let bytes = verdict.bridge.bytes + verdict.status.bytes;
    println!(
        "| {name} | {:.0} | {:.0} times real time |",
        bytes as f64 / flown,
        flown / took
    );
    verdict
}
