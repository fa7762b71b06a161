//! Draws an [`App`] into a buffer. Meaning is never by colour alone: alarms are reversed and have a word, marks on the map have letters
//! of their own, and old values have a question mark.

mod header;
mod list;
mod log;
mod map;
#[cfg(test)]
mod tests;
mod values;

use ipc_types::MonotonicNs;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};

use super::app::App;
use super::journal::Weight;

/// The least that the whole view needs, characters. On less there are a few lines and a word about it.
pub const MIN_WIDTH: u16 = 80;

/// The least that the whole view needs, lines.
pub const MIN_HEIGHT: u16 = 24;

/// Lines of values of the robot in detail.
const VALUES: u16 = 13;

/// Least lines of the journal, its title included.
const MIN_LOG: u16 = 4;

/// Lines of the journal, its title included, on a terminal of the least height; on a higher one a quarter of it, and the map gets the rest.
const USUAL_LOG: u16 = 8;

/// Width of the values, characters.
const VALUES_WIDTH: u16 = 44;

/// Which characters are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Glyphs {
    /// Lines, bars, arrows and Braille dots.
    #[default]
    Unicode,
    /// Nothing but ASCII, for a console without these.
    Ascii,
}

impl Glyphs {
    fn pick<T>(self, unicode: T, ascii: T) -> T {
        match self {
            Glyphs::Unicode => unicode,
            Glyphs::Ascii => ascii,
        }
    }
}

/// The time for which the screen is drawn.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    /// Host monotonic time.
    pub now: MonotonicNs,
    /// The same moment by the wall clock, seconds since 1970-01-01 UTC.
    pub utc_s: u64,
}

impl Clock {
    /// The time of day of an earlier moment, UTC.
    pub fn time_of_day(self, at: MonotonicNs) -> String {
        let seconds = self.utc_s.saturating_sub(self.now.since(at).as_secs()) % 86_400;
        let (hours, minutes) = (seconds / 3600, seconds / 60 % 60);
        format!("{hours:02}:{minutes:02}:{:02}", seconds % 60)
    }
}

/// Draws `app` into all of `buffer`.
pub fn draw(app: &App, clock: Clock, glyphs: Glyphs, buffer: &mut Buffer) {
    let area = buffer.area;
    if area.width < MIN_WIDTH || area.height < MIN_HEIGHT {
        return draw_small(app, clock, buffer);
    }
    let robots = u16::try_from(app.robots().len()).unwrap_or(u16::MAX);
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
    header::draw(app.robot(), clock, row(0, 1), buffer);
    header::draw_alarm(app.robot(), clock, row(1, 1), buffer);
    list::draw(app, clock, row(2, list), buffer);
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
    values::draw(app, clock, glyphs, values, buffer);
    log::draw(
        app.robot(),
        clock,
        glyphs,
        row(2 + list + body, log),
        buffer,
    );
    header::draw_keys(app, clock, row(area.height - 1, 1), buffer);
}

/// What matters most, where there is no room for all.
fn draw_small(app: &App, clock: Clock, buffer: &mut Buffer) {
    let area = buffer.area;
    let height = area.height;
    let row = |y: u16| Rect {
        y: area.y + y,
        height: u16::from(y < height),
        ..area
    };
    header::draw(app.robot(), clock, row(0), buffer);
    header::draw_alarm(app.robot(), clock, row(1), buffer);
    let pilot = app.robot().pilot();
    let altitude = pilot
        .altitude_m
        .map_or("-".to_owned(), |m| format!("{m:.1} m"));
    let battery = pilot
        .battery_v
        .map_or("-".to_owned(), |v| format!("{v:.1} V"));
    put(
        buffer,
        row(2),
        0,
        &format!("altitude {altitude}, battery {battery}"),
        Style::new(),
    );
    let (width, height) = (area.width, area.height);
    let advice = format!("terminal {width} x {height}: all needs {MIN_WIDTH} x {MIN_HEIGHT}");
    put(buffer, row(3), 0, &advice, TITLE);
    if height > 4 {
        header::draw_keys(app, clock, row(height - 1), buffer);
    }
}

/// Writes `text` at column `x` of the first line of `area`, as far as it fits; gives the column after it.
fn put(buffer: &mut Buffer, area: Rect, x: u16, text: &str, style: Style) -> u16 {
    put_line(buffer, area, x, &Line::from(Span::styled(text, style)))
}

/// The same of a line of several styles.
fn put_line(buffer: &mut Buffer, area: Rect, x: u16, line: &Line<'_>) -> u16 {
    let area = area.intersection(buffer.area);
    if area.is_empty() || x >= area.width {
        return x;
    }
    let (end, _) = buffer.set_line(area.x + x, area.y, line, area.width - x);
    end - area.x
}

/// Writes `text` at the right end of the first line of `area`.
fn put_right(buffer: &mut Buffer, area: Rect, text: &str, style: Style) {
    let width = u16::try_from(text.chars().count()).unwrap_or(u16::MAX);
    put(buffer, area, area.width.saturating_sub(width), text, style);
}

const TITLE: Style = Style::new().add_modifier(Modifier::BOLD);
const OLD: Style = Style::new().add_modifier(Modifier::DIM);
const GOOD: Style = Style::new().fg(Color::Green);
const ORDER: Style = Style::new().fg(Color::Cyan);
const WARNING: Style = Style::new().fg(Color::Yellow).add_modifier(Modifier::BOLD);
const ALARM: Style = Style::new()
    .fg(Color::Red)
    .add_modifier(Modifier::BOLD)
    .add_modifier(Modifier::REVERSED);

fn style_of(weight: Weight) -> Style {
    match weight {
        Weight::Note => Style::new(),
        Weight::Order => ORDER,
        Weight::Warning => WARNING,
        Weight::Alarm => ALARM,
    }
}
