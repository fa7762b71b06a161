//! The messages between a station and a robot that carry requests. Each may be lost, repeated, reordered and late.

use ipc_types::MonotonicNs;
use ipc_types::payload::RequestReport;

/// What the robot side says in the place of a session to a station that may command and has to wait, because as many others as have
/// [sessions](super::robot::SESSIONS) are active. No session has this number, nor 0, which is said to a station that may not command.
pub const NO_PLACE: u64 = 1;

/// Station to robot: carry this request out, if that was not done before, and answer with what is known about it.
///
/// A station repeats an order until it has the final report. All copies have the same session and number, but for an order that
/// [moves to another number](super::station).
#[derive(Clone, Debug, PartialEq)]
pub struct Order {
    /// Session that the robot side gave this life of the station.
    pub session: u64,
    /// Number of the order. A station counts from 1, through all its sessions.
    pub number: u64,
    /// All orders of this session with a lower number are settled at the station: the robot side may forget them.
    pub floor: u64,
    /// Which request service of the robot, as the two sides agreed.
    pub topic: u64,
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
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    /// Session of the order.
    pub session: u64,
    /// Number of the order.
    pub number: u64,
    /// Reports about an order count from 1. 0: the robot side has the order and no report about it yet; `report` then has nothing
    /// but the request id.
    pub serial: u32,
    /// The report. `reported_ns` is in the robot's monotonic clock, `path_id` is 0 when the relay made the report.
    pub report: RequestReport,
}

/// Robot to station: the robot side does not know the session of an order. It was restarted, or has forgotten this station.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnknownSession {
    /// Session of the order.
    pub session: u64,
}

/// The request id at the beginning of a request, or 0, which is no id, when there is none.
pub fn request_id(request: &[u8]) -> u64 {
    request
        .first_chunk()
        .map_or(0, |bytes| u64::from_le_bytes(*bytes))
}
