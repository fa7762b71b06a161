//! Senders that are lost, with the real processes: killed, stopped, and in a time namespace of their own.

use std::process::Command;
use std::time::Duration;

use crate::common::{Flight, sandbox};
use crate::watch::screen::Screen;
use ipc_types::code::{Functionality, LinkState};
use ipc_types::payload::{DspTelemetry, ModuleState, MovementData, WaypointPosition};
use ipc_types::{Client, MonotonicNs};
use ril_tests::languages::skip;
use ril_tests::process::Signal;
use ril_tests::{Process, Sandbox};

/// Within what time the helicopter hovers, on a machine that has a processor to spare.
const LIMIT: Duration = Duration::from_secs(1);

/// A path of 5 km with these options, under way.
fn path(rig: &Sandbox, flight: &Flight, options: &str) -> Process {
    let (latitude, longitude, altitude) = flight.place;
    let remote = latitude + 0.045;
    let mut path = rig.start(&format!("goto {remote},{longitude},{altitude} {options}"));
    path.wait_for_text("goto: progress");
    path
}

fn hovers(state: &ModuleState) -> bool {
    state.functionality() == Some(Functionality::AtRest)
        && state.link.state() == Some(LinkState::Up)
        && state
            .link
            .dsp_path()
            .is_some_and(|path| path.name() == "empty")
}

#[test]
fn the_real_bridge_holds_when_a_goto_is_killed_or_hangs_and_not_when_it_says_otherwise() {
    let rig = sandbox();
    let mut flight = Flight::begin(&rig);
    let mut screen = Screen::start(&rig, "watch", 100, 30);
    let mut took = vec![];
    for signal in [Signal::KILL, Signal::INT, Signal::HUP] {
        let process = path(&rig, &flight, "");
        let begin = MonotonicNs::now();
        process.signal(signal);
        took.push(begin_to_hover(&rig, begin));
        drop(rig.kill(process));
        flight.bridge.wait_for_text("sender-lost");
        // Who did not order it is told, too.
        let told = "goto ended early: sender-lost";
        let status = rig.run("status", 0);
        assert!(status.stdout.concat().contains(told), "{status:#?}");
        screen.shows(told);
    }
    screen.quits();
    let process = path(&rig, &flight, "--lease 2s");
    // It renews, however long it flies.
    let flown = MonotonicNs::now() + Duration::from_secs(4);
    let state = rig
        .watch(1)
        .until("the path is older than a lease", |state| {
            state.published_ns > flown.0
        });
    assert_eq!(state.functionality(), Some(Functionality::FollowingPath));
    let begin = MonotonicNs::now();
    process.signal(Signal::STOP);
    let lease = Duration::from_secs(2);
    took.push(begin_to_hover(&rig, begin).saturating_sub(lease));
    process.signal(Signal::CONT);
    let mut process = process;
    process.exits(5).err_says("(sender-lost)");
    // Overloaded machines are late now and then.
    let best = took.iter().min();
    assert!(best.is_some_and(|best| *best < LIMIT), "{took:?}");

    let process = path(&rig, &flight, "--sender-lost continue");
    drop(rig.kill(process));
    // Another's order comes, and a path whose sender goes on is what it replaces.
    let state = rig.watch(1).next_sample();
    assert_eq!(state.functionality(), Some(Functionality::FollowingPath));
    let killed = path(&rig, &flight, "--preempt");
    let newer = path(&rig, &flight, "--preempt");
    drop(rig.kill(killed));
    let state = rig.watch(1).next_sample();
    assert_eq!(state.functionality(), Some(Functionality::FollowingPath));
    rig.run("hold", 0);
    let mut newer = newer;
    newer.exits(5).err_says("(replaced)");
    flight.end();
}

/// How long after `begin` the bridge said that the helicopter hovers.
fn begin_to_hover(rig: &Sandbox, begin: MonotonicNs) -> Duration {
    let state = rig.watch(1).until("the helicopter hovers", hovers);
    MonotonicNs(state.published_ns).since(begin)
}

