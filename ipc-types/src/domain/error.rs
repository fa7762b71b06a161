//! What can be wrong with a domain, and what to do about it.

use std::io;
use std::path::{Path, PathBuf};

use super::MAX_PREFIX_AND_ROOT_LEN;

/// The domain cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum DomainError {
    /// One variable is set and the other is not.
    #[error("{set} is set but {missing} is not: set both, or none for the user's default domain")]
    OnlyOneVariable {
        /// The variable that is set.
        set: &'static str,
        /// The one that is not.
        missing: &'static str,
    },
    /// The prefix is not usable.
    #[error(
        "`{prefix}` is no prefix for shared-memory names: use 1 to 24 letters, digits and `-`, then one `_` (such as `hero1000_`)"
    )]
    InvalidPrefix {
        /// What was given.
        prefix: String,
    },
    /// The root is not usable.
    #[error(
        "`{}` is no root for shared memory: use an absolute path of letters, digits, `-`, `_`, `.` and `/`, without `..`", root.display()
    )]
    InvalidRoot {
        /// What was given.
        root: PathBuf,
    },
    /// Prefix and root together are too long for a socket's name.
    #[error(
        "root `{}` and prefix `{prefix}` have {len} bytes together, {MAX_PREFIX_AND_ROOT_LEN} are possible: choose a shorter root, such as a folder in /tmp", root.display()
    )]
    TooLong {
        /// The root.
        root: PathBuf,
        /// The prefix.
        prefix: String,
        /// Their bytes.
        len: usize,
    },
    /// Something of the domain belongs to another user, or others may write it.
    #[error("`{}` is not safe to use: {reason}; {next_step}", path.display())]
    Unsafe {
        /// Which file, folder or segment.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
        /// What the operator can do.
        next_step: &'static str,
    },
    /// This process already uses another domain.
    #[error(
        "this process already uses the domain with prefix `{present}`, it cannot enter `{wanted}` as well: enter a domain first thing in main, and only one"
    )]
    AnotherDomainEntered {
        /// Prefix in use.
        present: String,
        /// Prefix that was asked for.
        wanted: String,
    },
    /// The lock changed hands too often.
    #[error(
        "`{}` was removed and created again {attempts} times while this process tried to lock it: try again", path.display()
    )]
    Unsettled {
        /// The lock file.
        path: PathBuf,
        /// How often it was tried.
        attempts: u32,
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
        DomainError::Io {
            action,
            path: path.to_owned(),
            source: source.into(),
        }
    }
}
