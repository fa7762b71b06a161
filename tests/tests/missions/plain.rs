//! Missions on which nothing goes wrong.

use bridge::flight::assembly::MAX_WAYPOINTS;
use dsp_protocol::downlink::Geographic;
use dsp_protocol::{Command, port};
use dsp_sim::helicopter::Phase;
use dsp_sim::helicopter::vector::Vector;
use ipc_types::code::Functionality::{
    AtRest, FollowingPath, Landing, ReceivingPath, Stopping, TakingOff,
};
use ipc_types::code::ModuleStatus::{Ended, Running, WaitingDataToStart};
use ipc_types::code::{ControlCommand, Reason, Stage};
use ipc_types::payload::MovementData;

use crate::config::WorldConfig;
use crate::operator::{Step, await_link, carry_out, fly, point};
use crate::world::World;

/// A square of 20 m, and back.
fn square() -> Vec<Vector> {
    vec![
        point(0.0, 20.0, 10.0),
        point(20.0, 20.0, 15.0),
        point(20.0, 0.0, 15.0),
        point(0.0, 0.0, 10.0),
    ]
}

/// What every undisturbed flight leaves behind.
fn assert_undisturbed(world: &World, waypoints: u64) {
    let dsp = world.simulator.dsp().counters();
    assert_eq!((dsp.waypoints, dsp.waypoints_discarded), (waypoints, 0));
    assert_eq!(
        dsp.rejections.iter().sum::<u64>(),
        0,
        "the DSP rejected bytes"
    );
    let state = &world.witness.state;
    let refused = &state.refused;
    let bytes = [
        refused.stray,
        refused.unknown_header,
        refused.truncated,
        refused.checksum,
    ];
    assert_eq!(bytes, [0; 4], "the bridge refused bytes");
    assert_eq!(
        (refused.padding, refused.value, refused.implausible_groups),
        (0, 0, 0)
    );
    let link = &state.link;
    assert_eq!(
        (
            link.commands_failed,
            link.commands_repeated,
            link.acks_unmatched
        ),
        (0, 0, 0)
    );
    assert_eq!(
        (state.dsp_errors.total, link.dsp_boots, link.port_openings),
        (0, 0, 1)
    );
    assert_eq!(link.telemetry_incoherent, 0);
    assert_eq!(u64::from(link.waypoints_sent), waypoints);
}

/// Lets the DSP come to what it takes for the end of its path, which is nearer than the bridge's tolerance.
fn assert_arrived(world: &mut World, waypoints: u64) {
    world.run_until("it hovers", |world| {
        world.simulator.helicopter().phase() == Phase::Hovering
    });
    assert_eq!(world.simulator.helicopter().arrived(), waypoints);
}

#[test]
fn from_the_ground_to_the_ground() {
    for config in [WorldConfig::new(), WorldConfig::new().extended()] {
        fly_from_the_ground_to_the_ground(&config);
    }
}

fn fly_from_the_ground_to_the_ground(config: &WorldConfig) {
    let mut world = World::new(config);
    let second = vec![point(10.0, 10.0, 12.0), point(0.0, 5.0, 10.0)];
    fly(
        &mut world,
        &[
            Step::Start,
            Step::TakeOff(10.0),
            Step::Path(square()),
            Step::Path(second),
            Step::Land,
            Step::Stop,
        ],
    );
    world.finish();
    let moved = |functionality| [(Running, functionality), (Ended, AtRest)];
    let phases = [
        vec![(WaitingDataToStart, AtRest), (Running, AtRest)],
        moved(TakingOff).to_vec(),
        vec![(Ended, ReceivingPath)],
        moved(FollowingPath).to_vec(),
        vec![(Ended, ReceivingPath)],
        moved(FollowingPath).to_vec(),
        moved(Landing).to_vec(),
        vec![(Ended, Stopping), (Ended, AtRest)],
    ];
    assert_eq!(world.witness.phases, phases.concat());
    assert_undisturbed(&world, 6);
    // One sample in 20 ms from the moment the DSP was told to.
    let expected = world.now().as_millis() as u64 / 20;
    let missing = expected - world.witness.samples;
    assert!(missing < 10, "{missing} of {expected} samples are missing");
    // In the order of section 8 of the protocol, then what the flight needs.
    let write = |port, value| Command::Write16 { port, value };
    let commands: Vec<_> = world
        .probe
        .commands
        .iter()
        .filter(|command| !matches!(command, Command::Read16 { .. } | Command::Read32 { .. }))
        .collect();
    let expected = [
        write(port::STATUS_MASK, u16::MAX),
        write(port::PC_TIMEOUT_MS, config.bridge.link.pc_timeout_ms),
        Command::ActivateStatus,
        Command::ClearErrors,
        Command::InvalidatePath,
        Command::Following { on: true },
        Command::Write32 {
            port: port::TAKE_OFF_ALTITUDE_M,
            value: 10.0,
        },
        write(port::TAKE_OFF, 1),
        // At the end of each path, of the landing, and of the stop.
        Command::InvalidatePath,
        Command::InvalidatePath,
        write(port::LAND, 1),
        Command::InvalidatePath,
        Command::InvalidatePath,
        Command::ClearErrors,
    ];
    assert_eq!(commands, expected.iter().collect::<Vec<_>>());
}

