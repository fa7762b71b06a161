//! Draws the values of the robot in detail, a line each.

use std::borrow::Cow;

use ipc_types::MonotonicNs;
use ipc_types::code::{LinkState, PilotSwitch};
use operator::render::words::{count, duration, or_dash};
use operator::robot::clock::Clocks;
use operator::robot::freshness::{Freshness, named};
use operator::robot::history::{Past, PastPoint};
use operator::robot::model::{Process, WatchedRobot};
use operator::robot::pilot;
use operator::robot::relay_link::UNREADABLE;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;

use super::pen::{GOOD, Glyphs, OLD, TITLE, WARNING, put};

/// Width of the names, characters.
const NAMES: u16 = 9;

/// An altitude that changes by less than this over a sparkline is drawn as level, m.
const LEAST_CLIMB_M: f64 = 2.0;

/// A speed that changes by less than this over a sparkline is drawn as even, m/s.
const LEAST_CHANGE_MPS: f64 = 1.0;

/// The lines where there is room for all; a curve stands below its value.
pub(super) const ALL: [&str; 13] = [
    "altitude",
    "altitudes",
    "speed",
    "speeds",
    "position",
    "path",
    "supply",
    "switch",
    "GPS",
    "DSP link",
    "telemetry",
    "status",
    "relay",
];

/// The lines where there is not: what matters most comes first.
pub(super) const SHORT: [&str; 11] = [
    "DSP link",
    "position",
    "altitude",
    "supply",
    "speed",
    "path",
    "switch",
    "telemetry",
    "GPS",
    "status",
    "relay",
];

/// Draws as many of the lines `names` as fit, in their order.
pub(super) fn draw(
    names: &[&str],
    robot: &WatchedRobot,
    clock: Clocks,
    glyphs: Glyphs,
    area: Rect,
    buffer: &mut Buffer,
) {
    let telemetry = robot.telemetry_freshness(clock.now).is_fresh();
    let bridge = robot.process(Process::Bridge, clock.now).is_fresh();
    let mut lines = Lines {
        buffer,
        area,
        glyphs,
        y: 0,
    };
    for name in names {
        let (is_fresh, (text, style)) = match *name {
            "altitudes" => {
                lines.sparkline(&robot.past, |point| point.altitude_m, LEAST_CLIMB_M);
                continue;
            }
            "speeds" => {
                lines.sparkline(
                    &robot.past,
                    |point| point.ground_speed_mps,
                    LEAST_CHANGE_MPS,
                );
                continue;
            }
            "altitude" => (telemetry, plain(altitude(robot), telemetry)),
            "speed" => (telemetry, plain(speed(robot), telemetry)),
            "position" => (telemetry, plain(position(robot, clock.now), telemetry)),
            "path" => (bridge, plain(path(robot), bridge)),
            "supply" => (telemetry, plain(supply(robot), telemetry)),
            "switch" => (telemetry, switch(robot)),
            "GPS" => (telemetry, plain(fix(robot), telemetry)),
            "DSP link" => (bridge, dsp_link(robot, clock)),
            "telemetry" => (true, telemetry_line(robot, clock)),
            "status" => (true, status(robot, clock)),
            _ => (true, relay(robot, clock)),
        };
        lines.styled(name, is_fresh, &text, style);
    }
}

/// A value that is as new as can be, or else is drawn as an old one.
fn plain(text: String, is_fresh: bool) -> (String, Style) {
    (text, if is_fresh { Style::new() } else { OLD })
}

fn fix(robot: &WatchedRobot) -> String {
    or_dash(robot.pilot.gps)
}

/// The place where the next line goes.
struct Lines<'a> {
    buffer: &'a mut Buffer,
    area: Rect,
    glyphs: Glyphs,
    y: u16,
}

impl Lines<'_> {
    fn row(&mut self) -> Rect {
        let row = Rect {
            y: self.area.y + self.y,
            height: u16::from(self.y < self.area.height),
            ..self.area
        };
        self.y += 1;
        row
    }

    /// A value; one that is not of the present has a question mark.
    fn styled(&mut self, name: &str, is_fresh: bool, text: &str, style: Style) {
        let row = self.row();
        put(self.buffer, row, 0, name, TITLE);
        if !is_fresh {
            put(self.buffer, row, NAMES, "?", WARNING);
        }
        let text = match self.glyphs {
            Glyphs::Unicode => Cow::Borrowed(text),
            Glyphs::Ascii => Cow::Owned(text.replace('°', "")),
        };
        put(self.buffer, row, NAMES + 2, &text, style);
    }

    fn sparkline(&mut self, past: &Past, value: fn(&PastPoint) -> Option<f64>, least_range: f64) {
        const BARS: [&str; 8] = ["▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"];
        const ASCII: [&str; 8] = ["_", "_", ".", ".", "-", "-", "=", "#"];
        let row = self.row();
        let width = row.width.saturating_sub(NAMES + 2);
        let bars = past.bars(value, width.into(), BARS.len() as u64, least_range);
        let text: String = bars
            .into_iter()
            .map(|bar| match bar.and_then(|bar| usize::try_from(bar).ok()) {
                Some(bar) => self.glyphs.pick(BARS, ASCII)[bar.clamp(1, BARS.len()) - 1],
                None => " ",
            })
            .collect();
        put(self.buffer, row, NAMES + 2, &text, GOOD);
    }
}

fn altitude(robot: &WatchedRobot) -> String {
    let Some(altitude_m) = robot.pilot.altitude_m else {
        return "-".to_owned();
    };
    match robot.height_m() {
        Some(height_m) => format!("{altitude_m:.1} m, {height_m:+.1} m over take-off"),
        None => format!("{altitude_m:.1} m"),
    }
}

