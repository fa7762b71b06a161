//! What goes wrong between a station and its robot, and what is refused: every request ends once, nothing is executed
//! twice, and the robot does what it was configured for.

use std::fs;
use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::{Functionality, RelayLinkState};
use ipc_types::payload::{HeroTelemetry, ModuleState, RelayLink, RelayStations};
use ril_tests::air::{Air, Weather};
use ril_tests::process::{Finished, Signal};
use ril_tests::relayed::{
    BridgeLog, SPEED, STATION, await_link, free_endpoint, machine, start_robot_relay,
    start_station_relay,
};
use ril_tests::{Process, Rig};

use super::{rig, ril};

/// Exit code of a verb whose outcome is not known.
const OUTCOME_UNKNOWN: i32 = 7;
const ENDED_EARLY: i32 = 5;

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
    let Some(mut rig) = rig("robot relay", "") else {
        return;
    };
    let [latitude, longitude, altitude] = rig.take_off();
    let mut consumer = rig.station.subscribe::<HeroTelemetry>(1);
    let before = consumer.next_sample();
    let generations = consumer.port.generations();
    let goto = format!("goto {},{longitude},{altitude}", latitude + 0.0005);
    for (option, code) in [("", ENDED_EARLY), (" --sender-lost continue", 0)] {
        let mut path = rig.station.start(&format!("{goto}{option}"));
        path.wait_for_text("accepted");
        rig.kill_robot_relay();
        rig.start_robot_relay();
        let ended = path.exits(code);
        assert_eq!(finals(&ended), 1, "{ended:#?}");
        if code == ENDED_EARLY {
            ended.err_says("sender-lost");
            await_link(&rig.station, 1);
        }
    }
    // The publisher at the station is the one of before, with newer samples.
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
    let Some(mut rig) = rig("station relay", "") else {
        return;
    };
    rig.take_off();
    let mut path = rig.far_away();
    rig.kill_station_relay();
    let ended = path.exits(OUTCOME_UNKNOWN);
    assert_eq!(finals(&ended), 1, "{ended:#?}");
    rig.start_station_relay();
    await_link(&rig.station, 1);
    let state = rig.station.subscribe::<ModuleState>(1).next_sample();
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
    let Some(mut rig) = rig("bridge", "") else {
        return;
    };
    rig.take_off();
    let mut links = rig.station.subscribe::<RelayLink>(1);
    let mut consumer = rig.station.subscribe::<HeroTelemetry>(1);
    let before = consumer.next_sample();
    let mut path = rig.far_away();
    let former = rig.restart_bridge();
    let ended = path.exits(OUTCOME_UNKNOWN);
    assert_eq!(finals(&ended), 1, "{ended:#?}");
    ended.err_says("bridge-gone");
    consumer.until("samples of the next bridge", |sample| {
        sample.source_epoch_ns != before.source_epoch_ns
    });
    await_link(&rig.station, 1);
    rig.station.run("start", 0);
    rig.station.run("land", 0);
    // It was never the relays' link that was down.
    let link = links.next_sample();
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

/// A robot flies a path under this order for the loss of its station, and the station is lost.
fn lose_the_station(link_loss: &str, then: impl FnOnce(&Rig)) {
    let relay_toml = format!("[commands]\nlink_loss = \"{link_loss}\"\nlink_loss_s = 1\n");
    let Some(mut rig) = rig(link_loss, &relay_toml) else {
        return;
    };
    rig.take_off();
    let _path = rig.far_away();
    let flying = rig.robot.subscribe::<ModuleState>(1).next_sample();
    assert_eq!(flying.functionality, Functionality::FollowingPath.code());
    rig.kill_station_relay();
    let relay = rig.robot_relay.as_mut().expect("it runs");
    relay.wait_for_text("the movement is ended");
    then(&rig);
    // Another instance of the station commands again. A standstill of the machine does not take the link down before
    // the order.
    let silent = "[network]\nsilent_after_ms = 60000\n";
    rig.station.write("relay.toml", silent);
    rig.start_station_relay();
    await_link(&rig.station, 1);
    if link_loss == "hold" {
        rig.station.run("land", 0);
    }
    rig.end();
}

#[test]
fn a_robot_that_is_to_hold_ends_its_path_when_the_station_is_lost() {
    lose_the_station("hold", |rig| {
        let mut states = rig.robot.subscribe::<ModuleState>(1);
        let held = states.until("the path is ended", |state| {
            state.functionality != Functionality::FollowingPath.code()
        });
        let is_landing = held.functionality == Functionality::Landing.code();
        assert!(!is_landing, "{held:#?}");
    });
}

