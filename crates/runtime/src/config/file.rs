//! Reading a configuration file, which never waits for another process, and for a disk no longer than its caller can.

use std::fs::{self, File, FileType, OpenOptions};
use std::io::{self, Read};
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::path::Path;
use std::time::Duration;

use rustix::fs::OFlags;

use super::error::{ConfigError, MAX_FILE_BYTES, invalid};
use crate::helper::within;

/// As [`read_or_default`], for at most `limit`.
pub(super) fn read_within(
    explicit: Option<&Path>,
    default_file: &Path,
    limit: Duration,
) -> Result<Option<String>, ConfigError> {
    let file = explicit.unwrap_or(default_file).to_owned();
    let (is_explicit, path) = (explicit.is_some(), file.clone());
    let read = move || read_or_default(is_explicit.then_some(&path), &path);
    within("config", limit, read).unwrap_or(Err(ConfigError::NotInTime { file, limit }))
}

/// The text of the file; `None` if none was named and the default one is not there.
pub(super) fn read_or_default(
    explicit: Option<&Path>,
    default_file: &Path,
) -> Result<Option<String>, ConfigError> {
    match read(explicit.unwrap_or(default_file)) {
        Ok(text) => Ok(Some(text)),
        Err(ConfigError::Unreadable { source, .. })
            if explicit.is_none() && source.kind() == io::ErrorKind::NotFound =>
        {
            Ok(None)
        }
        Err(error) => Err(error),
    }
}

/// The text of `file`.
fn read(file: &Path) -> Result<String, ConfigError> {
    let mut bytes = Vec::new();
    let outcome = open(file).and_then(|opened| match opened {
        Opened::Regular(opened) => {
            // One byte more than allowed distinguishes a file of the greatest length from a longer one.
            opened.take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes)?;
            Ok(None)
        }
        Opened::Other(kind) => Ok(Some(kind)),
    });
    if let Ok(Some(kind)) = outcome {
        return Err(ConfigError::NotAFile {
            file: file.to_owned(),
            what: describe(kind),
        });
    }
    if let Err(source) = outcome {
        let next_step = match source.kind() {
            io::ErrorKind::NotFound => "; name a file that exists, or none for the defaults",
            io::ErrorKind::PermissionDenied => "; give yourself read permission",
            _ => "",
        };
        return Err(ConfigError::Unreadable {
            file: file.to_owned(),
            next_step,
            source,
        });
    }
    if bytes.len() as u64 > MAX_FILE_BYTES {
        return Err(ConfigError::TooLong {
            file: file.to_owned(),
        });
    }
    String::from_utf8(bytes).map_err(|error| {
        let start = error.utf8_error().valid_up_to();
        let reason = "is not UTF-8 text; save the file as UTF-8".to_owned();
        invalid(error.as_bytes(), start, reason, file)
    })
}

/// What is at a path: a file that can be read, or something that cannot be one.
enum Opened {
    Regular(File),
    Other(FileType),
}

/// Opens `file` without waiting.
///
/// A pipe would keep its opener waiting until a process writes into it, and a serial port restarts some autopilots when
/// it is opened: therefore the look before. What comes to the place after that look is opened without waiting, and not
/// read.
fn open(file: &Path) -> io::Result<Opened> {
    let kind = fs::metadata(file)?.file_type();
    if !kind.is_file() {
        return Ok(Opened::Other(kind));
    }
    let without_waiting = OFlags::NONBLOCK | OFlags::NOCTTY;
    let opened = OpenOptions::new()
        .read(true)
        .custom_flags(without_waiting.bits() as i32)
        .open(file)?;
    let kind = opened.metadata()?.file_type();
    Ok(match kind.is_file() {
        true => Opened::Regular(opened),
        false => Opened::Other(kind),
    })
}

fn describe(kind: FileType) -> &'static str {
    if kind.is_dir() {
        "a folder"
    } else if kind.is_fifo() {
        "a pipe"
    } else if kind.is_socket() {
        "a socket"
    } else {
        "a device"
    }
}
