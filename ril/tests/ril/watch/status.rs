//! `ril status`: what a pilot asks first, exit codes for scripts, and `--watch`.

use ipc_types::code::LinkState;
use ipc_types::payload::{DspTelemetry, HeroTelemetry};
use ipc_types::{MonotonicNs, TelemetryGroup};
use ril_tests::process::Signal;
use ril_tests::{StandInBridge, StandInStatus};

use super::screen::Screen;
use crate::common::{end, json, sandbox, shown_state, start_robot, state_of};

#[test]
fn a_flight_is_told_first_and_the_link_s_state_is_the_exit_code() {
    let rig = sandbox();
    let sim = rig.sim(1, "--speed 10");
    let bridge = rig.bridge(1);
    let status = rig.status(1);
    rig.watch(1).until_ready();
    let finished = state_of(&rig, "state --timeout 60s");
    let titles = finished.stdout.iter().filter_map(|line| line.get(..12));
    let titles: Vec<&str> = titles
        .map(str::trim)
        .filter(|title| !title.is_empty())
        .collect();
    #[rustfmt::skip]
    let expected = [
        "robot", "flight", "altitude", "position", "speed", "supply", "GPS", "data", "module", "status", "control", "movement",
        "link", "DSP path", "safety", "refused", "DSP errors", "dsp", "hero",
    ];
    assert_eq!(titles, expected, "{finished:#?}");
    finished.out_says("flight      on the ground");
    let shown = shown_state(&rig, 1);
    assert_eq!(shown["flight"]["flying"], false);
    assert!(
        shown["flight"]["battery_v"].as_f64().unwrap() > 1.0,
        "{shown}"
    );

    end(sim, Signal::TERM);
    let mut watch = rig.watch(1);
    watch.until("the link is down", |state| {
        state.link.state() != Some(LinkState::Up)
    });
    rig.run("state --timeout 60s", 6)
        .out_says("link        ")
        .err_says("`ril doctor --robot 1` finds out why");
    drop(watch);
    end(bridge, Signal::TERM);
    // Status alone is shown, too.
    rig.run("state --timeout 2s", 3)
        .out_says("no bridge runs")
        .out_says("status      hero-status");
    let shown = json(&rig.run("state --timeout 2s --json", 3).stdout[0]);
    assert!(shown["module"].is_null());
    assert_eq!(
        shown["processes"],
        serde_json::json!({"bridge": false, "status": true})
    );
    end(status, Signal::TERM);
}

#[test]
fn old_telemetry_over_a_link_that_is_up_is_code_4() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    let mut state = StandInBridge::idle_state();
    state.link.telemetry_published = 1;
    bridge.publish_state(&state);
    bridge.publish(&DspTelemetry {
        received_ns: MonotonicNs::now().0 - 5_000_000_000,
        ..DspTelemetry::default()
    });
    rig.run("state --timeout 5s", 4).out_says(", STALE");
}

#[test]
fn a_status_that_hangs_is_told_from_one_that_is_not_there() {
    let rig = sandbox();
    let robot = start_robot(&rig, 10);
    rig.run("state --timeout 60s", 0);
    let mut screen = Screen::start(&rig, "watch", 160, 50);
    screen.shows("on the ground");
    robot.status.signal(Signal::STOP);
    screen.shows("`ril run status` says nothing");
    rig.run("state --timeout 5s", 4)
        .out_says("status      no sample")
        .err_says("status of robot 1 runs and says nothing");
    robot.status.signal(Signal::CONT);
    rig.run("state --timeout 60s", 0);
    screen.signal(Signal::INT);
    screen.ends(true);
    robot.end();
}

/// A sample in which position and switch are valid.
fn sample(altitude_m: f64) -> HeroTelemetry {
    let mut hero = HeroTelemetry {
        valid_groups: u32::from(TelemetryGroup::Geographic.bit()),
        flying: 1,
        received_ns: MonotonicNs::now().0,
        ..HeroTelemetry::default()
    };
    hero.geodetic.altitude_m = altitude_m;
    hero
}

#[test]
fn watched_in_a_pipe_there_is_a_line_for_each_change() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    let status = StandInStatus::start(&rig.domain);
    status.publish(&sample(10.0));
    let mut text = rig.start("state --watch");
    text.wait_for_text("in the air, hovering");
    let mut objects = rig.start("state --watch --json");
    objects.wait_for_text("\"flying\":true");
    let mut state = StandInBridge::idle_state();
    state.link.state = LinkState::Silent.code();
    bridge.publish_state(&state);
    text.wait_for_text("link silent");
    objects.wait_for_text("\"state\":\"silent\"");
    bridge.die();
    text.wait_for_text("start `ril bridge --robot 1`");
    for process in [text, objects] {
        let finished = end(process, Signal::INT);
        assert!(finished.stdout.len() < 20, "{finished:#?}");
    }
}

#[test]
fn watched_on_a_terminal_the_block_is_shown_in_its_place() {
    let rig = sandbox();
    let _bridge = StandInBridge::start(&rig.domain);
    let status = StandInStatus::start(&rig.domain);
    let mut screen = Screen::start(&rig, "state --watch", 100, 40);
    screen.shows("no telemetry");
    for altitude_m in [10.0, 11.0] {
        status.publish(&sample(altitude_m));
        screen.shows(&format!("altitude    {altitude_m:.1} m"));
    }
    let shown = screen.text();
    assert_eq!(shown.matches("altitude    ").count(), 1, "{shown}");
    screen.signal(Signal::INT);
    assert_eq!(screen.ends(true).code(), Some(0));
}
