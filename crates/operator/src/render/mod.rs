//! How things are shown: JSON and the fields of samples by name, numbers and paragraphs in words, reports as messages,
//! the terminal.

pub mod fields;
pub mod finding;
pub mod messages;
pub mod stamps;
pub mod terminal;
pub mod words;

use std::fmt::Display;
use std::io::{self, Write};

use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::output::{standard_error, standard_output};
use runtime::plain::plain;
use serde::Serialize;

/// Prints a report on standard output: as one line of JSON, or as text.
pub fn print(report: &(impl Serialize + Display), is_json: bool) -> Result<(), Failure> {
    print_as(is_json, report, report)
}

/// Prints a report on standard output that has its JSON and its text apart.
pub fn print_as(is_json: bool, object: &impl Serialize, text: impl Display) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    match is_json {
        true => json_line(&mut out, object)?,
        false => {
            let text = text.to_string();
            out.write_all(plain(&text).as_bytes())
                .map_err(Failure::output)?;
        }
    }
    out.flush().map_err(Failure::output)
}

/// Writes a line for people on standard error, which may be closed or not read: data and exit code say enough.
pub fn note(text: impl Display) {
    standard_error().print(plain(&format!("{text}\n")));
}

/// Writes `value` as one line of JSON.
pub fn json_line(to: &mut impl Write, value: &impl Serialize) -> Result<(), Failure> {
    let text = json_text(value)?;
    to.write_all(text.as_bytes()).map_err(Failure::output)
}

/// `value` as one line of JSON.
pub fn json_text(value: &impl Serialize) -> Result<String, Failure> {
    Ok(serde_json::to_string(value).or_fail(ExitCode::Internal)? + "\n")
}

/// How much it matters that something is read which is printed while an order is followed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weight {
    /// What comes later says more.
    Progress,
    /// How it ended.
    Result,
}

/// Prints on standard output while an order is followed: nothing waits for its reader, see [`runtime::output`].
///
/// # Errors
///
/// When standard output was closed.
pub fn tell(weight: Weight, text: impl Into<String>) -> Result<(), Failure> {
    let out = standard_output();
    match weight {
        Weight::Progress => out.put_passing(text),
        Weight::Result => out.put(text),
    };
    match out.is_closed() {
        true => Err(Failure::output(io::ErrorKind::BrokenPipe.into())),
        false => Ok(()),
    }
}
