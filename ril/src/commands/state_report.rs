//! What `ril status` shows, as a value made of samples and the time: as text for people, as JSON for programs.
//!
//! It reads no clock and no port. What never happened is nothing, and what is too old is marked stale. The text is in
//! `text`.

#[cfg(test)]
mod tests;
mod text;

use dsp_protocol::DspErrorCode;
use ipc_types::code::{Functionality, LinkState, ModuleId, ModuleStatus};
use ipc_types::module::State;
use ipc_types::payload::{
    DspErrorCounters, LinkHealth, ModuleState, MovementState, RefusedCounters, SafetyState,
};
use ipc_types::{MonotonicNs, TelemetryGroup};
use serde::Serialize;

use super::relay_report::LinkReport;
use super::sample_age::{Sample, age_ms, named};
use crate::messages::details;

/// Name of the JSON object's layout.
pub const SCHEMA: &str = "ril.State.v3";

/// Everything that `ril status` shows.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StateReport {
    schema: &'static str,
    robot: u32,
    module: Module,
    movement: Option<Movement>,
    link: Link,
    refused: Refused,
    dsp_errors: DspErrors,
    safety: Safety,
    /// Raw telemetry; nothing when none was received.
    dsp: Option<Sample>,
    /// Telemetry in SI units; nothing when none was received.
    hero: Option<Sample>,
    /// The state of the module status; nothing when none was received.
    status: Option<StatusState>,
    /// Whether all of this comes from another machine.
    relayed: bool,
    /// The link to that machine; nothing when the robot is on this one, and when the relay said nothing.
    relay: Option<LinkReport>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct Module {
    id: String,
    status: String,
    functionality: String,
    blocked: bool,
    unable_to_abort: bool,
    error: String,
    sample: Sample,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct StatusState {
    id: String,
    status: String,
    doing: String,
    blocked: bool,
    error: String,
    sample: Sample,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct Movement {
    kind: String,
    request_id: u64,
    path_id: u64,
    waypoints_total: u32,
    waypoints_sent: u32,
    waypoints_reached: u32,
    distance_to_go_m: Option<f32>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct Link {
    state: String,
    state_since_ms: Option<u64>,
    port_openings: u32,
    dsp_boots: u32,
    last_message_age_ms: Option<u64>,
    last_telemetry_age_ms: Option<u64>,
    bytes_received: u64,
    messages_received: u64,
    telemetry_published: u32,
    telemetry_incoherent: u32,
    commands_acknowledged: u32,
    commands_repeated: u32,
    commands_failed: u32,
    acks_unmatched: u32,
    waypoints_sent: u32,
    waypoints_repeated: u32,
    delivery_verified: bool,
    dsp_path: String,
    /// Nothing before the DSP has answered the start-up sequence: it has not been asked.
    pc_timeout_supported: Option<bool>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct Safety {
    /// Nothing when no rule is violated.
    violation: Option<Violation>,
    pilot_switch: String,
    fence_areas: u32,
    interventions: u32,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct Violation {
    rule: String,
    amount: Option<f64>,
    /// Unit of `amount`; nothing for a rule that has none.
    unit: Option<&'static str>,
    action: String,
    /// The amount as people read it.
    #[serde(skip)]
    by: Option<String>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct Refused {
    stray: u32,
    unknown_header: u32,
    truncated: u32,
    checksum: u32,
    padding: u32,
    value: u32,
    implausible_groups: u32,
    implausible: Vec<&'static str>,
    requests: u32,
    transmit_overflows: u32,
    other_profile: u32,
    missed_messages: u32,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct DspErrors {
    total: u32,
    escalated: u32,
    unknown: u32,
    last: Option<String>,
    last_code: Option<u32>,
    by_code: Vec<DspErrorCount>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct DspErrorCount {
    code: u16,
    text: &'static str,
    count: u32,
}

impl StateReport {
    /// What `state`, the newest telemetry and the state of status say at `now`.
    pub fn new(
        robot: u32,
        state: &ModuleState,
        dsp: Option<Sample>,
        hero: Option<Sample>,
        status: Option<&State>,
        now: MonotonicNs,
    ) -> StateReport {
        StateReport {
            schema: SCHEMA,
            robot,
            module: Module::new(state, now),
            movement: (state.movement.kind != 0).then(|| Movement::new(&state.movement)),
            link: Link::new(&state.link, now),
            refused: Refused::new(&state.refused),
            dsp_errors: DspErrors::new(&state.dsp_errors),
            safety: Safety::new(&state.safety),
            dsp,
            hero,
            status: status.map(|status| StatusState::new(status, now)),
            relayed: false,
            relay: None,
        }
    }

    /// The same of a robot on another machine, to which `link` leads; nothing when the relay said nothing of it.
    #[must_use]
    pub fn relayed(self, link: Option<LinkReport>) -> StateReport {
        StateReport {
            relayed: true,
            relay: link,
            ..self
        }
    }
}

impl StatusState {
    fn new(state: &State, now: MonotonicNs) -> StatusState {
        StatusState {
            id: named(ModuleId::from_code(state.module_id), state.module_id),
            status: named(state.status(), state.status),
            doing: state.doing().unwrap_or("unreadable").to_owned(),
            blocked: state.is_blocked(),
            error: state.error().to_string(),
            sample: Sample::new(state.sequence, MonotonicNs(state.published_ns), now),
        }
    }
}

impl Module {
    fn new(state: &ModuleState, now: MonotonicNs) -> Module {
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
    fn new(movement: &MovementState) -> Movement {
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
    fn new(link: &LinkHealth, now: MonotonicNs) -> Link {
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
    fn new(counters: &RefusedCounters) -> Refused {
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
    fn counters(&self) -> [(&'static str, u32); 11] {
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
    fn new(counters: &DspErrorCounters) -> DspErrors {
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
    fn new(safety: &SafetyState) -> Safety {
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
