//! [`Membership`]: a process's part in the folder of a robot, and what happens to the folder when no process is in it.
//!
//! Every process holds a shared `flock` on the robot's doorbell file; the kernel drops it with the process, however it
//! ends. A process that gets the lock exclusively knows that no other is there. It renames the folder, and deletes it
//! under that name: a process that starts meanwhile makes a new one, without a wait.
//!
//! A rename goes by name, and its process may be held up for any time just before it. So that it never takes the folder
//! of the living away:
//!
//! * a folder gets its name when its maker is in it already, and no process turns an exclusive lock into a shared one;
//! * a folder is set aside under a name that is made of its own inode, and a rename replaces nothing. The process that
//!   renames it has the doorbell exclusively, or the folder itself, from before looking whether the folder still has
//!   its name;
//! * what was set aside is deleted by a process that has both locks. So while one is about to rename, that name stays
//!   taken, and a rename that comes too late fails.

use std::fs::{self, DirBuilder, File};
use std::io;
use std::os::fd::{AsRawFd, RawFd};
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::{Path, PathBuf};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use rustix::fs::{CWD, FlockOperation, RenameFlags, renameat_with};
use rustix::io::Errno;

use crate::domain::Domain;
use crate::domain_error::DomainError;
use crate::doorbell::Doorbell;
use crate::lock_file::{
    LockFile, entries, flock, is_at, is_same, make_folder, make_lock_file_in, open_folder,
    open_lock_file_in, open_to_look,
};
use crate::robot::RobotId;
use crate::{files, generation, random};

/// The file whose lock says that a process is there. Its content is the [`Doorbell`].
const DOORBELL_FILE: &str = "doorbell";

/// Stands between a robot and another word in the name of a folder that is being made, or is to be deleted.
const DISCARDED: char = '~';

/// How often and how long joining waits for a process that has the lock exclusively. Such a process holds it for
/// microseconds, or was stopped in them: then the folder is left to it, and a new one is made.
const LOCK_ATTEMPTS: u32 = 100;
const LOCK_PAUSE: Duration = Duration::from_millis(1);

/// How often the folder may vanish under a process that joins. Each time is another process's whole life.
const MAX_ATTEMPTS: u32 = 64;

/// A folder of a robot that was opened: the same one, whatever becomes of its name.
#[derive(Debug)]
struct Folder {
    /// Locked exclusively by a process that is about to rename or delete it without having the doorbell.
    dir: LockFile,
    path: PathBuf,
}

impl Folder {
    /// `None` if there is none of that name.
    fn open(path: &Path) -> Result<Option<Folder>, DomainError> {
        let dir = open_folder(path)?;
        Ok(dir.map(|dir| Folder {
            dir,
            path: path.to_owned(),
        }))
    }

    fn doorbell(&self) -> Result<Option<LockFile>, DomainError> {
        open_lock_file_in(&self.dir, DOORBELL_FILE, &self.path)
    }

    /// Whether this doorbell lies in it.
    fn is_of(&self, doorbell: &File) -> Result<bool, DomainError> {
        let present = self.doorbell()?;
        Ok(present.is_some_and(|present| is_same(&present, doorbell)))
    }

    /// Whether it still has the name under which it was opened.
    fn has_its_name(&self) -> bool {
        is_at(&self.dir, &self.path)
    }

    fn lock(&self, operation: FlockOperation) -> Result<bool, DomainError> {
        flock(&self.dir, operation, &self.path)
    }

    /// Gives it another name, under which no process looks for it, and returns that. Needs one of the two locks.
    fn set_aside(&self, domain: &Domain, robot: RobotId) -> Result<PathBuf, DomainError> {
        let metadata = self.dir.metadata();
        let inode = metadata.map_err(|error| DomainError::io("look at", &self.path, error))?;
        let name = format!("{robot}{DISCARDED}{}", inode.ino());
        let aside = domain.root().join(name);
        if self.has_its_name() {
            match rename(&self.path, &aside) {
                // Another process was quicker, and the name belongs to a new folder by now, or to none.
                Ok(()) | Err(Errno::EXIST | Errno::NOENT) => {}
                Err(error) => return Err(DomainError::io("rename", &self.path, error)),
            }
        }
        Ok(aside)
    }

