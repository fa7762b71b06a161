//! Kills and restarts in mid-path: every request ends once, nothing is executed twice, and consumers at the station go on.

use ipc_types::code::{Functionality, RelayLinkState};
use ipc_types::payload::{HeroTelemetry, ModuleState, RelayLink};
use ril_tests::process::Finished;

use crate::bridge_log::BridgeLog;
use crate::machine::says;
use crate::rig::Rig;

/// Exit code of a verb whose outcome is not known.
const OUTCOME_UNKNOWN: i32 = 7;

/// How often the verb said how its request ended: `done` is data, any other end an error.
fn finals(finished: &Finished) -> usize {
    // Every other end is the error that the verb ends with.
    let ends = ["goto: done", "error: goto "];
    let is_final = |line: &&String| ends.iter().any(|end| line.starts_with(end));
    let lines = finished.stdout.iter().chain(&finished.stderr);
    lines.filter(is_final).count()
}

#[test]
fn a_robot_relay_that_is_killed_in_mid_path_and_started_again_reports_the_true_end() {
    let Some(mut rig) = Rig::start("robot relay", "") else {
        return;
    };
    let [latitude, longitude, altitude] = rig.take_off();
    let mut consumer = rig.station.subscribe::<HeroTelemetry>(1);
    let before = consumer.next();
    let generations = consumer.port.generations();
    let mut path = rig.station.start(&format!(
        "goto {},{longitude},{altitude}",
        latitude + 0.0005
    ));
    path.wait_for_text("accepted");
    rig.kill_robot_relay();
    rig.start_robot_relay();
    let flown = path.wait_exit();
    assert_eq!(flown.code(), Some(0), "{flown:#?}");
    assert_eq!(finals(&flown), 1, "{flown:#?}");
    // The same publisher at the station, with newer samples.
    let after = consumer.until("newer samples", |sample| {
        sample.source_sequence > before.source_sequence + 10
    });
    assert_eq!(after.epoch_ns, before.epoch_ns);
    assert_eq!(consumer.port.generations(), generations);
    rig.station.run("land", 0);
    let [bridge, _] = rig.end();
    assert_eq!(BridgeLog::of([&bridge]).executed_twice(), Vec::<u64>::new());
}

#[test]
fn a_station_relay_that_is_killed_in_mid_path_leaves_an_outcome_that_is_unknown_and_the_path_goes_on()
 {
    let Some(mut rig) = Rig::start("station relay", "") else {
        return;
    };
    rig.take_off();
    let mut path = rig.far_away();
    rig.kill_station_relay();
    let ended = path.wait_exit();
    assert_eq!(ended.code(), Some(OUTCOME_UNKNOWN), "{ended:#?}");
    assert_eq!(finals(&ended), 1, "{ended:#?}");
    rig.start_station_relay();
    let state = rig.station.subscribe::<ModuleState>(1).next();
    assert_eq!(
        state.functionality,
        Functionality::FollowingPath.code(),
        "the robot flies on"
    );
    rig.station.run("hold", 0);
    rig.station.run("land", 0);
    let [bridge, _] = rig.end();
    let log = BridgeLog::of([&bridge]);
    assert_eq!(log.begun("goto"), 1, "{:#?}", log.lines);
    assert_eq!(log.executed_twice(), Vec::<u64>::new());
}

#[test]
fn a_bridge_that_is_killed_in_mid_path_ends_the_request_as_unknown_and_the_next_bridge_is_there_at_once()
 {
    let Some(mut rig) = Rig::start("bridge", "") else {
        return;
    };
    rig.take_off();
    let mut links = rig.station.subscribe::<RelayLink>(1);
    let mut consumer = rig.station.subscribe::<HeroTelemetry>(1);
    let before = consumer.next();
    let mut path = rig.far_away();
    let former = rig
        .crew
        .as_mut()
        .expect("it runs")
        .restart_bridge(&rig.robot);
    let ended = path.wait_exit();
    assert_eq!(ended.code(), Some(OUTCOME_UNKNOWN), "{ended:#?}");
    assert_eq!(finals(&ended), 1, "{ended:#?}");
    assert!(says(&ended.stderr, "bridge-gone"), "{ended:#?}");
    consumer.until("samples of the next bridge", |sample| {
        sample.source_epoch_ns != before.source_epoch_ns
    });
    rig.station.await_link(1);
    rig.station.run("start", 0);
    rig.station.run("land", 0);
    // It was never the relays' link that was down.
    let link = links.next();
    assert_eq!(
        (link.state, link.outages),
        (RelayLinkState::Up.code(), 0),
        "{link:#?}"
    );
    let [bridge, _] = rig.end();
    let log = BridgeLog::of([&former, &bridge]);
    assert_eq!(log.begun("goto"), 1, "{:#?}", log.lines);
    assert_eq!(log.executed_twice(), Vec::<u64>::new());
}
