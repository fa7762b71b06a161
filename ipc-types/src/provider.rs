//! The provider of a service of a robot: one live process at most.
//!
//! It holds an exclusive `flock` on the lock in the service's folder, and has written its name into it. The file stays
//! when the provider goes, for the next one.

use std::cell::Cell;
use std::fs;
use std::io::{self, Seek, Write};
use std::os::unix::fs::{FileExt, MetadataExt};
use std::path::{Path, PathBuf};
use std::time::Duration;

use rustix::fs::FlockOperation;
use rustix::io::Errno;
use rustix::process::{Pid, test_kill_process};

use crate::disk::{self, is_at, open_to_look};
use crate::domain_error::DomainError;
use crate::lock_file::{
    LockFile, flock, is_same, make_folder, make_lock_file_in, open_folder, open_lock_file_in,
    unless_missing,
};
use crate::time::MonotonicNs;

/// The file in a service's folder that its provider has locked.
const LOCK_FILE: &str = "lock";

/// How often and how long a provider waits for processes that only look whether there is one.
///
/// A look takes microseconds; a live provider keeps its lock for good. Twenty looks in a row at one service are not
/// chance.
const ATTEMPTS: u32 = 20;
const PAUSE: Duration = Duration::from_millis(1);

/// Largest content: a process, a time, two namespaces and a name.
const MAX_LEN: usize = 256;

/// The process that provides a service.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Provider {
    /// Its process, as it is numbered in its own PID namespace.
    pub pid: u32,
    /// The name that the process joined with.
    pub process: String,
    /// When it began to provide the service, host monotonic ns: distinguishes a restarted provider from its
    /// predecessor.
    pub since_ns: u64,
    /// The PID namespace of its process; 0 when the operating system did not say.
    pub pid_namespace: u64,
    /// The time namespace of its process; 0 when the operating system did not say. In another one the monotonic clock
    /// has another zero.
    pub time_namespace: u64,
}

impl Provider {
    /// This process, which begins to provide something at `since_ns`.
    pub(crate) fn this_process(process: &str, since_ns: u64) -> Provider {
        Provider {
            pid: std::process::id(),
            process: process.to_owned(),
            since_ns,
            pid_namespace: namespace("self", "pid"),
            time_namespace: namespace("self", "time"),
        }
    }

    /// Whether its process id means the same process here.
    pub fn shares_pids(&self) -> bool {
        self.pid_namespace == namespace("self", "pid")
    }

    /// Whether its times mean the same moments here.
    pub fn shares_clock(&self) -> bool {
        self.time_namespace == namespace("self", "time")
    }
}

/// The number of a namespace of a process; 0 when the operating system does not say.
pub(crate) fn namespace(process: &str, kind: &str) -> u64 {
    fs::metadata(format!("/proc/{process}/ns/{kind}")).map_or(0, |metadata| metadata.ino())
}

/// The one live provider of a service of a robot: an exclusive lock.
#[derive(Debug)]
pub(crate) struct ProviderLock {
    file: LockFile,
    path: PathBuf,
}

impl ProviderLock {
    /// Becomes the provider of the service in `folder`, or returns the process that is.
    pub(crate) fn acquire(
        folder: &Path,
        provider: &Provider,
    ) -> Result<Result<ProviderLock, Option<Provider>>, DomainError> {
        let mut by = None;
        for _ in 0..ATTEMPTS {
            match ProviderLock::attempt(folder)? {
                Some(Ok(lock)) => {
                    let written = write(&lock.file, provider);
                    written.map_err(|error| DomainError::io("write", &lock.path, error))?;
                    return Ok(Ok(lock));
                }
                Some(Err(of_other)) => {
                    by = read(&of_other);
                    disk::pause(PAUSE);
                }
                None => {}
            }
        }
        Ok(Err(by))
    }

    /// Takes the lock, or opens that of another process; `None` if the folder was removed meanwhile.
    pub(crate) fn attempt(
        folder: &Path,
    ) -> Result<Option<Result<ProviderLock, LockFile>>, DomainError> {
        let path = folder.join(LOCK_FILE);
        make_folder(folder)?;
        let Some(dir) = open_folder(folder)? else {
            return Ok(None);
        };
        let Some(file) = make_lock_file_in(&dir, LOCK_FILE, folder)? else {
            return Ok(None);
        };
        if !flock(&file, FlockOperation::NonBlockingLockExclusive, &path)? {
            return Ok(Some(Err(file)));
        }
        // Else it is the lock of a folder that was removed meanwhile.
        let is_in_place = is_at(&file, &path);
        Ok(is_in_place.then_some(Ok(ProviderLock { file, path })))
    }

