//! [`Journal`]: what happened, one line each, bounded.

use std::collections::VecDeque;

use ipc_types::MonotonicNs;

use crate::finding::Severity;

/// Lines that are kept: more than a tall terminal shows.
pub const MAX_LINES: usize = 200;

/// How much a line matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Weight {
    /// Something went on as it should.
    Note,
    /// An order, or what became of it.
    Order,
    /// Something to look at.
    Warning,
    /// Something to act on.
    Alarm,
}

impl Weight {
    /// What stands before a line, so that it does not need colour.
    pub fn mark(self) -> &'static str {
        match self {
            Weight::Note => " ",
            Weight::Order => ">",
            Weight::Warning => "!",
            Weight::Alarm => "!!",
        }
    }
}

impl From<Severity> for Weight {
    fn from(severity: Severity) -> Weight {
        match severity {
            Severity::Note => Weight::Note,
            Severity::Warning => Weight::Warning,
            Severity::Error => Weight::Alarm,
        }
    }
}

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