#[test]
fn a_robot_that_is_to_land_lands_when_the_station_is_lost() {
    lose_the_station("land", |rig| {
        let mut telemetry = rig.robot.subscribe::<HeroTelemetry>(1);
        telemetry.until("the robot has landed", |sample| !sample.is_flying());
    });
}

/// How often the link is cut.
const CUTS: usize = 3;

/// A robot and a station with a radio between them, and when the station takes the link for silent. `None` if there is
/// no `ril`.
fn over_the_air(name: &str, weather: Weather, silent_after_ms: u32) -> Option<(Rig, Air)> {
    let ril = ril()?;
    let (robot, station) = (machine(&ril, name), machine(&ril, name));
    let silent = format!("[network]\nsilent_after_ms = {silent_after_ms}\n");
    station.write("relay.toml", &silent);
    let endpoint = free_endpoint();
    let air = Air::to(&endpoint, weather);
    let endpoints = [endpoint, air.endpoint.clone()];
    Some((Rig::over(robot, station, endpoints, SPEED), air))
}

#[test]
fn a_path_that_was_ordered_before_a_hold_is_not_flown_after_it_when_the_link_comes_back() {
    // A request that comes while the link is cut is not refused: the station does not know yet that it is down.
    let near = Weather::far(Duration::ZERO);
    let Some((mut rig, air)) = over_the_air("cut", near, 60_000) else {
        return;
    };
    let [latitude, longitude, altitude] = rig.take_off();
    let far = format!("goto {},{longitude},{altitude}", latitude + 0.02);
    let mut links = rig.station.subscribe::<RelayLink>(1);
    let mut states = rig.robot.subscribe::<ModuleState>(1);
    for _ in 0..CUTS {
        let sent = links.next_sample().orders_sent;
        air.cut();
        let mut path = rig.station.start(&far);
        links.until("the path is ordered", |link| link.orders_sent > sent);
        let mut hold = rig.station.start("hold");
        links.until("the hold is ordered", |link| link.orders_sent > sent + 1);
        air.join();
        hold.exits(0);
        let ended = path.wait_exit();
        assert_ne!(ended.code(), Some(0), "{ended:#?}");
        let state = states.next_sample();
        let is_flown = state.functionality == Functionality::FollowingPath.code();
        assert!(!is_flown, "after the hold: {ended:#?}\n{state:#?}");
    }
    rig.station.run("land", 0);
    rig.end();
}

/// 0.6 s round trip, and each fifth packet is late: TCP repeats it after two to three round trips.
const WEATHER: Weather = Weather {
    lost_of: Some(5),
    repetition: Duration::from_millis(1500),
    ..Weather::far(Duration::from_millis(300))
};

#[test]
fn a_link_of_six_hundred_ms_round_trip_that_loses_every_fifth_packet_connects_and_carries_orders() {
    // The air is what is tried here, and not when it counts as silent.
    let Some((mut rig, _air)) = over_the_air("slow", WEATHER, 10_000) else {
        return;
    };
    let link = rig.station.subscribe::<RelayLink>(1).next_sample();
    assert!(link.round_trip_s > 0.5, "{link:#?}");
    assert_eq!(link.open_timeout_s, 8.0);
    rig.station.run("start --timeout 60s", 0);
    rig.end();
}

#[test]
fn the_robot_s_relay_says_which_station_commands() {
    let Some(mut rig) = rig("who commands", "") else {
        return;
    };
    let mut record = rig.robot.start("record --output record");
    record.wait_for_text("/robot1/relay/stations");
    rig.station.run("start", 0);
    rig.robot.run("takeoff --altitude 5", 0);
    let relay = rig.robot_relay.as_mut().expect("it runs");
    relay.wait_for_line(|line| line.text.contains("request=") && line.text.contains("gcs"));
    let mut stations = rig.robot.subscribe::<RelayStations>(1);
    stations.until("the order", |sample| {
        let gcs = sample.stations().first();
        gcs.is_some_and(|gcs| gcs.last_order().is_some())
    });
    let mut there = rig.station.subscribe::<RelayStations>(1);
    there.until("the same at the station", |sample| {
        let commanding = sample.commanding().and_then(|station| station.name());
        commanding == Some(STATION)
    });
    let status = rig.station.run("relay status", 0);
    status.out_says("commands    gcs, last order");
    record.end();
    let record: Vec<u8> = fs::read_dir(rig.robot.path("record"))
        .expect("a folder")
        .flat_map(|file| fs::read(file.expect("a file").path()).expect("it is read"))
        .collect();
    for text in [
        "start requested by station gcs",
        "takeoff requested by process ",
    ] {
        let mut places = record.windows(text.len());
        assert!(places.any(|place| place == text.as_bytes()), "{text}");
    }
    let [bridge, _] = rig.end();
    for (command, is_relayed) in [("start", true), ("takeoff", false)] {
        let command = format!("command=\"{command}\"");
        let mut log = bridge.stderr.iter();
        let line = log.find(|line| line.contains(&command)).expect("a line");
        assert_eq!(line.contains("station=\"gcs\""), is_relayed, "{line}");
        assert!(is_relayed || !line.contains("station="), "{line}");
    }
}

