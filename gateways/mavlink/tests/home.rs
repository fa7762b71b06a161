//! Home over restarts of the gateway.

use ipc_types::TelemetryGroup;
use ipc_types::code::Reason;
use mavlink_gateway::{KeptHome, OrderKind, Settings};

use crate::common::{HERE, QGC, World, acks};

/// What is to be kept, when time has passed.
fn kept(world: &mut World) -> Option<Option<KeptHome>> {
    world.pass(1_000);
    world.tick(20);
    let now = world.now;
    world.gateway.poll_home(now)
}

/// A helicopter that flies when its gateway starts, as an earlier gateway has known it.
fn restarted(before: &World, kept: Option<KeptHome>) -> World {
    let mut world = World::new(Settings::default());
    // The gateway of the flight so far is gone.
    world.gateway = mavlink_gateway::Gateway::new(Settings::default(), 1);
    if let Some(kept) = kept {
        world.gateway.restore_home(kept);
    }
    world.state = before.state;
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
fn home_is_where_the_bridge_says_and_a_restart_of_the_gateway_changes_nothing() {
    let mut world = World::new(Settings::default());
    world.tick(20);
    world.telemetry.flying = 1;
    assert_eq!(kept(&mut world), None, "the bridge keeps it");
    let mut again = restarted(&world, None);
    let there = returns_to(&mut again).expect("a return");
    assert!((there - HERE.0).abs() < 1e-9, "{there}");
    // A bridge that was started in the air does not know it.
    world.state.ground_valid = 0;
    assert_eq!(returns_to(&mut restarted(&world, None)), None);
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
    world.command(QGC, 179, set(0.2));
    let now = world.now;
    assert_eq!(world.gateway.poll_home(now), None, "not at once again");
    let due = world.gateway.deadline().expect("something is due");
    assert!(due <= now + std::time::Duration::from_secs(1));
    let second = kept(&mut world).flatten().expect("a home");
    assert!(second.position.latitude_deg > first.position.latitude_deg);
    // From another ground, too.
    let there = returns_to(&mut restarted(&world, Some(second))).expect("a return");
    assert!((there - second.position.latitude_deg).abs() < 1e-9);
}

#[test]
fn without_a_fix_home_is_set_neither_here_nor_at_a_place() {
    let mut world = World::new(Settings::default());
    world.heartbeat(QGC);
    // The values of groups that are not valid are zeros.
    world.telemetry.gps_quality = 0;
    world.telemetry.valid_groups &= !u32::from(TelemetryGroup::OF_A_FIX);
    (world.telemetry.geodetic, world.telemetry.velocity) = Default::default();
    world.tick(20);
    world.sent();
    let here = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let there = [0.0, 0.0, 0.0, 0.0, HERE.0 as f32, HERE.1 as f32, 40.0];
    for asked in [here, there] {
        world.command(QGC, 179, asked);
        let no_position = Reason::NoPosition.code();
        assert_eq!(acks(&world.sent()), [(179, 1, no_position)]);
        let now = world.now;
        assert_eq!(world.gateway.poll_home(now), None);
    }
    // With the fix home is there.
    world.telemetry.valid_groups = 0xffff;
    world.telemetry.geodetic.latitude_rad = HERE.0.to_radians();
    world.telemetry.geodetic.longitude_rad = HERE.1.to_radians();
    world.tick(20);
    world.sent();
    world.command(QGC, 179, here);
    assert_eq!(acks(&world.sent())[0].1, 0);
}
