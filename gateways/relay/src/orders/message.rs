//! The messages between a station and a robot that carry requests, of which each may be lost, repeated, reordered and
//! late; and the final reports that the relay itself makes ([`RelayVerdict`]).

use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::{Reason, Stage};
use ipc_types::payload::RequestReport;
use module_kit::journal::raw;
use serde::{Deserialize, Serialize};

/// Instead of a session: the station may not command.
pub const NOT_PERMITTED: u64 = 0;

/// Instead of a session: the station may command and has to wait, because as many others as have
/// [sessions](super::robot::SESSIONS) are active.
pub const NO_PLACE: u64 = 1;

/// Numbers that a station may use above its floor: twice what [`OPEN_ORDERS`](super::station::OPEN_ORDERS) need when
/// all of them move to another number at once, 2 · (32 + 32). The robot side remembers so many orders of a session,
/// about 600 bytes each. It ignores an order above, which no station sends.
pub const WINDOW: u64 = 128;

/// Station to robot: carry this request out, if that was not done before, and answer with what is known about it.
///
/// A station repeats an order until it has the final report. All copies have the same session and number, but for an
/// order that [moves to another number](super::station).
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Order {
    /// Session that the robot side gave this instance of the station.
    pub session: u64,
    /// Number of the order. A station counts from 1, through all its sessions.
    pub number: u64,
    /// All orders of this session with a lower number are settled at the station: the robot side forgets them.
    pub floor: u64,
    /// Which request service of the robot, as the two sides agreed.
    pub service: u64,
    /// The robot side must not pass the request on later than this. Monotonic clock of the *robot*.
    pub expires: MonotonicNs,
    /// The station has asked for this request before, perhaps in another session: it may have been carried out.
    pub is_repeat: bool,
    /// The station does not want the request any more. The robot side gives it up, and answers with a final report.
    pub is_given_up: bool,
    /// The request as its service has it. The first eight bytes are the request id, little-endian.
    pub request: Vec<u8>,
}

/// Robot to station: a report about an order.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// Session of the order.
    pub session: u64,
    /// Number of the order.
    pub number: u64,
    /// Reports about an order count from 1. 0: the robot side has the order and no report about it yet; `report` then
    /// has nothing but the request id.
    pub serial: u32,
    /// The report. `reported_ns` is in the robot's monotonic clock, `path_id` is 0 when the relay made the report.
    #[serde(with = "raw")]
    pub report: RequestReport,
}

/// The request id at the beginning of a request, or 0, which is no id, when there is none.
pub fn request_id(request: &[u8]) -> u64 {
    request
        .first_chunk()
        .map_or(0, |bytes| u64::from_le_bytes(*bytes))
}

/// Why the relay itself ends a request, and which side of it does. A report that says *refused* means that the request
/// was never passed on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RelayVerdict {
    /// Station: the station has no link to the robot.
    LinkDown,
    /// Station: the robot has not answered for so long that the station stopped waiting.
    LinkLost,
    /// Station: the robot's relay does not let this station command.
    NotPermitted,
    /// Station: as many other stations as the robot's relay takes requests from are active.
    TooManyStations,
    /// Station: two robots answer under the robot's number.
    TwoRobots,
    /// Both: a bounded table is full: the station's open orders, or the server's queue.
    TooManyRequests,
    /// Both: another request with this id is open.
    Busy,
    /// Both: the request has no id.
    InvalidRequest,
    /// Robot: the request came to the robot, or could be passed on, only after the moment until which it may begin: so
    /// much later.
    Expired(Duration),
    /// Robot: no process serves this request on the robot.
    NoServer,
    /// Robot: the request was asked before, and no process serves it now.
    ServerGone,
    /// Robot: the request was asked before, and the robot side that was asked is gone.
    NotRemembered,
    /// Robot: the request was asked before, and its server calls it busy for too long.
    StillOpen,
    /// Robot: the station gave the request up.
    GivenUp,
}

impl RelayVerdict {
    /// Stage and reason.
    const fn codes(self) -> (Stage, Reason) {
        match self {
            RelayVerdict::LinkDown => (Stage::Refused, Reason::RelayLinkDown),
            RelayVerdict::LinkLost => (Stage::Unknown, Reason::RelayLinkLost),
            RelayVerdict::NotPermitted => (Stage::Refused, Reason::RelayNotPermitted),
            RelayVerdict::TooManyStations => (Stage::Refused, Reason::RelayTooManyStations),
            RelayVerdict::TwoRobots => (Stage::Refused, Reason::RelayTwoRobots),
            RelayVerdict::TooManyRequests => (Stage::Refused, Reason::TooManyRequests),
            RelayVerdict::Busy => (Stage::Refused, Reason::StillOpen),
            RelayVerdict::InvalidRequest => (Stage::Refused, Reason::InvalidRequest),
            RelayVerdict::Expired(_) => (Stage::Refused, Reason::TooLate),
            RelayVerdict::NoServer => (Stage::Refused, Reason::BridgeGone),
            RelayVerdict::ServerGone => (Stage::Unknown, Reason::BridgeGone),
            RelayVerdict::NotRemembered => (Stage::Unknown, Reason::NotRemembered),
            RelayVerdict::StillOpen => (Stage::Unknown, Reason::StillOpen),
            RelayVerdict::GivenUp => (Stage::Unknown, Reason::None),
        }
    }

    /// The final report about this request. `now` is the clock of the side that makes it.
    pub fn report(self, request_id: u64, now: MonotonicNs) -> RequestReport {
        let (stage, reason) = self.codes();
        let late = match self {
            RelayVerdict::Expired(late) => Some(late.as_secs_f64()),
            _ => None,
        };
        RequestReport {
            request_id,
            reported_ns: now.0,
            value: late.unwrap_or_default(),
            value_valid: late.is_some().into(),
            ..RequestReport::new(stage, reason)
        }
    }
}
