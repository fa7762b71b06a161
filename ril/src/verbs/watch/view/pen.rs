//! What every part of the screen is drawn with: characters, the clock, styles, and text at a place.

use ipc_types::MonotonicNs;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};

use crate::render::words::time_of_day;
use crate::robot::changes::Weight;

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
    /// The one of these two.
    pub(super) fn pick<T>(self, unicode: T, ascii: T) -> T {
        match self {
            Glyphs::Unicode => unicode,
            Glyphs::Ascii => ascii,
        }
    }
}

/// The time for which the screen is drawn.
#[derive(Clone, Copy, Debug)]
pub struct ScreenClock {
    /// Host monotonic time.
    pub now: MonotonicNs,
    /// The wall clock when host monotonic time was 0, ns since 1970-01-01 UTC. Measured once and not for each picture, so that a
    /// moment has the same time of day in all of them.
    pub zero_unix_ns: u64,
}

impl ScreenClock {
    /// A moment by the wall clock, seconds since 1970-01-01 UTC.
    pub fn utc_s(self, at: MonotonicNs) -> u64 {
        self.zero_unix_ns.saturating_add(at.0) / 1_000_000_000
    }

    /// The time of day of a moment, UTC.
    pub fn time_of_day(self, at: MonotonicNs) -> String {
        time_of_day(self.utc_s(at))
    }
}

/// Writes `text` at column `x` of the first line of `area`, as far as it fits; gives the column after it.
pub(super) fn put(buffer: &mut Buffer, area: Rect, x: u16, text: &str, style: Style) -> u16 {
    let area = area.intersection(buffer.area);
    if area.is_empty() || x >= area.width {
        return x;
    }
    let line = Line::from(Span::styled(text, style));
    let (end, _) = buffer.set_line(area.x + x, area.y, &line, area.width - x);
    end - area.x
}

/// Writes `text` at the right end of the first line of `area`.
pub(super) fn put_right(buffer: &mut Buffer, area: Rect, text: &str, style: Style) {
    let width = u16::try_from(text.chars().count()).unwrap_or(u16::MAX);
    put(buffer, area, area.width.saturating_sub(width), text, style);
}

/// Titles, and words that must be seen.
pub(super) const TITLE: Style = Style::new().add_modifier(Modifier::BOLD);
/// Values that are not of the present.
pub(super) const OLD: Style = Style::new().add_modifier(Modifier::DIM);
/// What is as it should be.
pub(super) const GOOD: Style = Style::new().fg(Color::Green);
/// What the operator ordered.
const ORDER: Style = Style::new().fg(Color::Cyan);
/// What may become an alarm.
pub(super) const WARNING: Style = Style::new().fg(Color::Yellow).add_modifier(Modifier::BOLD);
/// Alarms, which are seen without colour, too.
pub(super) const ALARM: Style = Style::new()
    .fg(Color::Red)
    .add_modifier(Modifier::BOLD)
    .add_modifier(Modifier::REVERSED);

/// How a line of this weight is drawn.
pub(super) fn style_of(weight: Weight) -> Style {
    match weight {
        Weight::Note => Style::new(),
        Weight::Order => ORDER,
        Weight::Warning => WARNING,
        Weight::Alarm => ALARM,
    }
}