    /// Sets it aside for a process that was held up with the doorbell's lock, and leaves it to that one. Returns the
    /// new name unless a process can be in the folder.
    fn take_away(&self, domain: &Domain, robot: RobotId) -> Result<Option<PathBuf>, DomainError> {
        // From here on none finds that it is a member.
        if !self.lock(FlockOperation::NonBlockingLockExclusive)? {
            return Ok(None);
        }
        let is_free = match self.doorbell()? {
            Some(lock) => flock(&lock, FlockOperation::NonBlockingLockShared, &self.path)?,
            None => false,
        };
        let aside = match is_free {
            true => None,
            false => Some(self.set_aside(domain, robot)?),
        };
        self.lock(FlockOperation::NonBlockingUnlock)?;
        Ok(aside)
    }

    /// Deletes it where it was set aside. Needs the doorbell's exclusive lock, if there is one.
    fn delete(&self, domain: &Domain, aside: &Path) -> Result<bool, DomainError> {
        if !self.lock(FlockOperation::NonBlockingLockExclusive)? || !is_at(&self.dir, aside) {
            return Ok(false);
        }
        generation::delete_robot_folder(domain, aside).map(|()| true)
    }

    /// Whether a process that has the doorbell's shared lock is a member: the folder is not being taken away, and has
    /// its name.
    fn is_entered(&self) -> Result<bool, DomainError> {
        let is_ours = self.lock(FlockOperation::NonBlockingLockShared)?;
        if is_ours {
            self.lock(FlockOperation::NonBlockingUnlock)?;
        }
        Ok(is_ours && self.has_its_name())
    }

    /// Makes the folder of a robot with this process in it; `None` if another process was quicker.
    fn make(domain: &Domain, robot: RobotId) -> Result<Option<(Folder, LockFile)>, DomainError> {
        let name = format!("{robot}{DISCARDED}{}", random::name(8));
        let draft = domain.root().join(name);
        match files::while_no_port_opens(|| DirBuilder::new().mode(0o700).create(&draft)) {
            Ok(()) => {}
            // The last process of another robot has removed the root in this moment.
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(DomainError::io("create", &draft, error)),
        }
        let made = Folder::enter_draft(domain, robot, &draft);
        if !matches!(made, Ok(Some(_))) {
            delete(domain, &draft);
        }
        made
    }

    fn enter_draft(
        domain: &Domain,
        robot: RobotId,
        draft: &Path,
    ) -> Result<Option<(Folder, LockFile)>, DomainError> {
        let Some(mut folder) = Folder::open(draft)? else {
            return Ok(None);
        };
        // Both, before it gets its name: a process that deletes what dead ones left takes it for that until then.
        if !folder.lock(FlockOperation::NonBlockingLockShared)? {
            return Ok(None);
        }
        let Some(doorbell) = make_lock_file_in(&folder.dir, DOORBELL_FILE, draft)? else {
            return Ok(None);
        };
        if !flock(&doorbell, FlockOperation::NonBlockingLockShared, draft)? {
            return Ok(None);
        }
        folder.path = domain.robot_folder(robot);
        match rename(draft, &folder.path) {
            Ok(()) => {}
            Err(Errno::EXIST | Errno::NOENT) => return Ok(None),
            Err(error) => return Err(DomainError::io("rename", draft, error)),
        }
        folder.lock(FlockOperation::NonBlockingUnlock)?;
        Ok(Some((folder, doorbell)))
    }
}

/// Renames, and replaces nothing.
fn rename(from: &Path, to: &Path) -> Result<(), Errno> {
    renameat_with(CWD, from, CWD, to, RenameFlags::NOREPLACE)
}

/// A process's part in the folder of a robot.
#[derive(Debug)]
pub(crate) struct Membership {
    domain: Domain,
    robot: RobotId,
    lock: LockFile,
    doorbell: Doorbell,
    /// Deletes what a process found that was the first one here.
    cleaner: Option<JoinHandle<()>>,
}

