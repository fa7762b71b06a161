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
//!   taken, and a rename that comes too late fails;
//! * a process that had one of the locks and did not delete may have kept another from deleting. So it looks again when
//!   it has given the lock back.

use std::io;
use std::os::fd::{AsRawFd, RawFd};
use std::path::{Path, PathBuf};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use rustix::fs::FlockOperation;
use rustix::io::Errno;

use crate::disk::{self, is_at, open_to_look};
use crate::domain::Domain;
use crate::domain_error::DomainError;
use crate::doorbell::Doorbell;
use crate::generation;
use crate::lock_file::{
    LockFile, flock, is_same, make_folder, make_lock_file_in, open_folder, open_lock_file_in,
};
use crate::robot::RobotId;

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

/// What became of a folder that was to be deleted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Deletion {
    Done,
    /// A process is in it, or about to rename or delete it.
    InUse,
    /// This process had one of its locks meanwhile, and did not delete it. By that it may have kept another process
    /// from deleting it; so who can look again does.
    Disturbed,
}

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
    fn is_of(&self, doorbell: &LockFile) -> Result<bool, DomainError> {
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
        let inode = self.dir.inode();
        let inode = inode.map_err(|error| DomainError::io("look at", &self.path, error))?;
        let name = format!("{robot}{DISCARDED}{inode}");
        let aside = domain.root().join(name);
        if self.has_its_name() {
            match disk::rename(&self.path, &aside) {
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
    fn delete(&self, domain: &Domain, aside: &Path) -> Result<Deletion, DomainError> {
        if !self.lock(FlockOperation::NonBlockingLockExclusive)? {
            return Ok(Deletion::InUse);
        }
        if !is_at(&self.dir, aside) {
            return Ok(Deletion::Disturbed);
        }
        generation::delete_robot_folder(domain, aside).map(|()| Deletion::Done)
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
    fn make(domain: &Domain, robot: RobotId) -> Result<Option<LockFile>, DomainError> {
        let name = format!("{robot}{DISCARDED}{}", disk::fresh_name(8));
        let draft = domain.root().join(name);
        match disk::create_folder(&draft) {
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
    ) -> Result<Option<LockFile>, DomainError> {
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
        match disk::rename(draft, &folder.path) {
            Ok(()) => {}
            Err(Errno::EXIST | Errno::NOENT) => return Ok(None),
            Err(error) => return Err(DomainError::io("rename", draft, error)),
        }
        folder.lock(FlockOperation::NonBlockingUnlock)?;
        Ok(Some(doorbell))
    }
}

/// A process that is about to take part.
#[derive(Debug, Default)]
pub(crate) struct Joining {
    /// How often it found a process that has the doorbell exclusively.
    pub(crate) waited: u32,
    /// What dead ones left, set aside.
    pub(crate) discarded: Option<PathBuf>,
}

impl Joining {
    /// Enters the robot's folder, or makes it; `None` if that has to be tried again. After `patience` attempts the
    /// folder is taken from a process that has its doorbell exclusively.
    pub(crate) fn attempt(
        &mut self,
        domain: &Domain,
        robot: RobotId,
        patience: u32,
    ) -> Result<Option<LockFile>, DomainError> {
        let path = domain.robot_folder(robot);
        make_folder(domain.root())?;
        let Some(folder) = Folder::open(&path)? else {
            return Folder::make(domain, robot);
        };
        let Some(lock) = folder.doorbell()? else {
            // Not made by a process of the robot.
            return self.take_away(&folder, domain, robot);
        };
        if flock(&lock, FlockOperation::NonBlockingLockExclusive, &path)? {
            self.discarded = Some(folder.set_aside(domain, robot)?);
            return Ok(None);
        }
        if flock(&lock, FlockOperation::NonBlockingLockShared, &path)? {
            let is_entered = folder.is_entered()?;
            if !is_entered {
                disk::pause(LOCK_PAUSE);
            }
            return Ok(is_entered.then_some(lock));
        }
        self.waited += 1;
        if self.waited.is_multiple_of(patience) {
            return self.take_away(&folder, domain, robot);
        }
        disk::pause(LOCK_PAUSE);
        Ok(None)
    }

    fn take_away(
        &mut self,
        folder: &Folder,
        domain: &Domain,
        robot: RobotId,
    ) -> Result<Option<LockFile>, DomainError> {
        let aside = folder.take_away(domain, robot)?;
        self.discarded = aside.or(self.discarded.take());
        Ok(None)
    }
}

/// A process's place in the folder of a robot: the doorbell's lock. The last one who leaves deletes everything.
#[derive(Debug)]
pub(crate) struct Place {
    pub(crate) domain: Domain,
    pub(crate) robot: RobotId,
    pub(crate) lock: LockFile,
}

impl Place {
    /// Deletes the folder if no other process is in it. Says whether none was.
    pub(crate) fn leave(&self) -> Result<bool, DomainError> {
        let path = self.domain.robot_folder(self.robot);
        if !flock(&self.lock, FlockOperation::NonBlockingLockExclusive, &path)? {
            return Ok(false);
        }
        // Else this process was held up with the lock, and another one has taken the folder away.
        if let Some(folder) = Folder::open(&path)?
            && folder.is_of(&self.lock)?
        {
            delete_if_last(&self.domain, self.robot, &folder, &self.lock)?;
        }
        // Who looked meanwhile was kept from deleting what this process did not.
        flock(&self.lock, FlockOperation::NonBlockingUnlock, &path)
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        if !self.lock.is_own() {
            return;
        }
        match self.leave() {
            Ok(true) => {}
            Ok(false) => return,
            Err(error) => warn_of_leftovers(&self.domain.robot_folder(self.robot), &error),
        }
        // The last process of another robot may have been killed, with no other after it.
        if let Err(error) = delete_dead_robots(&self.domain) {
            crate::log::debug!(%error, "a dead robot was left behind");
        }
        // What processes were deleting when they were killed, or left to this one.
        delete_discarded(&self.domain);
        remove_root(&self.domain);
    }
}

/// A process's part in the folder of a robot.
#[derive(Debug)]
pub(crate) struct Membership {
    /// Deletes what a process found that was the first one here.
    cleaner: Option<JoinHandle<()>>,
    doorbell: Doorbell,
    place: Place,
}

impl Membership {
    /// Takes part. The first process sets aside what dead ones left, and begins with an empty folder.
    pub(crate) fn join(domain: &Domain, robot: RobotId) -> Result<Membership, DomainError> {
        let path = domain.robot_folder(robot);
        let mut joining = Joining::default();
        for _ in 0..MAX_ATTEMPTS + LOCK_ATTEMPTS {
            let Some(lock) = joining.attempt(domain, robot, LOCK_ATTEMPTS)? else {
                continue;
            };
            let doorbell = Doorbell::map(&lock);
            let place = Place {
                domain: domain.clone(),
                robot,
                lock,
            };
            // Nothing is left of an attempt that fails, unless others are here.
            let doorbell = doorbell.map_err(|error| DomainError::io("map", &path, error))?;
            return Ok(Membership {
                cleaner: joining.discarded.and_then(|folder| clean(domain, folder)),
                doorbell,
                place,
            });
        }
        Err(DomainError::Unsettled {
            path,
            attempts: MAX_ATTEMPTS,
        })
    }

    pub(crate) fn domain(&self) -> &Domain {
        &self.place.domain
    }

    pub(crate) fn robot(&self) -> RobotId {
        self.place.robot
    }

    pub(crate) fn doorbell(&self) -> &Doorbell {
        &self.doorbell
    }

    /// The file that each member has open, by its number among those of this process.
    pub(crate) fn doorbell_file(&self) -> RawFd {
        self.place.lock.as_raw_fd()
    }
}

impl Drop for Membership {
    fn drop(&mut self) {
        if self.doorbell.check_process().is_err() {
            return;
        }
        if let Some(cleaner) = self.cleaner.take() {
            // It has nothing to say, and a panic in it has been reported.
            let _ = cleaner.join();
        }
    }
}

/// Removes the domain's root, unless a robot has a folder in it.
pub(crate) fn remove_root(domain: &Domain) {
    let _ = disk::remove_folder(domain.root());
}

/// Deletes a folder that was set aside, on a thread: segments are found among those of all users, which can take long.
fn clean(domain: &Domain, folder: PathBuf) -> Option<JoinHandle<()>> {
    let domain = domain.clone();
    thread::Builder::new()
        .name("clean".to_owned())
        .spawn(move || clean_now(&domain, &folder))
        .ok()
}

/// Deletes a folder that this process has set aside.
pub(crate) fn clean_now(domain: &Domain, folder: &Path) {
    if delete(domain, folder) == Deletion::Disturbed {
        delete_discarded(domain);
    }
}

/// Deletes a folder that was set aside, unless a process is in it or about to rename it.
fn delete(domain: &Domain, aside: &Path) -> Deletion {
    let delete = || {
        let Some(folder) = Folder::open(aside)? else {
            return Ok(Deletion::InUse);
        };
        // Who has the folder looks again when it has given it back. This process has nothing then.
        if !folder.lock(FlockOperation::NonBlockingLockExclusive)? {
            return Ok(Deletion::InUse);
        }
        folder.lock(FlockOperation::NonBlockingUnlock)?;
        // Kept until it is deleted.
        let doorbell = folder.doorbell()?;
        if let Some(lock) = &doorbell
            && !flock(lock, FlockOperation::NonBlockingLockExclusive, aside)?
        {
            return Ok(Deletion::InUse);
        }
        match folder.delete(domain, aside)? {
            Deletion::InUse if doorbell.is_some() => Ok(Deletion::Disturbed),
            deletion => Ok(deletion),
        }
    };
    delete().unwrap_or_else(|error| {
        warn_of_leftovers(aside, &error);
        Deletion::InUse
    })
}

fn warn_of_leftovers(folder: &Path, error: &DomainError) {
    crate::log::warn!(folder = %folder.display(), %error, "shared memory of processes that are gone was left behind");
}

fn names_in(folder: &Path) -> impl Iterator<Item = String> {
    let found = disk::list(folder).into_iter();
    found.filter_map(|found| found.name)
}

/// The folders that were set aside by processes that were then killed.
pub(crate) fn discarded(domain: &Domain) -> Vec<PathBuf> {
    names_in(domain.root())
        .filter(|name| name.contains(DISCARDED))
        .map(|name| domain.root().join(name))
        .collect()
}

/// How often one process looks for set-aside folders from which it and others keep one another.
const MAX_LOOKS: u32 = 16;

/// Deletes the [`discarded`] folders. Returns how many those were.
pub(crate) fn delete_discarded(domain: &Domain) -> usize {
    let mut deleted = 0;
    for _ in 0..MAX_LOOKS {
        if !look_at_discarded(domain, &mut deleted) {
            break;
        }
    }
    deleted
}

/// Looks once, and counts what it deletes. Says whether it is to look again.
pub(crate) fn look_at_discarded(domain: &Domain, deleted: &mut usize) -> bool {
    let mut is_disturbed = false;
    for folder in discarded(domain) {
        match delete(domain, &folder) {
            Deletion::Done => *deleted += 1,
            Deletion::InUse => {}
            Deletion::Disturbed => is_disturbed = true,
        }
    }
    is_disturbed
}

/// Deletes the folders of robots in which no process is. Returns how many those were, or the first error.
pub(crate) fn delete_dead_robots(domain: &Domain) -> Result<usize, DomainError> {
    let mut deleted = Ok(0);
    for robot in robots(domain) {
        match delete_if_dead(domain, robot) {
            Ok(Deletion::Done) => deleted = deleted.map(|count| count + 1),
            Ok(_) => {}
            Err(error) => deleted = deleted.and(Err(error)),
        }
    }
    deleted
}

/// The robots that have a folder in the domain.
pub(crate) fn robots(domain: &Domain) -> Vec<RobotId> {
    let mut robots: Vec<RobotId> = names_in(domain.root())
        .filter_map(|name| name.parse().ok())
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

/// Sets aside and deletes the robot's folder, unless a process is in it. What is [disturbed](Deletion::Disturbed) is
/// then among the [`discarded`].
fn delete_if_dead(domain: &Domain, robot: RobotId) -> Result<Deletion, DomainError> {
    let Some(folder) = Folder::open(&domain.robot_folder(robot))? else {
        return Ok(Deletion::InUse);
    };
    match folder.doorbell()? {
        Some(lock) => delete_if_last(domain, robot, &folder, &lock),
        // Not made by a process of the robot.
        None => Ok(match folder.take_away(domain, robot)? {
            Some(aside) => delete(domain, &aside),
            None => Deletion::InUse,
        }),
    }
}

/// Sets aside and deletes the robot's folder, unless another process has the doorbell's `lock`.
fn delete_if_last(
    domain: &Domain,
    robot: RobotId,
    folder: &Folder,
    lock: &LockFile,
) -> Result<Deletion, DomainError> {
    if !flock(lock, FlockOperation::NonBlockingLockExclusive, &folder.path)? {
        return Ok(Deletion::InUse);
    }
    let aside = folder.set_aside(domain, robot)?;
    folder.delete(domain, &aside)
}