#[test]
fn the_real_bridge_takes_stops_of_another_time_namespace_and_refuses_the_rest_with_the_reason() {
    let ahead = "unshare --time --fork --monotonic=3";
    let behind = "unshare --time --fork --monotonic=-30";
    let attempt = |words: &str| {
        let mut words = words.split_whitespace();
        let mut command = Command::new(words.next().expect("a program"));
        command.args(words).arg("true").output()
    };
    for words in [ahead, behind] {
        let attempt = attempt(words);
        if !attempt.as_ref().is_ok_and(|output| output.status.success()) {
            return skip("another time namespace", &format!("{attempt:?}"));
        }
    }
    let rig = sandbox();
    let flight = Flight::begin(&rig);
    let (latitude, longitude, altitude) = flight.place;
    for (starter, deadline) in [(ahead, ""), (behind, "--deadline 5s")] {
        let path = flight.far_away(&rig);
        let goto = format!("goto {latitude},{longitude},{altitude} --preempt {deadline}");
        let refused = rig.start_by(starter, &goto).exits(5);
        refused.err_says("(clock-differs)").err_says("`ril doctor`");
        rig.start_by(starter, &format!("hold {deadline}")).exits(0);
        let mut path = path;
        path.exits(5).err_says("(replaced)");
        rig.start_by(starter, &format!("stop {deadline}")).exits(0);
        rig.run("start", 0);
    }
    rig.start_by(behind, "land").exits(0);
    flight.end();
}

/// Samples of a window in which the wakes of the bridge are counted, and renewals behind each.
const SAMPLES: u64 = 100;
const RENEWALS: u64 = 20;

#[test]
fn renewals_of_a_lease_cost_the_bridge_no_wake() {
    let rig = sandbox();
    let flight = Flight::begin(&rig);
    let (latitude, longitude_deg, altitude_m) = flight.place;
    let far_away = WaypointPosition {
        latitude_deg: latitude + 0.045,
        longitude_deg,
        altitude_m,
    };
    let ipc = rig.domain.join("renewing");
    let mut client: Client<MovementData> = ipc.client().expect("a client");
    let path = MovementData {
        // So long that it does not end in the test, when the bridge would look at it.
        lease_ms: 60_000,
        ..MovementData::waypoint(7001, 7001, far_away, true, true)
    };
    client.send(&path).expect("a bridge");
    rig.watch(1).until("the path is flown", |state| {
        state.functionality() == Some(Functionality::FollowingPath)
    });
    let mut samples = rig.subscribe::<DspTelemetry>(1);
    // Wakes for a hundred samples that the bridge publishes, whether they are all seen here or not.
    let mut window = |renewals| {
        let (begin, before) = (samples.next_sample().sequence, wakes(&flight.bridge));
        let mut published = 0;
        while published < SAMPLES {
            published = samples.next_sample().sequence - begin;
            for _ in 0..renewals {
                client.drain(|_| {});
            }
        }
        100 * (wakes(&flight.bridge) - before) / published
    };
    // The least counts: what else the machine does only adds.
    let mut least = |renewals| (0..3).map(|_| window(renewals)).min().expect("windows");
    let (without, with) = (least(0), least(RENEWALS));
    // When pieces of a frame come together is a matter of how busy the machine is.
    assert!(
        with <= without + 100 * RENEWALS / 2,
        "{with} wakes, {without} without renewals"
    );
    drop(client);
    flight.end();
}

/// How often the loop of a process has slept so far.
fn wakes(process: &Process) -> u64 {
    let status =
        std::fs::read_to_string(format!("/proc/{}/status", process.id())).expect("it runs");
    let mut lines = status.lines();
    let switches = lines.find_map(|line| line.strip_prefix("voluntary_ctxt_switches:"));
    switches
        .and_then(|number| number.trim().parse().ok())
        .expect("the kernel counts them")
}
