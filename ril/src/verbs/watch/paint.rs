//! The bytes that change what a terminal shows from one buffer to the next. ANSI sequences that every terminal of today knows.

use ratatui::buffer::{Buffer, Cell};
use ratatui::style::{Color, Modifier};

/// Takes the terminal: the other screen, no cursor, no wrapping of lines.
pub const ENTER: &[u8] = b"\x1b[?1049h\x1b[?25l\x1b[?7l\x1b[0m\x1b[2J";

/// Gives it back as it was.
pub const LEAVE: &[u8] = b"\x1b[0m\x1b[?7h\x1b[?25h\x1b[?1049l";

/// Rings the bell.
pub const BELL: &[u8] = b"\x07";

/// Adds to `out` what turns `before` into `after`; without `before`, all is drawn anew. Nothing is added when nothing changed.
pub fn changes(before: Option<&Buffer>, after: &Buffer, colour: bool, out: &mut Vec<u8>) {
    let empty;
    let before = match before {
        Some(before) if before.area == after.area => before,
        _ => {
            out.extend_from_slice(b"\x1b[0m\x1b[2J");
            empty = Buffer::empty(after.area);
            &empty
        }
    };
    let mut style = String::new();
    let mut next = None;
    for (x, y, cell) in before.diff(after) {
        if next != Some((x, y)) {
            out.extend_from_slice(format!("\x1b[{};{}H", y + 1, x + 1).as_bytes());
        }
        let wanted = sgr(cell, colour);
        if style != wanted {
            out.extend_from_slice(wanted.as_bytes());
            style = wanted;
        }
        out.extend_from_slice(cell.symbol().as_bytes());
        // A wide character moves the cursor by two: the next cell gets a place of its own.
        next = cell.symbol().is_ascii().then_some((x + 1, y));
    }
    if next.is_some() || !style.is_empty() {
        out.extend_from_slice(b"\x1b[0m");
    }
}

/// The sequence that selects the style of `cell`.
fn sgr(cell: &Cell, colour: bool) -> String {
    let mut text = "\x1b[0".to_owned();
    for (modifier, code) in [
        (Modifier::BOLD, ";1"),
        (Modifier::DIM, ";2"),
        (Modifier::UNDERLINED, ";4"),
        (Modifier::REVERSED, ";7"),
    ] {
        if cell.modifier.contains(modifier) {
            text += code;
        }
    }
    if colour {
        text += &colour_code(cell.fg, 30);
        text += &colour_code(cell.bg, 40);
    }
    text.push('m');
    text
}

/// The parameters of a colour; `base` is 30 for the foreground and 40 for the background.
fn colour_code(colour: Color, base: u8) -> String {
    let number = match colour {
        Color::Reset => return String::new(),
        Color::Indexed(index) => return format!(";{};5;{index}", base + 8),
        Color::Rgb(red, green, blue) => return format!(";{};2;{red};{green};{blue}", base + 8),
        Color::Black => 0,
        Color::Red => 1,
        Color::Green => 2,
        Color::Yellow => 3,
        Color::Blue => 4,
        Color::Magenta => 5,
        Color::Cyan => 6,
        Color::Gray => 7,
        Color::DarkGray => 60,
        Color::LightRed => 61,
        Color::LightGreen => 62,
        Color::LightYellow => 63,
        Color::LightBlue => 64,
        Color::LightMagenta => 65,
        Color::LightCyan => 66,
        Color::White => 67,
    };
    format!(";{}", base + number)
}

#[cfg(test)]
mod tests {
    use ratatui::layout::Rect;
    use ratatui::style::Style;

    use super::*;

    fn buffer(text: &str, style: Style) -> Buffer {
        let mut buffer = Buffer::empty(Rect::new(0, 0, 6, 2));
        buffer.set_string(0, 1, text, style);
        buffer
    }

    fn bytes(before: Option<&Buffer>, after: &Buffer, colour: bool) -> String {
        let mut out = Vec::new();
        changes(before, after, colour, &mut out);
        String::from_utf8(out).unwrap()
    }

    #[test]
    fn only_what_changed_is_written() {
        let before = buffer("abcdef", Style::new());
        let after = buffer("abXYef", Style::new());
        assert_eq!(
            bytes(Some(&before), &after, true),
            "\x1b[2;3H\x1b[0mXY\x1b[0m"
        );
        assert_eq!(bytes(Some(&after), &after, true), "");
    }

    #[test]
    fn without_a_buffer_before_all_is_drawn() {
        let text = bytes(None, &buffer("a", Style::new()), true);
        assert_eq!(text, "\x1b[0m\x1b[2J\x1b[2;1H\x1b[0ma\x1b[0m");
    }

    #[test]
    fn without_colour_there_is_none_but_what_stands_out_still_does() {
        let style = Style::new().fg(Color::Red).add_modifier(Modifier::REVERSED);
        let after = buffer("a", style);
        let before = Buffer::empty(after.area);
        assert!(bytes(Some(&before), &after, true).contains("\x1b[0;7;31ma"));
        assert!(bytes(Some(&before), &after, false).contains("\x1b[0;7ma"));
    }
}
