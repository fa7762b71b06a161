//! Draws the lines: what the robot does, and the worst alarm; the robots, one a line, when there are several; what
//! happened, newest last; keys, or the question that waits for its word.

use ipc_types::payload::ModuleState;
use operator::robot::changes::Weight;
use operator::robot::clock::Clocks;
use operator::robot::freshness::Freshness;
use operator::robot::model::{Process, WatchedRobot};
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Modifier, Style};

use super::pen::{ALARM, GOOD, Glyphs, OLD, TITLE, WARNING, mark_of, put, put_right, style_of};
use crate::verbs::watch::app::App;

/// What the robot does, in words; and the style of these.
pub(super) fn doing(robot: &WatchedRobot, clock: Clocks) -> (String, Style) {
    let doing = robot.doing(clock.now);
    let freshness = robot.process(Process::Bridge, clock.now);
    let age = freshness.age().unwrap_or_default();
    match freshness {
        Freshness::Fresh => (doing, TITLE),
        Freshness::Waiting | Freshness::Absent => (doing, WARNING),
        Freshness::Stale(_) => (format!("STALE, {age}: {doing}"), ALARM),
        Freshness::Gone(_) => (format!("GONE, {age}: {doing}"), ALARM),
    }
}

/// Whether the robot is in the air, as telemetry says.
pub(super) fn flying(robot: &WatchedRobot, clock: Clocks) -> (&'static str, Style) {
    let is_fresh = robot.telemetry_freshness(clock.now).is_fresh();
    match (robot.pilot.flying, is_fresh) {
        (Some(true), true) => ("in the air", TITLE),
        (Some(false), true) => ("on the ground", Style::new()),
        (Some(true), false) => ("in the air?", OLD),
        (Some(false), false) => ("on the ground?", OLD),
        (None, _) => ("no telemetry", OLD),
    }
}

/// Draws robot, phase, flying or landed, switch, and the time. A recording that `ril replay` plays is no robot, and is
/// called so.
pub(super) fn draw(robot: &WatchedRobot, clock: Clocks, area: Rect, buffer: &mut Buffer) {
    let mut x = put(buffer, area, 1, &format!("robot {}", robot.id), TITLE);
    if robot.state.as_ref().is_some_and(ModuleState::is_replayed) {
        x = put(buffer, area, x + 2, "REPLAY", ALARM);
    }
    let (text, style) = doing(robot, clock);
    x = put(buffer, area, x + 2, &text, style);
    let (text, style) = flying(robot, clock);
    x = put(buffer, area, x + 2, text, style);
    if let Some(switch) = robot.pilot.switch {
        let style = if switch == ipc_types::code::PilotSwitch::Auto {
            GOOD
        } else {
            WARNING
        };
        put(buffer, area, x + 2, &format!("switch {switch}"), style);
    }
    let time = format!(" {}Z", clock.time_of_day(clock.now));
    put_right(buffer, area, &time, Style::new());
}

/// The worst alarm, and how many more there are.
pub(super) fn draw_alarm(robot: &WatchedRobot, clock: Clocks, area: Rect, buffer: &mut Buffer) {
    let mut alarms = robot.alarms.lasting();
    let Some(worst) = alarms.next() else {
        put(buffer, area, 1, "no alarm", OLD);
        return;
    };
    let word = if worst.weight() == Weight::Alarm {
        "ALARM"
    } else {
        "WARNING"
    };
    let more = match alarms.count() {
        0 => String::new(),
        more => format!(", and {more} more"),
    };
    let since = clock.time_of_day(worst.since);
    let text = format!(" {word}  {} (since {since}{more}) ", worst.finding.text);
    let style = style_of(worst.weight()).add_modifier(Modifier::REVERSED);
    put(buffer, area, 0, &text, style);
}

/// The keys, or the prompt.
pub(super) fn draw_keys(app: &App, clock: Clocks, area: Rect, buffer: &mut Buffer) {
    let Some(prompt) = app.prompt.as_ref() else {
        let robots = if app.robots.len() > 1 {
            "  1-9 Tab robot"
        } else {
            ""
        };
        let zoom = app.zoom.name();
        let text = format!("h hold  l land  s stop{robots}  z zoom ({zoom})  q quit");
        put(buffer, area, 1, &text, OLD);
        return;
    };
    let (word, robot) = (prompt.order.word(), prompt.robot);
    let ask = format!(" robot {robot}: type {word} and Enter > {}_ ", prompt.typed);
    let x = put(buffer, area, 0, &ask, ALARM);
    let left = prompt.ends.since(clock.now).as_secs() + 1;
    let effect = prompt.order.effect();
    put(
        buffer,
        area,
        x + 1,
        &format!("{left} s, Esc: no. To {effect}"),
        TITLE,
    );
}

