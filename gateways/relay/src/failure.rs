//! [`Failure`]: why a relay cannot run, and [`NetworkError`]: why its network does not work.

use ipc_types::{JoinError, OpenError, WaitError};

/// Why a relay cannot run.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// The shared memory of this machine cannot be used.
    #[error(transparent)]
    Join(#[from] JoinError),
    /// Another relay runs, or a service cannot be opened.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The network cannot be used.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// The operating system cannot wait.
    #[error(transparent)]
    Wait(#[from] WaitError),
    /// The process has too many descriptors.
    #[error("the operating system gives no descriptor ({0})")]
    Descriptors(#[from] rustix::io::Errno),
}

/// The network does not work.
#[derive(Debug, thiserror::Error)]
pub enum NetworkError {
    /// Zenoh, or the operating system, refuses.
    #[error("{what}: {reason}")]
    Failed {
        /// What was wanted.
        what: String,
        /// What it says.
        reason: String,
    },
    /// The process was asked to end before a router was reached.
    #[error("it was ended before a router was reached")]
    Ended,
}

impl NetworkError {
    pub(crate) fn new(what: impl Into<String>, reason: impl std::fmt::Display) -> NetworkError {
        NetworkError::Failed {
            what: what.into(),
            reason: reason.to_string(),
        }
    }
}
