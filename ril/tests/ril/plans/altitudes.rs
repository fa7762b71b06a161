//! `ril takeoff` and `ril goto` with units, telemetry altitudes, heights above take-off, and coordinates as words of
//! their own.

use ril_tests::process::Signal;

use crate::common::{FOR_SLOW_MACHINES, end, end_all, place, sandbox};

#[test]
fn altitudes_have_units_and_are_those_of_telemetry_or_above_take_off() {
    let rig = sandbox();
    rig.write("bridge.toml", FOR_SLOW_MACHINES);
    let sim = rig.sim(1, "--speed 10");
    let bridge = rig.bridge(1);
    rig.watch(1).until_ready();
    let ground_m = place(&rig, 1).2;
    rig.run("start", 0);
    rig.run("takeoff 33ft", 0);
    let hover_m = place(&rig, 1).2;
    assert!(
        (hover_m - ground_m - 10.06).abs() < 2.0,
        "{hover_m} over {ground_m}"
    );

    // Where it hovers makes no difference to a height above take-off.
    rig.run("goto 37.4112 -6.0010 +15m", 0)
        .out_says("1 of 1 waypoints sent");
    let high_m = place(&rig, 1).2;
    assert!(
        (high_m - ground_m - 15.0).abs() < 2.0,
        "{high_m} over {ground_m}"
    );

    rig.run(&format!("goto 37.4111 -6.0010 {:.1}m", ground_m + 8.0), 0);
    let low_m = place(&rig, 1).2;
    assert!(
        (low_m - ground_m - 8.0).abs() < 2.0,
        "{low_m} over {ground_m}"
    );
    // Below the ground: a height above take-off was meant.
    rig.run("goto 37.4111 -6.0010 5m", 5)
        .err_says("(fence-breach: below-take-off, leg 1, by ")
        .err_says("such as +5m");
    // A bridge that begins in the air has not seen the ground.
    end(bridge, Signal::INT);
    let bridge = rig.bridge(1);
    rig.watch(1).until_ready();
    rig.run("start", 0);
    rig.run("goto 37.4111 -6.0010 +8m", 5)
        .err_says("the height above take-off is not known");
    rig.run("land", 0);
    end_all([bridge, sim]);
}

#[test]
fn a_relative_altitude_without_a_bridge_sends_nothing_and_says_why() {
    let rig = sandbox();
    rig.run("goto -37.4112 -6.0010 +5m --timeout 50ms --robot 7", 3)
        .err_says("start `ril run bridge --robot 7`");
}
