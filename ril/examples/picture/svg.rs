//! A picture of a terminal: a buffer as SVG, in which every run of characters has its place and its width, whatever the
//! font.

use ratatui::buffer::{Buffer, Cell};
use ratatui::style::{Color, Modifier};

/// Width and height of a character, and size of the font, pixels.
const WIDTH: f64 = 8.4;
const HEIGHT: f64 = 18.0;
const FONT: f64 = 14.0;

/// Free space around the characters, and height of the window's title, pixels.
const MARGIN: f64 = 12.0;
const TITLE: f64 = 30.0;

const BACKGROUND: &str = "#16181d";
const FOREGROUND: &str = "#d5d8de";
const FRAME: &str = "#2a2e37";

/// What a run of characters looks like.
#[derive(Clone, PartialEq)]
struct Look {
    fill: &'static str,
    /// Nothing is the window's own.
    back: Option<&'static str>,
    is_bold: bool,
    is_dim: bool,
    /// Few fonts with characters of one width have these, and the rest of a run would go to another font with them.
    is_braille: bool,
}

impl Look {
    fn of(cell: &Cell) -> Look {
        let (fill, back) = (name(cell.fg), name(cell.bg));
        let is_reversed = cell.modifier.contains(Modifier::REVERSED);
        let (fill, back) = match is_reversed {
            true => (
                Some(back.unwrap_or(BACKGROUND)),
                Some(fill.unwrap_or(FOREGROUND)),
            ),
            false => (fill, back),
        };
        Look {
            fill: fill.unwrap_or(FOREGROUND),
            back,
            is_bold: cell.modifier.contains(Modifier::BOLD),
            is_dim: cell.modifier.contains(Modifier::DIM),
            is_braille: cell
                .symbol()
                .starts_with(|letter| ('\u{2800}'..='\u{28ff}').contains(&letter)),
        }
    }
}

/// The picture of `buffer` in a window with this title.
pub fn svg(buffer: &Buffer, title: &str) -> String {
    let (columns, rows) = (buffer.area.width, buffer.area.height);
    let width = f64::from(columns) * WIDTH + 2.0 * MARGIN;
    let height = f64::from(rows) * HEIGHT + 2.0 * MARGIN + TITLE;
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.1} {height:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" role=\"img\">\n\
         <title>{}</title>\n\
         <rect width=\"100%\" height=\"100%\" rx=\"8\" fill=\"{BACKGROUND}\" stroke=\"{FRAME}\"/>\n",
        escaped(title)
    );
    for (number, colour) in ["#e0605a", "#e0b64c", "#6bb86b"].into_iter().enumerate() {
        let x = MARGIN + 8.0 + 18.0 * number as f64;
        text += &format!("<circle cx=\"{x:.1}\" cy=\"19\" r=\"5.5\" fill=\"{colour}\"/>\n");
    }
    text += &format!(
        "<g font-family=\"DejaVu Sans Mono, Menlo, Consolas, monospace\" font-size=\"{FONT}\" xml:space=\"preserve\">\n\
         <text x=\"{:.1}\" y=\"24\" fill=\"#8a909c\" text-anchor=\"middle\">{}</text>\n",
        width / 2.0,
        escaped(title)
    );
    for (row, cells) in buffer.content.chunks(columns.max(1).into()).enumerate() {
        text += &line(cells, row);
    }
    text + "</g>\n</svg>\n"
}

/// One line of characters as runs of the same look.
fn line(cells: &[Cell], row: usize) -> String {
    let mut text = String::new();
    let mut column = 0;
    for run in cells.chunk_by(|left, right| Look::of(left) == Look::of(right)) {
        text += &run_of(run, column, row);
        column += run.len();
    }
    text
}

fn run_of(cells: &[Cell], column: usize, row: usize) -> String {
    let look = Look::of(&cells[0]);
    let at = |column: usize| MARGIN + column as f64 * WIDTH;
    let top = MARGIN + TITLE + row as f64 * HEIGHT;
    let width = cells.len() as f64 * WIDTH;
    let mut text = String::new();
    if let Some(back) = look.back {
        let x = at(column);
        text += &format!(
            "<rect x=\"{x:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{HEIGHT}\" fill=\"{back}\"/>\n"
        );
    }
    let shown: String = cells.iter().map(Cell::symbol).collect();
    let blanks = shown.len() - shown.trim_start().len();
    let shown = shown.trim();
    if shown.is_empty() {
        return text;
    }
    let (x, y) = (at(column + blanks), top + HEIGHT * 0.74);
    let weight = if look.is_bold {
        " font-weight=\"bold\""
    } else {
        ""
    };
    let opacity = if look.is_dim { " opacity=\"0.6\"" } else { "" };
    text += &format!(
        "<text x=\"{x:.1}\" y=\"{y:.1}\" textLength=\"{:.1}\" lengthAdjust=\"spacingAndGlyphs\" fill=\"{}\"{weight}{opacity}>{}</text>\n",
        shown.chars().count() as f64 * WIDTH,
        look.fill,
        escaped(shown)
    );
    text
}

/// A colour of the palette; nothing for the terminal's own.
fn name(colour: Color) -> Option<&'static str> {
    Some(match colour {
        Color::Red | Color::LightRed => "#f0716b",
        Color::Green | Color::LightGreen => "#7fc97f",
        Color::Yellow | Color::LightYellow => "#e5c066",
        Color::Blue | Color::LightBlue => "#6ea4e8",
        Color::Magenta | Color::LightMagenta => "#d48ae0",
        Color::Cyan | Color::LightCyan => "#67c9d3",
        Color::Black => "#000000",
        Color::White => "#ffffff",
        Color::Gray => "#aab0bb",
        Color::DarkGray => "#6d7480",
        Color::Reset | Color::Rgb(..) | Color::Indexed(_) => return None,
    })
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}
