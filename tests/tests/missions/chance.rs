//! Missions of chance: paths, heights, wind, noise of the sensors and of the line, and faults of every kind, by seed.

use std::time::Duration;

use bridge::config::TrajectoryKind;
use dsp_sim::faults::{Damage, Directions, Fault, Script, Window};
use ipc_types::code::{ControlCommand, Reason, Stage};
use ipc_types::payload::{MovementData, ParameterRequest};

use crate::missions::dice::{Dice, FAULTS_END};
use crate::missions::operator::{
    Step, await_link, bring_home, carry_out, fly, fly_through_trouble, follow,
};
use crate::missions::seeds::sums;
use crate::missions::truth::Line;
use crate::missions::world::{Trouble, World};

sums! {
    /// What missions have seen.
    pub struct Seen {
        pub missions: u64,
        /// Movements that ended early, or bridges that were gone, while the DSP held waypoints.
        pub held_at_an_early_end: u64,
        pub stops_in_silence: u64,
        /// Bridges that were killed or ended.
        pub restarts: u64,
        /// Requests that another movement replaced.
        pub replaced: u64,
        /// Waypoints that were sent.
        pub waypoints: u64,
    }
    "{missions} missions; {held_at_an_early_end} early ends while the DSP held waypoints, {stops_in_silence} stops while \
     the link was silent, {restarts} bridges killed or ended, {replaced} requests replaced, {waypoints} waypoints sent"
}

/// Ends the world of a mission, and says what it has seen.
fn seen(mut world: World) -> Seen {
    world.finish();
    Seen {
        missions: 1,
        held_at_an_early_end: world.buffer.cleared,
        stops_in_silence: world.silent_stops,
        restarts: world.deaths.into(),
        replaced: world.witness.count(Reason::Replaced),
        waypoints: world.probe.waypoints as u64,
    }
}

/// A mission in wind and with noisy sensors, on a line that is sound.
pub fn fly_in_wind(seed: u64) -> Seen {
    let mut dice = Dice::new(seed);
    let config = dice.config(seed);
    let mission = dice.mission();
    let mut world = World::new(&config);
    fly(&mut world, &mission);
    let dsp = world.simulator.dsp().counters();
    let refused: u64 = dsp.rejections.iter().sum();
    assert_eq!((dsp.waypoints_discarded, refused), (0, 0));
    assert_eq!(world.witness.state.refused.implausible_groups, 0);
    seen(world)
}

/// A mission on a line on which a few bits are damaged in both directions. In the extended profile every damage is
/// noticed, and a repetition cures it: every step is done.
pub fn fly_with_damaged_bytes(seed: u64) -> Seen {
    let mut dice = Dice::new(seed);
    let mut config = dice.config(seed);
    let bit_error_rate = 10_f64.powf(dice.within(-6.0, -4.5));
    let faults = vec![Fault::Bytes {
        direction: Directions::Both,
        window: Window::ALWAYS,
        damage: Damage::FlipBits { bit_error_rate },
    }];
    config = config.faults(Script { seed, faults }, Duration::MAX);
    let is_noticed = config.line() == Line::Lossy;
    let mission = dice.mission();
    let mut world = World::new(&config);
    if is_noticed {
        fly(&mut world, &mission);
    } else {
        fly_through_trouble(&mut world, &mission);
    }
    seen(world)
}

/// A mission with noise on the line from a moment of chance on.
pub fn fly_in_noise(seed: u64) -> Seen {
    let mut dice = Dice::new(seed);
    let config = dice.config(seed).unsound();
    let mission = dice.mission();
    let mut world = World::new(&config);
    let moments: [fn(&World) -> bool; 4] = [
        |world| world.now() > Duration::from_millis(20),
        |world| world.now() > Duration::from_secs(2),
        |world| world.now() > Duration::from_secs(5),
        |world| world.probe.waypoints > 0,
    ];
    let when = moments[dice.count(0, 3) as usize];
    let time = Duration::from_secs_f64(dice.within(0.3, 4.0));
    world.plan(Trouble::Noise(time), when);
    fly_through_trouble(&mut world, &mission);
    assert!(!world.simulator.helicopter().is_flying());
    seen(world)
}

