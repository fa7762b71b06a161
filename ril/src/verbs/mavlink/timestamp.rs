//! [`TimestampFile`]: the timestamp of signatures that is kept, so that none is used twice when the gateway starts again.

use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use ipc_types::RobotId;
use runtime::durable;

/// Why a timestamp is not kept.
#[derive(Debug, thiserror::Error)]
pub(super) enum TimestampError {
    /// There is no folder for it.
    #[error("this user has no home for the timestamp of signatures")]
    NoFolder,
    /// The file cannot be read or written.
    #[error("the timestamp of signatures {}: {source}", path.display())]
    File {
        /// Which file.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// Something else is in the file.
    #[error("the timestamp of signatures {} is no number: remove the file if the clock of this machine is right", path.display())]
    NoNumber {
        /// Which file.
        path: PathBuf,
    },
}

impl TimestampError {
    /// Whether the disk is full, which may be another one later.
    pub fn is_full(&self) -> bool {
        use ErrorKind::{QuotaExceeded, StorageFull};
        matches!(self, TimestampError::File { source, .. } if matches!(source.kind(), StorageFull | QuotaExceeded))
    }
}

/// See the module's documentation.
pub(super) struct TimestampFile(Option<PathBuf>);

impl TimestampFile {
    /// That of a robot, in this folder.
    pub fn new(folder: Option<&Path>, robot: RobotId) -> TimestampFile {
        TimestampFile(folder.map(|folder| folder.join(format!("robot-{robot}.timestamp"))))
    }

    fn path(&self) -> Result<&Path, TimestampError> {
        self.0.as_deref().ok_or(TimestampError::NoFolder)
    }

    /// What was kept; 0 if nothing was.
    pub fn read(&self) -> Result<u64, TimestampError> {
        let path = self.path()?;
        let text = match fs::read_to_string(path) {
            Ok(text) => text,
            Err(source) if source.kind() == ErrorKind::NotFound => return Ok(0),
            Err(source) => return Err(failed(path, source)),
        };
        let path = path.to_owned();
        let number = text.trim_end().parse();
        number.map_err(|_| TimestampError::NoNumber { path })
    }

    /// As [`write`](TimestampFile::write); that it was not kept is a warning. The gateway tries again with the next one, within 30 s.
    pub fn keep(&self, timestamp: u64) {
        if let Err(error) = self.write(timestamp) {
            let why = "a restart with a clock that was set back repeats timestamps";
            tracing::warn!(%error, "the timestamp of signatures was not kept: {why}");
        }
    }

    /// Keeps it: a kill or a power cut meanwhile leaves the old one or this one.
    pub fn write(&self, timestamp: u64) -> Result<(), TimestampError> {
        let path = self.path()?;
        let text = format!("{timestamp}\n");
        durable::replace(path, text.as_bytes()).map_err(|source| failed(path, source))
    }
}

fn failed(path: &Path, source: io::Error) -> TimestampError {
    let path = path.to_owned();
    TimestampError::File { path, source }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_is_read_again_and_something_else_is_refused() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("state");
        let robot = RobotId::new(7).unwrap();
        let file = TimestampFile::new(Some(&folder), robot);
        assert_eq!(file.read().unwrap(), 0);
        for timestamp in [5, u64::MAX] {
            file.write(timestamp).unwrap();
            assert_eq!(file.read().unwrap(), timestamp);
        }
        fs::write(folder.join("robot-7.timestamp"), "").unwrap();
        assert!(matches!(file.read(), Err(TimestampError::NoNumber { .. })));
        let nowhere = TimestampFile::new(None, robot);
        assert!(matches!(nowhere.write(1), Err(TimestampError::NoFolder)));
    }
}
