//! Missions on which something goes wrong, at every moment of a flight: the DSP reboots, the port goes and comes back,
//! the bridge is killed and started again, the line is full of noise.
//!
//! Whatever happens, every request has exactly one final report, no implausible value is published, and an operator who
//! starts again brings the helicopter home. What the interrupted step is told is in the table.

use std::time::Duration;

use bridge::safety::BreachAction;
use dsp_protocol::Group;
use dsp_sim::faults::{Damage, Directions, Fault, HelicopterEvent, Script, Times, Window};
use dsp_sim::helicopter::Phase;
use ipc_types::TelemetryGroup;
use ipc_types::code::{Functionality, LinkState, Reason, SafetyRule, Stage};
use ipc_types::payload::MovementData;

use crate::missions::config::WorldConfig;
use crate::missions::operator::{
    Step, await_link, bring_home, carry_out, fly_through_trouble, point,
};
use crate::missions::witness::Outcome;
use crate::missions::world::{Trouble, World};

/// A moment of a flight.
type When = fn(&World) -> bool;

fn phase(world: &World) -> Phase {
    world.simulator.helicopter().phase()
}

fn does(world: &World, functionality: Functionality) -> bool {
    world.witness.state.functionality() == Some(functionality)
}

fn has_moved(world: &World) -> bool {
    world.witness.state.movement.kind().is_some()
}

/// What the trouble does to the step of its moment.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Effect {
    /// Nothing was under way that could be lost.
    None,
    /// A path that was still being sent is lost.
    Path,
    /// A movement that the DSP goes on with, or not.
    Movement,
}

/// Every moment, and what a loss of the DSP means then.
const MOMENTS: [(&str, When, Effect); 11] = [
    (
        "during start-up",
        |world| !world.probe.commands.is_empty(),
        Effect::None,
    ),
    (
        "on the ground",
        |world| world.bridge().link() == LinkState::Up,
        Effect::None,
    ),
    (
        "spinning up",
        |world| phase(world) == Phase::SpinningUp,
        Effect::Movement,
    ),
    (
        "taking off",
        |world| phase(world) == Phase::TakingOff,
        Effect::Movement,
    ),
    (
        "hovering",
        |world| has_moved(world) && does(world, Functionality::AtRest),
        Effect::None,
    ),
    (
        "receiving a path",
        |world| does(world, Functionality::ReceivingPath),
        Effect::Path,
    ),
    (
        "sending a path",
        |world| world.probe.waypoints == 1,
        Effect::Movement,
    ),
    (
        "flying a path",
        |world| world.witness.state.movement.waypoints_reached == 1,
        Effect::Movement,
    ),
    (
        "landing",
        |world| phase(world) == Phase::Landing,
        Effect::Movement,
    ),
    (
        "spinning down",
        |world| phase(world) == Phase::SpinningDown,
        Effect::Movement,
    ),
    (
        "landed",
        |world| {
            has_moved(world)
                && does(world, Functionality::AtRest)
                && phase(world) == Phase::OnGround
        },
        Effect::None,
    ),
];

fn mission() -> Vec<Step> {
    vec![
        Step::Start,
        Step::TakeOff(6.0),
        Step::Wait(Duration::from_secs(4)),
        Step::SlowPath(
            vec![
                point(0.0, 12.0, 8.0),
                point(12.0, 12.0, 8.0),
                point(0.0, 0.0, 6.0),
            ],
            Duration::from_millis(300),
        ),
        Step::Land,
    ]
}

/// Flies the mission with `trouble` at a moment; returns how the interrupted step ended.
fn fly(config: &WorldConfig, when: When, trouble: Trouble) -> (World, Option<Outcome>) {
    let mut world = World::new(config);
    world.plan(trouble, when);
    let failure = fly_through_trouble(&mut world, &mission());
    // What happens after the mission, or just before its end, must come to rest as well.
    world.run_for(Duration::from_secs(8));
    assert!(world.has_happened());
    if failure.is_none() {
        bring_home(&mut world);
    }
    assert!(!world.simulator.helicopter().is_flying());
    // The module can be used again.
    let start = carry_out(&mut world, &Step::Start);
    assert!(
        start.is_done() || start.reason == Reason::AlreadyRunning,
        "{start:?}"
    );
    assert!(carry_out(&mut world, &Step::Stop).is_done());
    ask_again(&mut world);
    world.finish();
    (world, failure)
}

fn check(what: &str, failure: Option<Outcome>, expected: Option<(Stage, Reason)>) {
    let failure = failure.map(|outcome| (outcome.stage, outcome.reason));
    assert_eq!(failure, expected, "{what}");
}

