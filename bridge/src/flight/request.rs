//! Requests as they are read from shared memory, parsed once into what the core works with, and which of two was issued
//! later.
//!
//! Any bit pattern may lie in a request: here it becomes either a typed value or a refusal with its reason. Inside the
//! core nothing is checked again, but for what depends on the state of the flight.
//!
//! **Order of issue.** An order says by its sender's clock when it was issued ([`Issued`]), because two orders may take
//! ways of different lengths. Orders by one clock are compared as they are. Those by two clocks are compared on the
//! safe side: an order is the later one only when it surely is. The bridge keeps one [`IssueMark`], of all orders that
//! it has taken, and carries out no movement that lies before it.

use std::time::Duration;

use dsp_protocol::{Waypoint, port};
use ipc_types::MonotonicNs;
use ipc_types::code::{ControlCommand, MovementKind, ParameterOperation, Reason, SenderLost};
use ipc_types::lease::LEASES_MS;
use ipc_types::payload::{ModuleControl, MovementData, ParameterRequest};
use serde::{Deserialize, Serialize};

use super::control::{Authority, Sender, SenderClock, Who};
use crate::config::{MovementLimits, STOP_WITHIN};
pub use crate::outputs::RequestKey;
use crate::safety::fence::Fence;

/// When an order was issued, as its sender says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Issued {
    /// By which clock: 0 for the robot's own, else that of one station.
    pub origin: u32,
    /// Not later than it truly was.
    pub at: MonotonicNs,
    /// Not earlier than it truly was; the same as `at` by the robot's own clock.
    pub latest: MonotonicNs,
}

impl Issued {
    /// The moment of two parts of one order.
    #[must_use]
    pub fn with(&self, other: &Issued) -> Issued {
        Issued {
            origin: self.origin,
            at: self.at.min(other.at),
            latest: self.latest.max(other.latest),
        }
    }
}

/// The moment before which an order is not carried out any more.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct IssueMark {
    /// Whose clock the last order was issued by.
    origin: u32,
    /// For orders by that clock.
    floor_same: MonotonicNs,
    /// For orders by any other clock.
    floor_other: MonotonicNs,
}

impl IssueMark {
    /// Whether a later order than this one was taken.
    pub fn supersedes(&self, issued: &Issued) -> bool {
        issued.at < self.floor(issued)
    }

    /// Something came between at `now` that no request ordered: orders that were issued before are not carried out any
    /// more.
    pub fn take_event(&mut self, now: MonotonicNs) {
        self.take(&Issued {
            origin: 0,
            at: now,
            latest: now,
        });
    }

    /// Takes an order. An order by another clock that is surely not the last changes nothing.
    pub fn take(&mut self, issued: &Issued) {
        if issued.origin != self.origin && issued.latest <= self.floor_same {
            return;
        }
        *self = IssueMark {
            origin: issued.origin,
            floor_same: self.floor(issued).max(issued.at),
            floor_other: self.floor_other.max(issued.latest),
        };
    }

    fn floor(&self, issued: &Issued) -> MonotonicNs {
        match issued.origin == self.origin {
            true => self.floor_same,
            false => self.floor_other,
        }
    }
}

/// What every request carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RequestHeader {
    /// To whom the reports go.
    pub key: RequestKey,
    /// The sender's id for the request.
    pub request_id: u64,
    /// The sender's id for the path, 0 if there is none.
    pub path_id: u64,
    /// When its order was issued.
    pub issued: Issued,
    /// What is known of the process that sent it.
    pub sender: Sender,
    /// The request that was the step before of the same command; 0 if it follows no other.
    pub after: u64,
    /// Until when it may begin on the DSP.
    pub begin_by: MonotonicNs,
    /// It was sent before, and its outcome is not known to the sender.
    pub repeat: bool,
    /// It may replace a path that is under way.
    pub preempt: bool,
    /// What becomes of its path without its sender.
    pub lost: WhenLost,
}

/// What becomes of a path when its sender is lost: its process ends, or it gives the path up, or does not renew its
/// lease.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct WhenLost {
    /// What follows.
    pub then: SenderLost,
    /// How often the sender renews the path; `None` if it does not.
    pub lease: Option<Duration>,
}

impl WhenLost {
    /// A lost sender changes nothing.
    pub const NOTHING: WhenLost = WhenLost {
        then: SenderLost::Continue,
        lease: None,
    };

