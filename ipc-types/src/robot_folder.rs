//! [`Membership`]: a process's part in the folder of a robot, and what happens to the folder when nobody is in it.
//!
//! Every process holds a shared `flock` on the robot's doorbell file; the kernel drops it with the process, however it ends.
//! Whoever gets the lock exclusively knows that nobody is there. It then renames the folder, and deletes it under that name:
//! a process that starts meanwhile makes a new one, and waits for nobody.

use std::fs::{self, DirBuilder, File, Metadata, OpenOptions};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use rustix::fs::{FlockOperation, OFlags};
use rustix::io::Errno;

use crate::domain::Domain;
use crate::domain_error::DomainError;
use crate::doorbell::Doorbell;
use crate::robot::RobotId;
use crate::{files, generation, random};

/// The file whose lock says that somebody is there. Its content is the [`Doorbell`].
const DOORBELL_FILE: &str = "doorbell";

/// Stands between a robot and a random name in the name of a folder that is to be deleted.
const DISCARDED: char = '~';

/// How often and how long joining waits for a process that has the lock exclusively. Such a process holds it for
/// microseconds, or was stopped in them: then the folder is left to it, and a new one is made.
const LOCK_ATTEMPTS: u32 = 100;
const LOCK_PAUSE: Duration = Duration::from_millis(1);

/// How often the folder may vanish under a process that joins. Each time is another process's whole life.
const MAX_ATTEMPTS: u32 = 64;

/// A process's part in the folder of a robot.
#[derive(Debug)]
pub(crate) struct Membership {
    domain: Domain,
    robot: RobotId,
    lock: File,
    doorbell: Doorbell,
    /// Deletes what a process found that was the first one here.
    cleaner: Option<JoinHandle<()>>,
}

impl Membership {
    /// Takes part. The first process sets aside what dead ones left, and begins with an empty folder.
    pub(crate) fn join(domain: &Domain, robot: RobotId) -> Result<Membership, DomainError> {
        let folder = domain.robot_folder(robot);
        let path = folder.join(DOORBELL_FILE);
        let mut discarded = None;
        let mut waited = 0;
        for _ in 0..MAX_ATTEMPTS + LOCK_ATTEMPTS {
            make_folder(domain.root())?;
            match make_folder(&folder) {
                // The last process of another robot has removed the root in this moment.
                Err(DomainError::Io { source, .. }) if source.kind() == io::ErrorKind::NotFound => {
                    continue;
                }
                result => result?,
            }
            let Some(lock) = open_lock_file(&path)? else {
                continue;
            };
            if flock(&lock, FlockOperation::NonBlockingLockExclusive, &path)? {
                if !is_at(&lock, &path) {
                    continue;
                }
                if !holds_only(&folder, DOORBELL_FILE) {
                    discarded = set_aside(domain, robot).or(discarded);
                    continue;
                }
            }
            if !flock(&lock, FlockOperation::NonBlockingLockShared, &path)? {
                waited += 1;
                if waited % LOCK_ATTEMPTS == 0 && is_at(&lock, &path) {
                    discarded = set_aside(domain, robot).or(discarded);
                } else {
                    thread::sleep(LOCK_PAUSE);
                }
                continue;
            }
            if !is_at(&lock, &path) {
                continue;
            }
            let doorbell =
                Doorbell::map(&lock).map_err(|error| DomainError::io("map", &path, error))?;
            return Ok(Membership {
                domain: domain.clone(),
                robot,
                lock,
                doorbell,
                cleaner: discarded.and_then(|folder| clean(domain, folder)),
            });
        }
        Err(DomainError::Unsettled {
            path,
            attempts: MAX_ATTEMPTS,
        })
    }

    pub(crate) fn domain(&self) -> &Domain {
        &self.domain
    }

    pub(crate) fn robot(&self) -> RobotId {
        self.robot
    }

    pub(crate) fn doorbell(&self) -> &Doorbell {
        &self.doorbell
    }
}

