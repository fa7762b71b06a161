//! What the bridge's state says, part by part, with names for codes and ages for times.

use dsp_protocol::DspErrorCode;
use ipc_types::code::{Functionality, LinkState, ModuleId, ModuleStatus};
use ipc_types::payload::{
    DspErrorCounters, LinkHealth, ModuleState, MovementState, RefusedCounters, SafetyState,
};
use ipc_types::{MonotonicNs, TelemetryGroup};
use serde::Serialize;

use super::super::sample_age::{Sample, age_ms, named};
use crate::messages::details;

#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Module {
    pub(super) id: String,
    pub(super) status: String,
    pub(super) functionality: String,
    pub(super) blocked: bool,
    pub(super) unable_to_abort: bool,
    pub(super) error: String,
    pub(super) sample: Sample,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Movement {
    pub(super) kind: String,
    pub(super) request_id: u64,
    pub(super) path_id: u64,
    pub(super) waypoints_total: u32,
    pub(super) waypoints_sent: u32,
    pub(super) waypoints_reached: u32,
    pub(super) distance_to_go_m: Option<f32>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Link {
    pub(super) state: String,
    pub(super) state_since_ms: Option<u64>,
    pub(super) port_openings: u32,
    pub(super) dsp_boots: u32,
    pub(super) last_message_age_ms: Option<u64>,
    pub(super) last_telemetry_age_ms: Option<u64>,
    pub(super) bytes_received: u64,
    pub(super) messages_received: u64,
    pub(super) telemetry_published: u32,
    pub(super) telemetry_incoherent: u32,
    pub(super) commands_acknowledged: u32,
    pub(super) commands_repeated: u32,
    pub(super) commands_failed: u32,
    pub(super) acks_unmatched: u32,
    pub(super) waypoints_sent: u32,
    pub(super) waypoints_repeated: u32,
    pub(super) delivery_verified: bool,
    pub(super) dsp_path: String,
    /// Nothing before the DSP has answered the start-up sequence: it has not been asked.
    pub(super) pc_timeout_supported: Option<bool>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Safety {
    /// Nothing when no rule is violated.
    pub(super) violation: Option<Violation>,
    pub(super) pilot_switch: String,
    pub(super) fence_areas: u32,
    pub(super) interventions: u32,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Violation {
    pub(super) rule: String,
    pub(super) amount: Option<f64>,
    /// Unit of `amount`; nothing for a rule that has none.
    pub(super) unit: Option<&'static str>,
    pub(super) action: String,
    /// The amount as people read it.
    #[serde(skip)]
    pub(super) by: Option<String>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Refused {
    pub(super) stray: u32,
    pub(super) unknown_header: u32,
    pub(super) truncated: u32,
    pub(super) checksum: u32,
    pub(super) padding: u32,
    pub(super) value: u32,
    pub(super) implausible_groups: u32,
    pub(super) implausible: Vec<&'static str>,
    pub(super) requests: u32,
    pub(super) transmit_overflows: u32,
    pub(super) other_profile: u32,
    pub(super) missed_messages: u32,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct DspErrors {
    pub(super) total: u32,
    pub(super) escalated: u32,
    pub(super) unknown: u32,
    pub(super) last: Option<String>,
    pub(super) last_code: Option<u32>,
    pub(super) by_code: Vec<DspErrorCount>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct DspErrorCount {
    pub(super) code: u16,
    pub(super) text: &'static str,
    pub(super) count: u32,
}

impl Module {
    pub(super) fn new(state: &ModuleState, now: MonotonicNs) -> Module {
        Module {
            id: named(ModuleId::from_code(state.module_id), state.module_id),
            status: named(ModuleStatus::from_code(state.status), state.status),
            functionality: named(
                Functionality::from_code(state.functionality),
                state.functionality,
            ),
            blocked: state.is_blocked(),
            unable_to_abort: state.is_unable_to_abort(),
            error: state.imi_error().to_string(),
            sample: Sample::new(state.sequence, state.published(), now),
        }
    }
}

impl Movement {
    pub(super) fn new(movement: &MovementState) -> Movement {
        Movement {
            kind: named(movement.kind(), movement.kind),
            request_id: movement.request_id,
            path_id: movement.path_id,
            waypoints_total: movement.waypoints_total,
            waypoints_sent: movement.waypoints_sent,
            waypoints_reached: movement.waypoints_reached,
            distance_to_go_m: movement.distance_to_go().filter(|m| m.is_finite()),
        }
    }
}

impl Link {
    /// Whether messages of the DSP come.
    pub(super) fn is_up(&self) -> bool {
        self.state == LinkState::Up.name()
    }

    pub(super) fn new(link: &LinkHealth, now: MonotonicNs) -> Link {
        // Without `..`: a field that is added must be shown.
        let LinkHealth {
            last_message_ns: _,
            last_telemetry_ns,
            state_since_ns,
            bytes_received,
            messages_received,
            state,
            port_openings,
            dsp_boots,
            commands_acknowledged,
            commands_repeated,
            commands_failed,
            acks_unmatched,
            waypoints_sent,
            waypoints_repeated,
            delivery_verified,
            telemetry_published,
            telemetry_incoherent,
            dsp_path,
            pc_timeout_supported,
        } = *link;
        let since = (state_since_ns > 0).then_some(MonotonicNs(state_since_ns));
        let is_asked = matches!(link.state(), Some(LinkState::Up | LinkState::Silent));
        let last_telemetry = (telemetry_published > 0).then_some(MonotonicNs(last_telemetry_ns));
        Link {
            state: named(LinkState::from_code(state), state),
            // 0 stands for "never": it is no time of the host.
            state_since_ms: since.and_then(|time| age_ms(time, now)),
            port_openings,
            dsp_boots,
            last_message_age_ms: link.last_message().and_then(|time| age_ms(time, now)),
            last_telemetry_age_ms: last_telemetry.and_then(|time| age_ms(time, now)),
            bytes_received,
            messages_received,
            telemetry_published,
            telemetry_incoherent,
            commands_acknowledged,
            commands_repeated,
            commands_failed,
            acks_unmatched,
            waypoints_sent,
            waypoints_repeated,
            delivery_verified: delivery_verified == 1,
            dsp_path: named(link.dsp_path(), dsp_path),
            pc_timeout_supported: (is_asked || pc_timeout_supported == 1)
                .then_some(pc_timeout_supported == 1),
        }
    }
}

impl Refused {
    pub(super) fn new(counters: &RefusedCounters) -> Refused {
        let RefusedCounters {
            stray,
            unknown_header,
            truncated,
            checksum,
            padding,
            value,
            implausible_groups,
            implausible_mask,
            requests,
            transmit_overflows,
            other_profile,
            missed_messages,
        } = *counters;
        // The mask has sixteen bits; others would be of a later layout.
        let mask = (implausible_mask & u32::from(u16::MAX)) as u16;
        Refused {
            stray,
            unknown_header,
            truncated,
            checksum,
            padding,
            value,
            implausible_groups,
            implausible: TelemetryGroup::in_mask(mask)
                .map(TelemetryGroup::name)
                .collect(),
            requests,
            transmit_overflows,
            other_profile,
            missed_messages,
        }
    }

    /// The counters by name.
    pub(super) fn counters(&self) -> [(&'static str, u32); 11] {
        [
            ("stray", self.stray),
            ("unknown header", self.unknown_header),
            ("truncated", self.truncated),
            ("checksum", self.checksum),
            ("padding", self.padding),
            ("value", self.value),
            ("implausible groups", self.implausible_groups),
            ("requests", self.requests),
            ("transmit overflows", self.transmit_overflows),
            ("other profile", self.other_profile),
            ("missed messages", self.missed_messages),
        ]
    }
}

impl DspErrors {
    pub(super) fn new(counters: &DspErrorCounters) -> DspErrors {
        let counts = DspErrorCode::KNOWN.into_iter().zip(counters.known);
        let by_code = counts
            .filter(|(_, count)| *count > 0)
            .map(|(code, count)| DspErrorCount {
                code: code.0,
                text: code.text(),
                count,
            })
            .collect();
        DspErrors {
            total: counters.total,
            escalated: counters.escalated,
            unknown: counters.unknown,
            last: counters.last().map(details::dsp_error),
            last_code: counters.last(),
            by_code,
        }
    }
}

impl Safety {
    pub(super) fn new(safety: &SafetyState) -> Safety {
        // Without `..`: a field that is added must be shown.
        let SafetyState {
            amount,
            rule,
            action,
            pilot_switch,
            fence_areas,
            interventions,
            reserved: _,
        } = *safety;
        let known = safety.rule();
        let violation = (rule != 0).then(|| Violation {
            rule: named(known, rule),
            amount: known
                .and_then(details::unit)
                .and(Some(amount))
                .filter(|amount| amount.is_finite()),
            unit: known.and_then(details::unit),
            action: named(safety.action(), action),
            by: known.and_then(|rule| details::amount(rule, amount)),
        });
        Safety {
            violation,
            pilot_switch: named(safety.pilot_switch(), pilot_switch),
            fence_areas,
            interventions,
        }
    }
}
