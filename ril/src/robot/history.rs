//! [`History`]: a value over time for a sparkline: one number for each second, of the last minutes.

use std::collections::VecDeque;
use std::time::Duration;

use ipc_types::MonotonicNs;

use crate::robot::changes::Weight;

/// Time of one bar of a sparkline.
pub const SLOT: Duration = Duration::from_secs(1);

/// Bars that are kept: four minutes, and more than a wide terminal shows.
pub const MAX_SLOTS: usize = 240;

/// See the module's documentation.
#[derive(Clone, Debug, Default)]
pub struct History {
    /// Oldest first; `None` where no value came.
    values: VecDeque<Option<f64>>,
    /// Number of the newest slot since the host's start.
    newest: u64,
}

impl History {
    /// Takes the value at `now`. The last of a slot counts; slots without one stay empty.
    pub fn push(&mut self, value: Option<f64>, now: MonotonicNs) {
        let slot = now.0 / SLOT.as_nanos() as u64;
        if self.values.is_empty() {
            self.newest = slot;
            self.values.push_back(None);
        }
        let passed = slot.saturating_sub(self.newest).min(MAX_SLOTS as u64);
        for _ in 0..passed {
            if self.values.len() == MAX_SLOTS {
                self.values.pop_front();
            }
            self.values.push_back(None);
        }
        self.newest = self.newest.max(slot);
        if let Some(newest) = self.values.back_mut() {
            *newest = value.filter(|value| value.is_finite()).or(*newest);
        }
    }

    /// The newest `count` slots, oldest first, each as a part of the range between the least and the greatest value of them, in
    /// steps from 1 to `steps`. The range is at least `least_range`, so that noise does not look like a climb.
    pub fn bars(&self, count: usize, steps: u64, least_range: f64) -> Vec<Option<u64>> {
        let skipped = self.values.len().saturating_sub(count);
        let shown: Vec<Option<f64>> = self.values.iter().skip(skipped).copied().collect();
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

/// See the module's documentation.
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

#[cfg(test)]
mod tests {
    use super::*;

    const fn at(ms: u64) -> MonotonicNs {
        MonotonicNs(ms * 1_000_000)
    }

    #[test]
    fn a_slot_has_its_last_value_and_a_pause_is_a_gap() {
        let mut history = History::default();
        for (ms, value) in [(0, 1.0), (800, 2.0), (1200, 3.0), (4200, 9.0)] {
            history.push(Some(value), at(ms));
        }
        let bars = history.bars(10, 8, 1.0);
        assert_eq!(bars, [Some(1), Some(2), None, None, Some(8)]);
        assert_eq!(history.bars(2, 8, 1.0), [None, Some(1)]);
    }

    #[test]
    fn it_is_bounded_and_takes_what_is_no_number_as_nothing() {
        let mut history = History::default();
        for index in 0..10_000 {
            history.push(Some(f64::from(index)), at(u64::from(index as u32) * 1000));
        }
        assert_eq!(history.bars(usize::MAX, 8, 1.0).len(), MAX_SLOTS);
        history.push(Some(f64::NAN), MonotonicNs(u64::MAX));
        history.push(Some(1.0), at(0));
        let bars = history.bars(MAX_SLOTS, 8, 1.0);
        assert_eq!(bars.iter().flatten().count(), 1, "a long pause empties it");
        assert!(History::default().bars(5, 8, 1.0).is_empty());
    }

    #[test]
    fn noise_stays_low() {
        let mut history = History::default();
        history.push(Some(10.0), at(0));
        history.push(Some(10.1), at(1000));
        assert_eq!(history.bars(9, 8, 5.0), [Some(1), Some(1)]);
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
