//! [`ModuleState`]: how the bridge, its movement, its line and the DSP are (`ModuleState`).

use super::number::given;
use super::position::WaypointPosition;
use crate::code::{
    DspPathState, Functionality, ImiCode, LinkState, ModuleId, ModuleStatus, MovementKind,
    PilotSwitch, Reason, SafetyAction, SafetyRule, Stage,
};
use crate::time::MonotonicNs;

shared_struct! {
    /// State of a module. Service `module_state`, written by the bridge at every change and at least once a second.
    ///
    /// Times are host monotonic nanoseconds; 0 stands for "never", which the counter beside it says as well.
    pub struct ModuleState("hero.ModuleState.v7") = 528 {
        /// Counts the samples of this publisher from 1.
        pub sequence: u64,
        /// When the publishing process began.
        pub epoch_ns: u64,
        /// When this was published.
        pub published_ns: u64,
        /// A [`ModuleId`](crate::code::ModuleId).
        pub module_id: u32 => module: ModuleId,
        /// A [`ModuleStatus`](crate::code::ModuleStatus).
        pub status: u32 => status: ModuleStatus,
        /// IMI error code: general 0–99, UAV 100–200, DSP 201–500.
        pub imi_error: u32,
        /// 1 when no movement is taken until the next start.
        pub blocked: u32,
        /// A [`Functionality`](crate::code::Functionality).
        pub functionality: u32 => functionality: Functionality,
        /// 1 when the movement under way cannot be aborted (`unable2abort`).
        pub unable_to_abort: u32,
        /// The movement under way, or the last one; all zero before the first.
        pub movement: MovementState,
        /// How the movement that ended last did so; all zero before the first end.
        pub last_end: MovementEnd,
        /// The line to the DSP.
        pub link: LinkHealth,
        /// What was discarded and why.
        pub refused: RefusedCounters,
        /// DSP errors by code.
        pub dsp_errors: DspErrorCounters,
        /// The rules of flight safety that the bridge enforces.
        pub safety: SafetyState,
        /// Home: where the helicopter stands, and in the air where it took off. Latitude, degrees; meaningful when `ground_valid` is 1.
        pub home_latitude_deg: f64,
        /// Longitude of home, degrees; meaningful when `ground_valid` is 1.
        pub home_longitude_deg: f64,
        /// Telemetry altitude of home, m: of the ground on which the helicopter stood last. Meaningful when `ground_valid` is 1.
        pub ground_altitude_m: f64,
        /// Number of the outline that holds: `number` of the pieces of the topic `bridge/outline`. To be compared for equality only.
        pub outline: u64,
        /// Who commands.
        pub control: ControlState,
        /// 1 when the bridge has seen the helicopter on the ground.
        pub ground_valid: u32,
        /// How the line was of late.
        pub last_minute: LastMinute,
    }
}

shared_struct! {
    /// Who commands the bridge (`docs/safety.md`, *Control*).
    pub struct ControlState("hero.ControlState.v1") = 56 {
        /// Since when the holder has control; means something when `held` is 1.
        pub since_ns: u64,
        /// When the holder's last movement was taken, 0 when none was.
        pub last_order_ns: u64,
        /// Who has control; means something when `held` is 1.
        pub holder: ControlSender,
        /// Who asks the holder for it; means something when `asked` is 1.
        pub asker: ControlSender,
        /// 1 when a sender has control.
        pub held: u32,
        /// 1 when another sender asks for it.
        pub asked: u32,
        /// 1 when movements and writes of other senders are refused (`[control] exclusive` of bridge.toml).
        pub exclusive: u32,
        /// Always zero; keeps the size a multiple of eight.
        pub reserved: u32,
    }
}

shared_struct! {
    /// A sender of requests: a station, or a session of processes on the robot's machine.
    pub struct ControlSender("hero.ControlSender.v1") = 12 {
        /// The station's number, as in `RelayStation`; 0 on the robot's machine.
        pub origin: u32,
        /// Number of the session, that of its first process; 0 when it is not known.
        pub session: u32,
        /// The process that sent last; 0 when it is not known.
        pub process: u32,
    }
}

shared_struct! {
    /// Figures of the line to the DSP over the last 60 to 70 seconds, or since the bridge began.
    pub struct LastMinute("hero.LastMinute.v1") = 20 {
        /// Seconds that these figures are of.
        pub duration_s: u32,
        /// Valid messages received.
        pub messages: u32,
        /// Pieces and messages rejected or missed, without the two that each opening of the port and each boot of the DSP may cut.
        pub rejected: u32,
        /// Commands sent again after a timeout.
        pub commands_repeated: u32,
        /// Commands given up after the last attempt.
        pub commands_failed: u32,
    }
}

