//! Missions on which nothing goes wrong.

use dsp_protocol::downlink::Geographic;
use dsp_protocol::{Command, port};
use dsp_sim::helicopter::Phase;
use dsp_sim::helicopter::vector::Vector;
use ipc_types::code::Functionality::{
    AtRest, FollowingPath, Landing, ReceivingPath, Stopping, TakingOff,
};
use ipc_types::code::ModuleStatus::{Ended, Running, WaitingDataToStart};

use crate::missions::config::WorldConfig;
use crate::missions::operator::{Step, fly, point};
use crate::missions::world::World;

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
    assert!(world.probe.stops > 0, "the DSP never said stop");
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
