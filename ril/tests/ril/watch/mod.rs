//! `ril watch` on a pseudo-terminal, and `ril status` with its exit codes and `--watch`: with real processes, and with
//! publishers that do as they are told.

mod picture;
pub mod screen;
mod status;

use crate::common::{FOR_SLOW_MACHINES, Flight, end, movement, sandbox};
use ipc_types::RobotId;
use ipc_types::code::{ControlCommand, LinkState, MovementKind, Reason};
use ipc_types::payload::DspTelemetry;
use ril_tests::process::Signal;
use ril_tests::{Answer, Received, StandInBridge};
use rustix::termios::Action;
use screen::Screen;

#[test]
fn a_flight_is_watched_held_and_its_bridge_is_missed_and_back() {
    let rig = sandbox();
    let mut flight = Flight::begin(&rig);
    let status = rig.status(1);
    let mut screen = Screen::start(&rig, "watch --robot 1", 80, 24);
    screen.shows("hovering");
    screen.shows("translating telemetry");
    let mut path = flight.far_away(&rig);
    screen.shows("flying the path, waypoint 1 of 1");
    screen.shows("in the air");
    screen.shows("0 of 1 reached");

    screen.types("h");
    screen.shows("robot 1: type hold and Enter > _");
    screen.types("hold\r");
    screen.shows("hold: sent");
    screen.shows("hold: done");
    path.exits(5);
    screen.shows("hovering");

    // It rings as well for a bridge that a machine which stalls keeps silent.
    let before = screen.bells();
    flight.bridge.signal(Signal::KILL);
    flight.bridge.wait_status();
    screen.shows("ALARM  the bridge is gone: start `ril bridge --robot 1`");
    screen.shows("GONE, ");
    screen.shows("STALE, ");
    assert!(screen.bells() > before);

    flight.bridge = rig.bridge(1);
    screen.hides("GONE, ");
    screen.shows("the bridge was started again");
    screen.shows("no alarm");

    screen.quits();
    end(status, Signal::TERM);
    flight.end();
}

#[test]
fn whatever_ends_it_the_terminal_is_given_back() {
    for end in [
        Some(Signal::TERM),
        Some(Signal::INT),
        Some(Signal::HUP),
        None,
    ] {
        let rig = sandbox();
        let mut screen = Screen::start(&rig, "watch", 80, 24);
        screen.shows("no bridge runs");
        // A word that was begun is not the shell's when it ends.
        screen.types("l");
        screen.shows("type land");
        match end {
            Some(signal) => screen.signal(signal),
            None => screen.types("\x1b\x03"),
        }
        assert_eq!(screen.ends(true).code(), Some(0), "{end:?}");
        screen.is_as_before();
        assert_eq!(screen.errors(), "");
    }
}

#[test]
fn what_it_cannot_draw_on_is_refused_with_what_to_do_instead() {
    let rig = sandbox();
    let finished = rig.run("watch", 2);
    finished.err_says("`ril status --json`");
    assert!(finished.stdout.is_empty());
    for term in ["dumb", ""] {
        let mut screen = Screen::start_with(&rig, "watch", 80, 24, &[("TERM", term)]);
        assert_eq!(screen.ends(true).code(), Some(2));
        assert!(screen.bytes.is_empty(), "{:?}", screen.bytes);
        let errors = screen.errors();
        assert!(
            errors.contains("set TERM") && errors.contains("`ril status --watch`"),
            "{errors}"
        );
        screen.is_as_before();
    }
}

