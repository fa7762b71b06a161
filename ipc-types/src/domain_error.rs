//! What can be wrong with a domain, and what to do about it.

use std::io;
use std::path::{Path, PathBuf};

use rustix::io::Errno;
use rustix::process::{Resource, getrlimit};

/// The domain cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum DomainError {
    /// The root is not usable.
    #[error(
        "`{}` is no root for shared memory: use an absolute path of letters, digits, `-`, `_`, `.` and `/`, without `..`", root.display()
    )]
    InvalidRoot {
        /// What was given.
        root: PathBuf,
    },
    /// The root is too long for a socket's name.
    #[error(
        "root `{}` has {len} bytes, {max} are possible: choose a shorter root, such as a folder in /tmp", root.display()
    )]
    TooLong {
        /// The root.
        root: PathBuf,
        /// Its bytes.
        len: usize,
        /// Most bytes.
        max: usize,
    },
    /// A folder of the domain belongs to another user, or others may write to it.
    #[error("`{}` cannot be used: {reason}; {next_step}", path.display())]
    Unsafe {
        /// Which folder.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
        /// What the operator can do.
        next_step: &'static str,
    },
    /// A lock changed hands too often.
    #[error(
        "`{}` was removed and created again {attempts} times while this process tried to lock it: try again", path.display()
    )]
    Unsettled {
        /// The lock file.
        path: PathBuf,
        /// How often it was tried.
        attempts: u32,
    },
    /// There is no room for what this process must create.
    #[error(
        "no room in `{}` for the shared memory of this process: remove what fills it (see `df -h` and `df -i`), or enlarge it (`mount -o remount,size=256m /dev/shm`)", path.display()
    )]
    NoRoom {
        /// What could not be created or written.
        path: PathBuf,
    },
    /// No descriptor was left.
    #[error(
        "no file descriptor is left to {action} `{}`: this process may have {limit} (`ulimit -n` of its shell, `LimitNOFILE=` of its service); raise that", path.display()
    )]
    NoDescriptor {
        /// What was tried.
        action: &'static str,
        /// On what.
        path: PathBuf,
        /// How many it may have.
        limit: u64,
    },
    /// The operating system refused something.
    #[error("cannot {action} `{}`", path.display())]
    Io {
        /// What was tried.
        action: &'static str,
        /// On what.
        path: PathBuf,
        /// Why not.
        #[source]
        source: io::Error,
    },
}

impl DomainError {
    pub(crate) fn io(
        action: &'static str,
        path: &Path,
        source: impl Into<io::Error>,
    ) -> DomainError {
        let (path, source) = (path.to_owned(), source.into());
        if let Some(Errno::MFILE | Errno::NFILE) = Errno::from_io_error(&source) {
            let limit = getrlimit(Resource::Nofile).current.unwrap_or(u64::MAX);
            return DomainError::NoDescriptor {
                action,
                path,
                limit,
            };
        }
        match source.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
                DomainError::NoRoom { path }
            }
            _ => DomainError::Io {
                action,
                path,
                source,
            },
        }
    }
}
