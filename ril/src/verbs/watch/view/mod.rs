//! Draws an [`App`] into a buffer. Meaning is never by colour alone: alarms are reversed and have a word, marks on the
//! map have letters of their own, and old values have a question mark.

mod lines;
mod map;
mod pen;
#[cfg(test)]
mod tests;
mod values;

use operator::robot::clock::Clocks;
pub use pen::Glyphs;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::app::App;

/// The least that the whole view needs, characters. On less there are a few lines and a word about it.
pub const MIN_WIDTH: u16 = 80;

/// The least that the whole view needs, lines.
pub const MIN_HEIGHT: u16 = 24;

/// Lines of values of the robot in detail.
const VALUES: u16 = 13;

/// Least lines of the journal, its title included.
const MIN_LOG: u16 = 4;

/// Least lines between the alarm and the keys of a small terminal with which some are given to what happened.
const MIN_SMALL: u16 = 6;

/// Lines of the journal, its title included, on a terminal of the least height; on a higher one a quarter of it, and
/// the map gets the rest.
const USUAL_LOG: u16 = 8;

/// Width of the values, characters.
const VALUES_WIDTH: u16 = 44;

/// Draws `app` into all of `buffer`.
pub fn draw(app: &App, clock: Clocks, glyphs: Glyphs, buffer: &mut Buffer) {
    let area = buffer.area;
    if area.width < MIN_WIDTH || area.height < MIN_HEIGHT {
        return draw_small(app, clock, glyphs, buffer);
    }
    let robots = u16::try_from(app.robots.len()).unwrap_or(u16::MAX);
    let spare = area.height - 3 - VALUES;
    let list = if robots > 1 {
        robots.min(spare - MIN_LOG)
    } else {
        0
    };
    let log = (spare - list).min(USUAL_LOG.max(area.height / 4));
    let body = area.height - 3 - list - log;
    let row = |y: u16, height: u16| Rect {
        y: area.y + y,
        height,
        ..area
    };
    lines::draw(app.robot(), clock, row(0, 1), buffer);
    lines::draw_alarm(app.robot(), clock, row(1, 1), buffer);
    lines::draw_list(app, clock, row(2, list), buffer);
    let middle = row(2 + list, body);
    let map = Rect {
        width: area.width - VALUES_WIDTH,
        ..middle
    };
    let values = Rect {
        x: map.right() + 1,
        width: VALUES_WIDTH - 1,
        ..middle
    };
    map::draw(app, glyphs, map, buffer);
    values::draw(&values::ALL, app.robot(), clock, glyphs, values, buffer);
    lines::draw_log(
        app.robot(),
        clock,
        glyphs,
        ("orders, alarms and events", ""),
        row(2 + list + body, log),
        buffer,
    );
    lines::draw_keys(app, clock, row(area.height - 1, 1), buffer);
}

/// What matters most, where there is no room for all: mode, alarm, values, then what happened, newest last.
fn draw_small(app: &App, clock: Clocks, glyphs: Glyphs, buffer: &mut Buffer) {
    let area = buffer.area;
    let row = |y: u16, height: u16| Rect {
        y: area.y + y,
        height: height.min(area.height.saturating_sub(y)),
        ..area
    };
    lines::draw(app.robot(), clock, row(0, 1), buffer);
    lines::draw_alarm(app.robot(), clock, row(1, 1), buffer);
    let body = area.height.saturating_sub(3);
    let log = if body < MIN_SMALL { 0 } else { body / 3 };
    let values = row(2, body - log);
    let values = Rect {
        x: values.x + 1,
        width: values.width.saturating_sub(1),
        ..values
    };
    values::draw(&values::SHORT, app.robot(), clock, glyphs, values, buffer);
    if log > 0 {
        let advice = format!(" enlarge to {MIN_WIDTH} x {MIN_HEIGHT} ");
        let log = row(2 + body - log, log);
        lines::draw_log(app.robot(), clock, glyphs, ("events", &advice), log, buffer);
    }
    if area.height > 4 {
        lines::draw_keys(app, clock, row(area.height - 1, 1), buffer);
    }
}
