//! Home over restarts of the gateway.

use mavlink_gateway::{KeptHome, OrderKind, Settings};

use crate::common::{HERE, QGC, World, acks};

/// What is to be kept, when time has passed.
fn kept(world: &mut World) -> Option<Option<KeptHome>> {
    world.pass(1_000);
    world.tick(20);
    let now = world.now;
    world.gateway.poll_home(now)
}

/// A helicopter that flies when its gateway starts, with the home of an earlier gateway.
fn restarted(before: KeptHome, ground_altitude_m: f64) -> World {
    let mut world = World::new(Settings::default());
    // The gateway of the flight so far is gone.
    world.gateway = mavlink_gateway::Gateway::new(Settings::default(), 1);
    world.gateway.restore_home(before);
    (world.state.ground_valid, world.state.ground_altitude_m) = (1, ground_altitude_m);
    world.state.blocked = 0;
    world.telemetry.flying = 1;
    // 111 m to the north of where it took off.
    world.telemetry.geodetic.latitude_rad = (HERE.0 + 0.001).to_radians();
    world.heartbeat(QGC);
    world.tick(20);
    world.sent();
    world
}

/// Where a return goes to; `None` if it is refused.
fn returns_to(world: &mut World) -> Option<f64> {
    world.command(QGC, 20, [0.0; 7]);
    let orders = world.orders();
    match orders.as_slice() {
        [] => {
            assert_eq!(acks(&world.sent())[0].1, 1);
            None
        }
        [order] => match order.kind {
            OrderKind::GoTo(position) => Some(position.latitude_deg),
            other => panic!("{other:?}"),
        },
        more => panic!("{more:?}"),
    }
}

#[test]
fn the_home_of_a_flight_outlives_the_gateway_and_ends_with_the_flight() {
    let mut world = World::new(Settings::default());
    (world.state.ground_valid, world.state.ground_altitude_m) = (1, 29.5);
    world.tick(20);
    assert_eq!(kept(&mut world), None, "nothing is kept on the ground");
    world.telemetry.flying = 1;
    let home = kept(&mut world).flatten().expect("a home");
    assert_eq!(home.ground_altitude_m, Some(29.5));
    assert!((home.position.latitude_deg - HERE.0).abs() < 1e-9);
    assert_eq!(kept(&mut world), None, "once");

    let mut again = restarted(home, 29.5);
    let there = returns_to(&mut again).expect("a return");
    assert!((there - HERE.0).abs() < 1e-9, "{there}");
    assert_eq!(kept(&mut again), None, "it is kept already");
    // The helicopter has stood somewhere else meanwhile.
    assert_eq!(returns_to(&mut restarted(home, 29.501)), None);

    again.telemetry.flying = 0;
    assert_eq!(kept(&mut again), Some(None), "it has landed");
}

#[test]
fn a_home_of_an_operator_holds_for_all_flights_and_is_kept_at_most_once_a_second() {
    let mut world = World::flying();
    let set = |north| {
        [
            0.0,
            0.0,
            0.0,
            0.0,
            HERE.0 as f32 + north,
            HERE.1 as f32,
            40.0,
        ]
    };
    world.command(QGC, 179, set(0.1));
    let now = world.now;
    let first = world.gateway.poll_home(now).flatten().expect("a home");
    assert_eq!(first.ground_altitude_m, None);
    world.command(QGC, 179, set(0.2));
    let now = world.now;
    assert_eq!(world.gateway.poll_home(now), None, "not at once again");
    let due = world.gateway.deadline().expect("something is due");
    assert!(due <= now + std::time::Duration::from_secs(1));
    let second = kept(&mut world).flatten().expect("a home");
    assert!(second.position.latitude_deg > first.position.latitude_deg);
    // From another ground, too.
    let there = returns_to(&mut restarted(second, 7.0)).expect("a return");
    assert!((there - second.position.latitude_deg).abs() < 1e-9);
}

#[test]
fn a_boot_of_the_dsp_in_flight_leaves_home_where_the_flight_began() {
    let mut world = World::flying();
    (world.state.ground_valid, world.state.ground_altitude_m) = (1, 29.5);
    let home = kept(&mut world).flatten().expect("a home");
    let away = |world: &mut World| {
        world.telemetry.geodetic.latitude_rad = (HERE.0 + 0.001).to_radians();
        world.state.link.dsp_boots += 1;
        world.tick(20);
    };
    // For this gateway, and for one that starts again after the boot.
    away(&mut world);
    assert_eq!(kept(&mut world), None, "it stays as it is");
    let mut again = restarted(home, 29.5);
    away(&mut again);
    for world in [&mut world, &mut again] {
        let there = returns_to(world).expect("a return");
        assert!((there - HERE.0).abs() < 1e-9, "{there}");
    }
}
