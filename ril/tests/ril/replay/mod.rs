//! `ril replay`: consumers see what was recorded, in its order and at its pace; requests are refused; a robot that
//! lives is left alone.

pub mod made;
mod recorded;
mod verifying;

use std::time::Duration;

use super::watch::screen::Screen;
use crate::common::{end, json, sandbox, shown_state, state_of};
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState};
use ipc_types::{MonotonicNs, Subscriber, Topic, Wake};
use made::{Made, record};
use ril_tests::process::{Signal, WAIT_LIMIT};
use ril_tests::{Replay, Sandbox, StandInStatus, TestDomain};

fn rig() -> (Sandbox, Made) {
    let rig = sandbox();
    let made = record(rig.folder());
    (rig, made)
}

fn subscriber<T: Topic>(rig: &Sandbox) -> Subscriber<T> {
    rig.domain.join("consumer").subscriber().unwrap()
}

/// The next samples, as many.
#[track_caller]
fn next<T: Topic + Copy>(subscriber: &mut Subscriber<T>, count: usize) -> Vec<T> {
    let mut samples = Vec::new();
    while samples.len() < count {
        assert_ne!(
            subscriber.wait(WAIT_LIMIT).unwrap(),
            Wake::TimedOut,
            "{} of {count}",
            samples.len()
        );
        subscriber.drain(|sample| samples.push(*sample)).unwrap();
    }
    samples
}

fn altitudes<'a>(samples: impl IntoIterator<Item = &'a HeroTelemetry>) -> Vec<f64> {
    samples
        .into_iter()
        .map(|sample| sample.geodetic.altitude_m)
        .collect()
}

#[test]
fn consumers_see_what_was_recorded_in_its_order_and_as_old_as_it_was() {
    let (rig, made) = rig();
    let mut hero = subscriber::<HeroTelemetry>(&rig);
    let mut dsp = subscriber::<DspTelemetry>(&rig);
    let mut replay = rig.start("replay flight.mcap --speed 10");
    let began = MonotonicNs::now();
    let (mut samples, mut raw) = (Vec::new(), Vec::new());
    while samples.len() < made.hero.len() {
        samples.extend(next(&mut hero, 1));
        dsp.drain(|sample| raw.push(sample.dsp_time_ms)).unwrap();
    }
    let lasted = MonotonicNs::now().since(began);
    assert_eq!(altitudes(&samples), altitudes(&made.hero));
    let sequences: Vec<u64> = samples.iter().map(|sample| sample.sequence).collect();
    assert_eq!(sequences, (1..=made.hero.len() as u64).collect::<Vec<_>>());
    // A tenth of the flight. A machine that stalls makes it longer, not shorter.
    assert!(
        lasted > Duration::from_millis(100 * (made.dsp.len() as u64 - 1) / 10),
        "{lasted:?}"
    );
    for pair in samples.windows(2) {
        let apart = pair[1].received().since(pair[0].received());
        assert!(apart >= Duration::from_millis(9), "{apart:?}");
    }
    // Raw telemetry passes before the SI telemetry that was made of it.
    let times = made.dsp.iter().map(|sample| sample.dsp_time_ms);
    assert_eq!(raw, times.collect::<Vec<_>>());
    let finished = replay.exits(0);
    assert_eq!(
        finished.stdout,
        ["1.000 s  request 77: takeoff, from process 812"]
    );
    finished.err_says("robot 1 is played in");
}

#[test]
fn what_was_old_is_as_old_again_and_the_state_says_that_it_is_replayed() {
    let (rig, _) = rig();
    let mut states = subscriber::<ModuleState>(&rig);
    let replay = rig.start("replay flight.mcap --loop");
    let state = next(&mut states, 1)[0];
    let now = MonotonicNs::now();
    assert!(state.is_replayed());
    let age = now.since(state.published());
    assert!(
        age >= Duration::from_nanos(made::AGE_NS) && age < WAIT_LIMIT,
        "{age:?}"
    );
    // The processes of the RIL take it for a robot.
    let shown = shown_state(&rig, 1);
    assert_eq!(shown["link"]["state"], "up", "{shown:#}");
    assert_eq!(shown["replayed"], true, "{shown:#}");
    let echoed = rig.run("echo hero --count 3 --json", 0);
    assert_eq!(json(&echoed.stdout[2])["schema"], "hero.HeroTelemetry.v3");
    let text = state_of(&rig, "status");
    text.out_says("replayed");
    let refused = rig.run("takeoff 10m", 5);
    refused.err_says("replayed");
    let finished = end(replay, Signal::TERM);
    finished.err_says("1 requests were refused");
}

#[test]
fn a_robot_that_lives_is_not_replaced_and_mistakes_are_told() {
    let (rig, _) = rig();
    let status = StandInStatus::start(&rig.domain);
    rig.run("replay flight.mcap", 5)
        .err_says("robot 1 lives in")
        .err_says("--robot 2");
    // As another one it can be played beside it.
    let played = rig.run("replay flight.mcap --robot 2 --from 6s -q", 0);
    assert!(played.stderr.is_empty(), "{played:#?}");
    drop(status);
    rig.write("none.mcap", "no recording");
    for (args, expected) in [
        ("replay none.mcap", "not an MCAP file"),
        ("replay missing.mcap", "missing.mcap cannot be played"),
        ("replay /dev/null", "it is no regular file"),
        ("replay flight.mcap --from 1h", "no message in this section"),
        ("replay flight.mcap --speed 0", "out of range"),
    ] {
        rig.run(args, 2).err_says(expected);
    }
}

#[test]
fn a_pause_holds_the_flight_and_steps_are_single_messages() {
    let (rig, made) = rig();
    let mut hero = subscriber::<HeroTelemetry>(&rig);
    let mut screen = Screen::start(&rig, "replay flight.mcap --speed 0.2", 90, 10);
    screen.shows("playing");
    screen.types(" ");
    screen.shows("paused");
    let mut seen = Vec::new();
    hero.drain(|sample| seen.push(*sample)).unwrap();
    let before = seen.len();
    for _ in 0..3 {
        // Of raw telemetry, SI telemetry and at times a state, each step is one message: one or two of three are SI
        // telemetry.
        screen.types("...");
        seen.extend(next(&mut hero, 1));
    }
    assert!(
        (before + 3..=before + 5).contains(&seen.len()),
        "{} {before}",
        seen.len()
    );
    assert_eq!(altitudes(&seen), altitudes(&made.hero[..seen.len()]));
    screen.types(" ");
    screen.shows("playing");
    next(&mut hero, 1);
    screen.types("q");
    assert_eq!(screen.ends(true).code(), Some(0));
    screen.is_as_before();
}

#[test]
fn a_developers_test_plays_a_recording_step_by_step() {
    let folder = ril_tests::PtyFolder::new();
    let made = record(folder.path());
    let domain = TestDomain::new();
    let mut hero = domain
        .join("consumer")
        .subscriber::<HeroTelemetry>()
        .unwrap();
    let mut replay = Replay::start(&domain, &made.file);
    let mut seen = Vec::new();
    while replay.play(Duration::from_secs(1)) {
        hero.drain(|sample| seen.push(*sample)).unwrap();
    }
    hero.drain(|sample| seen.push(*sample)).unwrap();
    assert_eq!(altitudes(&seen), altitudes(&made.hero));
    assert_eq!(replay.step(), None);
    replay.service();
}
