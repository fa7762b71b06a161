//! [`Settings`]: what the operator has chosen.

use std::net::SocketAddr;
use std::time::Duration;

use serde::Deserialize;

use crate::stations::StationAddress;

/// What becomes of a movement when the station that ordered it says nothing any more.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum StationLost {
    /// It goes on.
    #[default]
    Continue,
    /// The helicopter stops and hovers.
    Hold,
    /// It lands on the spot.
    Land,
}

/// What the operator has chosen for the gateway.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The vehicle's number, 1 … 250.
    pub system: u8,
    /// Stations that are sent a heartbeat unasked.
    pub stations: Vec<SocketAddr>,
    /// Systems that may command; if it is empty, all on this machine and all that sign.
    pub commanders: Vec<u8>,
    /// Whether stations on other machines are taken that do not sign.
    pub is_insecure: bool,
    /// Altitude above sea of telemetry's zero, m, if it is known.
    pub zero_above_sea_m: Option<f64>,
    /// Height of a take-off that names none, m.
    pub take_off_m: f64,
    /// The helicopter is lost when its newest sample is older.
    pub lost_after: Duration,
    /// How long the bridge has for its first answer, and until when an order that is no stop may begin.
    pub answer_within: Duration,
    /// What becomes of a movement of a station that is lost.
    pub station_lost: StationLost,
    /// A station is lost when nothing of it came for so long; at most [`SILENCE`](crate::SILENCE), after which it is
    /// gone.
    pub station_lost_after: Duration,
    /// Whether a station's fence goes into the bridge's configuration.
    pub accepts_fence: bool,
}

impl Settings {
    /// Why a station may not command; `None` if it may. `signs` says whether those of other machines sign.
    pub(crate) fn bars(&self, sender: StationAddress, signs: bool) -> Option<&'static str> {
        let is_named = self.commanders.contains(&sender.system);
        let is_known = signs || sender.address.ip().is_loopback();
        match self.commanders.is_empty() {
            false if !is_named => Some("this station may not command: `[commands] systems`"),
            true if !is_known => {
                Some("a station that does not sign may command when `[commands] systems` names it")
            }
            _ => None,
        }
    }
}

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            system: 1,
            stations: Vec::new(),
            commanders: Vec::new(),
            is_insecure: false,
            zero_above_sea_m: None,
            take_off_m: 10.0,
            lost_after: Duration::from_secs(2),
            answer_within: Duration::from_secs(1),
            station_lost: StationLost::Continue,
            station_lost_after: Duration::from_secs(10),
            accepts_fence: false,
        }
    }
}