    /// Reads what the movement says; without an action, it is the default.
    fn read(data: &MovementData, default: SenderLost) -> Result<WhenLost, Reason> {
        let lease = Duration::from_millis(data.lease_ms.into());
        let then = match data.sender_lost {
            0 => Some(default),
            code => SenderLost::from_code(code),
        };
        match (then, data.lease_ms) {
            (Some(then), ms) if ms == 0 || LEASES_MS.contains(&ms) => Ok(WhenLost {
                then,
                lease: (ms > 0).then_some(lease),
            }),
            _ => Err(Reason::InvalidRequest),
        }
    }
}

impl RequestHeader {
    /// Who sent it.
    pub fn who(&self) -> Who {
        Who {
            origin: self.issued.origin,
            sender: self.sender,
        }
    }
}

#[cfg(test)]
impl RequestHeader {
    pub(crate) const TEST: RequestHeader = RequestHeader {
        key: RequestKey::Control(1),
        request_id: 1,
        path_id: 0,
        issued: Issued {
            origin: 0,
            at: MonotonicNs(1),
            latest: MonotonicNs(1),
        },
        sender: Sender {
            process: None,
            session: None,
            clock: SenderClock::Own,
        },
        after: 0,
        begin_by: MonotonicNs(u64::MAX),
        repeat: false,
        preempt: false,
        lost: WhenLost::NOTHING,
    };
}

/// One waypoint with its frame bits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// The path that it belongs to.
    pub path_id: u64,
    /// Opens a path (`first_waypoint_data`).
    pub first: bool,
    /// Closes the path (`last_waypoint_data`).
    pub last: bool,
    /// The point.
    pub waypoint: Waypoint,
}

/// A movement with values that can be flown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Movement {
    /// Take off to `altitude_m` above the point of take-off.
    TakeOff {
        /// Height, m.
        altitude_m: f32,
    },
    /// Land on the spot.
    Land,
    /// Hover on the spot.
    Hold,
    /// One waypoint of a path.
    Waypoint(Segment),
}

/// What is asked for.
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    /// Start the module.
    Start,
    /// Stop the module.
    Stop,
    /// Take, release or hand over control.
    Control(Authority),
    /// Keep to this geofence: that of the configuration, read again, or why it cannot be used.
    NewFence(Result<Fence, Reason>),
    /// Move the helicopter.
    Movement(Movement),
    /// Describe, read or write a port. Which port it names, and whether that takes the value, is for
    /// [`parameters`](crate::flight::parameters) to say.
    Port {
        /// What is done.
        operation: ParameterOperation,
        /// The number of the port, or its place in the list.
        port: u32,
        /// What is written.
        value: f64,
    },
}

impl Request {
    /// What the request means for control.
    pub fn authority(&self) -> Authority {
        match self {
            Request::Control(authority) => *authority,
            Request::Movement(Movement::TakeOff { .. } | Movement::Waypoint(_))
            | Request::Port {
                operation: ParameterOperation::Write,
                ..
            } => Authority::Order,
            Request::Movement(Movement::Land | Movement::Hold)
            | Request::Start
            | Request::Stop
            | Request::NewFence(_)
            | Request::Port { .. } => Authority::Everyones,
        }
    }
}

/// A request as it was read, with what is asked for or why that cannot be.
pub type Parsed<R> = (RequestHeader, Result<R, Reason>);

/// Reads a control request of `sender`; `fence` is the geofence of the configuration, for the request that asks to read
/// it again.
pub fn parse_control(
    (key, sender): (RequestKey, Sender),
    control: &ModuleControl,
    fence: Option<Result<Fence, Reason>>,
    limits: &MovementLimits,
) -> Parsed<Request> {
    let command = ControlCommand::from_code(control.command);
    let within = match command {
        Some(ControlCommand::Stop) => STOP_WITHIN,
        _ => limits.begin_within(),
    };
    let issued = issued(control.issued_ns, control.issued_within_ns, control.origin);
    let header = RequestHeader {
        key,
        request_id: control.request_id,
        path_id: 0,
        issued,
        sender,
        after: control.after,
        begin_by: begin_by(control.begin_by_ns, issued.at, within),
        // A second start or stop has no further effect.
        repeat: false,
        preempt: false,
        lost: WhenLost::NOTHING,
    };
    let command = command.ok_or(Reason::InvalidRequest);
    let request = match (fence, command) {
        (Some(fence), command) => Ok(Request::NewFence(command.and(fence))),
        (None, Ok(ControlCommand::Start)) => Ok(Request::Start),
        (None, Ok(ControlCommand::Stop)) => Ok(Request::Stop),
        (None, Ok(ControlCommand::TakeControl)) => Ok(Request::Control(Authority::Take)),
        (None, Ok(ControlCommand::ReleaseControl)) => Ok(Request::Control(Authority::Release)),
        (None, Ok(ControlCommand::PassControl)) => Ok(Request::Control(Authority::Pass)),
        // The shell reads the configuration and gives the fence.
        (None, Ok(ControlCommand::ReloadFence)) => Err(Reason::InvalidFence),
        (None, Err(reason)) => Err(reason),
    };
    (header, request)
}

