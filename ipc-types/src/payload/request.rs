//! Requests to the bridge and the reports that answer them (`ModuleControl`, `MovementData`).
//!
//! Each carries the moment when its order was issued and the moment until which it may begin, both on the robot's
//! clock. The bridge judges by them which of two orders is the newer one, whatever way they came; see `docs/ipc.md`
//! section 4.

use super::module_state::ControlSender;
use super::number::given;
use super::position::WaypointPosition;
use super::text::{ascii_bytes, ascii_text};
use crate::code::{
    CameBetween, ControlCommand, ImiCode, MovementKind, ParameterOperation, PortKind, Reason,
    SafetyRule, SenderLost, Stage,
};
use crate::time::MonotonicNs;

shared_struct! {
    /// Start or stop the module (`ModuleControl`). Service `module_control`.
    pub struct ModuleControl("hero.ModuleControl.v3") = 48 {
        /// Chosen by the sender, not 0, never used before by any sender; every report repeats it.
        pub request_id: u64,
        /// When the order was issued, the robot's monotonic clock: not later than it truly was. 0 lets the client's port write
        /// the moment of sending.
        pub issued_ns: u64,
        /// Until when it may begin, same clock; 0 takes the bridge's default.
        pub begin_by_ns: u64,
        /// The request that was the step before of the same command: this one is taken only if nothing came between the two. 0 if it
        /// follows no other.
        pub after: u64,
        /// A [`ControlCommand`](crate::code::ControlCommand).
        pub command: u32 => command: ControlCommand,
        /// By how much later than `issued_ns` it may have been issued, ns; 0 from a program on the robot, whose clock is the same.
        pub issued_within_ns: u32,
        /// By which clock it was issued: 0 for the robot's own; the relay gives each station a number of its own.
        pub origin: u32,
        /// Always zero; keeps the size a multiple of eight.
        pub reserved: u32,
    }
}

shared_struct! {
    /// A movement (`MovementData`). Service `movement`.
    ///
    /// A path is framed by the pair (`first`, `last`): (1,1) is a single waypoint, (1,0) opens a path, (0,0) continues
    /// it, (0,1) closes it. Nothing of a path goes to the DSP until it is closed.
    pub struct MovementData("hero.MovementData.v4") = 96 {
        /// Chosen by the sender, not 0, never used before by any sender; every report repeats it.
        pub request_id: u64,
        /// Chosen by the sender, the same in all waypoints of one path and in every report about it; 0 for take-off
        /// and landing.
        pub path_id: u64,
        /// When the order was issued, the robot's monotonic clock: not later than it truly was. 0 lets the client's port write
        /// the moment of sending. All waypoints of a path carry the moment of the path.
        pub issued_ns: u64,
        /// Until when it may begin, same clock; 0 takes the bridge's default.
        pub begin_by_ns: u64,
        /// The request that was the step before of the same command: this one is taken only if nothing came between the two. 0 if it
        /// follows no other.
        pub after: u64,
        /// Latitude of the waypoint, degrees, north positive. Go-to only.
        pub latitude_deg: f64,
        /// Longitude of the waypoint, degrees, east positive. Go-to only.
        pub longitude_deg: f64,
        /// Go-to: altitude of the waypoint, m, same zero as telemetry. Take-off: height over the point of take-off, m.
        pub altitude_m: f64,
        /// A [`MovementKind`](crate::code::MovementKind) (`type_of_request`).
        pub kind: u32 => kind: MovementKind,
        /// 1 when this waypoint opens a path (`first_waypoint_data`). Go-to only.
        pub first: u16,
        /// 1 when this waypoint closes the path (`last_waypoint_data`). Go-to only.
        pub last: u16,
        /// By how much later than `issued_ns` it may have been issued, ns; 0 from a program on the robot, whose clock is the same.
        pub issued_within_ns: u32,
        /// By which clock it was issued: 0 for the robot's own; the relay gives each station a number of its own.
        pub origin: u32,
        /// 1 when this is sent again because the outcome is unknown: it is then never executed twice, not even by
        /// another bridge than the one that was asked first.
        pub repeat: u16,
        /// 1 when this may replace a path that is under way, which then ends as `replaced`; 0 refuses it as `busy`.
        /// In a path each waypoint needs it.
        pub preempt: u16,
        /// The sender renews the order at least this often, ms; not renewed in time, the bridge holds. 0 if it is not renewed.
        pub lease_ms: u32,
        /// What the bridge does when the process that ordered ends, a [`SenderLost`](crate::code::SenderLost); 0 takes the bridge's
        /// default.
        pub sender_lost: u32 => sender_lost: SenderLost,
        /// Always zero; keeps the size a multiple of eight.
        pub reserved: u32,
    }
}