impl Drop for Membership {
    /// Leaves; the last process deletes everything.
    fn drop(&mut self) {
        if let Some(cleaner) = self.cleaner.take() {
            // It has nothing to say, and a panic in it has been reported.
            let _ = cleaner.join();
        }
        let path = self.domain.robot_folder(self.robot).join(DOORBELL_FILE);
        let is_last = flock(&self.lock, FlockOperation::NonBlockingLockExclusive, &path);
        if !is_last.unwrap_or(false) || !is_at(&self.lock, &path) {
            return;
        }
        if let Some(folder) = set_aside(&self.domain, self.robot) {
            delete(&self.domain, &folder);
        }
        // The last process of another robot may have been killed, and nobody come after it.
        for robot in robots(&self.domain) {
            if let Err(error) = delete_if_dead(&self.domain, robot) {
                tracing::debug!(%robot, %error, "a dead robot was left behind");
            }
        }
        // Fails while another robot is there.
        let _ = fs::remove_dir(self.domain.root());
    }
}

/// Gives the robot's folder another name, under which nobody looks for it. The lock must be exclusive.
fn set_aside(domain: &Domain, robot: RobotId) -> Option<PathBuf> {
    let folder = domain.robot_folder(robot);
    let name = format!("{robot}{DISCARDED}{}", random::name(8));
    let discarded = domain.root().join(name);
    match fs::rename(&folder, &discarded) {
        Ok(()) => Some(discarded),
        Err(error) => {
            tracing::debug!(folder = %folder.display(), %error, "not set aside");
            None
        }
    }
}

/// Deletes a folder that was set aside, on a thread: segments are found among everybody's, which can take long.
fn clean(domain: &Domain, folder: PathBuf) -> Option<JoinHandle<()>> {
    let domain = domain.clone();
    thread::Builder::new()
        .name("clean".to_owned())
        .spawn(move || delete(&domain, &folder))
        .ok()
}

fn delete(domain: &Domain, folder: &Path) {
    if let Err(error) = generation::delete_robot_folder(domain, folder) {
        tracing::warn!(folder = %folder.display(), %error, "shared memory of processes that are gone was left behind");
    }
}

/// The folders that were set aside by processes that were then killed.
pub(crate) fn discarded(domain: &Domain) -> Vec<PathBuf> {
    fs::read_dir(domain.root())
        .into_iter()
        .flatten()
        .flatten()
        .filter(|entry| entry.file_name().to_string_lossy().contains(DISCARDED))
        .map(|entry| entry.path())
        .collect()
}

/// Deletes the [`discarded`] folders. Returns how many those were.
pub(crate) fn delete_discarded(domain: &Domain) -> usize {
    let folders = discarded(domain);
    for folder in &folders {
        delete(domain, folder);
    }
    folders.len()
}

/// The robots that have a folder in the domain.
pub(crate) fn robots(domain: &Domain) -> Vec<RobotId> {
    let Ok(entries) = fs::read_dir(domain.root()) else {
        return Vec::new();
    };
    let mut robots: Vec<RobotId> = entries
        .flatten()
        .filter_map(|entry| entry.file_name().to_str()?.parse().ok())
        .collect();
    robots.sort_unstable();
    robots
}

/// Whether a process is in the robot's folder.
pub(crate) fn is_anybody_in(domain: &Domain, robot: RobotId) -> bool {
    let path = domain.robot_folder(robot).join(DOORBELL_FILE);
    let Ok(file) = open_to_look(&path) else {
        return false;
    };
    !flock(&file, FlockOperation::NonBlockingLockExclusive, &path).unwrap_or(false)
}

/// Sets aside and deletes the robot's folder, unless a process is in it. Returns whether it was deleted.
pub(crate) fn delete_if_dead(domain: &Domain, robot: RobotId) -> Result<bool, DomainError> {
    let path = domain.robot_folder(robot).join(DOORBELL_FILE);
    let lock = match open_to_look(&path) {
        Ok(lock) => lock,
        // Its maker was killed before it made the lock, or is about to make it and will then begin anew.
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            return Ok(fs::remove_dir(domain.robot_folder(robot)).is_ok());
        }
        Err(error) => return Err(DomainError::io("open", &path, error)),
    };
    if !flock(&lock, FlockOperation::NonBlockingLockExclusive, &path)? || !is_at(&lock, &path) {
        return Ok(false);
    }
    match set_aside(domain, robot) {
        Some(folder) => generation::delete_robot_folder(domain, &folder).map(|()| true),
        None => Ok(false),
    }
}

