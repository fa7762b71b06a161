//! [`NotASnapshot`]: what is wrong with bytes that should be a snapshot of the core.

/// The bytes are no snapshot of this version's core.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("these bytes are no snapshot of a bridge of this version")]
pub struct NotASnapshot;