#[test]
fn single_points_one_after_the_other() {
    let mut world = World::new(&WorldConfig::new());
    let mut steps = vec![Step::Start, Step::TakeOff(8.0)];
    for point in square() {
        steps.push(Step::Path(vec![point]));
    }
    fly(&mut world, &steps);
    assert_arrived(&mut world, 4);
    // Where it is already.
    let here = Step::Path(vec![point(0.0, 0.0, 10.0)]);
    fly(&mut world, &[here, Step::Land]);
    world.finish();
    assert_undisturbed(&world, 5);
    assert!(
        !world
            .witness
            .phases
            .iter()
            .any(|(_, functionality)| *functionality == ReceivingPath)
    );
}

/// A zigzag of `side` × `side` points.
fn zigzag(side: usize, spacing_m: f64) -> Vec<Vector> {
    (0..side * side)
        .map(|index| {
            let (row, column) = (index / side, index % side);
            let column = if row % 2 == 0 {
                column
            } else {
                side - 1 - column
            };
            point(
                spacing_m * column as f64,
                spacing_m * (row + 1) as f64,
                12.0,
            )
        })
        .collect()
}

#[test]
fn a_long_path_waits_for_flow_control() {
    let mut world = World::new(&WorldConfig::new());
    fly(
        &mut world,
        &[Step::Start, Step::TakeOff(12.0), Step::Path(zigzag(8, 4.0))],
    );
    assert_arrived(&mut world, 64);
    fly(&mut world, &[Step::Land]);
    world.finish();
    assert_undisturbed(&world, 64);
    assert!(
        world.fewest_free_places < 2,
        "the DSP's buffer was never full"
    );
    assert!(world.stops_heard() > 0, "the DSP never said stop");
}

#[test]
fn the_longest_path_is_flown() {
    let side = MAX_WAYPOINTS.isqrt();
    assert_eq!(side * side, MAX_WAYPOINTS);
    let config = WorldConfig::new().parameters("status_period_ms = 100");
    let mut world = World::new(&config);
    let steps = [Step::Start, Step::TakeOff(12.0)];
    fly(&mut world, &steps);
    fly(&mut world, &[Step::Path(zigzag(side, 1.3)), Step::Land]);
    world.finish();
    assert_undisturbed(&world, MAX_WAYPOINTS as u64);
}

#[test]
fn nothing_is_sent_before_a_path_is_closed() {
    let mut world = World::new(&WorldConfig::new());
    let pause = std::time::Duration::from_secs(2);
    fly(
        &mut world,
        &[
            Step::Start,
            Step::TakeOff(10.0),
            Step::SlowPath(square(), pause),
            Step::Land,
        ],
    );
    world.finish();
    assert_undisturbed(&world, 4);
}

