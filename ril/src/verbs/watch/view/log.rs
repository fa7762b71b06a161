//! What happened, newest last.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;

use super::pen::{Clock, Glyphs, OLD, TITLE, put, style_of};
use crate::verbs::watch::model::Robot;

/// Draws a title, and as many lines as fit under it.
pub(super) fn draw(robot: &Robot, clock: Clock, glyphs: Glyphs, area: Rect, buffer: &mut Buffer) {
    let rule = glyphs.pick("─", "-").repeat(area.width.into());
    put(buffer, area, 0, &rule, OLD);
    put(buffer, area, 2, " orders, alarms and events ", TITLE);
    let count = area.height.saturating_sub(1);
    for (line, entry) in robot.journal().newest(count.into()).enumerate() {
        let row = Rect {
            y: area.y + 1 + line as u16,
            height: 1,
            ..area
        };
        let time = clock.time_of_day(entry.at);
        let x = put(buffer, row, 1, &time, Style::new());
        let mark = format!("{:<2}", entry.weight.mark());
        let style = style_of(entry.weight);
        let x = put(buffer, row, x + 1, &mark, style);
        put(buffer, row, x + 1, &entry.text, style);
    }
}
