//! Room for those that give orders, for when everything else is full: in memory, and among the open files of their
//! server.
//!
//! A client needs some memory and some files of its own. Any user can fill `/dev/shm`, and the helicopter must be
//! landed all the same: so each robot keeps a folder of files that are good for nothing. A client that finds no room
//! deletes them and tries again at once. The servers' housekeeper makes them anew when there is room.
//!
//! A process that serves needs open files for each client, too, and subscribers could take all that its limit allows.
//! So it holds some descriptors while it connects subscribers: these are left for one operator.

use std::fs::{self, File};
use std::io;
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use rustix::event::{EventfdFlags, eventfd};
use rustix::fs::{FallocateFlags, fallocate};

use crate::files;
use crate::limits;
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

/// Twice the descriptors that a server opens for a client: the client's segment, two connections, and what wakes the
/// client.
const DESCRIPTORS: usize = 8;

/// Whether this process has, or had, a server.
static SERVES: AtomicBool = AtomicBool::new(false);

/// From now on this process has a server.
pub(crate) fn note_server() {
    SERVES.store(true, Ordering::Relaxed);
}

/// Takes the last descriptors of a process that serves for as long as subscribers are connected, so that those fail
/// instead.
pub(crate) fn hold_descriptors() -> Vec<OwnedFd> {
    let count = match SERVES.load(Ordering::Relaxed) {
        true => DESCRIPTORS,
        false => 0,
    };
    let one = |_| eventfd(0, EventfdFlags::CLOEXEC).ok();
    (0..count).map_while(one).collect()
}

fn file(robot_folder: &Path, index: usize) -> PathBuf {
    robot_folder.join(FOLDER).join(index.to_string())
}

/// Makes what is missing of the reserve, if there is room. Says whether it is complete.
pub(crate) fn fill(robot_folder: &Path) -> bool {
    // The first has the memory, the last is made last.
    if file(robot_folder, FILES - 1).exists() {
        return true;
    }
    if !has_room() {
        return false;
    }
    make(robot_folder)
        .inspect_err(|error| {
            crate::log::debug!(%error, "no memory is kept in reserve for those that give orders");
        })
        .is_ok()
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
    let needed = (BYTES + LEFT_BYTES, FILES as u64 + LEFT_FILES);
    limits::free_memory().is_ok_and(|free| free.has(needed.0, needed.1))
}

/// Deletes the reserve, so that this process finds room. Says whether there was one.
pub(crate) fn give_up(robot_folder: &Path) -> bool {
    fs::remove_dir_all(robot_folder.join(FOLDER)).is_ok()
}
