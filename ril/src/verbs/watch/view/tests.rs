//! Screens of a robot in flight, as text; and of any bits that may lie in shared memory.

use ipc_types::RobotId;
use ipc_types::module::State;
use ipc_types::outline::Outline;
use ipc_types::payload::{ModuleState, RelayLink, RelayStation, RelayStations, ascii_bytes};
use operator::render::terminal::Key;
use operator::robot::changes::Weight;
use operator::robot::chart::Chart;
use operator::robot::fixture::{at, hero, on_path, outline};
use operator::robot::model::Process;
use proptest::prelude::*;
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Modifier;
use ril_tests::Garbage;

use super::*;
use crate::verbs::watch::fixture::{app, clock};

fn drawn(app: &App, clock: Clocks, glyphs: Glyphs, width: u16, height: u16) -> Buffer {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).expect("a test's terminal");
    let frame = |frame: &mut ratatui::Frame<'_>| draw(app, clock, glyphs, frame.buffer_mut());
    terminal.draw(frame).expect("a picture");
    terminal.backend().buffer().clone()
}

fn text(buffer: &Buffer) -> String {
    let width = usize::from(buffer.area.width);
    let lines = buffer.content.chunks(width).map(|line| {
        let line: String = line.iter().map(|cell| cell.symbol()).collect();
        line.trim_end().to_owned() + "\n"
    });
    lines.collect()
}

#[track_caller]
fn assert_screen(buffer: &Buffer, expected: &str) {
    let shown = text(buffer);
    assert!(
        shown == expected,
        "the screen is\n{shown}\nand not\n{expected}"
    );
}

#[test]
fn a_flight_at_80_by_24() {
    let buffer = drawn(&app(1), clock(20_000), Glyphs::Unicode, 80, 24);
    assert_screen(&buffer, include_str!("screens/80x24.txt"));
}

#[test]
fn a_flight_at_120_by_40() {
    let mut app = app(1);
    app.key(Key::Char('z'), at(20_000));
    app.key(Key::Char('z'), at(20_000));
    let buffer = drawn(&app, clock(20_000), Glyphs::Unicode, 120, 40);
    assert_screen(&buffer, include_str!("screens/120x40.txt"));
}

#[test]
fn several_robots_with_nothing_but_ascii() {
    let mut app = app(9);
    app.robots_mut()[1].hero(&hero(0.0, 15.0, 20_000), at(20_000));
    app.robots_mut()[1].judge(at(20_000));
    let buffer = drawn(&app, clock(20_000), Glyphs::Ascii, 80, 24);
    assert_screen(&buffer, include_str!("screens/nine-ascii.txt"));
    assert!(buffer.content.iter().all(|cell| cell.symbol().is_ascii()));
}

#[test]
fn a_replay_is_called_so_whatever_the_width() {
    let mut app = app(1);
    let mut state = on_path(1, 20_000);
    assert!(!text(&drawn(&app, clock(20_000), Glyphs::Unicode, 80, 24)).contains("REPLAY"));
    state.safety.reserved = 1;
    app.robots_mut()[0].state(&state, at(20_000));
    for width in [80, 120] {
        let shown = text(&drawn(&app, clock(20_000), Glyphs::Unicode, width, 24));
        let first = shown.lines().next().unwrap();
        assert!(first.contains("robot 1  REPLAY  "), "{first}");
    }
}

#[test]
fn a_terminal_that_is_too_small_shows_the_least_and_says_so() {
    let buffer = drawn(&app(1), clock(20_000), Glyphs::Unicode, 40, 12);
    let shown = text(&buffer);
    for expected in [
        "robot 1",
        "flying the path",
        "no alarm",
        "altitude   25.0 m",
        "battery 24.1 V",
        "enlarge to 80 x 24",
        "h hold",
    ] {
        assert!(shown.contains(expected), "{expected}:\n{shown}");
    }
}

