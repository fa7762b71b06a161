//! [`new_file`]: a record that is written anew.

use std::fs::{self, File};
use std::io::{BufWriter, ErrorKind, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

use recording::read::ReadError;
use runtime::exit::Failure;

/// Writes a record anew: what `write` gives, onto the disk, into a file that only its owner may write and its group may
/// read. `next_step` is for a file that is there already.
///
/// # Errors
///
/// Code 2 when the file is there already or cannot be written; what was written of it is removed, because it would look
/// like all.
pub fn new_file<T>(
    path: &Path,
    next_step: &str,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<T, ReadError>,
) -> Result<T, Failure> {
    let name = path.display();
    let mut options = File::options();
    let file = options.write(true).create_new(true).mode(0o640).open(path);
    let file = file.map_err(|error| match error.kind() {
        ErrorKind::AlreadyExists => {
            Failure::usage(format!("{name} exists already")).with_next_step(next_step)
        }
        _ => Failure::usage(format!("{name} cannot be written: {error}")),
    })?;
    let mut to = BufWriter::new(file);
    let written = write(&mut to).and_then(|written| {
        to.flush()?;
        to.get_ref().sync_all()?;
        Ok(written)
    });
    written.map_err(|error| {
        let _ = fs::remove_file(path);
        Failure::usage(error).context(name.to_string())
    })
}
