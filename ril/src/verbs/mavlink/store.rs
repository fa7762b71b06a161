//! [`MissionFile`]: keeps the mission over restarts. It is written beside the old one, synced and renamed, so that there is always the
//! old mission or the new one, whenever the process or the machine ends.

use std::fs::{self, File};
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};

use ipc_types::RobotId;
use mavlink_gateway::{MAX_FILE_BYTES, Mission};

/// See the module's documentation.
pub(super) struct MissionFile {
    path: Option<PathBuf>,
}

/// What a process has done of a file when it ends too early.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum WriteStep {
    Begun,
    Written,
    Synced,
    Renamed,
}

impl MissionFile {
    /// The file of `robot` in `folder`; without a folder no mission can be kept.
    pub fn new(folder: Option<&Path>, robot: RobotId) -> MissionFile {
        MissionFile {
            path: folder.map(|folder| folder.join(format!("robot-{robot}.mission"))),
        }
    }

    /// The mission that was kept; none if there is no file.
    ///
    /// # Errors
    ///
    /// Why the file cannot be used, as a sentence.
    pub fn read(&self) -> Result<Mission, String> {
        let Some(path) = &self.path else {
            return Ok(Mission::default());
        };
        let mut bytes = Vec::new();
        let opened = File::open(path).and_then(|file| {
            let limit = MAX_FILE_BYTES as u64 + 1;
            file.take(limit).read_to_end(&mut bytes)
        });
        let name = path.display();
        match opened {
            Ok(_) => Mission::decode(&bytes).map_err(|why| format!("{name} is not used: {why}")),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(Mission::default()),
            Err(error) => Err(format!("{name} cannot be read: {error}")),
        }
    }

    /// Keeps a mission. It waits for the disk, milliseconds as a rule: stations get telemetry again then.
    ///
    /// # Errors
    ///
    /// Why it was not kept, as a clause; the old one is.
    pub fn write(&self, mission: &Mission) -> Result<(), String> {
        let path = self
            .path
            .as_ref()
            .ok_or_else(|| "there is no folder for it: set `state` in mavlink.toml".to_owned())?;
        replace(path, &mission.encode(), |_| Ok(()))
            .map_err(|error| format!("{}: {error}", path.display()))
    }
}

/// Replaces a file as a whole; `done` is told of each step.
fn replace(
    path: &Path,
    bytes: &[u8],
    mut done: impl FnMut(WriteStep) -> io::Result<()>,
) -> io::Result<()> {
    let folder = path.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder)?;
    // One gateway of a robot has the port, so nobody else writes here. What a process has left half is written anew.
    let new = path.with_extension("mission.new");
    let mut file = File::create(&new)?;
    done(WriteStep::Begun)?;
    file.write_all(bytes)?;
    done(WriteStep::Written)?;
    file.sync_all()?;
    done(WriteStep::Synced)?;
    fs::rename(&new, path)?;
    done(WriteStep::Renamed)?;
    File::open(folder)?.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bytes of a mission of one item, a take-off to this height.
    fn mission(height_m: f32) -> Vec<u8> {
        let mut bytes = b"RILM\x01\x00\x01\x00".to_vec();
        bytes.extend([0; 24]);
        bytes.extend(height_m.to_le_bytes());
        bytes.extend([22, 0, 3, 0, 1]);
        let checksum = crc32(&bytes);
        bytes.extend(checksum.to_le_bytes());
        bytes
    }

    fn crc32(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(!0, |crc, byte| {
            (0..8).fold(crc ^ u32::from(*byte), |crc, _| {
                (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg())
            })
        })
    }

    #[test]
    fn a_process_that_ends_at_any_step_leaves_the_old_mission_or_the_new_one() {
        let (old, new) = (mission(10.0), mission(20.0));
        let (old, new) = (
            Mission::decode(&old).unwrap(),
            Mission::decode(&new).unwrap(),
        );
        assert_ne!(old, new);
        for step in [
            WriteStep::Begun,
            WriteStep::Written,
            WriteStep::Synced,
            WriteStep::Renamed,
        ] {
            let folder = tempfile::tempdir().unwrap();
            let state = folder.path().join("state/ril");
            let file = MissionFile::new(Some(&state), RobotId::new(7).unwrap());
            assert_eq!(file.read(), Ok(Mission::default()));
            file.write(&old).unwrap();
            let path = state.join("robot-7.mission");
            let ended = replace(&path, &new.encode(), |done| match done == step {
                true => Err(io::Error::other("killed")),
                false => Ok(()),
            });
            assert!(ended.is_err());
            let kept = if step == WriteStep::Renamed {
                &new
            } else {
                &old
            };
            assert_eq!(file.read().as_ref(), Ok(kept), "{step:?}");
            // The next one does not mind what was left.
            file.write(&new).unwrap();
            assert_eq!(file.read().as_ref(), Ok(&new));
            assert_eq!(fs::read_dir(&state).unwrap().count(), 1);
        }
    }

    #[test]
    fn a_file_that_is_none_is_said_and_a_folder_that_is_missing_is_too() {
        let folder = tempfile::tempdir().unwrap();
        let robot = RobotId::new(1).unwrap();
        let file = MissionFile::new(Some(folder.path()), robot);
        fs::write(folder.path().join("robot-1.mission"), b"RILM").unwrap();
        assert!(file.read().unwrap_err().contains("is not used"));
        let nowhere = MissionFile::new(None, robot);
        assert_eq!(nowhere.read(), Ok(Mission::default()));
        let why = nowhere.write(&Mission::default()).unwrap_err();
        assert!(why.contains("set `state`"), "{why}");
    }
}