/// How long samples are watched after the robot's relay has given up the station that stands still: beyond the lease of
/// its link, when the link is closed.
const WATCHED: Duration = Duration::from_secs(6);

/// A link whose closing waits until everything is sent holds up Zenoh's thread for ten seconds, in which the robot
/// publishes 1,000 samples. A machine that stalls holds up the robot as well, and so makes no gap in what it numbers.
const HELD_UP: u64 = 800;

#[test]
fn a_station_that_stands_still_does_not_hold_up_another_one() {
    let Some(mut rig) = rig("stall", "") else {
        return;
    };
    let ril = ril().expect("it was there");
    let other = machine(&ril, "stall");
    let relay = other.start(&format!(
        "relay station --name watcher --connect {}",
        rig.endpoint()
    ));
    await_link(&other, 1);
    relay.signal(Signal::STOP);
    let robot_relay = rig.robot_relay.as_mut().expect("it runs");
    robot_relay.wait_for_text("a station is silent");

    let mut telemetry = rig.station.subscribe::<HeroTelemetry>(1);
    let begin = MonotonicNs::now();
    let (mut before, mut longest) = (telemetry.next_sample().source_sequence, 0);
    while MonotonicNs::now().since(begin) < WATCHED {
        let number = telemetry.next_sample().source_sequence;
        longest = longest.max(number.saturating_sub(before));
        before = number;
    }
    assert!(longest < HELD_UP, "{longest} samples did not come");
    relay.signal(Signal::CONT);
    relay.end();
    rig.end();
}

/// Exit code of a verb that was refused.
const REFUSED: i32 = 5;

/// Ends with exit code 1 and these words.
#[track_caller]
fn assert_ends_with(mut process: Process, words: &str) {
    process.exits(1).err_says(words);
}

#[test]
fn a_station_that_may_not_command_sees_everything_and_is_told_who_may() {
    let Some(mut rig) = rig("may not command", "") else {
        return;
    };
    let ril = ril().expect("it was there");
    let other = machine(&ril, "may not command");
    let mut relay = other.start(&format!(
        "relay station --name other --connect {}",
        rig.endpoint()
    ));
    relay.wait_for_text("this station may not command");
    await_link(&other, 1);
    other.run("status", 0);
    let refused = other.run("takeoff --altitude 5", REFUSED);
    refused.err_says("relay-not-permitted");
    // The robot's own log names it, too.
    let log = relay.end();
    log.err_says("commands.stations");
    // Nothing of it came to the bridge.
    let state = rig.robot.subscribe::<ModuleState>(1).next_sample();
    assert_eq!(state.refused.requests, 0);
    rig.end();
}

#[test]
fn a_second_relay_of_a_robot_or_a_station_ends_at_once_and_says_why() {
    let Some(mut rig) = rig("second relay", "") else {
        return;
    };
    let elsewhere = free_endpoint();
    let second = rig
        .robot
        .start(&format!("relay robot --listen {elsewhere}"));
    assert_ends_with(second, "relay/state");
    let second = rig.station.start(&format!(
        "relay station --name second --connect {}",
        rig.endpoint()
    ));
    assert_ends_with(second, "relay/state");
    rig.station.run("relay status", 0);
    rig.end();
}

#[test]
fn a_robot_whose_number_is_taken_on_the_station_waits_for_its_place() {
    let Some(ril) = ril() else {
        return;
    };
    let robot = machine(&ril, "number is taken");
    let station = machine(&ril, "number is taken");
    let (processes, here) = (robot.start_robot(1, SPEED), station.start_robot(1, SPEED));
    let endpoint = free_endpoint();
    let robot_relay = start_robot_relay(&robot, &endpoint);
    let mut relay = start_station_relay(&station, &endpoint);
    relay.wait_for_text("cannot be provided here");
    let local = station.subscribe::<ModuleState>(1).next_sample();
    here.end();
    let mut states = station.subscribe::<ModuleState>(1);
    states.until("the robot's state", |state| {
        state.epoch_ns != local.epoch_ns
    });
    station.run("start", 0);
    relay.end();
    robot_relay.end();
    processes.end();
}
