//! [`ModuleLog`]: what the bridge said of itself, its link and its safety rules becomes phases, states and events.

use ipc_types::code::{Functionality, LinkState};
use ipc_types::payload::ModuleState;
use operator::render::messages::details;
use operator::robot::pilot;
use runtime::finding::Severity;
use view::page::Weight;
use view::report::flight::{Ink, Lane, Span};

use super::curves::Curves;
use super::events::{EventLog, LoggedEventKind};

/// What the bridge said of itself, its link and its safety rules, as phases, states and events.
#[derive(Debug, Default)]
pub struct ModuleLog {
    doing: States,
    link: States,
    before: Option<ModuleState>,
}

impl ModuleLog {
    /// Takes the next state; `flying` is what telemetry said last.
    pub fn state(
        &mut self,
        at_s: f64,
        state: &ModuleState,
        flying: Option<bool>,
        curves: &mut Curves,
        event_log: &mut EventLog,
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
            link(at_s, &before, state, flying, event_log);
            safety(at_s, &before, state, event_log);
            blocked(at_s, &before, state, event_log);
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
    event_log: &mut EventLog,
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
    event_log.add(LoggedEventKind::Link, at_s, weight, text, None);
}

fn safety(at_s: f64, before: &ModuleState, state: &ModuleState, event_log: &mut EventLog) {
    let safety = &state.safety;
    if (before.safety.rule, before.safety.action) == (safety.rule, safety.action) {
        return;
    }
    let Some(broken) = details::broken_rule(safety) else {
        let text = "no safety rule is broken any more";
        return event_log.add(LoggedEventKind::Safety, at_s, Weight::Note, text, None);
    };
    let text = broken.words;
    let weight = match broken.severity {
        Severity::Error => Weight::Alarm,
        Severity::Note | Severity::Warning => Weight::Warning,
    };
    event_log.add(LoggedEventKind::Safety, at_s, weight, text, None);
}

fn blocked(at_s: f64, before: &ModuleState, state: &ModuleState, event_log: &mut EventLog) {
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
        event_log.add(LoggedEventKind::Module, at_s, weight, text, None);
    } else if before.is_blocked() && !state.is_blocked() {
        let text = "the module was started";
        event_log.add(LoggedEventKind::Module, at_s, Weight::Note, text, None);
    }
}

/// Most spans. A flight has some dozens; a state that flutters is shown as changing from there on.
pub const MAX_SPANS: usize = 500;

/// What is shown when a state has changed too often.
const CHANGING: &str = "changing often";

/// Spans of time, each with the state that held in it.
#[derive(Clone, Debug, Default)]
pub struct States {
    spans: Vec<Span>,
    /// Whether the last span goes on.
    is_open: bool,
}

impl States {
    /// The state at a time.
    pub fn set(&mut self, at_s: f64, name: &str, ink: Ink) {
        let is_full = self.spans.len() >= MAX_SPANS;
        let (name, ink) = match is_full {
            true => (CHANGING, Ink::Grey),
            false => (name, ink),
        };
        if let Some(last) = self.spans.last_mut()
            && self.is_open
        {
            last.to_s = last.to_s.max(at_s);
            if last.name == name {
                return;
            }
        }
        let name = name.to_owned();
        let span = Span {
            from_s: at_s,
            to_s: at_s,
            name,
            ink,
        };
        match self.spans.last_mut() {
            Some(last) if is_full => {
                last.to_s = last.to_s.max(at_s);
                last.name.clone_from(&span.name);
                last.ink = ink;
            }
            _ => self.spans.push(span),
        }
        self.is_open = true;
    }

    /// From the last known time on the state is not known.
    pub fn interrupt(&mut self) {
        self.is_open = false;
    }

    /// The spans, the last of which ends at `end_s` if it goes on.
    pub fn finish(mut self, end_s: f64) -> Vec<Span> {
        if let Some(last) = self.spans.last_mut()
            && self.is_open
        {
            last.to_s = last.to_s.max(end_s);
        }
        self.spans
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_lasts_until_the_next_one_or_until_nothing_is_known() {
        let mut states = States::default();
        for (at_s, name) in [(0.0, "a"), (1.0, "a"), (2.0, "b")] {
            states.set(at_s, name, Ink::Blue);
        }
        states.interrupt();
        states.set(9.0, "b", Ink::Blue);
        let spans = states.finish(10.0);
        let shown: Vec<(f64, f64, &str)> = spans
            .iter()
            .map(|span| (span.from_s, span.to_s, span.name.as_str()))
            .collect();
        assert_eq!(shown, [(0.0, 2.0, "a"), (2.0, 2.0, "b"), (9.0, 10.0, "b")]);
    }

    #[test]
    fn a_state_that_flutters_is_bounded() {
        let mut states = States::default();
        for index in 0..10_000 {
            states.set(f64::from(index), ["a", "b"][index as usize % 2], Ink::Blue);
        }
        let spans = states.finish(10_000.0);
        assert_eq!(spans.len(), MAX_SPANS);
        let last = spans.last().unwrap();
        assert_eq!((last.name.as_str(), last.to_s), (CHANGING, 10_000.0));
    }
}
