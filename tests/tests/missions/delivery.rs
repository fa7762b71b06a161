//! Delivery of waypoints on a line that loses and repeats messages, falls silent, and with a DSP that reboots: what was
//! said of a path is what the helicopter did.
//!
//! `RIL_SEED=0..100000 cargo test --release -p ril-tests --test missions what_is_said -- --nocapture` flies any number
//! of them and prints the figures.

use std::cell::Cell;
use std::time::Duration;

use dsp_sim::faults::{
    Act, Damage, Directions, DspEvent, Fault, MessageKind, Script, Times, Window,
};
use dsp_sim::helicopter::vector::Vector;
use dsp_sim::random::Random;

use crate::config::WorldConfig;
use crate::operator::{Step, await_link, bring_home, carry_out, point};
use crate::seeds;
use crate::world::World;

/// The stream of a seed that makes these missions.
const STREAM: u64 = 9;

/// What a run of seeds has seen.
#[derive(Default)]
struct Figures {
    paths: Cell<u64>,
    delivered: Cell<u64>,
    failed: Cell<u64>,
    waypoints: Cell<u64>,
    repeated: Cell<u64>,
}

fn add(cell: &Cell<u64>, count: u64) {
    cell.set(cell.get() + count);
}

/// Up to three in ten messages lost, up to five in ten repeated, an outage of up to a minute, perhaps a reboot.
fn script(seed: u64, dice: &mut Random) -> Script {
    let mut within = |low: f64, high: f64| low + (high - low) * dice.uniform();
    let (loss, repeat) = (within(0.0, 0.3), within(0.0, 0.5));
    // The start-up and the take-off are not what is tried here.
    let begin = Window::since(Duration::from_secs(8));
    let kinds = [
        MessageKind::Waypoint,
        MessageKind::Command,
        MessageKind::Ack,
        MessageKind::FlowControl,
    ];
    let mut faults = Vec::new();
    for message in kinds {
        for (act, rate) in [(Act::Swallow, loss), (Act::Repeat, repeat)] {
            faults.push(Fault::Messages {
                message,
                window: begin,
                rate,
                act,
            });
        }
    }
    let outage = Duration::from_secs_f64(within(10.0, 40.0));
    if within(0.0, 1.0) < 0.3 {
        faults.push(Fault::Bytes {
            direction: Directions::Both,
            window: Window::between(outage, outage + Duration::from_secs_f64(within(0.1, 60.0))),
            damage: Damage::Outage,
        });
    }
    if within(0.0, 1.0) < 0.2 {
        faults.push(Fault::Dsp {
            times: Times::once(Duration::from_secs_f64(within(10.0, 40.0))),
            event: DspEvent::Reboot,
        });
    }
    Script { seed, faults }
}

fn path(dice: &mut Random) -> Vec<Vector> {
    let count = 2 + dice.next_u64() % 30;
    (0..count)
        .map(|index| {
            let side = if index % 2 == 0 { 3.0 } else { -3.0 };
            point(side * dice.uniform(), side, 6.0 + 2.0 * dice.uniform())
        })
        .collect()
}

/// The waypoints that the helicopter came to since it had come to `before` of them.
fn flown(world: &World, before: u64) -> Vec<Vector> {
    let helicopter = world.simulator.helicopter();
    let count = (helicopter.arrived() - before) as usize;
    let mut last: Vec<_> = helicopter
        .arrivals()
        .map(|arrival| arrival.waypoint_m)
        .collect();
    last.split_off(last.len() - count)
}

fn deliver(seed: u64, figures: &Figures) {
    let mut dice = Random::new(seed, STREAM);
    let mut config = WorldConfig::new()
        .seed(seed)
        .unsound()
        .parameters("status_period_ms = 50\nflow_control_period_ms = 20\ncruise_speed_mps = 8.0\nclimb_speed_mps = 4.0\nacceptance_radius_m = 0.6");
    config.simulator.model.noise_level = 0.0;
    config.simulator.faults = Some(script(seed, &mut dice));
    let mut world = World::new(&config);
    await_link(&mut world);
    for step in [Step::Start, Step::TakeOff(6.0)] {
        assert!(carry_out(&mut world, &step).is_done(), "{step:?}");
    }
    for _ in 0..4 {
        let path = path(&mut dice);
        let before = world.simulator.helicopter().arrived();
        let outcome = carry_out(&mut world, &Step::Path(path.clone()));
        add(&figures.paths, 1);
        if outcome.is_done() {
            // The helicopter may still be on its last metre.
            world.run_for(Duration::from_secs(3));
        }
        let flown = flown(&world, before);
        add(&figures.waypoints, flown.len() as u64);
        for (index, (flown, asked)) in flown.iter().zip(&path).enumerate() {
            let apart = (*flown - *asked).norm();
            assert!(
                apart < 0.02,
                "waypoint {index} of {} is {apart} m off: lost, repeated or out of order",
                path.len()
            );
        }
        let reboots = world.simulator.faults().map_or(0, |faults| faults.reboots);
        if outcome.is_done() {
            // The bridge has seen it arrive a moment before the DSP does; a DSP that reboots in that moment stops there.
            let missing = path.len() - flown.len();
            assert!(
                missing as u64 <= reboots,
                "a path that was done is flown whole: {missing} missing"
            );
            add(&figures.delivered, 1);
        } else {
            assert!(
                flown.len() <= path.len(),
                "more waypoints than the path has"
            );
            add(&figures.failed, 1);
            break;
        }
    }
    let state = world.witness.state;
    add(&figures.repeated, u64::from(state.link.waypoints_repeated));
    bring_home(&mut world);
    world.finish();
}

#[test]
fn what_is_said_of_a_path_is_what_was_flown() {
    let figures = Figures::default();
    seeds::for_each(3000..3040, |seed| deliver(seed, &figures));
    println!(
        "{} paths: {} delivered, {} reported as failed; {} waypoints flown, each once and in order; {} sent again; every request had one final word",
        figures.paths.get(),
        figures.delivered.get(),
        figures.failed.get(),
        figures.waypoints.get(),
        figures.repeated.get(),
    );
    assert!(figures.delivered.get() > 0 && figures.repeated.get() > 0);
}