shared_struct! {
    /// Progress of a movement.
    pub struct MovementState("hero.MovementState.v1") = 40 {
        /// Request that began or closed it.
        pub request_id: u64,
        /// Its path, 0 for take-off and landing.
        pub path_id: u64,
        /// A [`MovementKind`](crate::code::MovementKind), 0 before the first movement.
        pub kind: u32 => kind: MovementKind,
        /// Waypoints of the path.
        pub waypoints_total: u32,
        /// Waypoints sent to the DSP.
        pub waypoints_sent: u32,
        /// Waypoints that the helicopter was seen to reach, in order.
        pub waypoints_reached: u32,
        /// Horizontal distance to the last waypoint, m; meaningful when `distance_valid` is 1.
        pub distance_to_go_m: f32,
        /// 1 when `distance_to_go_m` is known.
        pub distance_valid: u32,
    }
}

shared_struct! {
    /// How a movement ended: what its final report says, for those who did not order it.
    pub struct MovementEnd("hero.MovementEnd.v1") = 32 {
        /// When it ended, 0 when no movement has ended.
        pub ended_ns: u64,
        /// Request that began or closed it; 0 when a safety rule ordered it.
        pub request_id: u64,
        /// A [`MovementKind`](crate::code::MovementKind), 0 when no movement has ended.
        pub kind: u32 => kind: MovementKind,
        /// A [`Stage`](crate::code::Stage): done, aborted or unknown.
        pub stage: u32 => stage: Stage,
        /// A [`Reason`](crate::code::Reason).
        pub reason: u32 => reason: Reason,
        /// Waypoints that the helicopter was seen to reach.
        pub waypoints_reached: u32,
    }
}

shared_struct! {
    /// The line to the DSP.
    pub struct LinkHealth("hero.LinkHealth.v2") = 96 {
        /// When the last valid message came.
        pub last_message_ns: u64,
        /// When the last status message was published.
        pub last_telemetry_ns: u64,
        /// Since when `state` holds.
        pub state_since_ns: u64,
        /// Bytes received.
        pub bytes_received: u64,
        /// Valid messages received.
        pub messages_received: u64,
        /// A [`LinkState`](crate::code::LinkState).
        pub state: u32 => state: LinkState,
        /// How often the port was opened.
        pub port_openings: u32,
        /// How often the DSP was seen to boot.
        pub dsp_boots: u32,
        /// Commands acknowledged.
        pub commands_acknowledged: u32,
        /// Commands sent again after a timeout.
        pub commands_repeated: u32,
        /// Commands given up after the last attempt.
        pub commands_failed: u32,
        /// Acknowledgements that matched no outstanding command.
        pub acks_unmatched: u32,
        /// Waypoints sent.
        pub waypoints_sent: u32,
        /// Waypoints sent again because the DSP had not taken them.
        pub waypoints_repeated: u32,
        /// 1 when the DSP counts the waypoints that it takes, 0 when it does not or has not been asked yet.
        pub delivery_verified: u32,
        /// Telemetry samples published.
        pub telemetry_published: u32,
        /// Status samples that coherence in time dropped.
        pub telemetry_incoherent: u32,
        /// What the DSP's path buffer may hold, a [`DspPathState`](crate::code::DspPathState).
        pub dsp_path: u32 => dsp_path: DspPathState,
        /// 1 when the DSP stops by itself when the bridge is gone (`pc_timeout_ms`), 0 when it does not or was not asked yet.
        pub pc_timeout_supported: u32,
    }
}

shared_struct! {
    /// Bytes and values that were discarded, by reason.
    pub struct RefusedCounters("hero.RefusedCounters.v1") = 48 {
        /// Runs of bytes without a header.
        pub stray: u32,
        /// Unknown headers.
        pub unknown_header: u32,
        /// Messages cut short by the next header.
        pub truncated: u32,
        /// Wrong checksums.
        pub checksum: u32,
        /// Unused bits that were not zero.
        pub padding: u32,
        /// Impossible field values.
        pub value: u32,
        /// Groups whose validity was withdrawn because a value was implausible.
        pub implausible_groups: u32,
        /// The groups withdrawn so far, as bits of the status mask.
        pub implausible_mask: u32,
        /// Requests refused.
        pub requests: u32,
        /// Bytes for the DSP that the line did not take in time.
        pub transmit_overflows: u32,
        /// Headers of the other profile: both ends must be configured alike.
        pub other_profile: u32,
        /// Messages of the DSP that were missed, by its sequence numbers; extended profile only.
        pub missed_messages: u32,
    }
}

/// Number of documented DSP error codes; `docs/protocol.md` section 7 lists them in the order of the counters.
pub const KNOWN_DSP_ERRORS: usize = 26;

shared_struct! {
    /// DSP errors received since the bridge began.
    pub struct DspErrorCounters("hero.DspErrorCounters.v2") = 120 {
        /// All errors.
        pub total: u32,
        /// Errors with a code that the documentation does not have.
        pub unknown: u32,
        /// Code of the last error as the DSP sent it, 0 … 65535; means something when `total` is not 0.
        pub last_code: u32,
        /// Errors that ended the functionality.
        pub escalated: u32,
        /// By documented code, ascending: 1 … 15, 18, 20, 21, 22, 30, 40, 45, 46, 100, 102, 300.
        pub known: [u32; KNOWN_DSP_ERRORS],
    }
}