/// Columns of the parts of a line.
const DOING: u16 = 13;
const ALTITUDE: u16 = 46;
const BATTERY: u16 = 56;
const WORST: u16 = 65;

/// Draws as many robots as fit, the selected one among them, and which of the others have an alarm.
pub(super) fn draw_list(app: &App, clock: Clocks, area: Rect, buffer: &mut Buffer) {
    let all = usize::from(area.height);
    // The last line is for those that do not fit.
    let height = match app.robots.len() > all && all > 1 {
        true => all - 1,
        false => all,
    };
    if height < all && height < app.robots.len() {
        let row = Rect {
            y: area.y + height as u16,
            height: 1,
            ..area
        };
        let first = (app.selected + 1).saturating_sub(height);
        let hidden = app.robots.iter().enumerate();
        let hidden = hidden.filter(|(index, _)| !(first..first + height).contains(index));
        let alarmed: Vec<String> = hidden
            .filter(|(_, robot)| robot.alarms.lasting().next().is_some())
            .map(|(_, robot)| robot.id.to_string())
            .collect();
        let more = app.robots.len() - height;
        let (text, style) = match alarmed.is_empty() {
            true => (format!("  and {more} more, without an alarm"), OLD),
            false => (
                format!("  and {more} more; alarms of robots {}", alarmed.join(", ")),
                ALARM,
            ),
        };
        put(buffer, row, 0, &text, style);
    }
    let first = (app.selected + 1).saturating_sub(height);
    for (line, index) in (first..app.robots.len()).take(height).enumerate() {
        let robot = &app.robots[index];
        let row = Rect {
            y: area.y + line as u16,
            height: 1,
            ..area
        };
        let is_selected = index == app.selected;
        let mark = if is_selected { ">" } else { " " };
        let style = match is_selected {
            true => Style::new().add_modifier(Modifier::BOLD),
            false => Style::new(),
        };
        let title = format!("{mark}{} robot {}", index + 1, robot.id);
        put(buffer, row, 0, &title, style);
        let (doing, doing_style) = doing(robot, clock);
        let cell = |x: u16, end: u16| Rect {
            x: row.x + x,
            width: end.saturating_sub(x + 1),
            ..row
        };
        put(buffer, cell(DOING, ALTITUDE), 0, &doing, doing_style);
        let old = if robot.telemetry_freshness(clock.now).is_fresh() {
            ""
        } else {
            "?"
        };
        if let Some(altitude_m) = robot.pilot.altitude_m {
            let text = format!("{altitude_m:.1} m{old}");
            put(buffer, cell(ALTITUDE, BATTERY), 0, &text, style);
        }
        if let Some(battery_v) = robot.pilot.battery_v {
            let text = format!("{battery_v:.1} V{old}");
            put(buffer, cell(BATTERY, WORST), 0, &text, style);
        }
        if let Some(worst) = robot.alarms.lasting().next() {
            let text = format!("{} {}", mark_of(worst.weight()), worst.finding.text);
            put(
                buffer,
                cell(WORST, area.width + 1),
                0,
                &text,
                style_of(worst.weight()),
            );
        }
    }
}

/// Draws a title, with words at its right end, and as many lines as fit under it.
pub(super) fn draw_log(
    robot: &WatchedRobot,
    clock: Clocks,
    glyphs: Glyphs,
    (title, right): (&str, &str),
    area: Rect,
    buffer: &mut Buffer,
) {
    let rule = glyphs.pick("─", "-").repeat(area.width.into());
    put(buffer, area, 0, &rule, OLD);
    put(buffer, area, 2, &format!(" {title} "), TITLE);
    put_right(buffer, area, right, TITLE);
    let count = area.height.saturating_sub(1);
    for (line, entry) in robot.journal.newest(count.into()).enumerate() {
        let row = Rect {
            y: area.y + 1 + line as u16,
            height: 1,
            ..area
        };
        let time = clock.time_of_day(entry.at);
        let x = put(buffer, row, 1, &time, Style::new());
        let mark = format!("{:<2}", mark_of(entry.weight));
        let style = style_of(entry.weight);
        let x = put(buffer, row, x + 1, &mark, style);
        put(buffer, row, x + 1, &entry.text, style);
    }
}
