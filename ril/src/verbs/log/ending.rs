//! How a command ends that has read a log.

use runtime::exit::{ExitCode, Failure};

use super::files;
use super::recording::ReadError;

/// How a command ends that has read the file `name` as far as it could.
pub(super) fn ending(
    name: &str,
    trouble: Option<ReadError>,
    damaged: u64,
    unfinished_bytes: usize,
) -> Result<(), Failure> {
    if let Some(error) = trouble {
        return Err(files::unreadable(name, error));
    }
    let text = match (damaged, unfinished_bytes) {
        (0, 0) => return Ok(()),
        (0, bytes) => format!("{name} ends with {bytes} bytes of a row that is cut off"),
        (lines, 0) => format!("{name} has {lines} damaged lines"),
        (lines, bytes) => {
            format!(
                "{name} has {lines} damaged lines and ends with {bytes} bytes of a row that is cut off"
            )
        }
    };
    let text = format!("{text}: everything else was read");
    Err(Failure::new(ExitCode::NotInOrder, text))
}
