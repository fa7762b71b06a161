//! What is wrong with a robot, and where the way from its DSP to here is cut.

use ipc_types::MonotonicNs;
use ipc_types::code::LinkState;
use ipc_types::payload::{ModuleState, RelayLink};
use runtime::finding::{Finding, Severity};

use super::{DSP_ERROR_SHOWN, Process, WatchedRobot};
use crate::render::messages::details;
use crate::robot::freshness::Freshness;
use crate::robot::sample_age::named;

impl WatchedRobot {
    /// All that is wrong, what matters most first. What follows from another finding is left out: one cause is one alarm.
    pub(super) fn findings(&self, now: MonotonicNs) -> Vec<Finding> {
        let mut findings = Vec::new();
        if let Some(cut) = self.cut(now) {
            findings.push(cut);
        } else {
            if let Some(age) = self.telemetry_feed.at(now).age() {
                findings.push(alarm("telemetry", format!("telemetry is {age}")));
            }
            if let Some(state) = &self.state {
                findings.extend(self.judge_state(state, now));
            }
        }
        let has_no_fix = self.pilot.gps.is_some_and(|gps| !gps.is_there());
        if has_no_fix && self.pilot.flying == Some(true) {
            findings.push(alarm("no-fix", "no GPS fix in flight"));
        }
        if matches!(self.process(Process::Status, now), Freshness::Gone(_)) {
            let text = "`ril run status` has ended: telemetry is the bridge's own, and no logs are written";
            findings.push(warning("status-gone", text));
        }
        findings
    }

    /// Where the way from the DSP to here is cut, nearest to here first.
    fn cut(&self, now: MonotonicNs) -> Option<Finding> {
        if self.is_relayed {
            let relay = self.relay.as_ref();
            let feed = self.process(Process::Relay, now);
            if !feed.is_fresh() || !relay.is_some_and(RelayLink::is_up) {
                let state = relay.and_then(RelayLink::state);
                let state = state.map_or("unknown", |state| state.name());
                let text = match feed.age() {
                    Some(age) => format!("relay's link {state}, {age}"),
                    None => format!("relay's link {state}"),
                };
                return Some(alarm("relay-link", text));
            }
        }
        match self.process(Process::Bridge, now) {
            Freshness::Gone(_) => {
                let text = format!("the bridge is gone: start `ril bridge --robot {}`", self.id);
                return Some(alarm("bridge-gone", text));
            }
            Freshness::Stale(_) => {
                let text = "the bridge says nothing: is it stopped, or is the machine overloaded?";
                return Some(alarm("bridge-silent", text));
            }
            Freshness::Absent | Freshness::Waiting | Freshness::Fresh => {}
        }
        let link = self.state.as_ref()?.link;
        if link.state() == Some(LinkState::Up) {
            return None;
        }
        let name = named(link.state(), link.state);
        Some(alarm("dsp-link", format!("link to the DSP {name}")))
    }

    fn judge_state(&self, state: &ModuleState, now: MonotonicNs) -> Vec<Finding> {
        let mut findings = Vec::new();
        let safety = &state.safety;
        if let Some(broken) = details::broken_rule(safety) {
            findings.push(Finding::new(broken.severity, "safety", broken.words).about(safety.rule));
        }
        if let Some(error) = self.dsp_error
            && now.since(error.at) < DSP_ERROR_SHOWN
        {
            let severity = match error.is_fatal {
                true => Severity::Error,
                false => Severity::Warning,
            };
            let finding = Finding::new(severity, "dsp-error", details::dsp_error(error.code));
            findings.push(finding.about(error.code));
        }
        if state.is_blocked() && state.imi_error != 0 {
            let error = state.imi_error();
            let text = format!("movements are blocked until `ril start`: {error}");
            findings.push(warning("blocked", text).about(state.imi_error));
        }
        findings
    }
}

fn alarm(id: &'static str, text: impl Into<String>) -> Finding {
    Finding::new(Severity::Error, id, text)
}

fn warning(id: &'static str, text: impl Into<String>) -> Finding {
    Finding::new(Severity::Warning, id, text)
}
