//! [`CertifyError`]: why there are no certificates, and the exit code of it.

use std::io;
use std::path::PathBuf;

use runtime::exit::{ExitCode, Failure};

/// Certificates that cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum CertifyError {
    /// A machine is named twice.
    #[error("`{0}` is named twice")]
    Twice(String),
    /// A file is there already.
    #[error("{} is there already, and is not overwritten: move it away first, or choose another name", .0.display())]
    Exists(PathBuf),
    /// The files of the authority cannot be used.
    #[error("the authority in {} cannot be used: {reason}", folder.display())]
    Authority {
        /// Where it is.
        folder: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A file cannot be written or read.
    #[error("{}: {error}", path.display())]
    File {
        /// Which one.
        path: PathBuf,
        /// Why.
        error: io::Error,
    },
    /// The library refuses.
    #[error("a certificate cannot be made: {0}")]
    Library(#[from] rcgen::Error),
}

impl From<CertifyError> for Failure {
    fn from(error: CertifyError) -> Failure {
        let code = match error {
            CertifyError::Twice(_) => ExitCode::Usage,
            CertifyError::Exists(_) => ExitCode::Refused,
            CertifyError::Authority { .. } => ExitCode::NotInOrder,
            CertifyError::File { .. } | CertifyError::Library(_) => ExitCode::Internal,
        };
        Failure::new(code, error)
    }
}