#[test]
fn a_path_that_returns_to_its_start_is_flown_all_the_way() {
    for path in [
        vec![
            point(15.0, 0.0, 10.0),
            point(15.0, 15.0, 10.0),
            point(0.0, 0.0, 10.0),
        ],
        vec![
            point(0.0, 0.0, 10.0),
            point(15.0, 0.0, 10.0),
            point(0.0, 0.0, 10.0),
        ],
        vec![
            point(15.0, 0.0, 10.0),
            point(0.0, 0.0, 10.0),
            point(0.0, 15.0, 10.0),
            point(0.0, 0.0, 10.0),
        ],
    ] {
        let mut world = World::new(&WorldConfig::new());
        fly(&mut world, &[Step::Start, Step::TakeOff(10.0)]);
        // Hovering at the very point where the path ends.
        world.run_until("it hovers", |world| {
            world.simulator.helicopter().phase() == Phase::Hovering
        });
        let count = path.len() as u64;
        fly(&mut world, &[Step::Path(path)]);
        assert_arrived(&mut world, count);
        fly(&mut world, &[Step::Land]);
        world.finish();
        assert_undisturbed(&world, count);
    }
}

#[test]
fn the_whole_chain_says_what_the_helicopter_does() {
    // Across the antimeridian in both directions, far north, far south, and where longitudes are long.
    for (latitude_deg, longitude_deg) in [
        (37.0, 179.9999),
        (37.0, -179.9999),
        (70.0, 25.0),
        (-60.0, -70.0),
        (0.0, 0.0),
    ] {
        let config = WorldConfig::new().at(latitude_deg, longitude_deg).exact();
        let mut world = World::new(&config);
        fly(
            &mut world,
            &[
                Step::Start,
                Step::TakeOff(6.0),
                Step::Path(vec![
                    point(25.0, 5.0, 9.0),
                    point(-25.0, -5.0, 12.0),
                    point(0.0, 0.0, 8.0),
                ]),
                Step::Land,
            ],
        );
        world.finish();
        assert_undisturbed(&world, 3);
        assert!(
            world.chain.compared > 1000,
            "{} samples",
            world.chain.compared
        );
    }
}

#[test]
fn a_waypoint_just_beyond_the_antimeridian_is_reached_on_this_side() {
    let config = WorldConfig::new()
        .at(37.0, 179.9998)
        .exact()
        .wind(0.0, 0.0, 0.0);
    let mut world = World::new(&config);
    fly(&mut world, &[Step::Start, Step::TakeOff(10.0)]);
    let line = Geographic {
        longitude_deg: -179.999_999_9,
        altitude_m: 20.0,
        ..config.simulator.model.home
    };
    let beyond = world.simulator.helicopter().world().to_flat(line);
    assert!(beyond.x > 15.0, "to the east");
    fly(&mut world, &[Step::Path(vec![beyond])]);
    // The path ends where the DSP takes the waypoint for reached, half a metre before it.
    let away_m = beyond.x - world.simulator.helicopter().body().position_m.x;
    assert!((0.0..0.6).contains(&away_m), "{away_m}");
    assert!(world.simulator.helicopter().position().longitude_deg > 179.0);
    fly(&mut world, &[Step::Land]);
    world.finish();
}

#[test]
fn at_70_degrees_the_box_of_arrival_is_narrow_and_found() {
    // A hundred thousandth of a degree of longitude are 38 cm there, less than the DSP's acceptance radius.
    let mut world = World::new(&WorldConfig::new().at(70.0, 25.0));
    fly(
        &mut world,
        &[
            Step::Start,
            Step::TakeOff(10.0),
            Step::Path(square()),
            Step::Land,
        ],
    );
    world.finish();
    assert_undisturbed(&world, 4);
}

