//! [`StateFile`]: what the gateway keeps over restarts, a file for each thing: the mission, the home of a flight, the
//! timestamp of signatures.

use std::fs::File;
use std::io::{self, ErrorKind, Read};
use std::path::{Path, PathBuf};

use ipc_types::RobotId;
use runtime::durable;

/// A file of what the gateway keeps over restarts; without a path nothing is kept.
pub(crate) struct StateFile {
    path: Option<PathBuf>,
}

/// Why something is not kept.
#[derive(Debug, thiserror::Error)]
pub(crate) enum StateError {
    /// This user has no home.
    #[error("there is no folder for it: set `state` in mavlink.toml")]
    NoFolder,
    /// The file cannot be read or written.
    #[error("{}: {source}", path.display())]
    File {
        /// Which file.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// Something else is in the file.
    #[error("{} is not used: {why}", path.display())]
    Wrong {
        /// Which file.
        path: PathBuf,
        /// What is wrong, as a clause.
        why: String,
    },
}

impl StateError {
    /// Whether the disk is full, which may be another one later.
    pub fn is_full(&self) -> bool {
        use ErrorKind::{QuotaExceeded, StorageFull};
        matches!(self, StateError::File { source, .. } if matches!(source.kind(), StorageFull | QuotaExceeded))
    }
}

impl StateFile {
    /// The file of `robot` for `what` in `folder`; without a folder nothing can be kept.
    pub fn new(folder: Option<&Path>, robot: RobotId, what: &str) -> StateFile {
        StateFile {
            path: folder.map(|folder| folder.join(format!("robot-{robot}.{what}"))),
        }
    }

    fn path(&self) -> Result<&Path, StateError> {
        self.path.as_deref().ok_or(StateError::NoFolder)
    }

    /// What was kept, as `decode` makes it of at most `limit` bytes; `None` if nothing was.
    pub fn read<T>(
        &self,
        limit: usize,
        decode: impl FnOnce(&[u8]) -> Result<T, String>,
    ) -> Result<Option<T>, StateError> {
        let path = self.path()?;
        let mut bytes = Vec::new();
        let opened =
            File::open(path).and_then(|file| file.take(limit as u64 + 1).read_to_end(&mut bytes));
        let path = path.to_owned();
        match opened {
            Ok(_) if bytes.len() > limit => {
                let why = "it is too long".to_owned();
                Err(StateError::Wrong { path, why })
            }
            Ok(_) => match decode(&bytes) {
                Ok(kept) => Ok(Some(kept)),
                Err(why) => Err(StateError::Wrong { path, why }),
            },
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            Err(source) => Err(StateError::File { path, source }),
        }
    }

    /// Keeps it: a process or machine that ends meanwhile leaves what was kept before, or this.
    pub fn write(&self, bytes: &[u8]) -> Result<(), StateError> {
        let path = self.path()?;
        durable::replace(path, bytes).map_err(|source| StateError::File {
            path: path.to_owned(),
            source,
        })
    }
}

/// Longest file of a timestamp: a number of 64 bits, and the end of the line.
pub(crate) const MAX_TIMESTAMP_BYTES: usize = 21;

/// A timestamp of signatures in its file.
pub(crate) fn timestamp_of(bytes: &[u8]) -> Result<u64, String> {
    let text = str::from_utf8(bytes).ok();
    let number = text.and_then(|text| text.trim_end().parse().ok());
    number.ok_or_else(|| {
        "it is no number: remove the file if the clock of this machine is right".to_owned()
    })
}

/// Keeps a timestamp of signatures.
pub(crate) fn write_timestamp(file: &StateFile, timestamp: u64) -> Result<(), StateError> {
    file.write(format!("{timestamp}\n").as_bytes())
}

/// Warns that a timestamp of signatures was not kept. The gateway tries again with the next one, within 30 s.
pub(crate) fn warn_of_timestamp(error: &StateError) {
    let why = "a restart with a clock that was set back repeats timestamps";
    tracing::warn!(%error, "the timestamp of signatures was not kept: {why}");
}

#[cfg(test)]
mod tests {
    use std::fs;

    use crate::{MAX_FILE_BYTES, Mission};

    use super::*;

    #[test]
    fn what_is_kept_is_read_again_and_something_else_is_refused() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("state");
        let robot = RobotId::new(7).unwrap();
        let file = StateFile::new(Some(&folder), robot, "timestamp");
        let read = || file.read(MAX_TIMESTAMP_BYTES, timestamp_of);
        assert_eq!(read().unwrap(), None);
        for timestamp in [5, u64::MAX] {
            write_timestamp(&file, timestamp).unwrap();
            assert_eq!(read().unwrap(), Some(timestamp));
        }
        for wrong in ["", "five", "-1", &"0".repeat(99)] {
            file.write(wrong.as_bytes()).unwrap();
            assert!(matches!(read(), Err(StateError::Wrong { .. })), "{wrong}");
        }
    }

    #[test]
    fn a_mission_that_is_none_is_said_and_a_folder_that_is_missing_is_too() {
        let folder = tempfile::tempdir().unwrap();
        let robot = RobotId::new(1).unwrap();
        let file = StateFile::new(Some(folder.path()), robot, "mission");
        fs::write(folder.path().join("robot-1.mission"), b"RILM").unwrap();
        let decode = |bytes: &[u8]| Mission::decode(bytes).map_err(str::to_owned);
        let why = file.read(MAX_FILE_BYTES, decode).unwrap_err();
        assert!(why.to_string().contains("is not used"), "{why}");
        let nowhere = StateFile::new(None, robot, "mission");
        let why = nowhere.write(b"").unwrap_err();
        assert!(why.to_string().contains("set `state`"), "{why}");
    }
}