#[test]
fn a_reboot_of_the_dsp_at_every_moment() {
    let config = WorldConfig::new().loses_only();
    for (what, when, effect) in MOMENTS {
        let (world, failure) = fly(&config, when, Trouble::Reboot);
        let expected = match effect {
            Effect::None => None,
            Effect::Path | Effect::Movement => Some((Stage::Aborted, Reason::DspRebooted)),
        };
        check(what, failure, expected);
        // During start-up there is no clock yet that could go back.
        let boots = u32::from(what != "during start-up");
        assert_eq!(world.witness.state.link.dsp_boots, boots, "{what}");
    }
}

#[test]
fn a_port_that_goes_and_comes_back_at_every_moment() {
    let config = WorldConfig::new().loses_only();
    for pause in [Duration::from_millis(150), Duration::from_secs(5)] {
        for (what, when, effect) in MOMENTS {
            let (world, failure) = fly(&config, when, Trouble::PortGone(pause));
            let lost = Reason::CommunicationFatalError;
            let expected = match effect {
                Effect::None => None,
                Effect::Path => Some((Stage::Aborted, lost)),
                Effect::Movement => Some((Stage::Unknown, lost)),
            };
            check(what, failure, expected);
            assert_eq!(world.witness.state.link.port_openings, 2, "{what}");
            assert_eq!(world.witness.state.link.dsp_boots, 0, "{what}");
        }
    }
}

#[test]
fn a_bridge_that_is_killed_and_started_again_at_every_moment() {
    let config = WorldConfig::new().loses_only();
    for away in [Duration::from_millis(50), Duration::from_secs(5)] {
        for (what, when, effect) in MOMENTS {
            let (world, failure) = fly(&config, when, Trouble::BridgeDies(away));
            let is_begun = !matches!(what, "during start-up" | "on the ground");
            let is_over = what == "landed";
            let expected = match effect {
                // The client's own side says it. The DSP empties its buffer when the next bridge starts up.
                Effect::Path | Effect::Movement => Some((Stage::Unknown, Reason::BridgeGone)),
                // A new bridge does nothing before it is started.
                Effect::None if is_begun && !is_over => Some((Stage::Refused, Reason::NotStarted)),
                Effect::None => None,
            };
            check(what, failure, expected);
            assert_eq!(world.deaths, 1, "{what}");
            assert_eq!(world.witness.state.link.dsp_boots, 0, "{what}");
        }
    }
}

/// Asks again for everything that the dead bridge was asked for: the one that runs now carries out none of it.
fn ask_again(world: &mut World) {
    let sent = (world.probe.waypoints, world.probe.commands.len());
    for request_id in 1..=world.requests_of_the_dead {
        for request in [
            MovementData::take_off(request_id, 6.0),
            MovementData::land(request_id),
        ] {
            let outcome = world.ask_again(&MovementData {
                repeat: 1,
                ..request
            });
            let expected = (Stage::Unknown, Reason::NotRemembered);
            assert_eq!((outcome.stage, outcome.reason), expected);
        }
    }
    let now = (world.probe.waypoints, world.probe.commands.len());
    assert_eq!(now, sent, "it was carried out");
}

#[test]
fn the_port_of_a_script_hangs_up_at_every_second_of_a_mission() {
    for second in 1..40 {
        let script = Script {
            seed: second,
            faults: vec![Fault::HangUp {
                times: Times::once(Duration::from_secs(second)),
                length: Duration::from_millis(100 * (second % 7)),
                elsewhere: false,
            }],
        };
        let end = Duration::from_secs(second + 1);
        let config = WorldConfig::new().faults(script, end);
        let mut world = World::new(&config);
        let failure = fly_through_trouble(&mut world, &mission());
        world.run_until("the hang-up", |world| world.simulator.port().hang_ups > 0);
        await_link(&mut world);
        if let Some(outcome) = failure {
            // A request that comes while there is no link is refused; nobody knows what becomes of a movement.
            let expected = [
                (Stage::Refused, Reason::LinkDown),
                (Stage::Aborted, Reason::CommunicationFatalError),
                (Stage::Unknown, Reason::CommunicationFatalError),
            ];
            let outcome = (outcome.stage, outcome.reason);
            assert!(expected.contains(&outcome), "{outcome:?} at {second} s");
        }
        assert!(!world.simulator.helicopter().is_flying());
        assert_eq!(world.witness.state.link.port_openings, 2, "at {second} s");
        world.finish();
    }
}

