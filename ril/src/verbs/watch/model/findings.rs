//! What is wrong with a robot, and where the way from its DSP to here is cut.

use ipc_types::MonotonicNs;
use ipc_types::code::{LinkState, SafetyAction};
use ipc_types::payload::{ModuleState, RelayLink};

use super::super::alarms::{Finding, Kind};
use super::super::freshness::Freshness;
use super::{DSP_ERROR_SHOWN, Robot};
use crate::changes::Weight;
use crate::messages::details;

impl Robot {
    /// All that is wrong. What follows from another finding is left out: one cause is one alarm.
    pub(super) fn findings(&self, now: MonotonicNs) -> Vec<Finding> {
        let mut findings = Vec::new();
        let mut add = |kind, weight, text: String| findings.push(Finding { kind, weight, text });
        if let Some((kind, text)) = self.cut(now) {
            add(kind, Weight::Alarm, text);
        } else {
            let age = self.telemetry_feed.at(now).age();
            if let Some(age) = age {
                let text = format!("telemetry is {age}");
                add(Kind::Telemetry, Weight::Alarm, text);
            }
            if let Some(state) = &self.state {
                self.judge_state(state, now, &mut add);
            }
        }
        let has_no_fix = self.pilot.gps.is_some_and(|gps| !gps.is_there());
        if has_no_fix && self.pilot.flying == Some(true) {
            add(
                Kind::NoFix,
                Weight::Alarm,
                "no GPS fix in flight".to_owned(),
            );
        }
        if matches!(self.status_feed.at(now), Freshness::Gone(_)) {
            let text = "`ril run status` has ended: telemetry is the bridge's own, and no logs are written";
            add(Kind::StatusGone, Weight::Warning, text.to_owned());
        }
        findings
    }

    /// Where the way from the DSP to here is cut, nearest to here first.
    fn cut(&self, now: MonotonicNs) -> Option<(Kind, String)> {
        if self.is_relayed {
            let relay = self.relay.as_ref();
            let feed = self.relay_feed.at(now);
            if !feed.is_fresh() || !relay.is_some_and(RelayLink::is_up) {
                let state = relay.and_then(RelayLink::state);
                let state = state.map_or("unknown", |state| state.name());
                let text = match feed.age() {
                    Some(age) => format!("relay's link {state}, {age}"),
                    None => format!("relay's link {state}"),
                };
                return Some((Kind::RelayLink, text));
            }
        }
        match self.bridge_feed.at(now) {
            Freshness::Gone(_) => {
                let text = format!("the bridge is gone: start `ril bridge --robot {}`", self.id);
                return Some((Kind::BridgeGone, text));
            }
            Freshness::Stale(_) => {
                let text = "the bridge says nothing: is it stopped, or is the machine overloaded?";
                return Some((Kind::BridgeSilent, text.to_owned()));
            }
            Freshness::Absent | Freshness::Waiting | Freshness::Fresh => {}
        }
        let link = self.state.as_ref()?.link;
        match link.state() {
            Some(LinkState::Up) => None,
            Some(state) => Some((Kind::DspLink, format!("link to the DSP {state}"))),
            None => Some((
                Kind::DspLink,
                format!("link to the DSP unknown-{}", link.state),
            )),
        }
    }

    fn judge_state(
        &self,
        state: &ModuleState,
        now: MonotonicNs,
        add: &mut impl FnMut(Kind, Weight, String),
    ) {
        let safety = &state.safety;
        if safety.rule != 0 {
            let rule = safety.rule();
            let name =
                rule.map_or_else(|| format!("rule {}", safety.rule), |rule| rule.to_string());
            let by = rule.and_then(|rule| details::amount(rule, safety.amount));
            let by = by.map_or_else(String::new, |by| format!(" {by}"));
            let action = safety.action().map_or("unknown action", SafetyAction::name);
            let weight = match safety.action() {
                Some(SafetyAction::Warn) => Weight::Warning,
                _ => Weight::Alarm,
            };
            let text = format!("{name}{by}: {action}");
            add(Kind::Safety(safety.rule), weight, text);
        }
        if let Some(error) = self.dsp_error
            && now.since(error.at) < DSP_ERROR_SHOWN
        {
            let weight = if error.is_fatal {
                Weight::Alarm
            } else {
                Weight::Warning
            };
            add(
                Kind::DspError(error.code),
                weight,
                details::dsp_error(error.code),
            );
        }
        if state.is_blocked() && state.imi_error != 0 {
            let text = format!(
                "movements are blocked until `ril start`: {}",
                state.imi_error()
            );
            add(Kind::Blocked(state.imi_error), Weight::Warning, text);
        }
    }
}