#[test]
fn without_colour_nothing_is_coloured_and_alarms_still_stand_out() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    let mut state = StandInBridge::idle_state();
    state.link.state = LinkState::Gone.code();
    let no_colour = [("TERM", "xterm-256color"), ("NO_COLOR", "1")];
    let mut screen = Screen::start_with(&rig, "watch --no-bell", 80, 24, &no_colour);
    let again = || _ = bridge.publish_state(&state);
    screen.until_with("the alarm", again, |screen| {
        screen.contains("ALARM  link to the DSP gone")
    });
    let text = String::from_utf8_lossy(&screen.bytes).into_owned();
    let is_style = |(style, _): &(&str, &str)| {
        style
            .bytes()
            .all(|byte| byte.is_ascii_digit() || byte == b';')
    };
    let parts = text.split("\x1b[").filter_map(|part| part.split_once('m'));
    let styles = parts.filter(is_style);
    let parameters = styles.flat_map(|(style, _)| style.split(';'));
    for parameter in parameters.filter_map(|parameter| parameter.parse::<u32>().ok()) {
        assert!(
            [0, 1, 2, 4, 7].contains(&parameter),
            "{parameter} in {text:?}"
        );
    }
    assert!(text.contains("\x1b[0;1;7m"), "reversed and bold: {text:?}");
    assert_eq!(screen.bells(), 0);
    screen.quits();
}

#[test]
fn another_size_is_drawn_at_once_and_one_that_is_too_small_says_so() {
    let rig = sandbox();
    let mut screen = Screen::start(&rig, "watch", 80, 24);
    screen.shows("h hold");
    screen.resize(40, 12);
    screen.shows("enlarge to 80 x 24");
    screen.resize(132, 43);
    screen.shows("no position yet");
    let last = screen.text();
    assert!(!last.contains("enlarge"), "{last}");
    screen.quits();
}

#[test]
fn what_stops_to_come_is_said_although_nothing_wakes_the_screen() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    let mut state = StandInBridge::idle_state();
    state.link.telemetry_published = 1;
    bridge.publish_state(&state);
    bridge.publish(&DspTelemetry {
        flying: 1,
        ..DspTelemetry::default()
    });
    let mut screen = Screen::start(&rig, "watch", 80, 24);
    screen.shows(" s old: hovering");
    screen.shows("in the air?");
    screen.shows("the bridge says nothing");
    let again = || _ = bridge.publish_state(&state);
    screen.until_with("fresh again", again, |screen| {
        !screen.contains("old: hovering") && screen.contains("telemetry is ")
    });
    screen.quits();
}

#[test]
fn an_order_goes_to_the_robot_that_is_selected_and_how_it_ends_is_told() {
    let rig = sandbox();
    let bridges =
        [1, 2].map(|robot| StandInBridge::start_for(&rig.domain, RobotId::new(robot).unwrap()));
    // However long a machine stalls that runs other tests.
    rig.write("ril.toml", "[request]\ntimeout_s = 80\n");
    let mut screen = Screen::start(&rig, "watch", 100, 30);
    screen.shows(">1 robot 1");
    screen.shows(" 2 robot 2");
    screen.types("\t");
    screen.shows(">2 robot 2");
    screen.types("sstop\r");
    let Received::Control(control) = bridges[1].next_request() else {
        panic!("a stop was expected");
    };
    assert_eq!(control.command(), Some(ControlCommand::Stop));
    screen.shows("stop: done");

    bridges[0].answer_next(Answer::refuse(Reason::NotFlying));
    screen.types("1");
    screen.shows(">1 robot 1");
    screen.types("lland\r");
    let land = movement(bridges[0].next_request());
    assert_eq!((land.kind(), land.preempt), (Some(MovementKind::Land), 1));
    screen.shows("land was refused (not-flying)");
    screen.quits();
}

#[test]
fn a_bridge_that_hangs_does_not_stop_the_screen() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    bridge.answer_next(Answer::Hang);
    let mut screen = Screen::start(&rig, "watch", 100, 30);
    screen.shows("h hold");
    screen.types("hhold\r");
    bridge.next_request();
    screen.shows("hold: sent");
    screen.types("z");
    screen.shows("z zoom (near)");
    screen.shows("hold: no answer in time");
    screen.quits();
}

#[test]
fn without_a_bridge_an_order_is_not_sent_and_says_so() {
    let rig = sandbox();
    let mut screen = Screen::start(&rig, "watch --robot 7", 80, 24);
    screen.shows("no bridge runs");
    screen.types("hhold\r");
    screen.shows("hold: not sent, no bridge runs: start `ril bridge --robot 7`");
    screen.types("hold\r");
    screen.shows("hold: another word was typed, nothing was sent");
    screen.quits();
}

