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
    print_as(is_json, report, report)
}

/// The same of what has its JSON and its text apart.
pub(crate) fn print_as(
    is_json: bool,
    object: &impl Serialize,
    text: impl Display,
) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    match is_json {
        true => json_line(&mut out, object)?,
        false => write!(out, "{text}").map_err(Failure::output)?,
    }
    out.flush().map_err(Failure::output)
}

/// Writes a line for people on standard error. That may be closed, which does no harm: data and exit code say enough.
pub(crate) fn note(text: impl Display) {
    let _ = writeln!(io::stderr(), "{text}");
}

/// Writes `value` as one line of JSON.
pub(crate) fn json_line(to: &mut impl Write, value: &impl Serialize) -> Result<(), Failure> {
    let text = serde_json::to_string(value).or_fail(ExitCode::Internal)?;
    writeln!(to, "{text}").map_err(Failure::output)
}
