//! What happened to a robot, and how it was. [`EventLog`]: the last events. [`Past`]: the last minutes, for plots and
//! sparklines: values five times a second, and the phases of its flight.

use std::collections::VecDeque;
use std::time::Duration;

use ipc_types::MonotonicNs;

use crate::robot::changes::Weight;
use crate::robot::pilot::PilotView;

/// Lines that are kept: more than a tall terminal shows.
pub const MAX_LINES: usize = 200;

/// A line.
#[derive(Clone, Debug, PartialEq)]
pub struct EventLine {
    /// When it happened.
    pub at: MonotonicNs,
    /// How much it matters.
    pub weight: Weight,
    /// What happened.
    pub text: String,
}

/// The last events of a robot, in order.
#[derive(Clone, Debug, Default)]
pub struct EventLog {
    lines: VecDeque<EventLine>,
    /// Lines that were ever added.
    added: u64,
}

impl EventLog {
    /// Adds a line; the oldest goes when there are too many.
    pub fn add(&mut self, at: MonotonicNs, weight: Weight, text: impl Into<String>) {
        if self.lines.len() == MAX_LINES {
            self.lines.pop_front();
        }
        let text = text.into();
        self.lines.push_back(EventLine { at, weight, text });
        self.added += 1;
    }

    /// How many lines were ever added.
    pub fn added(&self) -> u64 {
        self.added
    }

    /// The lines that were added after the first `added` ones and are still kept, oldest first.
    pub fn since(&self, added: u64) -> impl Iterator<Item = &EventLine> {
        let new = self.added.saturating_sub(added);
        self.newest(usize::try_from(new).unwrap_or(MAX_LINES))
    }

    /// The newest `count` lines, oldest first.
    pub fn newest(&self, count: usize) -> impl Iterator<Item = &EventLine> {
        self.lines
            .iter()
            .skip(self.lines.len().saturating_sub(count))
    }
}

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

/// The last minutes of a robot, for plots and sparklines: values five times a second, and the phases of its flight.
#[derive(Clone, Debug, Default)]
pub struct Past {
    points: VecDeque<PastPoint>,
    phases: VecDeque<PastPhase>,
}