fn speed(robot: &WatchedRobot) -> String {
    let pilot = &robot.pilot;
    let Some(speed_mps) = pilot.ground_speed_mps else {
        return "-".to_owned();
    };
    let mut text = format!("{speed_mps:.1} m/s");
    if let Some(climb_mps) = pilot.climb_mps {
        text += &format!(", climb {climb_mps:+.1}");
    }
    if let Some(course_deg) = pilot.course_deg {
        text += &format!(", course {course_deg:03.0}°");
    }
    text
}

fn position(robot: &WatchedRobot, now: MonotonicNs) -> String {
    match robot.lost_place(now) {
        Some((place, age)) => format!("- last {place}, {} ago", duration(age.as_secs_f64())),
        None => or_dash(robot.pilot.place),
    }
}

fn path(robot: &WatchedRobot) -> String {
    let Some(state) = robot.state.as_ref() else {
        return "-".to_owned();
    };
    let Some(mut text) = pilot::movement(state) else {
        return "-".to_owned();
    };
    let distance_m = state
        .movement
        .distance_to_go()
        .filter(|distance| distance.is_finite());
    if let Some(distance_m) = distance_m {
        text += &format!(", {distance_m:.1} m to go");
    }
    text
}

fn supply(robot: &WatchedRobot) -> String {
    or_dash(robot.pilot.supply())
}

fn switch(robot: &WatchedRobot) -> (String, Style) {
    let (text, style) = match robot.pilot.switch {
        Some(PilotSwitch::Auto) => ("auto: the DSP flies", GOOD),
        Some(PilotSwitch::Manual) => ("manual: the pilot flies", WARNING),
        _ => ("-", OLD),
    };
    // Of both the shorter form has room on a narrow screen.
    let text = match (robot.commander(), text.split_once(':')) {
        (Some(commander), Some((switch, _))) => format!("{switch}; {commander} commands"),
        (Some(commander), None) => format!("{text}; {commander} commands"),
        (None, _) => text.to_owned(),
    };
    (text, style)
}

fn dsp_link(robot: &WatchedRobot, clock: Clocks) -> (String, Style) {
    let Some(state) = robot.state.as_ref() else {
        return ("-".to_owned(), OLD);
    };
    let link = &state.link;
    let known = link.state();
    let name = named(known, link.state);
    let age = robot.link_age(clock.now);
    let age = age.map_or_else(String::new, |(age, is_known)| {
        let at_least = if is_known { "" } else { "at least " };
        format!(" {at_least}{}", duration(age.as_secs() as f64))
    });
    let refused = &state.refused;
    let lost = [refused.checksum, refused.truncated, refused.missed_messages]
        .into_iter()
        .fold(0_u32, u32::saturating_add);
    let text = format!(
        "{name}{age}, {lost} lost, {} repeated",
        link.commands_repeated
    );
    let style = if known == Some(LinkState::Up) {
        GOOD
    } else {
        WARNING
    };
    (text, style)
}

fn telemetry_line(robot: &WatchedRobot, clock: Clocks) -> (String, Style) {
    let freshness = robot.telemetry_freshness(clock.now);
    match freshness.age() {
        Some(age) => (format!("STALE, {age}"), WARNING),
        None if freshness.is_fresh() => (format!("fresh, {} lost", robot.lost), GOOD),
        None => ("none yet".to_owned(), OLD),
    }
}

fn status(robot: &WatchedRobot, clock: Clocks) -> (String, Style) {
    let freshness = robot.process(Process::Status, clock.now);
    let doing = robot.status.as_ref().and_then(|status| status.doing());
    let doing = doing.unwrap_or(UNREADABLE);
    match freshness {
        Freshness::Fresh => (doing.to_owned(), GOOD),
        Freshness::Absent => ("not running: raw telemetry, no logs".to_owned(), OLD),
        Freshness::Waiting => ("running, no state yet".to_owned(), WARNING),
        Freshness::Stale(_) => ("STALE: it says nothing".to_owned(), WARNING),
        Freshness::Gone(_) => ("GONE: raw telemetry, no logs".to_owned(), WARNING),
    }
}

fn relay(robot: &WatchedRobot, clock: Clocks) -> (String, Style) {
    let stations = robot.known_stations(clock.now);
    let commands = stations.and_then(|stations| stations.commanding());
    let commands = commands.map_or(String::new(), |station| {
        format!(", {} commands", station.name().unwrap_or(UNREADABLE))
    });
    if !robot.is_relayed {
        let Some(stations) = stations else {
            return ("none: the robot is on this host".to_owned(), OLD);
        };
        let up = stations.stations().iter().filter(|one| one.is_up != 0);
        let text = format!("{}{commands}", count(up.count() as u64, "station"));
        return (text, GOOD);
    }
    let Some(link) = robot.last_relay() else {
        return ("link unknown".to_owned(), WARNING);
    };
    let freshness = robot.process(Process::Relay, clock.now);
    let state = link.state().map_or("unknown", |state| state.name());
    let lost = link
        .lost_on_air()
        .map_or("-".to_owned(), |part| format!("{:.1} % lost", part * 100.0));
    let heard = link.last_heard().filter(|at| *at <= clock.now);
    let age = heard.map_or("-".to_owned(), |at| {
        format!("{:.1} s", clock.now.since(at).as_secs_f64())
    });
    let trip = link.round_trip().map_or(String::new(), |seconds| {
        format!(", round trip {:.0} ms", seconds * 1000.0)
    });
    let text = format!("{state} {age}{commands}, {lost}{trip}");
    match freshness.age() {
        Some(age) => (format!("STALE, {age}: {text}"), WARNING),
        None if link.is_up() => (text, GOOD),
        None => (text, WARNING),
    }
}