shared_struct! {
    /// One answer in the response stream of a request.
    pub struct RequestReport("hero.RequestReport.v3") = 160 {
        /// The request's id.
        pub request_id: u64,
        /// The request's path, 0 when it has none.
        pub path_id: u64,
        /// When this was said, host monotonic ns.
        pub reported_ns: u64,
        /// A [`Stage`](crate::code::Stage).
        pub stage: u32 => stage: Stage,
        /// A [`Reason`](crate::code::Reason).
        pub reason: u32 => reason: Reason,
        /// IMI error code, 0 when there is none.
        pub imi_error: u32,
        /// Waypoints of the path so far.
        pub waypoints_total: u32,
        /// Waypoints sent to the DSP.
        pub waypoints_sent: u32,
        /// Waypoints that the helicopter was seen to reach, in order.
        pub waypoints_reached: u32,
        /// The safety rule that was broken, a [`SafetyRule`](crate::code::SafetyRule); 0 when none was.
        pub rule: u32 => rule: SafetyRule,
        /// The waypoint, or the leg that leads to it, that the reason is about, counted from 1; 0 when there is none.
        pub waypoint: u32,
        /// The DSP error that the reason is about, as the DSP sent it; means something when `dsp_error_valid` is 1.
        pub dsp_error_code: u32,
        /// 1 when `dsp_error_code` is given.
        pub dsp_error_valid: u16,
        /// 1 when `value` is given.
        pub value_valid: u16,
        /// Rule broken: by how much, in the rule's unit. Take-off done: the height that was reached over the point of
        /// take-off, m. Parameter read or written: the value that the port has.
        pub value: f64,
        /// The port that a parameter request is about. When an area of the geofence was broken: its name, and nothing else. All zero in
        /// other reports.
        pub port: PortInfo,
        /// Superseded: the id of the request that came between; 0 when no request did.
        pub between_request_id: u64,
        /// Superseded: who sent the request that came between; all zero when no request did.
        pub between_sender: ControlSender,
        /// Superseded: what came between, a [`CameBetween`](crate::code::CameBetween); 0 in other reports. When it is a safety rule,
        /// `rule` says which.
        pub between: u32 => between: CameBetween,
    }
}

shared_struct! {
    /// Reads, writes or lists the DSP's virtual ports (`docs/protocol.md` section 6). Service `parameters`.
    pub struct ParameterRequest("hero.ParameterRequest.v3") = 56 {
        /// Chosen by the sender, not 0, never used before by any sender; every report repeats it.
        pub request_id: u64,
        /// When the order was issued, the robot's monotonic clock: not later than it truly was. 0 lets the client's port write
        /// the moment of sending.
        pub issued_ns: u64,
        /// Until when it may begin, same clock; 0 takes the bridge's default.
        pub begin_by_ns: u64,
        /// The request that was the step before of the same command: this one is taken only if nothing came between the two. 0 if it
        /// follows no other.
        pub after: u64,
        /// Write: the value. A 16-bit port takes whole numbers only.
        pub value: f64,
        /// Read, write: number of the port. List: which port of the list, counted from 0.
        pub port: u32,
        /// A [`ParameterOperation`](crate::code::ParameterOperation).
        pub operation: u32 => operation: ParameterOperation,
        /// By how much later than `issued_ns` it may have been issued, ns; 0 from a program on the robot, whose clock is the same.
        pub issued_within_ns: u32,
        /// By which clock it was issued: 0 for the robot's own; the relay gives each station a number of its own.
        pub origin: u32,
    }
}

shared_struct! {
    /// A virtual port of the DSP.
    pub struct PortInfo("hero.PortInfo.v1") = 64 {
        /// Least value that may be written.
        pub min: f64,
        /// Greatest value that may be written.
        pub max: f64,
        /// Number of the port.
        pub number: u32,
        /// A [`PortKind`](crate::code::PortKind).
        pub kind: u32 => kind: PortKind,
        /// Bit 0: may be written by request; bit 1: also while the helicopter flies.
        pub access: u32,
        /// Ports of the list.
        pub count: u32,
        /// Name in ASCII with its unit, filled up with zeros.
        pub name: [u8; 32],
    }
}