/// Reads a movement request of `sender` at `now`.
pub fn parse_movement(
    (key, sender): (RequestKey, Sender),
    data: &MovementData,
    limits: &MovementLimits,
    now: MonotonicNs,
) -> Parsed<Movement> {
    let kind = MovementKind::from_code(data.kind);
    let issued = issued(data.issued_ns, data.issued_within_ns, data.origin);
    // Of another movement nothing depends on its sender.
    let lost = match kind {
        Some(MovementKind::GoToWaypoint) => WhenLost::read(data, limits.sender_lost),
        _ => Ok(WhenLost::NOTHING),
    };
    let (from, within) = match kind {
        Some(MovementKind::Land | MovementKind::Hold) => (issued.at, STOP_WITHIN),
        // The path's sender lives: it has waited for the answer to the waypoint before this one.
        Some(MovementKind::GoToWaypoint) if data.first == 0 => (now, limits.begin_within()),
        _ => (issued.at, limits.begin_within()),
    };
    let header = RequestHeader {
        key,
        request_id: data.request_id,
        path_id: data.path_id,
        issued,
        sender,
        after: data.after,
        begin_by: begin_by(data.begin_by_ns, from, within),
        repeat: data.repeat != 0,
        preempt: data.preempt != 0,
        lost: lost.unwrap_or(WhenLost::NOTHING),
    };
    let movement = match kind {
        _ if lost.is_err() => Err(Reason::InvalidRequest),
        Some(MovementKind::TakeOff) => take_off(data.altitude_m),
        Some(MovementKind::Land) => Ok(Movement::Land),
        Some(MovementKind::Hold) => Ok(Movement::Hold),
        Some(MovementKind::GoToWaypoint) => segment(data, limits).map(Movement::Waypoint),
        None => Err(Reason::InvalidRequest),
    };
    (header, movement)
}

/// Reads a parameter request of `sender`.
pub fn parse_parameter(
    (key, sender): (RequestKey, Sender),
    request: &ParameterRequest,
    limits: &MovementLimits,
) -> Parsed<Request> {
    let issued = issued(request.issued_ns, request.issued_within_ns, request.origin);
    let header = RequestHeader {
        key,
        request_id: request.request_id,
        path_id: 0,
        issued,
        sender,
        after: request.after,
        begin_by: begin_by(request.begin_by_ns, issued.at, limits.begin_within()),
        // A second read or write of a port has no further effect.
        repeat: false,
        preempt: false,
        lost: WhenLost::NOTHING,
    };
    let operation = request.operation();
    let port = |operation| Request::Port {
        operation,
        port: request.port,
        value: request.value,
    };
    (header, operation.map(port).ok_or(Reason::InvalidRequest))
}

/// What becomes of a request by the clock that its sender reads. Its moments mean nothing by another clock, nor do
/// those from the future, nor none at all: they have no place among the orders. A hold, a landing or a stop is taken
/// all the same, as issued when it is read.
pub fn judged_by_clock(asked: Parsed<Request>, now: MonotonicNs) -> Parsed<Request> {
    let (mut header, request) = asked;
    let clock = header.sender.clock;
    let says_none = header.issued.at == MonotonicNs(0);
    let differs = clock == SenderClock::Other || header.issued.at > now;
    let is_stop = |request: &Request| {
        let on_the_spot = matches!(request, Request::Movement(Movement::Land | Movement::Hold));
        on_the_spot || *request == Request::Stop
    };
    match request {
        Ok(request) if is_stop(&request) => {
            if says_none || differs || clock == SenderClock::Unknown {
                let within = match says_none {
                    true => STOP_WITHIN,
                    false => header.begin_by.since(header.issued.at),
                };
                (header.issued.at, header.issued.latest) = (now, now);
                header.begin_by = now + within;
            }
            (header, Ok(request))
        }
        Ok(_) if says_none => (header, Err(Reason::InvalidRequest)),
        Ok(_) if differs => (header, Err(Reason::ClockDiffers)),
        request => (header, request),
    }
}

