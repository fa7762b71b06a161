//! The provider of a service of a robot: one live process at most.
//!
//! It holds an exclusive `flock` on the lock in the service's folder, and has written its name into it. The file stays when
//! the provider goes, for the next one.

use std::fs::{self, File};
use std::io::{self, Seek, Write};
use std::os::unix::fs::{FileExt, MetadataExt};
use std::path::{Path, PathBuf};
use std::time::Duration;

use rustix::fs::{AtFlags, FlockOperation, unlinkat};
use rustix::io::Errno;
use rustix::process::{Pid, test_kill_process};

use crate::domain_error::DomainError;
use crate::lock_file::{
    LockFile, flock, is_at, is_same, make_folder, make_lock_file_in, open_folder,
    open_lock_file_in, open_to_look,
};

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
    /// When it began to provide the service, host monotonic ns: distinguishes a restarted provider from its predecessor.
    pub since_ns: u64,
    /// The PID namespace of its process; 0 when the operating system did not say.
    pub pid_namespace: u64,
    /// The time namespace of its process; 0 when the operating system did not say. In another one the monotonic clock has
    /// another zero.
    pub time_namespace: u64,
}

impl Provider {
    /// This process, which begins to provide something at `since_ns`.
    pub(crate) fn this_process(process: &str, since_ns: u64) -> Provider {
        Provider {
            pid: std::process::id(),
            process: process.to_owned(),
            since_ns,
            pid_namespace: namespace("pid"),
            time_namespace: namespace("time"),
        }
    }

    /// Whether its process id means the same process here.
    pub fn shares_pids(&self) -> bool {
        self.pid_namespace == namespace("pid")
    }

    /// Whether its times mean the same moments here.
    pub fn shares_clock(&self) -> bool {
        self.time_namespace == namespace("time")
    }
}

/// The number of a namespace of this process.
fn namespace(kind: &str) -> u64 {
    fs::metadata(format!("/proc/self/ns/{kind}")).map_or(0, |metadata| metadata.ino())
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
        let path = folder.join(LOCK_FILE);
        let mut by = None;
        for _ in 0..ATTEMPTS {
            make_folder(folder)?;
            let Some(dir) = open_folder(folder)? else {
                continue;
            };
            let Some(file) = make_lock_file_in(&dir, LOCK_FILE, folder)? else {
                continue;
            };
            if !flock(&file, FlockOperation::NonBlockingLockExclusive, &path)? {
                by = read(&file);
                std::thread::sleep(PAUSE);
                continue;
            }
            // Else it is the lock of a folder that was removed meanwhile.
            if is_at(&file, &path) {
                write(&file, provider).map_err(|error| DomainError::io("write", &path, error))?;
                return Ok(Ok(ProviderLock { file, path }));
            }
        }
        Ok(Err(by))
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
            Some(lock) if is_same(&lock, &self.file) => unlinkat(&*dir, name, AtFlags::empty())
                .map_err(|error| DomainError::io("remove", &folder.join(name), error)),
            _ => Ok(()),
        }
    }
}

impl Drop for ProviderLock {
    /// The next provider has the lock before it has written its name.
    fn drop(&mut self) {
        if let Err(error) = self.file.set_len(0) {
            tracing::debug!(path = %self.path.display(), %error, "the provider's name stays");
        }
    }
}

/// Looks whether a process has a lock exclusively, time and again: a system call each time while one has.
#[derive(Debug)]
pub(crate) struct LockWatch {
    path: PathBuf,
    /// Kept while the lock is held: its file is not removed as long.
    file: Option<LockFile>,
}

impl LockWatch {
    /// Watches a lock whose file need not be there yet.
    pub(crate) fn new(path: PathBuf) -> LockWatch {
        LockWatch { path, file: None }
    }

    /// Whether the lock is held.
    ///
    /// # Errors
    ///
    /// When the file cannot be opened or locked.
    pub(crate) fn is_held(&mut self) -> Result<bool, DomainError> {
        let file = match self.file.take() {
            Some(file) => file,
            None => match open_to_look(&self.path) {
                Ok(file) => file,
                Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(false),
                Err(error) => return Err(DomainError::io("open", &self.path, error)),
            },
        };
        // When it is got, no process had it; dropping the file gives it back.
        let is_held = !flock(&file, FlockOperation::NonBlockingLockShared, &self.path)?;
        self.file = is_held.then_some(file);
        Ok(is_held)
    }
}

/// Looks for the live provider of a service, time and again: two system calls each time while there is one.
#[derive(Debug)]
pub(crate) struct ProviderWatch(LockWatch);

impl ProviderWatch {
    /// Watches the service in `folder`, which need not have been provided yet.
    pub(crate) fn new(folder: &Path) -> ProviderWatch {
        ProviderWatch(LockWatch::new(folder.join(LOCK_FILE)))
    }

    /// The live provider, if there is one now.
    ///
    /// # Errors
    ///
    /// When the file cannot be opened or locked.
    pub(crate) fn look(&mut self) -> Result<Option<Provider>, DomainError> {
        if !self.0.is_held()? {
            return Ok(None);
        }
        // A provider that has the lock but not yet written its name counts as being there.
        Ok(Some(self.0.file.as_deref().and_then(read).unwrap_or(
            Provider {
                pid: 0,
                process: "unknown".to_owned(),
                since_ns: 0,
                pid_namespace: 0,
                time_namespace: 0,
            },
        )))
    }
}

fn write(mut file: &File, provider: &Provider) -> io::Result<()> {
    let Provider {
        pid,
        process,
        since_ns,
        pid_namespace,
        time_namespace,
    } = provider;
    let text = format!("{pid} {since_ns} {pid_namespace} {time_namespace} {process}\n");
    file.set_len(0)?;
    file.rewind()?;
    file.write_all(text.as_bytes())
}

fn read(file: &File) -> Option<Provider> {
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
        let mut watch = ProviderWatch::new(&service);
        assert_eq!(watch.look().unwrap(), None);
        let [one, other] = [7, 8].map(|since_ns| Provider::this_process("bridge", since_ns));
        let lock = ProviderLock::acquire(&service, &one).unwrap().unwrap();
        assert_eq!(watch.look().unwrap().as_ref(), Some(&one));
        assert!(one.shares_pids() && one.shares_clock());
        let refused = ProviderLock::acquire(&service, &other).unwrap();
        assert_eq!(refused.unwrap_err(), Some(one));
        drop(lock);
        assert_eq!(watch.look().unwrap(), None);
        let _lock = ProviderLock::acquire(&service, &other).unwrap().unwrap();
        assert_eq!(watch.look().unwrap(), Some(other));
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
        let file = File::create(service.join(LOCK_FILE)).unwrap();
        write(&file, &killed).unwrap();
        assert!(flock(&file, FlockOperation::NonBlockingLockExclusive, &service).unwrap());
        let refused = ProviderLock::acquire(&service, &next).unwrap();
        assert_eq!(refused.unwrap_err(), None);
        let seen = ProviderWatch::new(&service).look().unwrap().unwrap();
        assert_eq!(seen.process, "unknown");
    }

    #[test]
    fn half_a_line_names_no_process() {
        for text in ["", "7", "7 8 9 10", "x 8 9 10 bridge"] {
            assert_eq!(parse(text), None, "{text}");
        }
    }
}
