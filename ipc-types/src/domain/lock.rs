//! The three kinds of locks of a domain: who is in it, who is making something in it, and who provides a service.
//!
//! All are `flock`s on files in the root, because the kernel drops them with the process, also after `kill -9`.
//! `flock` belongs to the open file, not to the process, so that several sessions of one process count one by one.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Seek, Write};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::time::Duration;

use rustix::fs::{FlockOperation, OFlags};
use rustix::io::Errno;

use super::{Domain, DomainError, Removal, remains};
use crate::robot::RobotId;

/// The file whose lock says that somebody is in the domain.
pub(super) const LOCK_FILE: &str = "domain.lock";

/// The file whose lock says that somebody is making something.
pub(super) const MAKING_FILE: &str = "making.lock";

/// The folder with a file for each service that was ever provided.
pub(super) const OWNERS_DIR: &str = "owners";

/// How often a lock file may vanish between opening and locking it before we give up.
///
/// It vanishes when the last process leaves in that instant; each time is another process's whole life.
const MAX_LOCK_ATTEMPTS: u32 = 16;

/// How often and how long a provider waits for somebody who only looks whether there is one.
///
/// A look takes microseconds; a live provider keeps its lock for good. Twenty looks in a row at one service are not
/// chance.
const OWNER_ATTEMPTS: u32 = 20;
const OWNER_PAUSE: Duration = Duration::from_millis(1);

/// How often and how long somebody who makes something waits for somebody who removes remains.
///
/// That takes a fraction of a millisecond for each dead process; only a cleaner that was stopped takes longer than all
/// of these together.
const MAKING_ATTEMPTS: u32 = 100;
const MAKING_PAUSE: Duration = Duration::from_millis(1);

/// Largest owner file: a process id, a time and a name.
const MAX_OWNER_LEN: u64 = 256;

/// Somebody is in the domain: a shared lock on its lock file.
#[derive(Debug)]
pub(crate) struct DomainLock {
    file: File,
}

impl DomainLock {
    /// Takes part in the domain. Whoever is the first removes what dead processes left.
    ///
    /// Blocks while another process removes the domain, which is a matter of milliseconds.
    pub(crate) fn acquire(domain: &Domain) -> Result<DomainLock, DomainError> {
        let path = domain.root.join(LOCK_FILE);
        for _ in 0..MAX_LOCK_ATTEMPTS {
            make_root(&domain.root)?;
            let Some(file) = open_lock_file(&path)? else {
                continue;
            };
            let lock = DomainLock { file };
            if lock.flock(FlockOperation::NonBlockingLockExclusive, &path)?
                && lock.is_current(&path)
                && !remains::has_live_node(domain)
            {
                remains::remove(domain)?;
            }
            // From exclusive to shared, or waiting for whoever has it exclusively. The change is not atomic, another
            // process may get the file in between and remove it: therefore the second look.
            if lock.flock(FlockOperation::LockShared, &path)? && lock.is_current(&path) {
                return Ok(lock);
            }
        }
        Err(DomainError::Unsettled {
            path,
            attempts: MAX_LOCK_ATTEMPTS,
        })
    }

    /// The domain for oneself, or nothing when somebody else is in it.
    pub(super) fn acquire_exclusive(domain: &Domain) -> Result<Option<DomainLock>, DomainError> {
        let path = domain.root.join(LOCK_FILE);
        for _ in 0..MAX_LOCK_ATTEMPTS {
            make_root(&domain.root)?;
            let Some(file) = open_lock_file(&path)? else {
                continue;
            };
            let lock = DomainLock { file };
            if !lock.flock(FlockOperation::NonBlockingLockExclusive, &path)? {
                return Ok(None);
            }
            if lock.is_current(&path) {
                return Ok(Some(lock));
            }
        }
        Err(DomainError::Unsettled {
            path,
            attempts: MAX_LOCK_ATTEMPTS,
        })
    }

    /// Removes the whole domain, the lock file last. The lock must be exclusive.
    pub(super) fn remove_domain(self, domain: &Domain) -> Result<Removal, DomainError> {
        if remains::has_live_node(domain) {
            return Ok(Removal::InUse);
        }
        let removed = remains::remove(domain)?;
        let path = domain.root.join(LOCK_FILE);
        fs::remove_file(&path).map_err(|error| DomainError::io("remove", &path, error))?;
        // A root that has other files in it was not made by us, or somebody keeps something there.
        match fs::remove_dir(&domain.root) {
            Err(error) if error.kind() != io::ErrorKind::DirectoryNotEmpty => {
                Err(DomainError::io("remove", &domain.root, error))
            }
            _ => Ok(Removal::Removed(removed + 2)),
        }
    }

