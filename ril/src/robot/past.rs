//! [`Past`]: the last minutes of a robot for plots: values five times a second, and the phases of its flight.

use std::collections::VecDeque;
use std::time::Duration;

use ipc_types::MonotonicNs;

use crate::robot::model::{Process, WatchedRobot};
use crate::robot::pilot::{self, PilotView};

/// How long values are kept.
pub const KEPT: Duration = Duration::from_secs(600);

/// Time between two points.
pub const SPACING: Duration = Duration::from_millis(200);

/// Points that are kept, at least all of [`KEPT`]; the oldest goes.
const MAX_POINTS: usize = (KEPT.as_millis() / SPACING.as_millis()) as usize;

/// Phases that are kept: one every 2.3 seconds of [`KEPT`]. The oldest goes.
const MAX_PHASES: usize = 256;

/// Values at one moment; what was not measured is nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PastPoint {
    /// When.
    pub at: MonotonicNs,
    /// Telemetry altitude, m.
    pub altitude_m: Option<f64>,
    /// Speed over ground, m/s.
    pub ground_speed_mps: Option<f64>,
    /// Battery, V.
    pub battery_v: Option<f64>,
}

/// What the helicopter did from one moment to another.
#[derive(Clone, Debug, PartialEq)]
pub struct PastPhase {
    /// Since when.
    pub from: MonotonicNs,
    /// Until when; it lasts if this is `None`.
    pub to: Option<MonotonicNs>,
    /// In a word or two.
    pub text: &'static str,
}

/// See the module's documentation.
#[derive(Clone, Debug, Default)]
pub struct Past {
    points: VecDeque<PastPoint>,
    phases: VecDeque<PastPhase>,
}

impl Past {
    /// Takes how `robot` is at `now`; to be called at least as often as points are kept. What is not of the present is a gap.
    pub fn take(&mut self, robot: &WatchedRobot, now: MonotonicNs) {
        let is_fresh = robot.telemetry_freshness(now).is_fresh();
        self.push(is_fresh.then_some(&robot.pilot), now);
        let state = robot.state.as_ref();
        let state = state.filter(|_| robot.process(Process::Bridge, now).is_fresh());
        let functionality = state.and_then(|state| state.functionality());
        let activity = functionality.map(|one| pilot::activity(one, robot.pilot.flying));
        self.phase(activity, now);
    }

    fn push(&mut self, view: Option<&PilotView>, now: MonotonicNs) {
        if self
            .points
            .back()
            .is_some_and(|last| now < last.at + SPACING)
        {
            return;
        }
        if self.points.len() == MAX_POINTS {
            self.points.pop_front();
        }
        self.points.push_back(PastPoint {
            at: now,
            altitude_m: view.and_then(|view| view.altitude_m),
            ground_speed_mps: view.and_then(|view| view.ground_speed_mps),
            battery_v: view.and_then(|view| view.battery_v),
        });
        let oldest = MonotonicNs(now.0.saturating_sub(KEPT.as_nanos() as u64));
        while self.points.front().is_some_and(|point| point.at < oldest) {
            self.points.pop_front();
        }
        self.phases
            .retain(|phase| phase.to.is_none_or(|to| to >= oldest));
    }

    /// The phase is `text` from now on; `None` if it is not known.
    fn phase(&mut self, text: Option<&'static str>, now: MonotonicNs) {
        let last = self.phases.back_mut().filter(|last| last.to.is_none());
        if last.as_ref().map(|last| last.text) == text {
            return;
        }
        if let Some(last) = last {
            last.to = Some(now);
        }
        if let Some(text) = text {
            if self.phases.len() == MAX_PHASES {
                self.phases.pop_front();
            }
            self.phases.push_back(PastPhase {
                from: now,
                to: None,
                text,
            });
        }
    }

    /// The values, oldest first.
    pub fn points(&self) -> impl Iterator<Item = &PastPoint> {
        self.points.iter()
    }

    /// The phases, oldest first.
    pub fn phases(&self) -> impl Iterator<Item = &PastPhase> {
        self.phases.iter()
    }
}

#[cfg(test)]
mod tests {
    use ipc_types::RobotId;

    use super::*;
    use crate::robot::fixture::{at, fly};

    #[test]
    fn a_flight_has_phases_and_points_and_what_is_old_is_a_gap() {
        let mut past = Past::default();
        let mut robot = WatchedRobot::new(RobotId::DEFAULT);
        past.take(&robot, at(0));
        assert_eq!(past.points().next().unwrap().altitude_m, None);
        fly(&mut robot);
        for ms in (20_000..26_000).step_by(50) {
            past.take(&robot, at(ms));
        }
        let texts: Vec<_> = past.phases().map(|phase| phase.text).collect();
        assert_eq!(texts, ["flying the path"]);
        assert!(
            past.phases().next().unwrap().to.is_some(),
            "it is not known any more"
        );
        let known: Vec<bool> = past
            .points()
            .map(|point| point.altitude_m.is_some())
            .collect();
        assert_eq!(known.len(), 31);
        assert!(known[1] && !known[30]);
    }

    #[test]
    fn it_is_bounded_by_time_and_by_number() {
        let mut past = Past::default();
        let robot = WatchedRobot::new(RobotId::DEFAULT);
        for tick in 0..20_000 {
            past.take(&robot, at(tick * 100));
            past.phase(Some(if tick % 2 == 0 { "a" } else { "b" }), at(tick * 100));
        }
        assert!(past.points().count() <= MAX_POINTS);
        assert!(past.points().count() > MAX_POINTS - 10);
        assert!(past.phases().count() <= MAX_PHASES);
        past.take(&robot, at(10_000_000));
        assert_eq!(past.points().count(), 1);
    }
}
