//! [`MissionFile`]: keeps the mission over restarts: there is always the old mission or the new one, whenever the process or the machine
//! ends.

use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

use ipc_types::RobotId;
use mavlink_gateway::{MAX_FILE_BYTES, Mission};
use runtime::durable;

/// See the module's documentation.
pub(super) struct MissionFile {
    path: Option<PathBuf>,
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
        durable::replace(path, &mission.encode())
            .map_err(|error| format!("{}: {error}", path.display()))
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

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
    fn what_was_kept_is_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let state = folder.path().join("state/ril");
        let file = MissionFile::new(Some(&state), RobotId::new(7).unwrap());
        assert_eq!(file.read(), Ok(Mission::default()));
        for height_m in [10.0, 20.0] {
            let mission = Mission::decode(&mission(height_m)).unwrap();
            file.write(&mission).unwrap();
            assert_eq!(file.read().as_ref(), Ok(&mission));
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