    /// That of a process of a model.
    #[cfg(test)]
    pub(crate) fn of_model(handle: disk::model::Handle, path: PathBuf) -> ProviderLock {
        ProviderLock {
            file: LockFile::of_model(handle),
            path,
        }
    }

    #[cfg(test)]
    pub(crate) fn keep(mut self) -> disk::model::Handle {
        self.file.keep()
    }

    /// Whether it still is the lock that others find. Else the folder of a live robot was removed from outside.
    pub(crate) fn is_in_place(&self) -> bool {
        is_at(&self.file, &self.path)
    }

    /// Removes a file from the folder in which this process provides, and from no other that has its name by now.
    pub(crate) fn remove(&self, name: &str) -> Result<(), DomainError> {
        let folder = self.path.parent().unwrap_or(&self.path);
        let Some(dir) = open_folder(folder)? else {
            return Ok(());
        };
        match open_lock_file_in(&dir, LOCK_FILE, folder)? {
            Some(lock) if is_same(&lock, &self.file) => {
                let path = folder.join(name);
                unless_missing(disk::remove_in(&dir, name), "remove", &path).map(|_| ())
            }
            _ => Ok(()),
        }
    }
}

impl Drop for ProviderLock {
    /// The next provider has the lock before it has written its name.
    fn drop(&mut self) {
        if let Err(error) = self.file.set_len(0) {
            crate::log::debug!(path = %self.path.display(), %error, "the provider's name stays");
        }
    }
}

/// The file of a lock if a process has the lock exclusively; it is not removed as long as it is open. `open` is the
/// file of an earlier look. `None` also if there is no such file.
fn held(path: &Path, open: Option<LockFile>) -> Result<Option<LockFile>, DomainError> {
    let opened = match open {
        Some(file) => Some(file),
        None => unless_missing(open_to_look(path), "open", path)?,
    };
    let Some(file) = opened else { return Ok(None) };
    // When it is got, no process had it; dropping the file gives it back.
    let is_got = flock(&file, FlockOperation::NonBlockingLockShared, path)?;
    Ok((!is_got).then_some(file))
}

/// The live provider of the service in `folder`, which need not have been provided yet.
///
/// # Errors
///
/// When the file cannot be opened or locked.
pub(crate) fn look(folder: &Path) -> Result<Option<Provider>, DomainError> {
    let file = held(&folder.join(LOCK_FILE), None)?;
    // A provider that has the lock but not yet written its name counts as being there.
    let provider = |file: LockFile| {
        read(&file).unwrap_or(Provider {
            pid: 0,
            process: "unknown".to_owned(),
            since_ns: 0,
            pid_namespace: 0,
            time_namespace: 0,
        })
    };
    Ok(file.map(provider))
}

/// Looks whether a process has a lock exclusively, time and again, and remembers it: a look takes a system call.
pub(crate) struct LockWatch {
    path: PathBuf,
    file: Cell<Option<LockFile>>,
    was_held: Cell<bool>,
    looked: Cell<MonotonicNs>,
}

impl LockWatch {
    /// Watches a lock that counts as held before the first look.
    pub(crate) fn new(path: PathBuf) -> LockWatch {
        LockWatch {
            path,
            file: Cell::new(None),
            was_held: Cell::new(true),
            looked: Cell::default(),
        }
    }

    /// Whether the lock is held. One that cannot be looked at counts as not held.
    pub(crate) fn look(&self) -> bool {
        let file = held(&self.path, self.file.take()).unwrap_or_else(|error| {
            crate::log::debug!(%error, "a provider cannot be looked for");
            None
        });
        self.was_held.set(file.is_some());
        self.file.set(file);
        self.looked.set(MonotonicNs::now());
        self.was_held()
    }

    /// Looks if the last look is so long ago.
    pub(crate) fn look_after(&self, period: Duration) {
        if MonotonicNs::now().since(self.looked.get()) >= period {
            self.look();
        }
    }

    /// Whether the lock was held at the last look.
    pub(crate) fn was_held(&self) -> bool {
        self.was_held.get()
    }
}