    /// Leaves the domain; whoever is the last removes it.
    pub(crate) fn release(self, domain: &Domain) {
        let path = domain.root.join(LOCK_FILE);
        let is_last = self
            .flock(FlockOperation::NonBlockingLockExclusive, &path)
            .unwrap_or(false);
        if !is_last || !self.is_current(&path) {
            return;
        }
        if let Err(error) = self.remove_domain(domain) {
            tracing::warn!(%error, "the shared memory of the domain was left behind");
        }
    }

    /// Whether the lock was got; only the non-blocking kinds can say no.
    fn flock(&self, operation: FlockOperation, path: &Path) -> Result<bool, DomainError> {
        loop {
            return match rustix::fs::flock(&self.file, operation) {
                Ok(()) => Ok(true),
                Err(Errno::WOULDBLOCK) => Ok(false),
                // Only a signal interrupts; whoever owns the signals looks at them after joining.
                Err(Errno::INTR) => continue,
                Err(error) => Err(DomainError::io("lock", path, error)),
            };
        }
    }

    /// Whether the locked file is still the one in the root, not one that was removed meanwhile.
    fn is_current(&self, path: &Path) -> bool {
        match (self.file.metadata(), fs::symlink_metadata(path)) {
            (Ok(ours), Ok(present)) => ours.dev() == present.dev() && ours.ino() == present.ino(),
            _ => false,
        }
    }
}

/// Makes the root if it is not there, and checks that nobody else can put anything into it.
fn make_root(root: &Path) -> Result<(), DomainError> {
    match fs::DirBuilder::new().mode(0o700).create(root) {
        Ok(()) => {}
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
        Err(error) => return Err(DomainError::io("create", root, error)),
    }
    let metadata = match fs::symlink_metadata(root) {
        Ok(metadata) => metadata,
        // Removed between the two lines by the last process that left; the caller tries again.
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(DomainError::io("look at", root, error)),
    };
    if !metadata.is_dir() {
        return Err(unsafe_path(root, "it is not a folder".to_owned()));
    }
    check_owner(root, &metadata)?;
    if metadata.mode() & 0o022 != 0 {
        let reason = format!(
            "others may write to it (mode {:03o})",
            metadata.mode() & 0o777
        );
        return Err(DomainError::Unsafe {
            path: root.to_owned(),
            reason,
            next_step: "change its mode to 700",
        });
    }
    Ok(())
}

/// Whether something belongs to this user.
pub(crate) fn is_ours(metadata: &fs::Metadata) -> bool {
    metadata.uid() == rustix::process::geteuid().as_raw()
}

/// Refuses what belongs to another user.
pub(super) fn check_owner(path: &Path, metadata: &fs::Metadata) -> Result<(), DomainError> {
    if is_ours(metadata) {
        return Ok(());
    }
    let uid = rustix::process::geteuid().as_raw();
    let reason = format!("it belongs to user {}, this is user {uid}", metadata.uid());
    Err(unsafe_path(path, reason))
}

fn unsafe_path(path: &Path, reason: String) -> DomainError {
    DomainError::Unsafe {
        path: path.to_owned(),
        reason,
        next_step: "remove it, or choose another domain with RIL_IPC_PREFIX and RIL_IPC_ROOT",
    }
}

