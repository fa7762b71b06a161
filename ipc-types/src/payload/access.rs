//! Typed access to the payloads: constructors for senders, enums instead of numbers for readers.
//!
//! Any bit pattern may lie in shared memory, therefore every number comes back as an `Option`.

use super::dsp_telemetry::DspTelemetry;
use super::hero_telemetry::HeroTelemetry;
use super::module_state::{
    DspErrorCounters, LinkHealth, ModuleState, MovementState, RefusedCounters, SafetyState,
};
use super::request::{ModuleControl, MovementData, ParameterRequest, PortInfo, RequestReport};
use crate::code::{
    ControlCommand, DspPathState, Functionality, ImiCode, LinkState, ModuleId, ModuleStatus,
    MovementKind, ParameterOperation, PilotSwitch, PortKind, Reason, SafetyAction, SafetyRule,
    Stage,
};
use crate::group::TelemetryGroup;
use crate::time::MonotonicNs;

impl DspTelemetry {
    /// Whether the values of `group` mean something.
    pub const fn valid(&self, group: TelemetryGroup) -> bool {
        self.valid_groups & group.bit() != 0
    }

    /// Whether the helicopter is in the air.
    pub const fn is_flying(&self) -> bool {
        self.flying != 0
    }

    /// When the message was read.
    pub const fn received(&self) -> MonotonicNs {
        MonotonicNs(self.received_ns)
    }

    /// Code of the last DSP error, or nothing when there was none.
    pub const fn last_dsp_error(&self) -> Option<u32> {
        given(self.dsp_errors, self.last_dsp_error_code)
    }
}

impl HeroTelemetry {
    /// Whether the values of `group` mean something.
    pub const fn valid(&self, group: TelemetryGroup) -> bool {
        self.valid_groups & group.bit() as u32 != 0
    }

    /// Whether the helicopter is in the air.
    pub const fn is_flying(&self) -> bool {
        self.flying != 0
    }

    /// When the bridge read the message that this was made of.
    pub const fn received(&self) -> MonotonicNs {
        MonotonicNs(self.received_ns)
    }

    /// Code of the last DSP error, or nothing when there was none.
    pub const fn last_dsp_error(&self) -> Option<u32> {
        given(self.dsp_errors, self.last_dsp_error_code)
    }
}

impl DspErrorCounters {
    /// Code of the last DSP error, or nothing when there was none.
    pub const fn last(&self) -> Option<u32> {
        given(self.total, self.last_code)
    }
}

/// A number that means something when another one is not zero.
const fn given(valid: u32, number: u32) -> Option<u32> {
    if valid == 0 { None } else { Some(number) }
}

impl ModuleState {
    /// Whose state it is.
    pub const fn module(&self) -> Option<ModuleId> {
        ModuleId::from_code(self.module_id)
    }

    /// State of the module.
    pub const fn status(&self) -> Option<ModuleStatus> {
        ModuleStatus::from_code(self.status)
    }

    /// The error that goes with it.
    pub const fn imi_error(&self) -> ImiCode {
        ImiCode(self.imi_error)
    }

    /// Whether no movement is taken until the next start.
    pub const fn is_blocked(&self) -> bool {
        self.blocked != 0
    }

    /// What the functionality is doing.
    pub const fn functionality(&self) -> Option<Functionality> {
        Functionality::from_code(self.functionality)
    }

    /// Whether the movement under way cannot be aborted.
    pub const fn is_unable_to_abort(&self) -> bool {
        self.unable_to_abort != 0
    }

    /// When it was published.
    pub const fn published(&self) -> MonotonicNs {
        MonotonicNs(self.published_ns)
    }

    /// Whether all that is published of this robot is a recorded flight that is played.
    pub const fn is_replayed(&self) -> bool {
        self.safety.reserved != 0
    }
}

impl MovementState {
    /// Kind of the movement, nothing before the first.
    pub const fn kind(&self) -> Option<MovementKind> {
        MovementKind::from_code(self.kind)
    }

    /// Horizontal distance to the last waypoint, m, if it is known.
    pub const fn distance_to_go(&self) -> Option<f32> {
        if self.distance_valid == 0 {
            None
        } else {
            Some(self.distance_to_go_m)
        }
    }
}

impl ModuleState {
    /// Telemetry altitude of the ground on which the helicopter stood last, m, if it is known.
    pub const fn ground_altitude(&self) -> Option<f64> {
        if self.ground_valid == 0 {
            None
        } else {
            Some(self.ground_altitude_m)
        }
    }
}

impl LinkHealth {
    /// State of the line.
    pub const fn state(&self) -> Option<LinkState> {
        LinkState::from_code(self.state)
    }

    /// What the DSP's path buffer may hold.
    pub const fn dsp_path(&self) -> Option<DspPathState> {
        DspPathState::from_code(self.dsp_path)
    }

    /// When the last valid message came, nothing before the first.
    pub const fn last_message(&self) -> Option<MonotonicNs> {
        if self.messages_received == 0 {
            None
        } else {
            Some(MonotonicNs(self.last_message_ns))
        }
    }
}