fn issued(at_ns: u64, within_ns: u32, origin: u32) -> Issued {
    let at = MonotonicNs(at_ns);
    let latest = at + Duration::from_nanos(within_ns.into());
    Issued { origin, at, latest }
}

fn begin_by(begin_by_ns: u64, from: MonotonicNs, within: Duration) -> MonotonicNs {
    match begin_by_ns {
        0 => from + within,
        begin_by_ns => MonotonicNs(begin_by_ns),
    }
}

fn take_off(altitude_m: f64) -> Result<Movement, Reason> {
    if !altitude_m.is_finite() {
        return Err(Reason::NotFinite);
    }
    let altitude_m = altitude_m as f32;
    let in_range = port::port32(port::TAKE_OFF_ALTITUDE_M)
        .is_some_and(|port| (port.min..=port.max).contains(&altitude_m));
    if in_range {
        Ok(Movement::TakeOff { altitude_m })
    } else {
        Err(Reason::OutOfRange)
    }
}

fn segment(data: &MovementData, limits: &MovementLimits) -> Result<Segment, Reason> {
    let values = [data.latitude_deg, data.longitude_deg, data.altitude_m];
    if !values.iter().all(|value| value.is_finite()) {
        return Err(Reason::NotFinite);
    }
    if data.latitude_deg.abs() > 90.0
        || data.longitude_deg.abs() > 180.0
        || !(limits.min_altitude_m..=limits.max_altitude_m).contains(&data.altitude_m)
    {
        return Err(Reason::OutOfRange);
    }
    Ok(Segment {
        path_id: data.path_id,
        first: flag(data.first)?,
        last: flag(data.last)?,
        waypoint: Waypoint {
            latitude_deg: data.latitude_deg,
            longitude_deg: data.longitude_deg,
            altitude_m: data.altitude_m,
        },
    })
}

