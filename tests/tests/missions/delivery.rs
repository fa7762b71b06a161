//! Delivery of waypoints while everything between bridge and DSP goes wrong: messages are lost and repeated, the line
//! falls silent, the port hangs up, the DSP reboots, and the bridge is killed and started again. What was said of a
//! path is what the helicopter did.

use std::time::Duration;

use dsp_sim::faults::{
    Act, Damage, Directions, DspEvent, Fault, MessageKind, Script, Times, Window,
};
use dsp_sim::helicopter::Phase;
use dsp_sim::helicopter::vector::Vector;
use dsp_sim::random::Random;

use crate::missions::config::WorldConfig;
use crate::missions::operator::{Step, await_link, bring_home, carry_out, point};
use crate::missions::seeds::sums;
use crate::missions::world::{Trouble, World};

/// The stream of a seed that makes these missions.
const STREAM: u64 = 9;

/// Paths of one mission.
const PATHS: usize = 8;
/// Attempts to start the module for the next path; each can meet the rest of a trouble.
const ATTEMPTS: usize = 30;
/// The start-up and the take-off are not what is tried here.
const BEGIN: Duration = Duration::from_secs(8);
/// A mission's troubles end here, long after most missions.
const END: Duration = Duration::from_secs(1200);

sums! {
    /// What a run of seeds has seen.
    pub struct Figures {
        pub missions: u64,
        pub paths: u64,
        pub delivered: u64,
        pub failed: u64,
        pub waypoints: u64,
        pub sent_again: u64,
        pub requests: u64,
        pub reboots: u64,
        pub hang_ups: u64,
        pub deaths: u64,
    }
    "0 of {waypoints} waypoints lost, repeated or out of order: {missions} missions, {paths} paths, {delivered} \
     delivered, {failed} reported as failed, {sent_again} waypoints sent again; {reboots} reboots of the DSP, \
     {deaths} deaths of the bridge, {hang_ups} hang-ups of the port; 0 of {requests} requests without exactly one \
     final report"
}

/// Draws what goes wrong.
struct Dice(Random);

impl Dice {
    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.uniform()
    }

    fn seconds(&mut self, low: f64, high: f64) -> Duration {
        Duration::from_secs_f64(self.within(low, high))
    }

    fn once_in(&mut self, count: u64) -> bool {
        self.0.next_u64().is_multiple_of(count)
    }

    /// Up to three in ten messages lost, up to five in ten repeated; perhaps outages of up to a minute, reboots,
    /// hang-ups.
    fn script(&mut self, seed: u64) -> Script {
        let (loss, repeat) = (self.within(0.0, 0.3), self.within(0.0, 0.5));
        let kinds = [
            MessageKind::Waypoint,
            MessageKind::Command,
            MessageKind::Ack,
            MessageKind::FlowControl,
        ];
        let mut faults = Vec::new();
        for message in kinds {
            for (act, rate) in [(Act::Drop, loss), (Act::Repeat, repeat)] {
                faults.push(Fault::Messages {
                    message,
                    window: Window::between(BEGIN, END),
                    rate,
                    act,
                });
            }
        }
        if self.once_in(3) {
            let (begin, length) = (self.seconds(10.0, 60.0), self.seconds(0.0, 60.0));
            let pause = self.seconds(60.0, 180.0);
            faults.push(Fault::Bytes {
                direction: Directions::Both,
                window: Window::between(begin, begin + length).every(length + pause),
                damage: Damage::Outage,
            });
        }
        if self.once_in(3) {
            faults.push(Fault::Dsp {
                times: self.times(),
                event: DspEvent::Reboot,
            });
        }
        if self.once_in(3) {
            faults.push(Fault::HangUp {
                times: self.times(),
                length: self.seconds(0.0, 10.0),
                elsewhere: false,
            });
        }
        Script { seed, faults }
    }

    fn times(&mut self) -> Times {
        Times::every(self.seconds(10.0, 60.0), self.seconds(40.0, 200.0))
    }

    /// When the bridge is killed, and for how long it stays away.
    fn deaths(&mut self) -> Vec<(Duration, Trouble)> {
        let mut deaths = Vec::new();
        let mut when = self.seconds(10.0, 60.0);
        while when < END {
            deaths.push((when, Trouble::BridgeDies(self.seconds(0.01, 5.0))));
            when += self.seconds(20.0, 200.0);
        }
        deaths
    }

    fn path(&mut self) -> Vec<Vector> {
        let count = 1 + self.0.next_u64() % 64;
        (0..count)
            .map(|index| {
                let side = if index % 2 == 0 { 3.0 } else { -3.0 };
                point(self.within(0.0, side), side, self.within(6.0, 8.0))
            })
            .collect()
    }
}