shared_struct! {
    /// The safety rules of the bridge as they stand now.
    pub struct SafetyState("hero.SafetyState.v1") = 32 {
        /// By how much the limit of `rule` is exceeded, in the unit of the rule
        /// ([`SafetyRule`](crate::code::SafetyRule)); means something when `rule` is not 0.
        pub amount: f64,
        /// The most severe rule that is violated now, a [`SafetyRule`](crate::code::SafetyRule); 0 when none is.
        pub rule: u32 => rule: SafetyRule,
        /// What the bridge does about it, a [`SafetyAction`](crate::code::SafetyAction); 0 when no rule is violated.
        pub action: u32 => action: SafetyAction,
        /// The pilot's switch, a [`PilotSwitch`](crate::code::PilotSwitch).
        pub pilot_switch: u32 => pilot_switch: PilotSwitch,
        /// Areas of the geofence in force.
        pub fence_areas: u32,
        /// Movements refused or ended by a safety rule since `epoch_ns`.
        pub interventions: u32,
        /// 1 when all that is published of this robot is a recorded flight that `ril replay` plays; zero from a bridge. It was
        /// spare before, so its name and the layout stay.
        pub reserved: u32,
    }
}

impl ModuleState {
    /// The error that goes with it.
    pub const fn imi_error(&self) -> ImiCode {
        ImiCode(self.imi_error)
    }

    /// Whether no movement is taken until the next start.
    pub const fn is_blocked(&self) -> bool {
        self.blocked != 0
    }

    /// Whether the movement under way cannot be aborted.
    pub const fn is_unable_to_abort(&self) -> bool {
        self.unable_to_abort != 0
    }

    /// When it was published.
    pub const fn published(&self) -> MonotonicNs {
        MonotonicNs(self.published_ns)
    }

    /// Telemetry altitude of the ground on which the helicopter stood last, m, if it is known.
    pub const fn ground_altitude(&self) -> Option<f64> {
        given(self.ground_valid != 0, self.ground_altitude_m)
    }

    /// Where the helicopter stands, and in the air where it took off, if it is known.
    pub const fn home(&self) -> Option<WaypointPosition> {
        let home = WaypointPosition {
            latitude_deg: self.home_latitude_deg,
            longitude_deg: self.home_longitude_deg,
            altitude_m: self.ground_altitude_m,
        };
        given(self.ground_valid != 0, home)
    }

    /// Who has control; `None` if control is free.
    pub const fn holder(&self) -> Option<ControlSender> {
        given(self.control.held != 0, self.control.holder)
    }

    /// Who asks the holder for control; `None` if no sender does.
    pub const fn asker(&self) -> Option<ControlSender> {
        given(self.control.asked != 0, self.control.asker)
    }

    /// Whether all that is published of this robot is a recorded flight that is played.
    pub const fn is_replayed(&self) -> bool {
        self.safety.reserved != 0
    }
}

impl MovementState {
    /// Horizontal distance to the last waypoint, m, if it is known.
    pub const fn distance_to_go(&self) -> Option<f32> {
        given(self.distance_valid != 0, self.distance_to_go_m)
    }
}

impl MovementEnd {
    /// When it ended, `None` when no movement has ended.
    pub const fn ended(&self) -> Option<MonotonicNs> {
        given(self.ended_ns != 0, MonotonicNs(self.ended_ns))
    }

    /// Whether this is another end than `before`, the last one that a consumer has seen. Moments of a relayed state
    /// move a little with each estimate of the other machine's clock, and so tell no two ends of a request apart: each
    /// request ends once. Those that safety rules ordered, which have no number, are at least a second apart.
    pub fn is_another_than(&self, before: &MovementEnd) -> bool {
        let what = |end: &MovementEnd| (end.request_id, end.kind, end.stage, end.reason);
        let is_later = self.ended_ns.abs_diff(before.ended_ns) >= 1_000_000_000;
        what(self) != what(before) || self.request_id == 0 && is_later
    }

    /// Why it ended early; `None` when it was done, or no movement has ended.
    pub fn early(&self) -> Option<Reason> {
        let is_early = matches!(self.stage(), Some(Stage::Aborted | Stage::Unknown));
        self.reason().filter(|_| is_early)
    }
}

impl LinkHealth {
    /// When the last valid message came, `None` before the first.
    pub const fn last_message(&self) -> Option<MonotonicNs> {
        given(
            self.messages_received != 0,
            MonotonicNs(self.last_message_ns),
        )
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

impl DspErrorCounters {
    /// Code of the last DSP error, or `None` if there was none.
    pub const fn last(&self) -> Option<u32> {
        given(self.total != 0, self.last_code)
    }
}

#[cfg(test)]
mod tests {
    use super::super::DspTelemetry;
    use super::*;

    #[test]
    fn what_has_not_happened_is_nothing() {
        assert_eq!(DspTelemetry::default().last_dsp_error(), None);
        assert_eq!(LinkHealth::default().last_message(), None);
        assert_eq!(MovementState::default().kind(), None);
        assert_eq!(MovementState::default().distance_to_go(), None);
    }
}
