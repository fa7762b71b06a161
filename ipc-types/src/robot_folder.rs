//! [`Membership`]: a process's part in the folder of a robot, and what happens to the folder when no process is in it.
//!
//! Every process holds a shared `flock` on the robot's doorbell file; the kernel drops it with the process, however it ends.
//! A process that gets the lock exclusively knows that no other is there. It renames the folder, and deletes it under that name:
//! a process that starts meanwhile makes a new one, without a wait.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use rustix::fs::FlockOperation;

use crate::domain::Domain;
use crate::domain_error::DomainError;
use crate::doorbell::Doorbell;
use crate::lock_file::{entries, flock, is_at, make_folder, open_lock_file, open_to_look};
use crate::robot::RobotId;
use crate::{generation, random};

/// The file whose lock says that a process is there. Its content is the [`Doorbell`].
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
            let doorbell = match Doorbell::map(&lock) {
                Ok(doorbell) => doorbell,
                Err(error) => {
                    // Nothing is left of an attempt, unless others are here.
                    let _ = delete_if_last(domain, robot, &lock);
                    remove_root(domain);
                    return Err(DomainError::io("map", &path, error));
                }
            };
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
        match delete_if_last(&self.domain, self.robot, &self.lock) {
            Ok(true) => {}
            Ok(false) => return,
            Err(error) => warn_of_leftovers(&self.domain.robot_folder(self.robot), &error),
        }
        // What processes were deleting when they were killed.
        delete_discarded(&self.domain);
        // The last process of another robot may have been killed, with no other after it.
        for robot in robots(&self.domain) {
            if let Err(error) = delete_if_dead(&self.domain, robot) {
                tracing::debug!(%robot, %error, "a dead robot was left behind");
            }
        }
        remove_root(&self.domain);
    }
}

/// Removes the domain's root, unless a robot has a folder in it.
fn remove_root(domain: &Domain) {
    let _ = fs::remove_dir(domain.root());
}

/// Gives the robot's folder another name, under which no process looks for it. The lock must be exclusive.
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

/// Deletes a folder that was set aside, on a thread: segments are found among those of all users, which can take long.
fn clean(domain: &Domain, folder: PathBuf) -> Option<JoinHandle<()>> {
    let domain = domain.clone();
    thread::Builder::new()
        .name("clean".to_owned())
        .spawn(move || delete(&domain, &folder))
        .ok()
}

fn delete(domain: &Domain, folder: &Path) {
    if let Err(error) = generation::delete_robot_folder(domain, folder) {
        warn_of_leftovers(folder, &error);
    }
}

fn warn_of_leftovers(folder: &Path, error: &DomainError) {
    tracing::warn!(folder = %folder.display(), %error, "shared memory of processes that are gone was left behind");
}

/// The folders that were set aside by processes that were then killed.
pub(crate) fn discarded(domain: &Domain) -> Vec<PathBuf> {
    entries(domain.root())
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
    let mut robots: Vec<RobotId> = entries(domain.root())
        .filter_map(|entry| entry.file_name().to_str()?.parse().ok())
        .collect();
    robots.sort_unstable();
    robots
}

/// Whether a process is in the robot's folder.
pub(crate) fn is_any_process_in(domain: &Domain, robot: RobotId) -> bool {
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
    delete_if_last(domain, robot, &lock)
}

/// Sets aside and deletes the robot's folder, unless another process has its `lock`. Returns whether it was deleted.
fn delete_if_last(domain: &Domain, robot: RobotId, lock: &File) -> Result<bool, DomainError> {
    let path = domain.robot_folder(robot).join(DOORBELL_FILE);
    if !flock(lock, FlockOperation::NonBlockingLockExclusive, &path)? || !is_at(lock, &path) {
        return Ok(false);
    }
    match set_aside(domain, robot) {
        Some(folder) => generation::delete_robot_folder(domain, &folder).map(|()| true),
        None => Ok(false),
    }
}

/// Whether the folder holds one file of this name, and nothing else.
fn holds_only(folder: &Path, name: &str) -> bool {
    fs::read_dir(folder).is_ok_and(|mut entries| {
        entries.all(|entry| entry.is_ok_and(|entry| entry.file_name() == name))
    })
}