#[test]
fn a_stop_in_the_middle_of_a_path_leaves_a_helicopter_that_hovers() {
    let mut world = World::new(&WorldConfig::new());
    fly(&mut world, &[Step::Start, Step::TakeOff(10.0)]);
    let path: Vec<_> = (1..=40)
        .map(|index| point(0.0, 5.0 * f64::from(index), 10.0))
        .collect();
    let ids: Vec<_> = (0..path.len())
        .map(|index| world.waypoint(7, &path, index))
        .collect();
    let closing = *ids.last().expect("waypoints");
    world.run_until("some way", |world| {
        world.witness.state.movement.waypoints_reached == 5
    });
    assert!(carry_out(&mut world, &Step::Stop).is_done());
    let outcome = world.witness.outcome(closing).expect("a final report");
    assert_eq!(
        (outcome.stage, outcome.reason),
        (Stage::Aborted, Reason::Stopped)
    );
    assert_eq!(
        world.simulator.helicopter().free_places(),
        16,
        "the DSP's buffer is not empty"
    );
    let sent = world.probe.waypoints;
    assert!(sent < path.len());
    world.run_until("it hovers", |world| {
        world.simulator.helicopter().phase() == Phase::Hovering
    });
    assert_eq!(
        world.probe.waypoints, sent,
        "waypoints were sent after the stop"
    );
    // It can go on from there.
    let refused = world.waypoint(8, &[point(0.0, 5.0, 10.0)], 0);
    let outcome = world.witness.outcome(refused).expect("a final report");
    assert_eq!(
        (outcome.stage, outcome.reason),
        (Stage::Refused, Reason::NotStarted)
    );
    fly(
        &mut world,
        &[Step::Start, Step::Path(square()), Step::Land, Step::Stop],
    );
    world.finish();
}

#[test]
fn a_bridge_that_ends_says_so_to_everybody() {
    type Begin = fn(&mut World) -> u64;
    let cases: [(Begin, Stage); 3] = [
        (
            |world| world.movement(MovementData::take_off(0, 10.0)),
            Stage::Unknown,
        ),
        (
            |world| {
                fly(world, &[Step::TakeOff(10.0)]);
                world.waypoint(9, &square(), 0)
            },
            Stage::Aborted,
        ),
        (
            |world| {
                fly(world, &[Step::TakeOff(10.0)]);
                world.waypoint(9, &square()[..1], 0)
            },
            Stage::Unknown,
        ),
    ];
    for (begin, stage) in cases {
        let mut world = World::new(&WorldConfig::new());
        fly(&mut world, &[Step::Start]);
        let id = begin(&mut world);
        world.run_for(std::time::Duration::from_millis(500));
        assert_eq!(world.witness.outcome(id), None, "it is still open");
        world.finish();
        let outcome = world.witness.outcome(id).expect("a final report");
        assert_eq!(
            (outcome.stage, outcome.reason),
            (stage, Reason::BridgeEnding)
        );
    }
}

#[test]
fn a_sender_that_goes_takes_its_unfinished_path_along_and_leaves_a_movement_alone() {
    let mut world = World::new(&WorldConfig::new());
    fly(&mut world, &[Step::Start, Step::TakeOff(10.0)]);
    let path = square();
    let first = world.waypoint(9, &path, 0);
    let second = world.waypoint(9, &path, 1);
    world.sender_gone(second);
    let outcome = world.witness.outcome(first).expect("a final report");
    assert!(outcome.is_done(), "it became part of the path");
    let outcome = world.witness.outcome(second).expect("a final report");
    assert_eq!(
        (outcome.stage, outcome.reason),
        (Stage::Aborted, Reason::PathBroken)
    );
    let functionality = world.witness.state.functionality();
    assert_eq!(functionality, Some(AtRest));

    let id = world.waypoint(10, &path[..1], 0);
    world.sender_gone(id);
    world.run_until("the path is flown", |world| {
        world.witness.outcome(id).is_some()
    });
    assert!(world.witness.outcome(id).expect("awaited").is_done());
    fly(&mut world, &[Step::Land]);
    world.finish();
}

#[test]
fn without_a_gps_fix_nothing_is_begun() {
    let mut config = WorldConfig::new();
    config.simulator.model.gps_fix_after = std::time::Duration::from_secs(20);
    let mut world = World::new(&config);
    await_link(&mut world);
    world.control(ControlCommand::Start);
    let outcome = carry_out(&mut world, &Step::TakeOff(10.0));
    assert_eq!(
        (outcome.stage, outcome.reason),
        (Stage::Refused, Reason::NoPosition)
    );
    world.run_for(std::time::Duration::from_secs(21));
    fly(
        &mut world,
        &[Step::TakeOff(10.0), Step::Path(square()), Step::Land],
    );
    world.finish();
}
