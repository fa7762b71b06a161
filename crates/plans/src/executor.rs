//! [`Executor`]: does the steps of a flight one after the other, at most one of them open at a time.
//!
//! | state | `begin` | `poll` | `step_done`, the end of a hover | `pause` | `fail` |
//! |---|---|---|---|---|---|
//! | ready | → step 1; done if there is none | – | – | – | – |
//! | step n, not given out | – | gives it out; a hover begins | – | → paused | → failed |
//! | step n, given out | – | – | → step n + 1; after the last one → done | → paused | → failed |
//! | paused, failed, done | – | – | – | – | – |
//!
//! A flight that was paused or failed goes on as a flight of its own, which begins with [`Executor::next_item`]: the
//! helicopter is elsewhere, so what leads on is planned and checked anew.

use std::time::Duration;

use ipc_types::MonotonicNs;

use crate::steps::Step;

/// Longest hover: a longer one is surely a mistake of units, and is cut off.
const MAX_HOVER: Duration = Duration::from_secs(86_400);

/// How far a flight is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Progress {
    /// Not begun.
    Ready,
    /// A step is under way, or is the next one.
    Step,
    /// Somebody took over: the step under way was not done to its end.
    Paused,
    /// All steps are done.
    Done,
    /// The step under way ended otherwise than done, for this reason.
    Failed(String),
}

/// Gives out the steps of a flight one after the other, at most one of them open at a time.
#[derive(Clone, Debug)]
pub struct Executor {
    steps: Vec<Step>,
    progress: Progress,
    /// The step under way, from 0; as many as there are steps at the end.
    step: usize,
    /// Whether the step under way was given out.
    is_open: bool,
    /// When the hover under way ends.
    hover_end: Option<MonotonicNs>,
    /// Waypoints of the path under way that were reached.
    reached: usize,
    /// The item that the flight begins with.
    from: u32,
}

impl Executor {
    /// A flight that was not begun; `from` is the item that it begins with, from 1.
    pub fn new(steps: Vec<Step>, from: u32) -> Executor {
        Executor {
            steps,
            progress: Progress::Ready,
            step: 0,
            is_open: false,
            hover_end: None,
            reached: 0,
            from,
        }
    }

    /// Begins with the first step.
    pub fn begin(&mut self) {
        if self.progress == Progress::Ready {
            self.progress = Progress::Step;
            self.end_if_last();
        }
    }

    /// The step that is to be begun now; each is given out once. `None` while one is open, and when there is nothing
    /// more to do.
    pub fn poll(&mut self, now: MonotonicNs) -> Option<&Step> {
        if self.progress != Progress::Step || self.is_open {
            return None;
        }
        self.is_open = true;
        let step = self.steps.get(self.step)?;
        if let Step::Wait { duration_s, .. } = step {
            let duration_s = duration_s.clamp(0.0, MAX_HOVER.as_secs_f64());
            self.hover_end = Some(now + Duration::from_secs_f64(duration_s));
        }
        Some(step)
    }

    /// When the hover under way ends; [`Executor::advance`] is to be called then.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        self.hover_end
    }

    /// Time has passed: ends a hover that is over.
    pub fn advance(&mut self, now: MonotonicNs) {
        if self.hover_end.is_some_and(|end| now >= end) {
            self.step_done();
        }
    }

    /// The open step has been done.
    pub fn step_done(&mut self) {
        if self.progress == Progress::Step && self.is_open {
            self.step += 1;
            self.close();
            self.reached = 0;
            self.end_if_last();
        }
    }

    fn end_if_last(&mut self) {
        if self.step == self.steps.len() {
            self.progress = Progress::Done;
        }
    }

    /// So many waypoints of the open path were reached, from its beginning. Gives the items that are new.
    pub fn reached(&mut self, count: usize) -> Vec<u32> {
        let Some(Step::Path(points)) = self.steps.get(self.step) else {
            return Vec::new();
        };
        let before = self.reached;
        self.reached = count.clamp(before, points.len().max(before));
        let new = points.get(before..self.reached).unwrap_or_default();
        new.iter().map(|point| point.item).collect()
    }

    /// Somebody else moves the helicopter, or makes it hover.
    pub fn pause(&mut self) {
        self.stop(Progress::Paused);
    }

    /// The open step ended otherwise than done.
    pub fn fail(&mut self, reason: impl Into<String>) {
        self.stop(Progress::Failed(reason.into()));
    }

    fn stop(&mut self, progress: Progress) {
        if self.progress == Progress::Step {
            self.progress = progress;
            self.close();
        }
    }

    fn close(&mut self) {
        (self.is_open, self.hover_end) = (false, None);
    }

    /// How far the flight is.
    pub fn progress(&self) -> &Progress {
        &self.progress
    }

    /// Whether a step is under way, or is the next one.
    pub fn is_running(&self) -> bool {
        self.progress == Progress::Step
    }

    /// The step under way, and that at which the flight was paused or failed; `None` at the end.
    pub fn step(&self) -> Option<&Step> {
        self.steps.get(self.step)
    }

    /// The number of the step under way, from 1, and how many there are.
    pub fn step_number(&self) -> (usize, usize) {
        ((self.step + 1).min(self.steps.len()), self.steps.len())
    }

    /// Waypoints of the path under way that were reached, and all of it; `None` if the step under way is no path.
    pub fn waypoints(&self) -> Option<(usize, usize)> {
        match self.step()? {
            Step::Path(points) => Some((self.reached, points.len())),
            _ => None,
        }
    }

    /// The first item that has not been done; `None` if all have.
    pub fn next_item(&self) -> Option<u32> {
        let points_left = match self.step()? {
            Step::Path(points) => points.get(self.reached).map(|point| point.item),
            step => step.first_item(),
        };
        let later = || {
            self.steps[self.step + 1..]
                .iter()
                .find_map(Step::first_item)
        };
        points_left.or_else(later).map(|item| item.max(self.from))
    }
}

