//! What a server is given at its start, and what it gets to know of each peer.

use std::net::{IpAddr, SocketAddr};

use crate::page::{ReplayInfo, Role, TileRange};

/// What distinguishes this start of the server from all others: a text without meaning.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Instance(pub String);

/// A secret by which a viewer may look or order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Token {
    /// Its name, for the log.
    pub name: String,
    /// What it allows.
    pub role: Role,
    /// At least 128 random bits in letters and digits.
    pub secret: String,
}

/// How a server behaves.
#[derive(Clone, Debug, Default)]
pub struct Settings {
    /// Names and addresses by which requests may call this machine, beside those of loopback. Without ports.
    pub names: Vec<String>,
    /// Origins of other programs' pages that may connect, as `https://studio.example`.
    pub origins: Vec<String>,
    /// Which viewers may do what.
    pub tokens: Vec<Token>,
    /// Whether Foxglove clients whose token allows to order may call services and set parameters.
    pub foxglove_commands: bool,
    /// Whether Foxglove clients may read parameters.
    pub foxglove_parameters: bool,
    /// The recording that is played; `None` if robots are shown live. In a replay all orders are refused.
    pub replay: Option<ReplayInfo>,
    /// The zooms of which there are tiles; `None` without any.
    pub tiles: Option<TileRange>,
    /// Whether the recording that is played has a report.
    pub has_report: bool,
}

/// The other end of a connection, as the operating system knows it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Peer {
    /// Its address.
    pub address: SocketAddr,
    /// The address of this machine at which it has come.
    pub at: IpAddr,
    /// Whether it is a process of the user that the server runs as, on this machine.
    pub is_own_user: bool,
    /// Whether the bytes are those of a TLS connection.
    pub is_encrypted: bool,
}

impl Peer {
    /// Whether it is on this machine.
    pub fn is_loopback(&self) -> bool {
        self.address.ip().to_canonical().is_loopback()
    }
}