impl Past {
    /// Takes how the robot is at `now`, `None` if that is not known; to be called at least as often as points are kept.
    pub fn push(&mut self, view: Option<&PilotView>, now: MonotonicNs) {
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
    pub fn phase(&mut self, text: Option<&'static str>, now: MonotonicNs) {
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

    /// The newest `count` seconds of a value for a sparkline, oldest first, each as a part of the range between the
    /// least and the greatest of them, in steps from 1 to `steps`; `None` where there was none. The last value of a
    /// second counts. The range is at least `least_range`, so that noise does not look like a climb.
    pub fn bars(
        &self,
        value: impl Fn(&PastPoint) -> Option<f64>,
        count: usize,
        steps: u64,
        least_range: f64,
    ) -> Vec<Option<u64>> {
        let second = |point: &PastPoint| point.at.0 / 1_000_000_000;
        let (Some(first), Some(last)) = (self.points.front(), self.points.back()) else {
            return Vec::new();
        };
        let most = usize::try_from(second(last) - second(first) + 1).unwrap_or(usize::MAX);
        let count = count.min(most);
        let mut shown = vec![None; count];
        for point in &self.points {
            let ago = usize::try_from(second(last) - second(point)).unwrap_or(usize::MAX);
            if let Some(slot) = count
                .checked_sub(ago + 1)
                .and_then(|index| shown.get_mut(index))
            {
                *slot = value(point).or(*slot);
            }
        }
        let known = || shown.iter().flatten().copied();
        let low = known().fold(f64::INFINITY, f64::min);
        let high = known().fold(f64::NEG_INFINITY, f64::max);
        let range = (high - low).max(least_range);
        let bar = |value: f64| {
            let part = ((value - low) / range).clamp(0.0, 1.0);
            1 + (part * steps.saturating_sub(1) as f64).round() as u64
        };
        shown.into_iter().map(|value| value.map(bar)).collect()
    }
}

#[cfg(test)]
mod tests {
    use ipc_types::RobotId;

    use super::*;
    use crate::robot::fixture::{at, fly};
    use crate::robot::model::WatchedRobot;

    #[test]
    fn a_flight_has_phases_and_points_and_what_is_old_is_a_gap() {
        let mut robot = WatchedRobot::new(RobotId::DEFAULT);
        fly(&mut robot);
        for ms in (20_050..26_000).step_by(50) {
            robot.judge(at(ms));
        }
        let texts: Vec<_> = robot.past.phases().map(|phase| phase.text).collect();
        assert_eq!(texts, ["on the ground", "taking off", "flying the path"]);
        assert!(
            robot.past.phases().last().unwrap().to.is_some(),
            "it is not known any more"
        );
        let known: Vec<bool> = robot
            .past
            .points()
            .map(|point| point.altitude_m.is_some())
            .collect();
        // One every 250 ms in flight, then one every 200 ms.
        assert_eq!(known.len(), 81 + 29);
        assert!(known[80] && !known[109]);
    }

    #[test]
    fn it_is_bounded_by_time_and_by_number() {
        let mut past = Past::default();
        for tick in 0..20_000 {
            past.push(None, at(tick * 100));
            past.phase(Some(if tick % 2 == 0 { "a" } else { "b" }), at(tick * 100));
        }
        assert!(past.points().count() <= MAX_POINTS);
        assert!(past.points().count() > MAX_POINTS - 10);
        assert!(past.phases().count() <= MAX_PHASES);
        past.push(None, at(10_000_000));
        assert_eq!(past.points().count(), 1);
    }

    /// The bars of these altitudes, at these moments, ms.
    fn bars(values: &[(u64, Option<f64>)], count: usize, least_range: f64) -> Vec<Option<u64>> {
        let mut past = Past::default();
        for (ms, altitude_m) in values {
            let view = PilotView {
                altitude_m: *altitude_m,
                ..PilotView::default()
            };
            past.push(Some(&view), at(*ms));
        }
        past.bars(|point| point.altitude_m, count, 8, least_range)
    }

    #[test]
    fn a_bar_is_the_last_value_of_a_second_and_a_pause_is_a_gap() {
        let values = [
            (0, Some(1.0)),
            (800, Some(2.0)),
            (1200, Some(3.0)),
            (1400, None),
            (4200, Some(9.0)),
        ];
        let expected = [Some(1), Some(2), None, None, Some(8)];
        assert_eq!(bars(&values, 10, 1.0), expected);
        assert_eq!(bars(&values, 2, 1.0), [None, Some(1)]);
        assert!(bars(&[], 5, 1.0).is_empty());
        assert_eq!(bars(&[(0, None)], 5, 1.0), [None]);
    }

    #[test]
    fn noise_stays_low() {
        let values = [(0, Some(10.0)), (1000, Some(10.1))];
        assert_eq!(bars(&values, 9, 5.0), [Some(1), Some(1)]);
    }

    #[test]
    fn the_newest_lines_stay() {
        let mut journal = EventLog::default();
        for number in 0..1000 {
            journal.add(MonotonicNs(number), Weight::Note, number.to_string());
        }
        assert_eq!(journal.newest(usize::MAX).count(), MAX_LINES);
        let texts: Vec<&str> = journal.newest(2).map(|line| line.text.as_str()).collect();
        assert_eq!(texts, ["998", "999"]);
        let since: Vec<&str> = journal.since(998).map(|line| line.text.as_str()).collect();
        assert_eq!((since, journal.added()), (texts, 1000));
        assert_eq!(journal.since(1000).count(), 0);
        assert_eq!(journal.since(0).count(), MAX_LINES);
    }
}