impl ModuleControl {
    /// The request that asks for `command`, issued now, on this machine.
    pub fn new(request_id: u64, command: ControlCommand) -> ModuleControl {
        ModuleControl {
            request_id,
            issued_ns: MonotonicNs::now().0,
            command: command.code(),
            ..ModuleControl::default()
        }
    }
}

impl MovementData {
    /// The request to take off and climb to `altitude_m` over the point of take-off, issued now, as are the others.
    pub fn take_off(request_id: u64, altitude_m: f64) -> MovementData {
        MovementData {
            altitude_m,
            ..MovementData::of_kind(request_id, MovementKind::TakeOff)
        }
    }

    /// The request to land on the spot.
    pub fn land(request_id: u64) -> MovementData {
        MovementData::of_kind(request_id, MovementKind::Land)
    }

    /// The request to stop on the spot and stay started; it ends a path that is under way as `replaced`.
    pub fn hold(request_id: u64) -> MovementData {
        MovementData::of_kind(request_id, MovementKind::Hold)
    }

    /// Allows the request to replace a path that is under way.
    #[must_use]
    pub const fn preempting(self) -> MovementData {
        MovementData { preempt: 1, ..self }
    }

    /// Makes the request the next step of the command whose step before is the request `before`: it is taken only if
    /// nothing came between. Of a path each waypoint is made so, and the path's last waypoint is the step before of
    /// what follows it.
    #[must_use]
    pub const fn following(self, before: u64) -> MovementData {
        MovementData {
            after: before,
            ..self
        }
    }

    /// One waypoint of a path: `first` opens the path, `last` closes it.
    pub fn waypoint(
        request_id: u64,
        path_id: u64,
        position: WaypointPosition,
        first: bool,
        last: bool,
    ) -> MovementData {
        MovementData {
            path_id,
            latitude_deg: position.latitude_deg,
            longitude_deg: position.longitude_deg,
            altitude_m: position.altitude_m,
            first: first as u16,
            last: last as u16,
            ..MovementData::of_kind(request_id, MovementKind::GoToWaypoint)
        }
    }

    /// The requests of a whole path, in order, all issued now; `next_id` gives each its id.
    pub fn path(
        path_id: u64,
        positions: &[WaypointPosition],
        mut next_id: impl FnMut() -> u64,
    ) -> impl Iterator<Item = MovementData> {
        let issued_ns = MonotonicNs::now().0;
        positions.iter().enumerate().map(move |(index, position)| {
            let (first, last) = (index == 0, index + 1 == positions.len());
            MovementData {
                issued_ns,
                ..MovementData::waypoint(next_id(), path_id, *position, first, last)
            }
        })
    }

    fn of_kind(request_id: u64, kind: MovementKind) -> MovementData {
        MovementData {
            request_id,
            issued_ns: MonotonicNs::now().0,
            kind: kind.code(),
            ..MovementData::default()
        }
    }

    /// Whether this waypoint opens a path; `None` if the number is neither 0 nor 1.
    pub const fn is_first(&self) -> Option<bool> {
        flag(self.first)
    }

    /// Whether this waypoint closes the path; `None` if the number is neither 0 nor 1.
    pub const fn is_last(&self) -> Option<bool> {
        flag(self.last)
    }
}

impl ParameterRequest {
    /// The request to read a port, issued now, as are the others.
    pub fn read(request_id: u64, port: u16) -> ParameterRequest {
        ParameterRequest::of(request_id, ParameterOperation::Read, port as u32, 0.0)
    }

    /// The request to write a port.
    pub fn write(request_id: u64, port: u16, value: f64) -> ParameterRequest {
        ParameterRequest::of(request_id, ParameterOperation::Write, port as u32, value)
    }

    /// The request for the description of the port that stands at `index` of the list.
    pub fn list(request_id: u64, index: u32) -> ParameterRequest {
        ParameterRequest::of(request_id, ParameterOperation::List, index, 0.0)
    }

    fn of(
        request_id: u64,
        operation: ParameterOperation,
        port: u32,
        value: f64,
    ) -> ParameterRequest {
        ParameterRequest {
            request_id,
            issued_ns: MonotonicNs::now().0,
            value,
            port,
            operation: operation.code(),
            ..ParameterRequest::default()
        }
    }
}