#[test]
fn at_60_by_15_what_matters_most_comes_first_and_fills_the_screen() {
    let buffer = drawn(&app(1), clock(20_000), Glyphs::Unicode, 60, 15);
    assert_screen(&buffer, include_str!("screens/60x15.txt"));
}

#[test]
fn the_station_that_commands_is_named_on_the_robot_and_at_every_station() {
    let mut stations = RelayStations {
        published_ns: at(20_000).0,
        count: 2,
        ..RelayStations::default()
    };
    for (index, (name, last_order_ns)) in [("watcher", 0), ("gcs", 7)].into_iter().enumerate() {
        stations.stations[index] = RelayStation {
            name: ascii_bytes(name),
            last_order_ns,
            is_up: 1,
            ..RelayStation::default()
        };
    }
    for (is_relayed, expected) in [
        (false, "2 stations, gcs commands"),
        (true, "0.0 s, gcs commands"),
    ] {
        let mut app = app(1);
        let robot = &mut app.robots_mut()[0];
        robot.is_relayed = is_relayed;
        let link = RelayLink {
            published_ns: at(20_000).0,
            last_heard_ns: at(20_000).0,
            samples_received: 1,
            ..RelayLink::default()
        };
        robot.relay(&link, at(20_000));
        robot.stations(&stations);
        let shown = |now_ms| text(&drawn(&app, clock(now_ms), Glyphs::Unicode, 120, 40));
        assert!(shown(20_000).contains(expected), "{}", shown(20_000));
        assert!(!shown(26_000).contains("gcs"), "the relay has ended");
    }
}

#[test]
fn a_link_says_for_how_long_it_has_been_as_it_is() {
    for (since_ms, now_ms, expected) in [
        (Some(8_000), 611_000, "up 10m03s, 0 lost"),
        (Some(20_000), 20_000, "up 0s, 0 lost"),
        // Of a bridge that does not say it: since the screen saw it.
        (None, 611_000, "up at least 10m11s"),
        (Some(700_000), 611_000, "up at least 10m11s"),
    ] {
        let mut app = app(1);
        let mut state = on_path(1, now_ms);
        state.link.state_since_ns = since_ms.map_or(0, |ms| at(ms).0);
        app.robots_mut()[0].state(&state, at(now_ms));
        let shown = text(&drawn(&app, clock(now_ms), Glyphs::Unicode, 80, 24));
        assert!(shown.contains(expected), "{expected}:\n{shown}");
    }
}

#[test]
fn an_event_has_the_same_time_of_day_whenever_it_is_drawn() {
    let mut app = app(1);
    app.robots_mut()[0]
        .journal
        .add(at(19_999), Weight::Note, "just before the second");
    for now_ms in (20_000..22_000).step_by(7) {
        let shown = text(&drawn(&app, clock(now_ms), Glyphs::Unicode, 80, 24));
        assert!(
            shown.contains("12:00:19    just before"),
            "{now_ms}:\n{shown}"
        );
    }
}

#[test]
fn the_fence_of_a_file_is_called_so_until_the_bridge_says_its_own() {
    let drawn_with = |app: &App| text(&drawn(app, clock(20_000), Glyphs::Unicode, 80, 24));
    let mut app = App::new(&[RobotId::DEFAULT], Chart::from(&outline()));
    operator::robot::fixture::fly(&mut app.robots_mut()[0]);
    let shown = drawn_with(&app);
    assert!(
        shown.contains("#x fence of file") && shown.contains("xxx"),
        "{shown}"
    );
    let number = |number| Outline {
        number,
        areas: Vec::new(),
        ..outline()
    };
    app.robots_mut()[0].held(&number(0));
    let shown = drawn_with(&app);
    assert!(
        shown.contains("#x fence ·") && !shown.contains("xxx"),
        "{shown}"
    );
    // The state names another outline than the last one that came.
    app.robots_mut()[0].held(&number(7));
    let shown = drawn_with(&app);
    assert!(shown.contains("#x fence ? · path ?"), "{shown}");
}

