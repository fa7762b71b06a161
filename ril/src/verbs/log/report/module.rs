//! [`Module`]: what the bridge said of itself, its link and its safety rules becomes phases, states and events.

use flight_report::flight::{Ink, Lane, Span, Weight};
use ipc_types::code::{Functionality, LinkState, SafetyAction};
use ipc_types::payload::ModuleState;

use super::curves::Curves;
use super::happenings::{Happenings, Kind};
use super::states::States;
use crate::messages::details;
use crate::pilot;

/// See the module's documentation.
#[derive(Debug, Default)]
pub struct Module {
    doing: States,
    link: States,
    before: Option<ModuleState>,
}

impl Module {
    /// Takes the next state; `flying` is what telemetry said last.
    pub fn state(
        &mut self,
        at_s: f64,
        state: &ModuleState,
        flying: Option<bool>,
        curves: &mut Curves,
        happenings: &mut Happenings,
    ) {
        match state.functionality() {
            Some(functionality) => {
                let activity = pilot::activity(functionality, flying);
                self.doing
                    .set(at_s, activity, phase_ink(functionality, flying));
            }
            None => self.doing.interrupt(),
        }
        match state.link.state() {
            Some(link) => self.link.set(at_s, link.name(), link_ink(link)),
            None => self.link.interrupt(),
        }
        if let Some(before) = self
            .before
            .filter(|before| before.epoch_ns == state.epoch_ns)
        {
            counters(at_s, &before, state, curves);
            link(at_s, &before, state, flying, happenings);
            safety(at_s, &before, state, happenings);
            blocked(at_s, &before, state, happenings);
        }
        self.before = Some(*state);
    }

    /// The phases, and the lane of the link; empty when no state came.
    pub fn finish(self, end_s: f64) -> (Vec<Span>, Lane) {
        let link = Lane {
            name: "link".to_owned(),
            spans: self.link.finish(end_s),
        };
        (self.doing.finish(end_s), link)
    }
}

fn phase_ink(functionality: Functionality, flying: Option<bool>) -> Ink {
    match functionality {
        Functionality::AtRest | Functionality::ReceivingPath if flying == Some(false) => Ink::Grey,
        Functionality::AtRest | Functionality::ReceivingPath | Functionality::Holding => Ink::Green,
        Functionality::TakingOff => Ink::Yellow,
        Functionality::FollowingPath => Ink::Blue,
        Functionality::Landing => Ink::Purple,
        Functionality::Stopping => Ink::Orange,
    }
}

fn link_ink(state: LinkState) -> Ink {
    match state {
        LinkState::Up => Ink::Green,
        LinkState::Connecting => Ink::Grey,
        LinkState::Silent => Ink::Yellow,
        LinkState::Gone => Ink::Red,
    }
}

/// What the bridge rejected and sent again since the state before.
fn counters(at_s: f64, before: &ModuleState, state: &ModuleState, curves: &mut Curves) {
    let new = state
        .refused
        .pieces()
        .saturating_sub(before.refused.pieces());
    curves.rejected.add(at_s, new as f64);
    let repeated = state
        .link
        .commands_repeated
        .saturating_sub(before.link.commands_repeated);
    curves.repeated.add(at_s, repeated.into());
}

fn link(
    at_s: f64,
    before: &ModuleState,
    state: &ModuleState,
    flying: Option<bool>,
    happenings: &mut Happenings,
) {
    if before.link.state == state.link.state {
        return;
    }
    let Some(link) = state.link.state() else {
        return;
    };
    let weight = match (link, flying) {
        (LinkState::Up, _) => Weight::Note,
        (_, Some(true)) => Weight::Alarm,
        _ => Weight::Warning,
    };
    let text = format!("the link to the DSP is {}", link.name());
    happenings.add(Kind::Link, at_s, weight, text, None);
}

fn safety(at_s: f64, before: &ModuleState, state: &ModuleState, happenings: &mut Happenings) {
    let safety = &state.safety;
    if (before.safety.rule, before.safety.action) == (safety.rule, safety.action) {
        return;
    }
    if safety.rule == 0 {
        let text = "no safety rule is broken any more";
        return happenings.add(Kind::Safety, at_s, Weight::Note, text, None);
    }
    let rule = safety.rule();
    let name = rule.map_or_else(|| format!("rule {}", safety.rule), |rule| rule.to_string());
    let by = rule.and_then(|rule| details::amount(rule, safety.amount));
    let by = by.map_or_else(String::new, |by| format!(" {by}"));
    let action = safety.action();
    let weight = match action {
        Some(SafetyAction::Warn) => Weight::Warning,
        _ => Weight::Alarm,
    };
    let action = action.map_or("unknown action", SafetyAction::name);
    let text = format!("safety rule {name} broken{by}: {action}");
    happenings.add(Kind::Safety, at_s, weight, text, None);
}

fn blocked(at_s: f64, before: &ModuleState, state: &ModuleState, happenings: &mut Happenings) {
    if state.is_blocked() && !before.is_blocked() {
        let (weight, text) = match state.imi_error {
            0 => (Weight::Note, "the module was stopped".to_owned()),
            _ => {
                let error = state.imi_error();
                (
                    Weight::Alarm,
                    format!("movements are blocked until a start: {error}"),
                )
            }
        };
        happenings.add(Kind::Module, at_s, weight, text, None);
    } else if before.is_blocked() && !state.is_blocked() {
        let text = "the module was started";
        happenings.add(Kind::Module, at_s, Weight::Note, text, None);
    }
}