#[test]
fn the_script_that_comes_with_the_simulator_is_survived() {
    let text = include_str!("../../../dsp-sim/faults.toml");
    let script: Script =
        runtime::config::parse(text, "faults.toml").expect("an example that parses");
    // Some of its faults come again and again.
    let config = WorldConfig::new().faults(script, Duration::MAX);
    let mut world = World::new(&config);
    // Longer than the last fault that it has.
    while world.now() < Duration::from_secs(240) {
        fly_through_trouble(&mut world, &mission());
        bring_home(&mut world);
    }
    let faults = world.simulator.faults().expect("there is a script");
    assert!(
        faults.hang_ups > 0 && faults.reboots > 0 && faults.hangs > 0 && faults.clock_jumps > 0
    );
    world.finish();
}

#[test]
fn noise_at_every_moment_publishes_nothing_implausible_and_ends() {
    for (number, (what, when, _)) in MOMENTS.into_iter().enumerate() {
        for seconds in [1, 4] {
            let seed = 10 * number as u64 + seconds;
            let config = WorldConfig::new().unsound().seed(seed);
            let trouble = Trouble::Noise(Duration::from_secs(seconds));
            let (world, _) = fly(&config, when, trouble);
            let refused = &world.witness.state.refused;
            let bytes = refused.checksum + refused.truncated + refused.unknown_header;
            // During the start-up the DSP says nothing but answers to what it understands.
            let refusals = world.simulator.dsp().counters().rejections;
            let count = u64::from(bytes) + refusals.iter().sum::<u64>();
            assert!(count > 0, "{what}: the noise was not heard, {refused:?}");
        }
    }
}

#[test]
fn in_the_extended_profile_noise_lets_nothing_false_through() {
    // Without noise of the sensors and on a line that takes no time, every sample can be compared with the truth.
    for (seed, (what, when, _)) in MOMENTS.into_iter().enumerate() {
        let config = WorldConfig::new()
            .extended()
            .unsound()
            .exact()
            .seed(seed as u64);
        let trouble = Trouble::Noise(Duration::from_secs(3));
        let (world, _) = fly(&config, when, trouble);
        assert!(world.chain.compared > 500, "{what}");
        assert_eq!(world.witness.state.refused.implausible_groups, 0, "{what}");
    }
}

#[test]
fn what_the_checksum_misses_is_not_believed() {
    // A sum of 7 bits misses one in 128 damaged messages. In short ones with many narrow limits that shows soon.
    let wide = [
        Group::Xy,
        Group::Attitude,
        Group::Acceleration,
        Group::AngularRate,
        Group::References,
    ];
    let mut implausible = 0;
    for seed in 0..4 {
        let config = WorldConfig::new().without(&wide).unsound().seed(seed);
        let mut world = World::new(&config);
        world.plan(Trouble::FaintNoise(Duration::from_secs(40)), |world| {
            world.bridge().link() == LinkState::Up
        });
        world.run_for(Duration::from_secs(42));
        bring_home(&mut world);
        world.finish();
        implausible += world.witness.state.refused.implausible_groups;
    }
    // The witness has looked at every sample that was published.
    assert!(implausible > 0, "nothing was withdrawn");
}

/// Nothing passes in either direction for a while.
fn outage(begin: Duration, end: Duration) -> Script {
    let outage = Fault::Bytes {
        direction: Directions::Both,
        window: Window::between(begin, end),
        damage: Damage::Outage,
    };
    Script {
        seed: 1,
        faults: vec![outage],
    }
}

#[test]
fn a_dsp_without_time_is_believed_again_after_a_silence() {
    // Its status is taken after a look at its mask. The probes of the silence make the first answer uncertain.
    for length_s in [1.5, 2.0, 2.5, 3.0] {
        let begin = Duration::from_secs(3);
        let end = begin + Duration::from_secs_f64(length_s);
        let mut config = WorldConfig::new().faults(outage(begin, end), end);
        config.simulator.firmware.has_time = false;
        let mut world = World::new(&config);
        world.run_for(Duration::from_secs(8));
        let samples = world.witness.samples;
        world.run_for(Duration::from_secs(2));
        assert!(world.witness.samples > samples + 90, "after {length_s} s");
        world.finish();
    }
}

