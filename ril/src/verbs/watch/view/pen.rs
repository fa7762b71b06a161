//! What every part of the screen is drawn with: characters, styles, and text at a place.

use operator::robot::changes::Weight;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};

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

/// What stands before a line of this weight, so that it does not need colour.
pub(super) fn mark_of(weight: Weight) -> &'static str {
    match weight {
        Weight::Note => " ",
        Weight::Order => ">",
        Weight::Warning => "!",
        Weight::Alarm => "!!",
    }
}