/// Opens or makes a lock file; nothing when the root vanished meanwhile.
fn open_lock_file(path: &Path) -> Result<Option<File>, DomainError> {
    let result = OpenOptions::new()
        .read(true)
        .write(true)
        .create(true)
        .truncate(false)
        .mode(0o600)
        .custom_flags(OFlags::NOFOLLOW.bits() as i32)
        .open(path);
    match result {
        Ok(file) => Ok(Some(file)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(DomainError::io("open", path, error)),
    }
}

/// Somebody is making a node, a service or a port: a shared lock. Who holds it exclusively knows that what looks half made will
/// never be finished, because its maker is dead.
#[derive(Debug)]
pub(crate) struct MakingLock {
    _file: File,
}

impl MakingLock {
    /// Announces that something is being made. Waits for whoever has the lock exclusively, but not without end: nothing,
    /// when that takes too long or the domain is gone.
    ///
    /// It is then made without the lock. Whoever has it exclusively was stopped for long, and knows only of older things.
    pub(crate) fn share(domain: &Domain) -> Option<MakingLock> {
        let file = open_lock_file(&domain.root.join(MAKING_FILE)).ok()??;
        for _ in 0..MAKING_ATTEMPTS {
            match rustix::fs::flock(&file, FlockOperation::NonBlockingLockShared) {
                Ok(()) => return Some(MakingLock { _file: file }),
                Err(Errno::INTR) => {}
                Err(Errno::WOULDBLOCK) => std::thread::sleep(MAKING_PAUSE),
                Err(_) => return None,
            }
        }
        tracing::debug!("somebody has been removing remains for long");
        None
    }

    /// Makes sure that nobody makes anything; nothing when somebody does.
    pub(super) fn exclude(domain: &Domain) -> Option<MakingLock> {
        let file = open_lock_file(&domain.root.join(MAKING_FILE)).ok()??;
        rustix::fs::flock(&file, FlockOperation::NonBlockingLockExclusive).ok()?;
        Some(MakingLock { _file: file })
    }
}

/// The one live provider of a service of a robot: an exclusive lock on its owner file.
#[derive(Debug)]
pub(crate) struct OwnerLock {
    _file: File,
}

/// Who provides a service.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Provider {
    /// Its process.
    pub pid: u32,
    /// The name that the process joined with.
    pub process: String,
    /// When it began to provide the service, host monotonic ns: tells a restarted provider from its predecessor.
    pub since_ns: u64,
}

impl OwnerLock {
    /// Becomes the provider, or says who is.
    pub(crate) fn acquire(
        domain: &Domain,
        robot: RobotId,
        key: &str,
        provider: &Provider,
    ) -> Result<Result<OwnerLock, Option<Provider>>, DomainError> {
        let path = owner_path(domain, robot, key)?;
        let Some(mut file) = open_lock_file(&path)? else {
            return Err(DomainError::Unsettled { path, attempts: 1 });
        };
        for _ in 0..OWNER_ATTEMPTS {
            match rustix::fs::flock(&file, FlockOperation::NonBlockingLockExclusive) {
                Ok(()) => {
                    write_owner(&mut file, provider)
                        .map_err(|error| DomainError::io("write", &path, error))?;
                    return Ok(Ok(OwnerLock { _file: file }));
                }
                Err(Errno::INTR) => {}
                Err(Errno::WOULDBLOCK) => std::thread::sleep(OWNER_PAUSE),
                Err(error) => return Err(DomainError::io("lock", &path, error)),
            }
        }
        Ok(Err(read_owner(&mut file)))
    }
}

/// The live provider of a service, if there is one.
pub(crate) fn find_provider(
    domain: &Domain,
    robot: RobotId,
    key: &str,
) -> Result<Option<Provider>, DomainError> {
    let path = domain.root.join(OWNERS_DIR).join(format!("{robot}.{key}"));
    let mut file = match open_to_look(&path) {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(DomainError::io("open", &path, error)),
    };
    loop {
        return match rustix::fs::flock(&file, FlockOperation::NonBlockingLockShared) {
            Ok(()) => Ok(None),
            Err(Errno::INTR) => continue,
            // A provider that has the lock but not yet written its name counts as being there.
            Err(Errno::WOULDBLOCK) => Ok(Some(read_owner(&mut file).unwrap_or(Provider {
                pid: 0,
                process: "unknown".to_owned(),
                since_ns: 0,
            }))),
            Err(error) => Err(DomainError::io("lock", &path, error)),
        };
    }
}

/// Opens a file without waiting for anybody, whatever stands in its place.
pub(super) fn open_to_look(path: &Path) -> io::Result<File> {
    OpenOptions::new()
        .read(true)
        .custom_flags((OFlags::NOFOLLOW | OFlags::NONBLOCK).bits() as i32)
        .open(path)
}

fn owner_path(domain: &Domain, robot: RobotId, key: &str) -> Result<PathBuf, DomainError> {
    let folder = domain.root.join(OWNERS_DIR);
    match fs::DirBuilder::new().mode(0o700).create(&folder) {
        Err(error) if error.kind() != io::ErrorKind::AlreadyExists => {
            Err(DomainError::io("create", &folder, error))
        }
        _ => Ok(folder.join(format!("{robot}.{key}"))),
    }
}

fn write_owner(file: &mut File, provider: &Provider) -> io::Result<()> {
    file.set_len(0)?;
    file.rewind()?;
    let Provider {
        pid,
        process,
        since_ns,
    } = provider;
    file.write_all(format!("{pid} {since_ns} {process}\n").as_bytes())
}