#[cfg(test)]
mod tests {
    use dsp_protocol::Waypoint;

    use super::*;
    use crate::steps::PathPoint;

    const SECOND: u64 = 1_000_000_000;

    fn steps() -> Vec<Step> {
        let point = |item| PathPoint {
            item,
            waypoint: Waypoint::default(),
        };
        vec![
            Step::TakeOff {
                item: None,
                height_m: 12.5,
            },
            Step::Speed {
                item: 1,
                speed_mps: 3.0,
            },
            Step::Path(vec![point(2), point(3), point(5)]),
            Step::Wait {
                item: 5,
                duration_s: 9.0,
            },
            Step::Land { item: 6 },
        ]
    }

    /// A flight whose open step is the one with this number, from 1.
    fn at_step(number: usize) -> Executor {
        let mut executor = Executor::new(steps(), 1);
        executor.begin();
        for _ in 1..number {
            executor.poll(MonotonicNs(0));
            executor.step_done();
        }
        executor.poll(MonotonicNs(0));
        executor
    }

    #[test]
    fn each_state_and_each_event() {
        use Progress::{Done, Failed, Paused, Step as Under};
        let ready = || Executor::new(steps(), 1);
        let begun = || {
            let mut executor = ready();
            executor.begin();
            executor
        };
        let after = |change: fn(&mut Executor)| {
            let mut executor = at_step(1);
            change(&mut executor);
            executor
        };
        let failed = || Failed("stuck".to_owned());
        let done = || {
            let mut executor = at_step(5);
            executor.step_done();
            executor
        };
        let states: [(&str, Executor); 6] = [
            ("ready", ready()),
            ("not given out", begun()),
            ("given out", at_step(1)),
            ("paused", after(Executor::pause)),
            ("failed", after(|executor| executor.fail("stuck"))),
            ("done", done()),
        ];
        type Event = fn(&mut Executor);
        type Row = [(Progress, usize); 6];
        // What each state is afterwards, and its step: the same, but for these.
        let but = |changes: &[(usize, Progress, usize)]| -> Row {
            let mut row = states.clone().map(|(_, one)| (one.progress, one.step));
            for (state, progress, step) in changes {
                row[*state] = (progress.clone(), *step);
            }
            row
        };
        #[rustfmt::skip]
        let table: [(&str, Event, Row); 5] = [
            ("begin", Executor::begin, but(&[(0, Under, 0)])),
            ("step_done", Executor::step_done, but(&[(2, Under, 1)])),
            ("pause", Executor::pause, but(&[(1, Paused, 0), (2, Paused, 0)])),
            ("fail", |executor| executor.fail("stuck"), but(&[(1, failed(), 0), (2, failed(), 0)])),
            ("advance", |executor| executor.advance(MonotonicNs(u64::MAX)), but(&[])),
        ];
        for (event, happens, expected) in table {
            for ((state, executor), expected) in states.iter().zip(expected) {
                let mut executor = executor.clone();
                happens(&mut executor);
                let found = (executor.progress.clone(), executor.step);
                assert_eq!(found, expected, "{state}: {event}");
            }
        }
        // Only a step that was not given out is given out.
        let gives = states.map(|(_, mut executor)| executor.poll(MonotonicNs(0)).is_some());
        assert_eq!(gives, [false, true, false, false, false, false]);
        let mut empty = Executor::new(Vec::new(), 1);
        empty.begin();
        assert_eq!((empty.progress(), empty.next_item()), (&Done, None));
    }

    #[test]
    fn a_hover_ends_with_its_time_and_not_after_a_pause() {
        let mut executor = at_step(4);
        assert_eq!(executor.deadline(), Some(MonotonicNs(9 * SECOND)));
        executor.advance(MonotonicNs(9 * SECOND - 1));
        assert_eq!(executor.step_number(), (4, 5));
        let mut paused = executor.clone();
        paused.pause();
        paused.advance(MonotonicNs(9 * SECOND));
        assert_eq!((paused.deadline(), paused.step_number()), (None, (4, 5)));
        executor.advance(MonotonicNs(9 * SECOND));
        assert_eq!(
            (executor.deadline(), executor.step_number()),
            (None, (5, 5))
        );
        let endless = Step::Wait {
            item: 1,
            duration_s: f64::INFINITY,
        };
        let mut executor = Executor::new(vec![endless], 1);
        executor.begin();
        executor.poll(MonotonicNs(0));
        assert_eq!(executor.deadline(), Some(MonotonicNs(86_400 * SECOND)));
    }

    #[test]
    fn the_next_item_is_the_first_that_was_not_done() {
        assert_eq!(at_step(1).next_item(), Some(1));
        let mut executor = at_step(3);
        assert_eq!(executor.next_item(), Some(2));
        assert_eq!(executor.reached(2), [2, 3]);
        assert_eq!(executor.next_item(), Some(5));
        assert_eq!(executor.reached(1), [0; 0], "never fewer");
        assert_eq!(executor.waypoints(), Some((2, 3)));
        assert_eq!(executor.reached(99), [5]);
        assert_eq!(executor.next_item(), Some(5), "its hover was not done");
        executor.step_done();
        assert_eq!(executor.next_item(), Some(5));
        assert_eq!(at_step(5).next_item(), Some(6));
        let mut executor = at_step(5);
        executor.step_done();
        assert_eq!(executor.next_item(), None);
        // A take-off in front of the plan is none of its items.
        assert_eq!(Executor::new(steps(), 4).next_item(), Some(4));
    }
}