fn flag(value: u16) -> Result<bool, Reason> {
    match value {
        0 => Ok(false),
        1 => Ok(true),
        _ => Err(Reason::InvalidRequest),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEY: RequestKey = RequestKey::Movement(1);
    const NOW: MonotonicNs = MonotonicNs(1_000_000_000);

    fn goto() -> MovementData {
        MovementData {
            request_id: 9,
            path_id: 4,
            issued_ns: NOW.0,
            kind: MovementKind::GoToWaypoint.code(),
            latitude_deg: 37.0,
            longitude_deg: -6.0,
            altitude_m: 20.0,
            first: 1,
            last: 1,
            ..MovementData::default()
        }
    }

    fn parse(change: impl FnOnce(&mut MovementData)) -> Result<Movement, Reason> {
        let mut data = goto();
        change(&mut data);
        parse_movement(
            (KEY, Sender::default()),
            &data,
            &MovementLimits::default(),
            NOW,
        )
        .1
    }

    #[test]
    fn what_cannot_be_flown_is_refused_with_its_reason() {
        assert!(parse(|_| ()).is_ok());
        assert_eq!(
            parse(|data| data.latitude_deg = f64::NAN),
            Err(Reason::NotFinite)
        );
        assert_eq!(
            parse(|data| data.longitude_deg = f64::INFINITY),
            Err(Reason::NotFinite)
        );
        assert_eq!(
            parse(|data| data.altitude_m = f64::NEG_INFINITY),
            Err(Reason::NotFinite)
        );
        assert_eq!(
            parse(|data| data.latitude_deg = 90.1),
            Err(Reason::OutOfRange)
        );
        assert_eq!(
            parse(|data| data.longitude_deg = -180.1),
            Err(Reason::OutOfRange)
        );
        assert_eq!(parse(|data| data.altitude_m = 1e9), Err(Reason::OutOfRange));
        assert_eq!(parse(|data| data.first = 2), Err(Reason::InvalidRequest));
        assert_eq!(
            parse(|data| data.last = 0xFFFF),
            Err(Reason::InvalidRequest)
        );
        assert_eq!(parse(|data| data.kind = 0), Err(Reason::InvalidRequest));
        assert_eq!(
            parse(|data| data.kind = u32::MAX),
            Err(Reason::InvalidRequest)
        );
    }

    #[test]
    fn a_take_off_must_fit_the_port_that_takes_its_altitude() {
        let altitude = |altitude_m| {
            parse(|data| {
                data.kind = MovementKind::TakeOff.code();
                data.altitude_m = altitude_m;
            })
        };
        assert_eq!(altitude(10.0), Ok(Movement::TakeOff { altitude_m: 10.0 }));
        assert_eq!(altitude(0.0), Err(Reason::OutOfRange));
        assert_eq!(altitude(200.5), Err(Reason::OutOfRange));
        assert_eq!(altitude(f64::NAN), Err(Reason::NotFinite));
    }

    #[test]
    fn the_header_survives_a_refusal() {
        let mut data = goto();
        data.kind = 77;
        data.begin_by_ns = 250;
        let (header, movement) = parse_movement(
            (KEY, Sender::default()),
            &data,
            &MovementLimits::default(),
            NOW,
        );
        assert_eq!(movement, Err(Reason::InvalidRequest));
        assert_eq!((header.request_id, header.path_id), (9, 4));
        assert_eq!(header.begin_by, MonotonicNs(250));
    }

    #[test]
    fn a_control_request_is_start_or_stop() {
        for (code, expected) in [
            (1, Ok(Request::Start)),
            (2, Ok(Request::Stop)),
            (0, Err(Reason::InvalidRequest)),
            (3, Err(Reason::InvalidFence)),
            (4, Ok(Request::Control(Authority::Take))),
            (5, Ok(Request::Control(Authority::Release))),
            (6, Ok(Request::Control(Authority::Pass))),
            (7, Err(Reason::InvalidRequest)),
        ] {
            let control = ModuleControl {
                command: code,
                issued_ns: NOW.0,
                ..ModuleControl::default()
            };
            let limits = MovementLimits::default();
            assert_eq!(
                parse_control((KEY, Sender::default()), &control, None, &limits).1,
                expected
            );
        }
    }

    const fn order(origin: u32, at: u64, within: u64) -> Issued {
        Issued {
            origin,
            at: MonotonicNs(at),
            latest: MonotonicNs(at + within),
        }
    }

    #[test]
    fn orders_by_one_clock_are_compared_as_they_are() {
        let mut mark = IssueMark::default();
        for origin in [0, 7] {
            assert!(!mark.supersedes(&order(origin, 0, 0)));
        }
        mark.take(&order(7, 100, 50));
        assert!(mark.supersedes(&order(7, 99, 50)));
        assert!(!mark.supersedes(&order(7, 100, 50)));
        assert!(!mark.supersedes(&order(7, 101, 50)));
        mark.take(&order(7, 90, 50));
        assert!(
            mark.supersedes(&order(7, 99, 50)),
            "an earlier order takes nothing back"
        );
    }

    #[test]
    fn an_order_by_another_clock_is_later_only_when_it_surely_is() {
        let mut mark = IssueMark::default();
        mark.take(&order(7, 100, 50));
        assert!(mark.supersedes(&order(0, 149, 0)));
        assert!(!mark.supersedes(&order(0, 150, 0)));
        assert!(mark.supersedes(&order(8, 149, 50)));
        // A hold of the robot itself, which counts though it may have been issued before.
        mark.take(&order(0, 120, 0));
        assert!(mark.supersedes(&order(7, 149, 50)));
        assert!(mark.supersedes(&order(0, 149, 0)));
        assert!(!mark.supersedes(&order(0, 150, 0)));
        // One that is surely older leaves those by the clock of the last order in their places.
        mark.take(&order(8, 200, 50));
        mark.take(&order(0, 200, 0));
        assert!(!mark.supersedes(&order(8, 200, 50)));
        mark.take(&order(0, 201, 0));
        assert!(mark.supersedes(&order(8, 200, 50)));
    }

    #[test]
    fn the_parts_of_an_order_have_its_earliest_moment() {
        let whole = order(7, 100, 50).with(&order(7, 90, 80));
        assert_eq!(whole, order(7, 90, 80));
    }
}