fn config(seed: u64, dice: &mut Dice) -> WorldConfig {
    let mut config = WorldConfig::new().seed(seed).parameters(
        "status_period_ms = 80\nflow_control_period_ms = 50\ncruise_speed_mps = 8.0\nclimb_speed_mps = 4.0\n\
         acceptance_radius_m = 0.6",
    );
    if dice.once_in(2) {
        config = config.extended();
    }
    config.simulator.model.noise_level = 0.0;
    config.faults(dice.script(seed), END).loses_only()
}

/// What makes the DSP forget its path.
fn interruptions(world: &World) -> u64 {
    let faults = world.simulator.faults().expect("there is a script");
    faults.reboots + faults.hang_ups + u64::from(world.deaths)
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

fn await_hover(world: &mut World) {
    world.run_until("it hovers", |world| {
        world.simulator.helicopter().phase() == Phase::Hovering
    });
}

/// Gets a helicopter that is in the air ready for the next path, as the documentation says: stopped once, whatever
/// becomes of the stop, and started anew. What the DSP holds of the last path is for the bridge to know.
fn make_ready(world: &mut World) {
    await_link(world);
    carry_out(world, &Step::Stop);
    for _ in 0..ATTEMPTS {
        await_link(world);
        // The link may go again before it is asked.
        if carry_out(world, &Step::Start).is_done() {
            return await_hover(world);
        }
    }
    panic!("the module could not be started again");
}

/// Flies one path and compares what is said with what is done.
fn deliver(world: &mut World, path: &[Vector], figures: &mut Figures) {
    let before = world.simulator.helicopter().arrived();
    let outcome = carry_out(world, &Step::Path(path.to_vec()));
    let interrupted = interruptions(world);
    figures.paths += 1;
    if outcome.is_done() {
        // The helicopter may still be on its last metre, or go back to a waypoint that it passed too far away.
        await_hover(world);
    } else {
        make_ready(world);
    }
    let flown = flown(world, before);
    figures.waypoints += flown.len() as u64;
    let count = path.len();
    assert!(flown.len() <= count, "more waypoints than the path has");
    for (index, (flown, asked)) in flown.iter().zip(path).enumerate() {
        let apart = (*flown - *asked).norm();
        assert!(
            apart < 0.02,
            "waypoint {index} of {count} is {apart} m off: lost, repeated or out of order"
        );
    }
    if outcome.is_done() {
        // The world has seen that it was at all of them, within the bridge's tolerance. At the last one the bridge lets
        // the DSP, whose tolerance is narrower, go on for two seconds at most; an interruption stops it there as well.
        assert!(
            flown.len() + 1 >= count || interruptions(world) > interrupted,
            "a path that was done is flown whole: {} of {count}",
            flown.len()
        );
        figures.delivered += 1;
    } else {
        figures.failed += 1;
    }
}

/// Flies the mission of a seed.
pub fn fly(seed: u64) -> Figures {
    let mut dice = Dice(Random::new(seed, STREAM));
    let config = config(seed, &mut dice);
    let mut world = World::new(&config);
    if dice.once_in(3) {
        world.schedule(dice.deaths());
    }
    await_link(&mut world);
    for step in [Step::Start, Step::TakeOff(6.0)] {
        assert!(carry_out(&mut world, &step).is_done(), "{step:?}");
    }
    let mut figures = Figures {
        missions: 1,
        ..Figures::default()
    };
    for _ in 0..PATHS {
        let path = dice.path();
        deliver(&mut world, &path, &mut figures);
    }
    let arrived = world.simulator.helicopter().arrived();
    bring_home(&mut world);
    assert_eq!(
        world.simulator.helicopter().arrived(),
        arrived,
        "it flew to a waypoint after its path"
    );
    world.finish();
    let faults = world.simulator.faults().expect("there is a script");
    figures.sent_again = world.probe.repeated_waypoints;
    figures.requests = world.witness.request_count();
    figures.reboots = faults.reboots;
    figures.hang_ups = faults.hang_ups;
    figures.deaths = u64::from(world.deaths);
    figures
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::missions::seeds;

    #[test]
    fn what_is_said_of_a_path_is_what_was_flown() {
        let figures = seeds::fly_each(0..20, fly);
        println!("{figures}");
        assert!(figures.delivered > 0 && figures.failed > 0 && figures.sent_again > 0);
        assert!(figures.reboots > 0 && figures.hang_ups > 0 && figures.deaths > 0);
    }
}