/// An operator who sends anything at any time, while everything goes wrong at once.
pub fn be_reckless(seed: u64) -> Seen {
    let mut dice = Dice::new(seed);
    let mut config = dice.config(seed);
    let corruption = dice.once_in(2).then(|| dice.corruption());
    let silence = dice.once_in(2).then(|| dice.silence());
    let faults = corruption.into_iter().chain(silence).collect();
    config = config.faults(Script { seed, faults }, FAULTS_END);
    let mut world = World::new(&config);
    for _ in 0..dice.count(20, 60) {
        world.run_for(dice.duration(0.0, 1.5));
        match dice.count(0, 24) {
            0 => world.plan(Trouble::Reboot, |_| true),
            1 => world.plan(Trouble::PortGone(dice.duration(0.01, 3.0)), |_| true),
            2 => world.plan(Trouble::Noise(dice.duration(0.1, 2.0)), |_| true),
            3 => world.schedule(vec![(world.now(), dice.restart().1)]),
            4..=8 => _ = world.control(ControlCommand::Start),
            9 => _ = world.control(ControlCommand::Stop),
            10..=12 => _ = world.movement(MovementData::take_off(0, dice.within(0.0, 12.0))),
            13 => _ = world.movement(MovementData::land(0)),
            14 => _ = world.movement(MovementData::land(0).preempting()),
            15 => _ = world.movement(MovementData::hold(0)),
            16 => {
                if let Step::Write(port, value) = dice.parameter() {
                    world.parameter(ParameterRequest::write(0, port, value.into()));
                }
            }
            _ => dice.send_waypoints(&mut world),
        }
    }
    bring_home(&mut world);
    assert!(!world.simulator.helicopter().is_flying());
    seen(world)
}

/// A mission under a script of faults, as `ril run sim --faults` takes it; half of the bridges are killed or ended on
/// the way.
pub fn fly_through_faults(seed: u64) -> Seen {
    let mut dice = Dice::new(seed);
    let mut config = dice.config(seed);
    if dice.once_in(2) {
        dice.limit_battery(&mut config);
    }
    let config = config.faults(dice.script(seed), FAULTS_END);
    let mission = dice.mission();
    let mut world = World::new(&config);
    if dice.once_in(2) {
        world.schedule(vec![dice.restart()]);
    }
    fly_through_trouble(&mut world, &mission);
    if world.simulator.helicopter().is_flying() {
        bring_home(&mut world);
    }
    seen(world)
}

/// An operator who changes plans in the middle of paths, on a line that damages bytes and falls silent at times:
/// another path, a landing, a hold or a stop takes the place of the one under way, also in silence; the bridge is
/// killed or ended; the DSP reboots.
pub fn change_plans(seed: u64) -> Seen {
    let mut dice = Dice::new(seed);
    let mut config = dice.config(seed);
    let mut faults = Vec::new();
    if dice.once_in(2) {
        faults.push(dice.corruption());
    } else {
        config = config.loses_only();
    }
    for _ in 0..dice.count(0, 3) {
        faults.push(dice.silence());
    }
    config = config.faults(Script { seed, faults }, FAULTS_END);
    let mut world = World::new(&config);
    let mut restarts: Vec<_> = (0..dice.count(0, 2)).map(|_| dice.restart()).collect();
    if dice.once_in(3) {
        restarts.push((dice.duration(3.0, 50.0), Trouble::Reboot));
    }
    world.schedule(restarts);
    for _ in 0..dice.count(2, 6) {
        get_airborne(&mut world, &mut dice);
        let path_id = world.now().as_nanos() as u64;
        let path = dice.path();
        for index in 0..path.len() {
            world.waypoint(path_id, &path, index);
        }
        world.run_for(dice.duration(0.0, 6.0));
        change_plan(&mut world, &mut dice);
    }
    bring_home(&mut world);
    assert!(!world.simulator.helicopter().is_flying());
    seen(world)
}

/// Starts and takes off, where that is possible now.
fn get_airborne(world: &mut World, dice: &mut Dice) {
    await_link(world);
    carry_out(world, &Step::Start);
    if !world.simulator.helicopter().is_flying() {
        carry_out(world, &Step::TakeOff(dice.within(3.0, 10.0)));
    }
}

