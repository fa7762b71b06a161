//! The style sheet.

use std::fmt::Write;

use crate::plot::colour;

/// What does not depend on the flight.
const SHEET: &str = include_str!("style.css");

/// The style sheet of a page with this many events.
pub fn sheet(events: usize) -> String {
    let dark = format!(
        "@media screen and (prefers-color-scheme:dark){{\n{}{}}}\n",
        colour::classes(true),
        colour::dark_rules()
    );
    format!("{SHEET}{}{dark}{}", colour::classes(false), jumps(events))
}

/// The mark of an event stands out when a link has led to its time. So the page needs no script.
fn jumps(events: usize) -> String {
    if events == 0 {
        return String::new();
    }
    let mut marks = String::new();
    let mut rows = String::new();
    for number in 1..=events {
        let comma = if number == 1 { "" } else { "," };
        // Writing to a string cannot fail.
        let _ = write!(marks, "{comma}#t{number}:target~.plots .m{number}");
        let _ = write!(rows, "{comma}#t{number}:target~.events #e{number}");
    }
    format!(
        "{marks}{{opacity:1;stroke-width:6;stroke-dasharray:none}}\n{rows},tr:target{{background:var(--chosen)}}\n"
    )
}