#[test]
fn a_dsp_that_still_takes_off_when_the_bridge_has_lost_sight_of_that_refuses_the_landing() {
    let mut refused = 0;
    for begin_ms in (2_000..8_000).step_by(200) {
        let begin = Duration::from_millis(begin_ms);
        // All three attempts of a command fall into it, and it is too short for the link to be lost.
        let end = begin + Duration::from_millis(700);
        let mut world = World::new(&WorldConfig::new().faults(outage(begin, end), end));
        await_link(&mut world);
        carry_out(&mut world, &Step::Start);
        let took_off = carry_out(&mut world, &Step::TakeOff(10.0));
        await_link(&mut world);
        let is_up = world.witness.latest().is_some_and(|one| one.flying != 0);
        let climbs = world.simulator.is_taking_off();
        let landing = carry_out(&mut world, &Step::Land);
        let expected = match (is_up, climbs) {
            (false, _) => (Stage::Refused, Reason::NotFlying),
            (true, true) => (Stage::Aborted, Reason::RefusedByDsp),
            (true, false) => (Stage::Done, Reason::None),
        };
        check("landing", Some(landing), Some(expected));
        if took_off.is_done() {
            assert!(!climbs);
        } else {
            let unknown = (Stage::Unknown, Reason::CommunicationFatalError);
            check("take-off", Some(took_off), Some(unknown));
        }
        refused += u32::from(climbs && is_up);
        // The DSP takes it when the take-off is over.
        bring_home(&mut world);
        world.finish();
    }
    assert!(refused > 0, "no take-off was lost sight of");
}

/// The GPS has no fix from the middle of a path on, and the DSP flies on. What the rule makes of it, and that it is
/// over when the fix is back; no consumer gets a position meanwhile.
#[test]
fn a_helicopter_whose_gps_has_no_fix_flies_on_hovers_or_lands_and_has_no_position() {
    let lost = Duration::from_secs(8);
    // The rule, how the path ends while the fix is lost, and what the module does then.
    let table = [
        (BreachAction::Warn, None, Functionality::FollowingPath),
        (
            BreachAction::Hold,
            Some(Reason::NoPosition),
            Functionality::AtRest,
        ),
        (
            BreachAction::Land,
            Some(Reason::NoPosition),
            Functionality::Landing,
        ),
    ];
    for (rule, ends_as, functionality) in table {
        let mut config = WorldConfig::new();
        config.bridge.safety.position_lost = rule;
        config.bridge.safety.position_lost_s = 1.0;
        let mut world = World::new(&config);
        await_link(&mut world);
        carry_out(&mut world, &Step::Start);
        carry_out(&mut world, &Step::TakeOff(10.0));
        let path = world.waypoint(1, &[point(60.0, 0.0, 10.0)], 0);
        world.run_until("it flies", |world| {
            world.simulator.helicopter().body().position_m.x > 5.0
        });
        let event = HelicopterEvent::LoseFix(lost);
        world.simulator.apply_to_helicopter(event);
        let back = world.now() + lost;
        world.run_for(Duration::from_secs(2));
        assert_eq!(
            world.bridge().state().safety.rule(),
            Some(SafetyRule::PositionLost)
        );
        assert!(does(&world, functionality), "{rule:?}");
        let outcome = world.witness.outcome(path);
        assert_eq!(outcome.map(|outcome| outcome.reason), ends_as, "{rule:?}");
        let next = world.waypoint(2, &[point(0.0, 0.0, 10.0)], 0);
        let refused = world.witness.outcome(next).map(|outcome| outcome.reason);
        assert!(
            matches!(refused, Some(Reason::NoPosition | Reason::Busy)),
            "{rule:?}: {refused:?}"
        );
        while world.now() + Duration::from_millis(500) < back {
            world.run_for(Duration::from_millis(100));
            let hero = world.chain.latest.as_ref().expect("telemetry goes on");
            let (place, velocity) = (&hero.geodetic, &hero.velocity);
            for group in [
                TelemetryGroup::Geographic,
                TelemetryGroup::Xy,
                TelemetryGroup::GpsVelocity,
            ] {
                assert!(!hero.valid(group), "{rule:?}: {group:?}");
            }
            let values = [place.latitude_rad, place.longitude_rad, place.altitude_m];
            assert_eq!(values, [0.0; 3]);
            assert_eq!(velocity.ground_speed_mps, 0.0);
        }
        world.run_for(Duration::from_secs(3));
        let hero = world.chain.latest.as_ref().expect("telemetry goes on");
        assert!(hero.valid(TelemetryGroup::Geographic));
        assert_ne!(
            world.bridge().state().safety.rule(),
            Some(SafetyRule::PositionLost)
        );
        bring_home(&mut world);
        world.finish();
    }
}
