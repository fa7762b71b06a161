//! [`Error`]: everything that can go wrong, as a text that says what to do, and as a code for C.

use std::fmt::Write;

use ipc_types::schema::{LoadError, SchemaError};
use ipc_types::subscriber::ReceiveError;
use ipc_types::{
    DomainError, DynamicError, Forked, JoinError, OpenError, PublishError, ReportError, SendError,
    ServeError, WaitError,
};

/// Something went wrong.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum Error {
    #[error(transparent)]
    Domain(#[from] DomainError),
    #[error(transparent)]
    Join(#[from] JoinError),
    #[error(transparent)]
    Open(#[from] OpenError),
    #[error(transparent)]
    Dynamic(#[from] DynamicError),
    #[error(transparent)]
    Publish(#[from] PublishError),
    #[error(transparent)]
    Receive(#[from] ReceiveError),
    #[error(transparent)]
    Send(#[from] SendError),
    #[error(transparent)]
    Serve(#[from] ServeError),
    #[error(transparent)]
    Report(#[from] ReportError),
    #[error(transparent)]
    Wait(#[from] WaitError),
    #[error(transparent)]
    Load(#[from] LoadError),
    #[error(transparent)]
    Forked(#[from] Forked),
    #[error(transparent)]
    Signal(#[from] runtime::signal::SignalError),
    #[error("the schema cannot be read")]
    Schema(#[from] SchemaError),
    /// The caller's struct is not the one that lies in the topic.
    #[error("{0}")]
    Layout(String),
    /// The bridge hangs, or the machine stalls.
    #[error("the bridge did not answer a waypoint of the path in time: is it alive?")]
    NoAnswer,
    /// No report about this request can come.
    #[error(
        "request {0} is not open: its final report was read before, or the request was given up"
    )]
    NotOpen(u64),
    /// An argument that cannot be meant.
    #[error("{0}")]
    Invalid(String),
}

/// What kind of error it is: the negative values of `hero_ril_result` in the header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum ErrorKind {
    /// An argument is invalid.
    Invalid = -1,
    /// The service carries another struct than the caller was built with.
    Layout = -2,
    /// No process serves the request, or provides a service whose schema is wanted.
    NotThere = -3,
    /// Another process provides the service already.
    Taken = -4,
    /// There are as many ports or open requests as there can be.
    Full = -5,
    /// Anything else.
    Failed = -6,
    /// A bug in the library; the handle must be closed.
    Panic = -7,
}

impl Error {
    /// What kind of error it is.
    pub fn kind(&self) -> ErrorKind {
        match self {
            Error::Open(error) | Error::Dynamic(DynamicError::Open(error)) => of_open(error),
            Error::Dynamic(DynamicError::OwnService { .. }) | Error::Layout(_) => ErrorKind::Layout,
            Error::Send(SendError::NoServer { .. }) | Error::Load(LoadError::Missing(_)) => {
                ErrorKind::NotThere
            }
            Error::Send(
                SendError::TooManyOutstanding | SendError::NoPlace(_) | SendError::ServerFull,
            ) => ErrorKind::Full,
            Error::Receive(error) if error.is_full() => ErrorKind::Full,
            Error::Dynamic(_)
            | Error::Schema(_)
            | Error::Invalid(_)
            | Error::NotOpen(_)
            | Error::Wait(WaitError::NoSources | WaitError::TooManySources(_))
            | Error::Report(ReportError::NotOpen) => ErrorKind::Invalid,
            Error::Join(JoinError::InvalidProcessName(_)) => ErrorKind::Invalid,
            _ => ErrorKind::Failed,
        }
    }

    /// The text with that of every cause.
    pub fn text(&self) -> String {
        let mut text = self.to_string();
        let mut cause = std::error::Error::source(self);
        while let Some(error) = cause {
            // Writing to a string cannot fail.
            let _ = write!(text, ": {error}");
            cause = error.source();
        }
        text
    }
}

fn of_open(error: &OpenError) -> ErrorKind {
    match error {
        OpenError::LayoutMismatch { .. } => ErrorKind::Layout,
        OpenError::AlreadyProvided { .. } => ErrorKind::Taken,
        OpenError::Full { .. } => ErrorKind::Full,
        _ => ErrorKind::Failed,
    }
}
