//! [`Journal`]: what happened, one line each, bounded.

use std::collections::VecDeque;

use ipc_types::MonotonicNs;

use crate::changes::Weight;

/// Lines that are kept: more than a tall terminal shows.
pub const MAX_LINES: usize = 200;

/// A line.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// When it happened.
    pub at: MonotonicNs,
    /// How much it matters.
    pub weight: Weight,
    /// What happened.
    pub text: String,
}

/// See the module's documentation.
#[derive(Clone, Debug, Default)]
pub struct Journal {
    lines: VecDeque<Line>,
}

impl Journal {
    /// Adds a line; the oldest goes when there are too many.
    pub fn add(&mut self, at: MonotonicNs, weight: Weight, text: impl Into<String>) {
        if self.lines.len() == MAX_LINES {
            self.lines.pop_front();
        }
        let text = text.into();
        self.lines.push_back(Line { at, weight, text });
    }

    /// The newest `count` lines, oldest first.
    pub fn newest(&self, count: usize) -> impl Iterator<Item = &Line> {
        self.lines
            .iter()
            .skip(self.lines.len().saturating_sub(count))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_lines_stay() {
        let mut journal = Journal::default();
        for number in 0..1000 {
            journal.add(MonotonicNs(number), Weight::Note, number.to_string());
        }
        assert_eq!(journal.newest(usize::MAX).count(), MAX_LINES);
        let texts: Vec<&str> = journal.newest(2).map(|line| line.text.as_str()).collect();
        assert_eq!(texts, ["998", "999"]);
    }
}