impl RefusedCounters {
    /// Pieces of the line that were no message, and messages that were missed.
    pub fn pieces(&self) -> u64 {
        [
            self.stray,
            self.unknown_header,
            self.truncated,
            self.checksum,
            self.padding,
            self.value,
            self.other_profile,
            self.missed_messages,
        ]
        .into_iter()
        .map(u64::from)
        .sum()
    }
}

impl SafetyState {
    /// The most severe rule that is violated, nothing when none is.
    pub const fn rule(&self) -> Option<SafetyRule> {
        SafetyRule::from_code(self.rule)
    }

    /// What the bridge does about it.
    pub const fn action(&self) -> Option<SafetyAction> {
        SafetyAction::from_code(self.action)
    }

    /// The pilot's switch.
    pub const fn pilot_switch(&self) -> Option<PilotSwitch> {
        PilotSwitch::from_code(self.pilot_switch)
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

    /// What it asks for.
    pub const fn command(&self) -> Option<ControlCommand> {
        ControlCommand::from_code(self.command)
    }
}

/// A place to fly to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WaypointPosition {
    /// Latitude, degrees, north positive.
    pub latitude_deg: f64,
    /// Longitude, degrees, east positive.
    pub longitude_deg: f64,
    /// Altitude, m, same zero as telemetry.
    pub altitude_m: f64,
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

    /// The same request, allowed to replace a path that is under way.
    #[must_use]
    pub const fn preempting(self) -> MovementData {
        MovementData { preempt: 1, ..self }
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

    /// What it asks for.
    pub const fn kind(&self) -> Option<MovementKind> {
        MovementKind::from_code(self.kind)
    }

    /// Whether this waypoint opens a path; nothing when the number is neither 0 nor 1.
    pub const fn is_first(&self) -> Option<bool> {
        flag(self.first)
    }

    /// Whether this waypoint closes the path; nothing when the number is neither 0 nor 1.
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

    /// What it asks for.
    pub const fn operation(&self) -> Option<ParameterOperation> {
        ParameterOperation::from_code(self.operation)
    }
}

impl PortInfo {
    /// Bit of `access`: a request may write the port.
    pub const WRITABLE: u32 = 1;
    /// Bit of `access`: a request may write the port while the helicopter flies.
    pub const WRITABLE_IN_FLIGHT: u32 = 2;

    /// How the port's value is coded on the wire; nothing when this describes no port.
    pub const fn kind(&self) -> Option<PortKind> {
        PortKind::from_code(self.kind)
    }

    /// The port's name; nothing when it is not text.
    pub fn name(&self) -> Option<&str> {
        let text = self
            .name
            .split(|byte| *byte == 0)
            .next()
            .unwrap_or_default();
        std::str::from_utf8(text).ok()
    }

    /// A name as it lies in shared memory, cut to its length.
    pub fn name_bytes(name: &str) -> [u8; 32] {
        let mut bytes = [0; 32];
        for (place, byte) in bytes.iter_mut().zip(name.bytes()) {
            *place = byte;
        }
        bytes
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
    /// The report that a request has come to `stage` because of `reason`; the server's port fills in the request's id
    /// and the time.
    pub fn new(stage: Stage, reason: Reason) -> RequestReport {
        RequestReport {
            stage: stage.code(),
            reason: reason.code(),
            ..RequestReport::default()
        }
    }

    /// How far the request has come.
    pub const fn stage(&self) -> Option<Stage> {
        Stage::from_code(self.stage)
    }

    /// Why.
    pub const fn reason(&self) -> Option<Reason> {
        Reason::from_code(self.reason)
    }

    /// The error that goes with it.
    pub const fn imi_error(&self) -> ImiCode {
        ImiCode(self.imi_error)
    }

    /// The safety rule that was broken, if one was.
    pub const fn rule(&self) -> Option<SafetyRule> {
        SafetyRule::from_code(self.rule)
    }

    /// The DSP error that the reason is about, if it is about one.
    pub const fn dsp_error(&self) -> Option<u32> {
        given(self.dsp_error_valid as u32, self.dsp_error_code)
    }

    /// The value that the report gives, if it gives one.
    pub const fn value(&self) -> Option<f64> {
        if self.value_valid == 0 {
            None
        } else {
            Some(self.value)
        }
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
    fn validity_is_the_group_s_bit() {
        let dsp = DspTelemetry {
            valid_groups: 0b10,
            ..DspTelemetry::default()
        };
        let hero = HeroTelemetry {
            valid_groups: 0b10,
            ..HeroTelemetry::default()
        };
        for group in TelemetryGroup::ALL {
            let is_valid = group == TelemetryGroup::Geographic;
            assert_eq!((dsp.valid(group), hero.valid(group)), (is_valid, is_valid));
        }
    }

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

    #[test]
    fn what_has_not_happened_is_nothing() {
        assert_eq!(DspTelemetry::default().last_dsp_error(), None);
        assert_eq!(LinkHealth::default().last_message(), None);
        assert_eq!(MovementState::default().kind(), None);
        assert_eq!(MovementState::default().distance_to_go(), None);
    }
}