impl Membership {
    /// Takes part. The first process sets aside what dead ones left, and begins with an empty folder.
    pub(crate) fn join(domain: &Domain, robot: RobotId) -> Result<Membership, DomainError> {
        let path = domain.robot_folder(robot);
        let mut discarded = None;
        let mut waited = 0;
        for _ in 0..MAX_ATTEMPTS + LOCK_ATTEMPTS {
            make_folder(domain.root())?;
            let entered = match Folder::open(&path)? {
                None => Folder::make(domain, robot)?,
                Some(folder) => match folder.doorbell()? {
                    // Not made by a process of the robot.
                    None => {
                        discarded = folder.take_away(domain, robot)?.or(discarded);
                        None
                    }
                    Some(lock) => {
                        if flock(&lock, FlockOperation::NonBlockingLockExclusive, &path)? {
                            discarded = Some(folder.set_aside(domain, robot)?);
                            None
                        } else if flock(&lock, FlockOperation::NonBlockingLockShared, &path)? {
                            let is_entered = folder.is_entered()?;
                            if !is_entered {
                                thread::sleep(LOCK_PAUSE);
                            }
                            is_entered.then_some((folder, lock))
                        } else {
                            waited += 1;
                            if waited % LOCK_ATTEMPTS == 0 {
                                discarded = folder.take_away(domain, robot)?.or(discarded);
                            } else {
                                thread::sleep(LOCK_PAUSE);
                            }
                            None
                        }
                    }
                },
            };
            let Some((folder, lock)) = entered else {
                continue;
            };
            let doorbell = match Doorbell::map(&lock) {
                Ok(doorbell) => doorbell,
                Err(error) => {
                    // Nothing is left of an attempt, unless others are here.
                    let _ = delete_if_last(domain, robot, &folder, &lock);
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

    /// The file that each member has open, by its number among those of this process.
    pub(crate) fn doorbell_file(&self) -> RawFd {
        self.lock.as_raw_fd()
    }

    /// Deletes the folder if no other process is in it. Says whether it was that.
    fn leave(&self) -> Result<bool, DomainError> {
        let path = self.domain.robot_folder(self.robot);
        if !flock(&self.lock, FlockOperation::NonBlockingLockExclusive, &path)? {
            return Ok(false);
        }
        match Folder::open(&path)? {
            Some(folder) if folder.is_of(&self.lock)? => {
                delete_if_last(&self.domain, self.robot, &folder, &self.lock)
            }
            // This process was held up with the lock, and another one has taken the folder away.
            _ => {
                flock(&self.lock, FlockOperation::NonBlockingUnlock, &path)?;
                Ok(delete_discarded(&self.domain) > 0)
            }
        }
    }
}

impl Drop for Membership {
    /// Leaves; the last process deletes everything.
    fn drop(&mut self) {
        if self.doorbell.check_process().is_err() {
            return;
        }
        if let Some(cleaner) = self.cleaner.take() {
            // It has nothing to say, and a panic in it has been reported.
            let _ = cleaner.join();
        }
        match self.leave() {
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

/// Deletes a folder that was set aside, on a thread: segments are found among those of all users, which can take long.
fn clean(domain: &Domain, folder: PathBuf) -> Option<JoinHandle<()>> {
    let domain = domain.clone();
    thread::Builder::new()
        .name("clean".to_owned())
        .spawn(move || {
            delete(&domain, &folder);
        })
        .ok()
}

/// Deletes a folder that was set aside, unless a process is in it or about to rename it: that one, or the next that
/// looks, will. Says whether it is deleted.
fn delete(domain: &Domain, aside: &Path) -> bool {
    let deleted = Folder::open(aside).and_then(|folder| match folder {
        Some(folder) => match folder.doorbell()? {
            Some(lock) if !flock(&lock, FlockOperation::NonBlockingLockExclusive, aside)? => {
                Ok(false)
            }
            // Kept until it is deleted.
            _lock => folder.delete(domain, aside),
        },
        None => Ok(false),
    });
    deleted.unwrap_or_else(|error| {
        warn_of_leftovers(aside, &error);
        false
    })
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
    let folders = discarded(domain).into_iter();
    folders.filter(|folder| delete(domain, folder)).count()
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
    let Some(folder) = Folder::open(&domain.robot_folder(robot))? else {
        return Ok(false);
    };
    match folder.doorbell()? {
        Some(lock) => delete_if_last(domain, robot, &folder, &lock),
        // Not made by a process of the robot.
        None => match folder.take_away(domain, robot)? {
            Some(aside) => Ok(delete(domain, &aside)),
            None => Ok(false),
        },
    }
}

/// Sets aside and deletes the robot's folder, unless another process has the doorbell's `lock`. Returns whether it was
/// that.
fn delete_if_last(
    domain: &Domain,
    robot: RobotId,
    folder: &Folder,
    lock: &File,
) -> Result<bool, DomainError> {
    if !flock(lock, FlockOperation::NonBlockingLockExclusive, &folder.path)? {
        return Ok(false);
    }
    let aside = folder.set_aside(domain, robot)?;
    folder.delete(domain, &aside)
}
