//! Who provides a service of a robot: one live process at most.
//!
//! It holds an exclusive `flock` on the service's file in the folder of owners, and has written into it who it is. The file
//! stays when the provider goes, for the next one, until the domain is removed.

use std::fs::{self, File};
use std::io::{self, Seek, Write};
use std::os::unix::fs::{DirBuilderExt, FileExt};
use std::path::PathBuf;
use std::time::Duration;

use rustix::fs::FlockOperation;
use rustix::io::Errno;

use super::lock::{open_lock_file, open_to_look};
use super::{Domain, DomainError};
use crate::files;
use crate::robot::RobotId;

/// The folder with a file for each service that was ever provided.
pub(crate) const OWNERS_DIR: &str = "owners";

/// How often and how long a provider waits for somebody who only looks whether there is one.
///
/// A look takes microseconds; a live provider keeps its lock for good. Twenty looks in a row at one service are not
/// chance.
const OWNER_ATTEMPTS: u32 = 20;
const OWNER_PAUSE: Duration = Duration::from_millis(1);

/// Largest owner file: a process id, a time and a name.
const MAX_OWNER_LEN: usize = 256;

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
        Ok(Err(read_owner(&file)))
    }
}

/// Looks for the live provider of a service, time and again: two system calls each time while there is one.
#[derive(Debug)]
pub(crate) struct ProviderWatch {
    path: PathBuf,
    /// Kept while the provider lives: his file is not removed before the domain is.
    file: Option<File>,
}

impl ProviderWatch {
    /// Watches a service that need not have been provided yet.
    pub(crate) fn new(domain: &Domain, robot: RobotId, key: &str) -> ProviderWatch {
        ProviderWatch {
            path: file_of(domain, robot, key),
            file: None,
        }
    }

    /// The live provider, if there is one now.
    ///
    /// # Errors
    ///
    /// When the file cannot be opened or locked.
    pub(crate) fn look(&mut self) -> Result<Option<Provider>, DomainError> {
        let file = match self.file.take() {
            Some(file) => file,
            None => match open_to_look(&self.path) {
                Ok(file) => file,
                Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
                Err(error) => return Err(DomainError::io("open", &self.path, error)),
            },
        };
        loop {
            match rustix::fs::flock(&file, FlockOperation::NonBlockingLockShared) {
                // Nobody has it; closing the file gives the lock back.
                Ok(()) => return Ok(None),
                Err(Errno::INTR) => {}
                Err(Errno::WOULDBLOCK) => break,
                Err(error) => return Err(DomainError::io("lock", &self.path, error)),
            }
        }
        // A provider that has the lock but not yet written its name counts as being there.
        let provider = read_owner(&file).unwrap_or(Provider {
            pid: 0,
            process: "unknown".to_owned(),
            since_ns: 0,
        });
        self.file = Some(file);
        Ok(Some(provider))
    }
}

/// The service's file, in a folder that is there.
fn owner_path(domain: &Domain, robot: RobotId, key: &str) -> Result<PathBuf, DomainError> {
    let folder = domain.root.join(OWNERS_DIR);
    match files::while_no_port_opens(|| fs::DirBuilder::new().mode(0o700).create(&folder)) {
        Err(error) if error.kind() != io::ErrorKind::AlreadyExists => {
            Err(DomainError::io("create", &folder, error))
        }
        _ => Ok(file_of(domain, robot, key)),
    }
}

fn file_of(domain: &Domain, robot: RobotId, key: &str) -> PathBuf {
    domain.root.join(OWNERS_DIR).join(format!("{robot}.{key}"))
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

fn read_owner(file: &File) -> Option<Provider> {
    let mut text = [0; MAX_OWNER_LEN];
    let len = file.read_at(&mut text, 0).ok()?;
    parse_owner(str::from_utf8(&text[..len]).ok()?)
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
    use crate::domain::DomainLock;

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
    fn a_service_has_one_owner_and_the_second_learns_who() {
        let domain = Domain::isolated();
        let lock = DomainLock::acquire(&domain).unwrap();
        let robot = RobotId::DEFAULT;
        let mut watch = ProviderWatch::new(&domain, robot, "movement");
        assert_eq!(watch.look().unwrap(), None);

        let owner = OwnerLock::acquire(&domain, robot, "movement", &provider("first")).unwrap();
        let owner = owner.unwrap();
        let refused = OwnerLock::acquire(&domain, robot, "movement", &provider("second")).unwrap();
        assert_eq!(refused.unwrap_err(), Some(provider("first")));
        assert_eq!(watch.look().unwrap(), Some(provider("first")));
        // Another robot's service is another one.
        let other = RobotId::new(2).unwrap();
        let mut others = ProviderWatch::new(&domain, other, "movement");
        assert_eq!(others.look().unwrap(), None);

        // A later one is told from the first, also by who was watching; and watching is in nobody's way.
        drop(owner);
        let next = OwnerLock::acquire(&domain, robot, "movement", &provider("next")).unwrap();
        assert_eq!(watch.look().unwrap(), Some(provider("next")));
        drop(next);
        for _ in 0..2 {
            assert_eq!(watch.look().unwrap(), None);
        }
        assert!(
            OwnerLock::acquire(&domain, robot, "movement", &provider("last"))
                .unwrap()
                .is_ok()
        );
        lock.release(&domain);
        assert!(domain.residue().is_empty());
    }
}
