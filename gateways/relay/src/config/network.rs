//! `[network]`, `[robot]` and `[router]`: how a relay takes part in the network, and where it is reached.

use std::net::SocketAddrV4;
use std::time::Duration;

use serde::Deserialize;

runtime::ranged! {
    fn milliseconds(u64) in 50..=60_000;
    fn retry_ms(u64) in 20..=60_000;
    fn buffer_bytes(u32) in 4096..=16_777_216;
}

/// `[network]`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NetworkConfig {
    /// Whom a relay connects to.
    pub through: Through,
    /// Whether others are found by multicast.
    pub discovery: bool,
    /// Group and port of the discovery.
    pub multicast: SocketAddrV4,
    /// How long an attempt to connect may take.
    #[serde(deserialize_with = "milliseconds")]
    pub open_timeout_ms: u64,
    /// Pause between two attempts.
    #[serde(deserialize_with = "retry_ms")]
    pub retry_ms: u64,
    /// After how long without a byte a connection is closed.
    #[serde(deserialize_with = "milliseconds")]
    pub lease_ms: u64,
    /// Bytes that may wait in a connection over TCP or TLS.
    #[serde(deserialize_with = "buffer_bytes")]
    pub send_buffer_bytes: u32,
    /// After how long without an answer the link is down.
    #[serde(deserialize_with = "milliseconds")]
    pub silent_after_ms: u64,
}

impl Default for NetworkConfig {
    fn default() -> Self {
        NetworkConfig {
            through: Through::Peers,
            discovery: false,
            multicast: SocketAddrV4::new([224, 0, 0, 224].into(), 7446),
            open_timeout_ms: 700,
            retry_ms: 100,
            lease_ms: 3000,
            send_buffer_bytes: 8192,
            silent_after_ms: 2500,
        }
    }
}

impl NetworkConfig {
    /// After how long without an answer the link is down.
    pub fn silent_after(&self) -> Duration {
        Duration::from_millis(self.silent_after_ms)
    }
}

/// Whom a relay connects to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Through {
    /// The other side.
    Peers,
    /// Zenoh routers, as a star.
    Router,
}

/// `[robot]`
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RobotConfig {
    /// Endpoints of Zenoh where this relay is reached.
    pub listen: Vec<String>,
    /// Endpoints of Zenoh to connect to.
    pub connect: Vec<String>,
}

impl Default for RobotConfig {
    fn default() -> Self {
        RobotConfig {
            listen: vec!["tcp/127.0.0.1:7447".to_owned()],
            connect: Vec::new(),
        }
    }
}

/// `[router]`
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RouterConfig {
    /// Endpoints of Zenoh where robots and stations reach it.
    pub listen: Vec<String>,
    /// Endpoints of other routers.
    pub connect: Vec<String>,
}

impl Default for RouterConfig {
    fn default() -> Self {
        RouterConfig {
            listen: vec!["tcp/127.0.0.1:7447".to_owned()],
            connect: Vec::new(),
        }
    }
}