/// Makes a folder of the user's own, unless it is there.
pub(crate) fn make_folder(folder: &Path) -> Result<(), DomainError> {
    match files::while_no_port_opens(|| DirBuilder::new().mode(0o700).create(folder)) {
        Ok(()) => {}
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
        Err(error) => return Err(DomainError::io("create", folder, error)),
    }
    let metadata = match fs::symlink_metadata(folder) {
        Ok(metadata) => metadata,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(DomainError::io("look at", folder, error)),
    };
    check_folder(folder, &metadata)
}

/// Refuses a folder in which others could put something.
fn check_folder(folder: &Path, metadata: &Metadata) -> Result<(), DomainError> {
    let refuse = |reason, next_step| {
        Err(DomainError::Unsafe {
            path: folder.to_owned(),
            reason,
            next_step,
        })
    };
    const OTHER_DOMAIN: &str = "remove it, or choose another domain with RIL_IPC_ROOT";
    if !metadata.is_dir() {
        return refuse("it is not a folder".to_owned(), OTHER_DOMAIN);
    }
    if !is_ours(metadata) {
        let uid = rustix::process::geteuid().as_raw();
        let reason = format!("it belongs to user {}, this is user {uid}", metadata.uid());
        return refuse(reason, OTHER_DOMAIN);
    }
    if metadata.mode() & 0o022 != 0 {
        let mode = metadata.mode() & 0o777;
        let reason = format!("others may write to it (mode {mode:03o})");
        return refuse(reason, "change its mode to 700");
    }
    Ok(())
}

/// Whether something belongs to this user.
pub(crate) fn is_ours(metadata: &Metadata) -> bool {
    metadata.uid() == rustix::process::geteuid().as_raw()
}

/// Opens a file to lock it, and makes it if need be. Nothing when its folder is gone.
pub(crate) fn open_lock_file(path: &Path) -> Result<Option<File>, DomainError> {
    let mut options = OpenOptions::new();
    options
        .read(true)
        .write(true)
        .create(true)
        .truncate(false)
        .mode(0o600)
        .custom_flags((OFlags::NOFOLLOW | OFlags::NONBLOCK).bits() as i32);
    match files::while_no_port_opens(|| options.open(path)) {
        Ok(file) => Ok(Some(file)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(DomainError::io("open", path, error)),
    }
}

/// Opens a file without making it, and without waiting for a pipe that stands in its place.
pub(crate) fn open_to_look(path: &Path) -> io::Result<File> {
    OpenOptions::new()
        .read(true)
        .custom_flags((OFlags::NOFOLLOW | OFlags::NONBLOCK).bits() as i32)
        .open(path)
}

/// Locks without waiting; says whether the lock was got.
pub(crate) fn flock(
    file: &File,
    operation: FlockOperation,
    path: &Path,
) -> Result<bool, DomainError> {
    loop {
        return match rustix::fs::flock(file, operation) {
            Ok(()) => Ok(true),
            Err(Errno::WOULDBLOCK) => Ok(false),
            Err(Errno::INTR) => continue,
            Err(error) => Err(DomainError::io("lock", path, error)),
        };
    }
}

/// Whether `file` is still the one at `path`, not one that was removed or renamed meanwhile.
pub(crate) fn is_at(file: &File, path: &Path) -> bool {
    match (file.metadata(), fs::symlink_metadata(path)) {
        (Ok(ours), Ok(present)) => ours.dev() == present.dev() && ours.ino() == present.ino(),
        _ => false,
    }
}

/// Whether the folder holds one file of this name, and nothing else.
fn holds_only(folder: &Path, name: &str) -> bool {
    fs::read_dir(folder).is_ok_and(|mut entries| {
        entries.all(|entry| entry.is_ok_and(|entry| entry.file_name() == name))
    })
}
