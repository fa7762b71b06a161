//! [`NetworkError`]: why the network does not work.

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
    pub(super) fn new(what: impl Into<String>, reason: impl std::fmt::Display) -> NetworkError {
        NetworkError::Failed {
            what: what.into(),
            reason: reason.to_string(),
        }
    }
}
