//! The robots, one a line, when there are several.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Modifier, Style};

use super::header;
use super::pen::{Clock, put, style_of};
use crate::verbs::watch::app::App;

/// Columns of the parts of a line.
const DOING: u16 = 13;
const ALTITUDE: u16 = 46;
const BATTERY: u16 = 56;
const ALARM: u16 = 65;

/// Draws as many robots as fit, the selected one among them.
pub(super) fn draw(app: &App, clock: Clock, area: Rect, buffer: &mut Buffer) {
    let height = usize::from(area.height);
    let first = (app.selected() + 1).saturating_sub(height);
    for (line, index) in (first..app.robots().len()).take(height).enumerate() {
        let robot = &app.robots()[index];
        let row = Rect {
            y: area.y + line as u16,
            height: 1,
            ..area
        };
        let is_selected = index == app.selected();
        let mark = if is_selected { ">" } else { " " };
        let style = match is_selected {
            true => Style::new().add_modifier(Modifier::BOLD),
            false => Style::new(),
        };
        let title = format!("{mark}{} robot {}", index + 1, robot.id());
        put(buffer, row, 0, &title, style);
        let (doing, doing_style) = header::doing(robot, clock);
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
        if let Some(altitude_m) = robot.pilot().altitude_m {
            let text = format!("{altitude_m:.1} m{old}");
            put(buffer, cell(ALTITUDE, BATTERY), 0, &text, style);
        }
        if let Some(battery_v) = robot.pilot().battery_v {
            let text = format!("{battery_v:.1} V{old}");
            put(buffer, cell(BATTERY, ALARM), 0, &text, style);
        }
        if let Some(worst) = robot.alarms().lasting().next() {
            let text = format!("{} {}", worst.weight().mark(), worst.finding.text);
            put(
                buffer,
                cell(ALARM, area.width + 1),
                0,
                &text,
                style_of(worst.weight()),
            );
        }
    }
}
