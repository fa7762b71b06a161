//! [`PtyError`]: why the simulated port cannot be there, and what to do.

use std::io;
use std::path::PathBuf;

/// The port cannot be there.
#[derive(Debug, thiserror::Error)]
pub enum PtyError {
    /// There is no terminal for it.
    #[error("no pseudo-terminal can be opened: {step} failed")]
    Terminal {
        /// What was tried.
        step: &'static str,
        /// Why not.
        source: io::Error,
    },
    /// Something else has the name of its link.
    #[error("{}: is there and is not a symbolic link; name another place with --link", .0.display())]
    Occupied(PathBuf),
    /// Another simulator lives, whose link it is.
    #[error("{}: is the link of another simulator{owner}; name another place with --link", .path.display())]
    Taken {
        /// Where the link is.
        path: PathBuf,
        /// Which process that is, where it is known.
        owner: String,
    },
    /// The operating system refused the link.
    #[error("{}: the symbolic link cannot be made; name a place that you may write to with --link", .path.display())]
    Link {
        /// Where the link should be.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
}
