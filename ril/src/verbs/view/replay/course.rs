//! [`Course`]: the phases and events of all of a recording, for the scrubber.

use ipc_types::MonotonicNs;
use view::page::{Phase, ReplayEvent};

use super::super::messages::weight;
use crate::robot::changes::Weight;
use crate::robot::played::PlayedRobot;

/// Most phases; a flight has some dozens. Further ones are left out.
const MAX_PHASES: usize = 500;

/// Most events, of 120 bytes in a message of 1 MiB. At the bound those that are only good to know go; further ones are left out.
const MAX_EVENTS: usize = 2000;

/// See the module's documentation.
pub(super) struct Course {
    begin: MonotonicNs,
    phases: Vec<Phase>,
    /// When the last of the phases began.
    phase_from: Option<MonotonicNs>,
    events: Vec<(Weight, ReplayEvent)>,
    /// Lines of the robot's journal that were taken.
    lines: u64,
}

impl Course {
    pub fn new(begin: MonotonicNs) -> Course {
        Course {
            begin,
            phases: Vec::new(),
            phase_from: None,
            events: Vec::new(),
            lines: 0,
        }
    }

    /// Takes what is new of the robot; to be called after each look.
    pub fn take(&mut self, played: &PlayedRobot, now: MonotonicNs) {
        let journal = &played.robot.journal;
        for line in journal.since(self.lines) {
            self.event(line.at, line.weight, &line.text);
        }
        self.lines = journal.added();
        let Some(phase) = played.past.phases().last() else {
            return;
        };
        let to_s = self.position_s(phase.to.unwrap_or(now));
        if self.phase_from != Some(phase.from) {
            if self.phases.len() == MAX_PHASES {
                return;
            }
            self.phase_from = Some(phase.from);
            self.phases.push(Phase {
                from_s: self.position_s(phase.from),
                to_s,
                text: phase.text.to_owned(),
            });
        } else if let Some(last) = self.phases.last_mut() {
            last.to_s = to_s;
        }
    }

    /// Adds an event.
    pub fn event(&mut self, at: MonotonicNs, weight: Weight, text: &str) {
        if self.events.len() == MAX_EVENTS {
            self.events.retain(|(weight, _)| *weight >= Weight::Warning);
        }
        if self.events.len() < MAX_EVENTS {
            let event = ReplayEvent {
                at_s: self.position_s(at),
                severity: self::weight(weight),
                text: text.to_owned(),
            };
            self.events.push((weight, event));
        }
    }

    fn position_s(&self, at: MonotonicNs) -> f64 {
        at.since(self.begin).as_secs_f64()
    }

    /// The phases and the events, in the order of time.
    pub fn finish(self) -> (Vec<Phase>, Vec<ReplayEvent>) {
        let events = self.events.into_iter().map(|(_, event)| event);
        let mut events: Vec<ReplayEvent> = events.collect();
        events.sort_by(|one, other| one.at_s.total_cmp(&other.at_s));
        (self.phases, events)
    }
}
