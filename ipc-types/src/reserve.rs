//! Room in memory for those that give orders, for when everything else is full.
//!
//! A client needs some memory and some files of its own. Any user can fill `/dev/shm`, and the helicopter must be landed all
//! the same: so each robot keeps a folder of files that are good for nothing. A client that finds no room deletes them and
//! tries again at once. The servers' housekeeper makes them anew when there is room.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use rustix::fs::{FallocateFlags, fallocate};

use crate::domain::SHM_DIR;
use crate::files;
use crate::lock_file::make_folder;

/// The folder in that of the robot.
const FOLDER: &str = "reserve";

/// Files: a client makes some twenty, and two clients may come at once.
const FILES: usize = 48;

/// Memory, bytes: a client takes 0.3 MB, and each segment asks for 0.25 MB beyond its own size.
const BYTES: u64 = 2 << 20;

/// Room that must be left after the reserve was made: it is not made of the last memory that others have.
const LEFT_BYTES: u64 = 8 << 20;
const LEFT_FILES: u64 = 512;

fn file(robot_folder: &Path, index: usize) -> PathBuf {
    robot_folder.join(FOLDER).join(index.to_string())
}

/// Makes what is missing of the reserve, if there is room.
pub(crate) fn fill(robot_folder: &Path) {
    // The first has the memory, the last is made last.
    if file(robot_folder, FILES - 1).exists() || !has_room() {
        return;
    }
    if let Err(error) = make(robot_folder) {
        tracing::debug!(%error, "no memory is kept in reserve for those that give orders");
    }
}

fn make(robot_folder: &Path) -> io::Result<()> {
    make_folder(&robot_folder.join(FOLDER)).map_err(io::Error::other)?;
    for index in 0..FILES {
        let path = file(robot_folder, index);
        if path.exists() {
            continue;
        }
        let made = files::while_no_port_opens(|| File::create_new(&path))?;
        if index == 0 {
            fallocate(&made, FallocateFlags::empty(), 0, BYTES)?;
        }
    }
    Ok(())
}

fn has_room() -> bool {
    rustix::fs::statvfs(SHM_DIR).is_ok_and(|status| {
        let bytes = status.f_bavail.saturating_mul(status.f_frsize);
        bytes >= BYTES + LEFT_BYTES
            && (status.f_files == 0 || status.f_favail >= FILES as u64 + LEFT_FILES)
    })
}

/// Deletes the reserve, so that this process finds room. Says whether there was one.
pub(crate) fn give_up(robot_folder: &Path) -> bool {
    fs::remove_dir_all(robot_folder.join(FOLDER)).is_ok()
}
