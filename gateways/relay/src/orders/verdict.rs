//! The final reports that the relay itself makes; all others are the servers'.

use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::{Reason, Stage};
use ipc_types::payload::RequestReport;

/// Why the relay itself ends a request, and which side of it does. A report that says *refused* means that the request was never
/// passed on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Station: the station has no link to the robot.
    LinkDown,
    /// Station: the robot has not answered for so long that the station stopped waiting.
    LinkLost,
    /// Station: the robot's relay does not let this station command.
    NotPermitted,
    /// Station: as many other stations as the robot's relay takes requests from are active.
    TooManyStations,
    /// Both: a bounded table is full: the station's open orders, or the server's queue.
    TooManyRequests,
    /// Both: another request with this id is open.
    Busy,
    /// Both: the request has no id.
    InvalidRequest,
    /// Robot: the request came to the robot, or could be passed on, only after the moment until which it may begin: so much later.
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

impl Verdict {
    /// Stage and reason.
    const fn codes(self) -> (Stage, Reason) {
        match self {
            Verdict::LinkDown => (Stage::Refused, Reason::RelayLinkDown),
            Verdict::LinkLost => (Stage::Unknown, Reason::RelayLinkLost),
            Verdict::NotPermitted => (Stage::Refused, Reason::RelayNotPermitted),
            Verdict::TooManyStations => (Stage::Refused, Reason::RelayTooManyStations),
            Verdict::TooManyRequests => (Stage::Refused, Reason::TooManyRequests),
            Verdict::Busy => (Stage::Refused, Reason::StillOpen),
            Verdict::InvalidRequest => (Stage::Refused, Reason::InvalidRequest),
            Verdict::Expired(_) => (Stage::Refused, Reason::TooLate),
            Verdict::NoServer => (Stage::Refused, Reason::BridgeGone),
            Verdict::ServerGone => (Stage::Unknown, Reason::BridgeGone),
            Verdict::NotRemembered => (Stage::Unknown, Reason::NotRemembered),
            Verdict::StillOpen => (Stage::Unknown, Reason::StillOpen),
            Verdict::GivenUp => (Stage::Unknown, Reason::None),
        }
    }

    /// The final report about this request. `now` is the clock of the side that makes it.
    pub fn report(self, request_id: u64, now: MonotonicNs) -> RequestReport {
        let (stage, reason) = self.codes();
        let late = match self {
            Verdict::Expired(late) => Some(late.as_secs_f64()),
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