#[test]
fn a_bridge_that_is_gone_stands_out_without_colour() {
    let mut app = app(1);
    app.robots_mut()[0].provider(Process::Bridge, false, at(20_600));
    app.judge(at(25_000));
    let buffer = drawn(&app, clock(25_000), Glyphs::Unicode, 80, 24);
    let shown = text(&buffer);
    let lines: Vec<&str> = shown.lines().collect();
    assert!(
        lines[0].contains("GONE, 5 s old: flying the path"),
        "{shown}"
    );
    assert!(
        lines[1].contains("ALARM  the bridge is gone: start `ril bridge --robot 1`"),
        "{shown}"
    );
    assert!(
        shown.contains("STALE, 5 s old") && shown.contains("altitude ?"),
        "{shown}"
    );
    assert!(buffer[(2, 1)].modifier.contains(Modifier::REVERSED));
}

#[test]
fn a_question_is_asked_on_the_last_line() {
    let mut app = app(1);
    for letter in "lla".chars() {
        app.key(Key::Char(letter), at(20_000));
    }
    let buffer = drawn(&app, clock(20_000), Glyphs::Unicode, 80, 24);
    let shown = text(&buffer);
    let last = shown.lines().last().unwrap();
    assert!(
        last.starts_with(" robot 1: type land and Enter > la_ "),
        "{last}"
    );
    assert!(last.contains("Esc: no"), "{last}");
}

#[test]
fn without_any_process_it_says_what_is_missing() {
    let mut app = App::new(&[RobotId::DEFAULT], Chart::default());
    for process in Process::ALL {
        app.robots_mut()[0].provider(process, false, at(0));
    }
    app.judge(at(0));
    let shown = text(&drawn(&app, clock(0), Glyphs::Unicode, 80, 24));
    for expected in [
        "no bridge runs",
        "no telemetry",
        "no position yet",
        "not running",
    ] {
        assert!(shown.contains(expected), "{expected}:\n{shown}");
    }
}

#[test]
fn text_of_another_process_does_not_command_the_terminal() {
    let mut app = app(1);
    let mut status = State {
        published_ns: at(20_000).0,
        ..State::default()
    };
    status.doing[..8].copy_from_slice(b"\x1b[2Jdoom");
    app.robots_mut()[0].status(&status, at(20_000));
    let buffer = drawn(&app, clock(20_000), Glyphs::Unicode, 80, 24);
    assert!(
        !buffer
            .content
            .iter()
            .any(|cell| cell.symbol().contains('\x1b'))
    );
    assert!(!text(&buffer).contains("doom"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn any_bits_are_drawn_at_any_size(
        seed: u64,
        width in 0..200_u16,
        height in 0..60_u16,
        ms in 0..1_000_000_u64,
    ) {
        let mut app = app(2);
        let now = at(ms);
        let robot = &mut app.robots_mut()[1];
        let mut garbage = Garbage::new(seed);
        robot.is_relayed = true;
        robot.status(&garbage.payload(), now);
        robot.relay(&garbage.payload(), now);
        robot.stations(&garbage.payload());
        robot.dsp(&garbage.payload(), now);
        let states: [ModuleState; 3] = std::array::from_fn(|_| garbage.payload());
        for state in &states {
            robot.state(state, now);
            robot.hero(&garbage.payload(), now);
        }
        for state in &states {
            let valid = ModuleState { movement: state.movement, safety: state.safety, ..on_path(1, ms) };
            robot.state(&valid, now);
            robot.judge(now);
        }
        app.key(Key::Tab, now);
        app.judge(now);
        for _ in 0..3 {
            app.key(Key::Char('z'), now);
            for glyphs in [Glyphs::Unicode, Glyphs::Ascii] {
                let mut buffer = Buffer::empty(Rect::new(0, 0, width, height));
                draw(&app, clock(ms), glyphs, &mut buffer);
            }
        }
        prop_assert!(app.next(now).is_none_or(|next| next.0 > 0));
    }
}