impl PortInfo {
    /// Bit of `access`: a request may write the port.
    pub const WRITABLE: u32 = 1;
    /// Bit of `access`: a request may write the port while the helicopter flies.
    pub const WRITABLE_IN_FLIGHT: u32 = 2;

    /// The port's name; `None` if it is not text.
    pub fn name(&self) -> Option<&str> {
        ascii_text(&self.name)
    }

    /// A name as it lies in shared memory, cut to its length.
    pub fn name_bytes(name: &str) -> [u8; 32] {
        ascii_bytes(name)
    }
}

const fn flag(number: u16) -> Option<bool> {
    match number {
        0 => Some(false),
        1 => Some(true),
        _ => None,
    }
}

impl RequestReport {
    /// The area of the geofence that was broken; `None` if it was none.
    pub fn area(&self) -> Option<&str> {
        let is_area = self.rule != 0 && self.port.kind == 0;
        self.port.name().filter(|name| is_area && !name.is_empty())
    }

    /// The report that a request has come to `stage` because of `reason`; the server's port fills in the request's id
    /// and the time.
    pub fn new(stage: Stage, reason: Reason) -> RequestReport {
        RequestReport {
            stage: stage.code(),
            reason: reason.code(),
            ..RequestReport::default()
        }
    }

    /// The error that goes with it.
    pub const fn imi_error(&self) -> ImiCode {
        ImiCode(self.imi_error)
    }

    /// The DSP error that the reason is about, if it is about one.
    pub const fn dsp_error(&self) -> Option<u32> {
        given(self.dsp_error_valid != 0, self.dsp_error_code)
    }

    /// The value that the report gives, if it gives one.
    pub const fn value(&self) -> Option<f64> {
        given(self.value_valid != 0, self.value)
    }

    /// What came between the request and the step before, in words that end a sentence such as "before it came …";
    /// `None` if the report says nothing of it.
    pub fn in_between(&self) -> Option<String> {
        let what = self.between()?;
        let ControlSender {
            origin,
            session,
            process,
        } = self.between_sender;
        let sender = match (origin, process, session) {
            (0, 0, 0) => String::new(),
            (0, 0, session) => format!(" of session {session}"),
            (0, process, _) => format!(" of process {process}"),
            _ => format!(" of station {origin}"),
        };
        Some(match (what, self.rule()) {
            (CameBetween::SafetyRule, Some(rule)) => format!("the safety rule {rule}"),
            (CameBetween::SafetyRule, None) => "a safety rule".to_owned(),
            (CameBetween::Pilot, _) => "the pilot, who took over".to_owned(),
            (CameBetween::LinkLost, _) => "a loss of the link to the DSP".to_owned(),
            (CameBetween::DspRebooted, _) => "a reboot of the DSP".to_owned(),
            (CameBetween::BridgeBegan, _) => "a start of the bridge".to_owned(),
            (CameBetween::SenderLost, _) => "the loss of the sender of a path".to_owned(),
            (request, _) => format!("a {request}{sender}"),
        })
    }

    /// Whether no further report follows.
    pub fn is_final(&self) -> bool {
        self.stage().is_some_and(Stage::is_final)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_is_framed_by_first_and_last() {
        let position = WaypointPosition {
            latitude_deg: 37.4,
            longitude_deg: -5.9,
            altitude_m: 20.0,
        };
        let frames = |len: usize| -> Vec<(u64, u16, u16)> {
            let mut id = 0;
            let next = || {
                id += 1;
                id
            };
            MovementData::path(9, &vec![position; len], next)
                .map(|request| (request.request_id, request.first, request.last))
                .collect()
        };
        assert_eq!(frames(0), []);
        assert_eq!(frames(1), [(1, 1, 1)]);
        assert_eq!(frames(3), [(1, 1, 0), (2, 0, 0), (3, 0, 1)]);
    }

    #[test]
    fn unknown_numbers_come_back_as_nothing() {
        let report = RequestReport {
            stage: 99,
            reason: 99,
            ..RequestReport::default()
        };
        assert_eq!((report.stage(), report.reason()), (None, None));
        assert!(!report.is_final());
        let movement = MovementData {
            first: 2,
            ..MovementData::land(1)
        };
        assert_eq!(movement.is_first(), None);
        assert_eq!(movement.kind(), Some(MovementKind::Land));
    }
}