fn change_plan(world: &mut World, dice: &mut Dice) {
    match dice.count(0, 6) {
        0 => _ = world.movement(MovementData::hold(0)),
        1 => {
            let id = world.movement(MovementData::land(0).preempting());
            follow(world, id);
        }
        2 | 3 => {
            let (path_id, path) = (dice.count(1, 3), dice.path());
            for index in 0..path.len() {
                let request = world.waypoint_request(path_id, &path, index);
                world.movement(request.preempting());
            }
            world.run_for(dice.duration(0.0, 8.0));
        }
        4 => _ = world.control(ControlCommand::Stop),
        5 => {
            let id = world.control(ControlCommand::Stop);
            follow(world, id);
        }
        _ => world.run_for(dice.duration(0.0, 10.0)),
    }
}

/// How far outside the fence a waypoint that was accepted may seem to be here, m: the steps of the wire and of a flat
/// world.
const FENCE_MARGIN_M: f64 = 0.05;

/// Paths in a geofence, half of which break it: those are refused with the reason, and nothing of them is sent.
pub fn fly_fenced(seed: u64) -> Seen {
    let mut dice = Dice::new(seed);
    let (radius_m, ceiling_m) = (dice.within(8.0, 16.0), dice.within(9.0, 13.0));
    let config = dice.config(seed).fence(radius_m, ceiling_m);
    let mut world = World::new(&config);
    let height_m = dice.within(3.0, 6.0);
    fly(&mut world, &[Step::Start, Step::TakeOff(height_m)]);
    for _ in 0..dice.count(2, 5) {
        let path = dice.path();
        let sent = world.probe.waypoints;
        let is_inside = path.iter().all(|point| {
            point.x.hypot(point.y) < radius_m + FENCE_MARGIN_M
                && point.z < ceiling_m + FENCE_MARGIN_M
        });
        let outcome = carry_out(&mut world, &Step::Path(path.clone()));
        if outcome.is_done() {
            assert!(is_inside, "{path:?} leaves {radius_m} m, {ceiling_m} m");
            continue;
        }
        // A leg inside a circle has its ends inside; gusts carry the helicopter across its border at times.
        // The waypoint before one that is refused answers for the path.
        let reasons = [Reason::FenceBreach, Reason::PathBroken];
        assert!(reasons.contains(&outcome.reason), "{outcome:?}");
        if outcome.reason == Reason::PathBroken || outcome.stage == Stage::Refused {
            assert_eq!(world.probe.waypoints, sent, "of a path that was refused");
        }
    }
    bring_home(&mut world);
    seen(world)
}

/// A DSP whose status comes every few seconds.
pub fn fly_with_slow_status(seed: u64) -> Seen {
    let mut dice = Dice::new(seed);
    let period_ms = dice.count(500, 5000);
    let mut config = dice.config(seed);
    // The points of a divided leg begin at the last known position, which here may be one on the ground.
    config.bridge.trajectory.kind = TrajectoryKind::PassThrough;
    let mut config = config.parameters(&format!(
        "status_period_ms = {period_ms}\ncruise_speed_mps = 3.0\nclimb_speed_mps = 2.0"
    ));
    // Without counts a path is done only when each waypoint was seen to be reached, which needs more positions than
    // that.
    config.simulator.firmware.has_waypoint_count = true;
    let mut world = World::new(&config.sparse());
    let mission = dice.mission();
    fly(&mut world, &mission);
    seen(world)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::missions::seeds;

    #[test]
    fn missions_in_wind() {
        seeds::fly_each(0..200, fly_in_wind);
    }

    #[test]
    fn missions_in_noise() {
        seeds::fly_each(1000..1150, fly_in_noise);
    }

    #[test]
    fn reckless_operators() {
        seeds::fly_each(2000..2150, be_reckless);
    }

    #[test]
    fn missions_with_damaged_bytes() {
        seeds::fly_each(7000..7100, fly_with_damaged_bytes);
    }

    #[test]
    fn plans_that_change() {
        let seen = seeds::fly_each(4000..4200, change_plans);
        println!("{seen}");
        if seen.missions > 100 {
            assert!(seen.held_at_an_early_end > 0 && seen.stops_in_silence > 0);
            assert!(seen.restarts > 0 && seen.replaced > 0);
        }
    }

    #[test]
    fn missions_in_a_geofence() {
        seeds::fly_each(5000..5100, fly_fenced);
    }

    #[test]
    fn missions_with_slow_status() {
        seeds::fly_each(6000..6050, fly_with_slow_status);
    }

    #[test]
    fn missions_under_faults_of_every_kind() {
        seeds::fly_each(3000..3150, fly_through_faults);
    }
}
