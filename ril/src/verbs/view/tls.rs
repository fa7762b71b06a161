//! TLS of a connection, between its socket and the server. Without the feature `tls` there is none.

#[cfg(not(feature = "tls"))]
mod absent;
#[cfg(feature = "tls")]
mod session;

#[cfg(not(feature = "tls"))]
pub(super) use absent::{Session, Tls};
#[cfg(feature = "tls")]
pub(super) use session::{Session, Tls};

/// The first byte of a client that speaks TLS, by which it is told from HTTP: a record of a handshake.
pub(super) const HANDSHAKE: u8 = 0x16;