fn write(file: &LockFile, provider: &Provider) -> io::Result<()> {
    let Provider {
        pid,
        process,
        since_ns,
        pid_namespace,
        time_namespace,
    } = provider;
    let text = format!("{pid} {since_ns} {pid_namespace} {time_namespace} {process}\n");
    let mut file = &**file;
    file.set_len(0)?;
    file.rewind()?;
    file.write_all(text.as_bytes())
}

fn read(file: &LockFile) -> Option<Provider> {
    let mut text = [0; MAX_LEN];
    let len = file.read_at(&mut text, 0).ok()?;
    let provider = parse(str::from_utf8(&text[..len]).ok()?)?;
    // A provider that has the lock, but has not yet written its name, has left the name of one that was killed.
    let is_there = !provider.shares_pids() || is_alive(provider.pid);
    is_there.then_some(provider)
}

fn is_alive(pid: u32) -> bool {
    let pid = i32::try_from(pid).ok().and_then(Pid::from_raw);
    pid.is_some_and(|pid| test_kill_process(pid) != Err(Errno::SRCH))
}

fn parse(text: &str) -> Option<Provider> {
    let mut words = text.trim_end().splitn(5, ' ');
    Some(Provider {
        pid: words.next()?.parse().ok()?,
        since_ns: words.next()?.parse().ok()?,
        pid_namespace: words.next()?.parse().ok()?,
        time_namespace: words.next()?.parse().ok()?,
        process: words.next()?.to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_service_has_one_provider_who_can_be_named() {
        let folder = crate::files::test_folder();
        let service = folder.path().join("service");
        let look = || look(&service).unwrap();
        assert_eq!(look(), None);
        let [one, other] = [7, 8].map(|since_ns| Provider::this_process("bridge", since_ns));
        let lock = ProviderLock::acquire(&service, &one).unwrap().unwrap();
        assert_eq!(look().as_ref(), Some(&one));
        assert!(one.shares_pids() && one.shares_clock());
        let refused = ProviderLock::acquire(&service, &other).unwrap();
        assert_eq!(refused.unwrap_err(), Some(one));
        drop(lock);
        assert_eq!(look(), None);
        let _lock = ProviderLock::acquire(&service, &other).unwrap().unwrap();
        assert_eq!(look(), Some(other));
    }

    #[test]
    fn a_provider_whose_folder_was_taken_away_notices_and_leaves_the_next_ones_alone() {
        let folder = crate::files::test_folder();
        let [service, aside] = ["service", "aside"].map(|name| folder.path().join(name));
        let [one, other] = [7, 8].map(|since_ns| Provider::this_process("bridge", since_ns));
        let former = ProviderLock::acquire(&service, &one).unwrap().unwrap();
        assert!(former.is_in_place());
        fs::rename(&service, &aside).unwrap();
        assert!(!former.is_in_place());
        let lock = ProviderLock::acquire(&service, &other).unwrap().unwrap();
        let file = service.join("current");
        fs::write(&file, "x").unwrap();
        former.remove("current").unwrap();
        assert!(file.exists());
        lock.remove("current").unwrap();
        assert!(!file.exists());
    }

    #[test]
    fn a_provider_that_has_not_written_its_name_is_not_taken_for_the_one_before() {
        let folder = crate::files::test_folder();
        let service = folder.path().join("service");
        let mut dead = std::process::Command::new("true").spawn().unwrap();
        dead.wait().unwrap();
        let killed = Provider {
            pid: dead.id(),
            ..Provider::this_process("bridge", 7)
        };
        let next = Provider::this_process("bridge", 8);
        drop(ProviderLock::acquire(&service, &next).unwrap().unwrap());
        assert_eq!(fs::read_to_string(service.join(LOCK_FILE)).unwrap(), "");
        let file = LockFile::new(fs::File::create(service.join(LOCK_FILE)).unwrap());
        write(&file, &killed).unwrap();
        assert!(flock(&file, FlockOperation::NonBlockingLockExclusive, &service).unwrap());
        let refused = ProviderLock::acquire(&service, &next).unwrap();
        assert_eq!(refused.unwrap_err(), None);
        let seen = look(&service).unwrap().unwrap();
        assert_eq!(seen.process, "unknown");
    }

    #[test]
    fn half_a_line_names_no_process() {
        for text in ["", "7", "7 8 9 10", "x 8 9 10 bridge"] {
            assert_eq!(parse(text), None, "{text}");
        }
    }
}