fn read_owner(file: &mut File) -> Option<Provider> {
    file.rewind().ok()?;
    let mut text = String::new();
    file.take(MAX_OWNER_LEN).read_to_string(&mut text).ok()?;
    parse_owner(&text)
}

fn parse_owner(text: &str) -> Option<Provider> {
    let mut words = text.trim_end().splitn(3, ' ');
    Some(Provider {
        pid: words.next()?.parse().ok()?,
        since_ns: words.next()?.parse().ok()?,
        process: words.next()?.to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn provider(process: &str) -> Provider {
        Provider {
            pid: 42,
            process: process.to_owned(),
            since_ns: 7,
        }
    }

    #[test]
    fn an_owner_file_is_read_back_and_half_a_one_is_nothing() {
        assert_eq!(parse_owner("42 7 my bridge\n"), Some(provider("my bridge")));
        for text in ["", "42", "42 7", "x 7 bridge", "42 -1 bridge"] {
            assert_eq!(parse_owner(text), None, "{text:?}");
        }
    }

    #[test]
    fn the_first_in_removes_what_was_left_and_the_last_out_everything() {
        let domain = Domain::isolated();
        let root = domain.root().to_owned();
        fs::create_dir_all(root.join("nodes/123")).unwrap();
        fs::set_permissions(&root, std::os::unix::fs::PermissionsExt::from_mode(0o700)).unwrap();
        fs::write(root.join("nodes/123/node.details"), "half").unwrap();
        let segment = format!("/dev/shm/{}42.data", domain.prefix());
        fs::write(&segment, "left behind").unwrap();

        let first = DomainLock::acquire(&domain).unwrap();
        assert!(!root.join("nodes").exists());
        assert!(!Path::new(&segment).exists());

        let second = DomainLock::acquire(&domain).unwrap();
        fs::write(&segment, "in use").unwrap();
        assert_eq!(domain.remove_if_dead().unwrap(), Removal::InUse);
        first.release(&domain);
        assert!(Path::new(&segment).exists());
        second.release(&domain);
        assert_eq!(domain.residue(), Vec::<PathBuf>::new());
        assert_eq!(domain.remove_if_dead().unwrap(), Removal::Nothing);
    }

    #[test]
    fn files_that_are_not_the_domain_s_are_left_alone() {
        let folder = tempfile::tempdir_in("/tmp").unwrap();
        let domain = Domain::new("mine_", folder.path()).unwrap();
        fs::write(folder.path().join("letter.txt"), "dear").unwrap();
        DomainLock::acquire(&domain).unwrap().release(&domain);
        let names: Vec<_> = fs::read_dir(folder.path())
            .unwrap()
            .map(|entry| entry.unwrap().file_name())
            .collect();
        assert_eq!(names, ["letter.txt"]);
    }

    #[test]
    fn a_root_that_others_may_write_to_is_refused() {
        let folder = tempfile::tempdir_in("/tmp").unwrap();
        fs::set_permissions(
            folder.path(),
            std::os::unix::fs::PermissionsExt::from_mode(0o777),
        )
        .unwrap();
        let domain = Domain::new("open_", folder.path()).unwrap();
        let error = DomainLock::acquire(&domain).unwrap_err().to_string();
        assert!(error.contains("mode 777"), "{error}");
        assert!(error.contains("change its mode to 700"), "{error}");
    }

    #[test]
    fn a_service_has_one_owner_and_the_second_learns_who() {
        let domain = Domain::isolated();
        let lock = DomainLock::acquire(&domain).unwrap();
        let robot = RobotId::DEFAULT;
        assert_eq!(find_provider(&domain, robot, "movement").unwrap(), None);

        let owner = OwnerLock::acquire(&domain, robot, "movement", &provider("first")).unwrap();
        let owner = owner.unwrap();
        let refused = OwnerLock::acquire(&domain, robot, "movement", &provider("second")).unwrap();
        assert_eq!(refused.unwrap_err(), Some(provider("first")));
        assert_eq!(
            find_provider(&domain, robot, "movement").unwrap(),
            Some(provider("first"))
        );
        // Another robot's service is another one.
        let other = RobotId::new(2).unwrap();
        assert_eq!(find_provider(&domain, other, "movement").unwrap(), None);

        drop(owner);
        assert_eq!(find_provider(&domain, robot, "movement").unwrap(), None);
        lock.release(&domain);
        assert!(domain.residue().is_empty());
    }
}