#[test]
fn a_terminal_that_takes_nothing_does_not_keep_it_from_its_end() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    let mut screen = Screen::start(&rig, "watch", 200, 60);
    screen.shows("h hold");
    // From here on nothing of its pictures is read; keys and samples make it draw more than the terminal holds.
    for number in 0..40 {
        bridge.publish(&DspTelemetry {
            flying: 1,
            valid_groups: u16::MAX,
            dsp_boots: number,
            ..DspTelemetry::default()
        });
        screen.types("\x0c");
    }
    screen.signal(Signal::TERM);
    assert_eq!(screen.ends(false).code(), Some(0));
}

#[test]
fn a_hold_is_sent_while_the_terminal_s_output_is_stopped() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    let mut screen = Screen::start(&rig, "watch", 100, 30);
    screen.shows("h hold");
    // As Ctrl+S does it.
    screen.flow(Action::OOff);
    // It draws that the first was sent before it reads the keys of the second.
    for _ in 0..2 {
        screen.types("hhold\r");
        let hold = movement(bridge.next_request());
        assert_eq!(hold.kind(), Some(MovementKind::Hold));
    }
    screen.flow(Action::OOn);
    screen.shows("hold: done");
    screen.quits();
}

#[test]
fn fence_and_path_of_files_are_drawn_and_wrong_ones_are_refused() {
    let rig = sandbox();
    rig.write(
        "bridge.toml",
        "[fence]\n[[fence.area]]\nname = \"field\"\nkind = \"inclusion\"\ncentre = [37.411, -6.001]\nradius_m = 40.0\n",
    );
    let line =
        |number, latitude| format!("{number}\t0\t3\t16\t0\t0\t0\t0\t{latitude}\t-6.001\t25\t1\n");
    let lines = [line(0, "37.411"), line(1, "37.411"), line(2, "37.4112")];
    rig.write(
        "legs.waypoints",
        &format!("QGC WPL 110\n{}", lines.concat()),
    );
    let mut screen = Screen::start(&rig, "watch --plan legs.waypoints", 80, 24);
    screen.types("zz");
    screen.shows("fence: ");
    screen.until("fence and waypoints", |screen| {
        screen.contains("#####") && screen.contains('2') && screen.contains('·')
    });
    screen.quits();
    rig.write("wild.waypoints", &format!("QGC WPL 110\n{}", line(0, "91")));
    let mut screen = Screen::start(&rig, "watch --plan wild.waypoints", 80, 24);
    assert_eq!(screen.ends(true).code(), Some(2));
    assert!(screen.errors().contains("latitude"), "{}", screen.errors());
}

#[test]
fn the_fence_of_the_live_bridge_is_drawn_and_not_that_of_the_file() {
    let rig = sandbox();
    let circle = |radius_m: f64| {
        format!(
            "{FOR_SLOW_MACHINES}[[fence.area]]\nname = \"field\"\nkind = \"inclusion\"\ncentre = [37.411, -6.001]\nradius_m = {radius_m}\n"
        )
    };
    rig.write("bridge.toml", &circle(40.0));
    let robot = rig.start_robot(1, 1);
    rig.write("bridge.toml", "");
    let mut screen = Screen::start(&rig, "watch --robot 1", 80, 24);
    screen.types("zz");
    screen.until("the fence that is in force", |screen| {
        screen.contains("fence: ") && screen.contains("####")
    });
    // Another fence comes into force.
    rig.write("bridge.toml", FOR_SLOW_MACHINES);
    rig.run("fence reload", 0);
    screen.hides("####");
    screen.quits();
    // The file that is named is meant.
    rig.write("named.toml", &circle(20.0));
    let mut screen = Screen::start(&rig, "watch --robot 1 --bridge named.toml", 80, 24);
    screen.types("zz");
    screen.shows("#x fence of file");
    screen.quits();
    robot.end();
}
