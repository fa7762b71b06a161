//! [`Settings`]: what the operator has chosen.

use std::net::SocketAddr;
use std::time::Duration;

/// See the module's documentation.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The vehicle's number, 1 … 250.
    pub system: u8,
    /// Stations that are sent a heartbeat unasked.
    pub stations: Vec<SocketAddr>,
    /// Systems that may command; all if it is empty.
    pub commanders: Vec<u8>,
    /// Altitude above sea of telemetry's zero, m, if it is known.
    pub zero_above_sea_m: Option<f64>,
    /// Height of a take-off that names none, m.
    pub take_off_m: f64,
    /// The helicopter is lost when its newest sample is older.
    pub lost_after: Duration,
    /// How long the bridge has for its first answer, and until when an order that is no stop may begin.
    pub answer_within: Duration,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            system: 1,
            stations: Vec::new(),
            commanders: Vec::new(),
            zero_above_sea_m: None,
            take_off_m: 10.0,
            lost_after: Duration::from_secs(2),
            answer_within: Duration::from_secs(1),
        }
    }
}
