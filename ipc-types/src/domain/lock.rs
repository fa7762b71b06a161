//! Who is in a domain, and who is making something in it: a lock for each.
//!
//! Both are `flock`s on files in the root, because the kernel drops them with the process, also after `kill -9`.
//! `flock` belongs to the open file, not to the process, so that several sessions of one process count one by one.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt};
use std::path::Path;
use std::time::Duration;

use rustix::fs::{FlockOperation, OFlags};
use rustix::io::Errno;

use super::{Domain, DomainError, Removal, remains};
use crate::files;

/// The file whose lock says that somebody is in the domain.
pub(super) const LOCK_FILE: &str = "domain.lock";

/// The file whose lock says that somebody is making something.
pub(super) const MAKING_FILE: &str = "making.lock";

/// How often a lock file may vanish between opening and locking it before we give up.
///
/// It vanishes when the last process leaves in that instant; each time is another process's whole life.
const MAX_LOCK_ATTEMPTS: u32 = 16;

/// How often and how long somebody who makes something waits for somebody who removes remains.
///
/// That takes a fraction of a millisecond for each dead process; only a cleaner that was stopped takes longer than all
/// of these together.
const MAKING_ATTEMPTS: u32 = 100;
const MAKING_PAUSE: Duration = Duration::from_millis(1);

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
    match files::while_no_port_opens(|| fs::DirBuilder::new().mode(0o700).create(root)) {
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
pub(super) fn open_lock_file(path: &Path) -> Result<Option<File>, DomainError> {
    let mut options = OpenOptions::new();
    options
        .read(true)
        .write(true)
        .create(true)
        .truncate(false)
        .mode(0o600)
        .custom_flags(OFlags::NOFOLLOW.bits() as i32);
    match files::while_no_port_opens(|| options.open(path)) {
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

/// Opens a file without waiting for anybody, whatever stands in its place.
pub(super) fn open_to_look(path: &Path) -> io::Result<File> {
    OpenOptions::new()
        .read(true)
        .custom_flags((OFlags::NOFOLLOW | OFlags::NONBLOCK).bits() as i32)
        .open(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_in_removes_what_was_left_and_the_last_out_everything() {
        let domain = Domain::isolated();
        let root = domain.root().to_owned();
        files::create_dir_all(&root.join("nodes/123")).unwrap();
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
        assert_eq!(domain.residue(), Vec::<std::path::PathBuf>::new());
        assert_eq!(domain.remove_if_dead().unwrap(), Removal::Nothing);
    }

    #[test]
    fn files_that_are_not_the_domain_s_are_left_alone() {
        let folder = files::test_folder();
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
        let folder = files::test_folder();
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
}
