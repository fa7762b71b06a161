//! How things are shown: JSON and the fields of samples by name, numbers and paragraphs in words, reports as messages, the terminal.

pub mod fields;
pub mod finding;
pub mod messages;
pub mod stamps;
pub mod terminal;
pub mod words;

use std::io::Write;

use runtime::exit::{ExitCode, Failure, OrFail};
use serde::Serialize;

/// Writes `value` as one line of JSON.
pub(crate) fn json_line(to: &mut impl Write, value: &impl Serialize) -> Result<(), Failure> {
    let text = serde_json::to_string(value).or_fail(ExitCode::Internal)?;
    writeln!(to, "{text}").map_err(Failure::output)
}
