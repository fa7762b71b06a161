//! What a page says to the server.

use serde::{Deserialize, Serialize};

use super::words::{CheckKind, LeaseAction, OrderKind, ReplayAction};

/// `order`: what a page orders.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OrderRequest {
    /// A number that the page chose at random: the same one is executed once.
    pub order: String,
    /// The robot's number.
    pub robot: u32,
    /// What is ordered.
    pub kind: OrderKind,
    /// The newest `now` that was drawn when the pilot ordered.
    pub seen: u64,
    /// Latitude and longitude, degrees; `None` if the order needs none.
    pub position: Option<[f64; 2]>,
    /// `None` if the order needs none.
    pub altitude_m: Option<f64>,
    /// The word that confirms; `None` if none was asked for.
    pub confirm: Option<String>,
}

/// `check`: what a page asks before it orders.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CheckRequest {
    /// A number that the page chose; the answer has it.
    pub order: String,
    /// The robot's number.
    pub robot: u32,
    /// What would be ordered.
    pub kind: CheckKind,
    /// Latitude and longitude, degrees; `None` if the order needs none.
    pub position: Option<[f64; 2]>,
    /// `None` if the order needs none.
    pub altitude_m: Option<f64>,
}

/// `replay`: what a page wants of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReplayRequest {
    /// What to do.
    pub action: ReplayAction,
    /// Where to go to, for [`ReplayAction::Seek`].
    pub position_s: Option<f64>,
    /// How fast, for [`ReplayAction::Speed`].
    pub speed: Option<f64>,
}

/// A message from a page.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "type", rename_all = "kebab-case")]
pub(crate) enum Incoming {
    Open {
        token: Option<String>,
        robot: Option<u32>,
        rate_hz: f64,
    },
    Seen {
        n: u64,
    },
    Order(OrderRequest),
    Check(CheckRequest),
    Lease {
        robot: u32,
        action: LeaseAction,
    },
    Replay(ReplayRequest),
    Hidden {
        hidden: bool,
    },
    Ping {
        id: String,
    },
}
