//! How things are shown: JSON and the fields of samples by name, numbers and paragraphs in words, reports as messages, the terminal.

pub mod fields;
pub mod finding;
pub mod messages;
pub mod stamps;
pub mod terminal;
pub mod words;

use std::fmt::Display;
use std::io::{self, Write};

use runtime::exit::{ExitCode, Failure, OrFail};
use serde::Serialize;

/// Prints a report on standard output: as one line of JSON, or as text.
pub(crate) fn print(report: &(impl Serialize + Display), is_json: bool) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    match is_json {
        true => json_line(&mut out, report)?,
        false => write!(out, "{report}").map_err(Failure::output)?,
    }
    out.flush().map_err(Failure::output)
}

/// Writes `value` as one line of JSON.
pub(crate) fn json_line(to: &mut impl Write, value: &impl Serialize) -> Result<(), Failure> {
    let text = serde_json::to_string(value).or_fail(ExitCode::Internal)?;
    writeln!(to, "{text}").map_err(Failure::output)
}
