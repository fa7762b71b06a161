//! A station whose link dies in mid-path: the robot does what it was configured for.

use ipc_types::code::Functionality;
use ipc_types::payload::{HeroTelemetry, ModuleState};

use crate::rig::Rig;

fn configuration(link_loss: &str) -> String {
    format!("[commands]\nlink_loss = \"{link_loss}\"\nlink_loss_s = 1\n")
}

#[test]
fn a_robot_that_is_to_hold_ends_its_path_when_the_station_is_lost() {
    let Some(mut rig) = Rig::start("hold", &configuration("hold")) else {
        return;
    };
    rig.take_off();
    let _path = rig.far_away();
    let mut states = rig.robot.subscribe::<ModuleState>(1);
    let flying = states.next();
    assert_eq!(flying.functionality, Functionality::FollowingPath.code());
    rig.kill_station_relay();
    let relay = rig.robot_relay.as_mut().expect("it runs");
    relay.wait_for_text("the movement is ended");
    let held = states.until("the path is ended", |state| {
        state.functionality != Functionality::FollowingPath.code()
    });
    assert_ne!(
        held.functionality,
        Functionality::Landing.code(),
        "{held:#?}"
    );
    // Another life of the station commands again.
    rig.start_station_relay();
    rig.station.run("land", 0);
    rig.end();
}

#[test]
fn a_robot_that_is_to_land_lands_when_the_station_is_lost() {
    let Some(mut rig) = Rig::start("land", &configuration("land")) else {
        return;
    };
    rig.take_off();
    let _path = rig.far_away();
    let mut telemetry = rig.robot.subscribe::<HeroTelemetry>(1);
    assert!(telemetry.next().is_flying());
    rig.kill_station_relay();
    let relay = rig.robot_relay.as_mut().expect("it runs");
    relay.wait_for_text("the movement is ended");
    telemetry.until("the robot has landed", |sample| !sample.is_flying());
    rig.start_station_relay();
    rig.end();
}
