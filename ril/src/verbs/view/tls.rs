//! TLS of a connection, between its socket and the server. Without the feature `tls` there is none.

#[cfg(not(feature = "tls"))]
mod absent;
#[cfg(feature = "tls")]
mod session;

#[cfg(not(feature = "tls"))]
pub(super) use absent::{Tls, TlsSession};
#[cfg(feature = "tls")]
pub(super) use session::{Tls, TlsSession};

/// The first byte of a TLS connection, a handshake record: it distinguishes TLS from HTTP.
pub(super) const HANDSHAKE: u8 = 0x16;
