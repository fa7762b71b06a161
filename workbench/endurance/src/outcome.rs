//! What came of a measurement ([`Outcome`]): a row of a table, and what was not as it must be.

use std::fmt::{self, Display};
use std::time::Duration;

/// What came of a measurement.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    cells: Vec<(&'static str, String)>,
    notes: Vec<String>,
    failures: Vec<String>,
}

impl Outcome {
    /// Adds a cell under this heading.
    pub fn cell(&mut self, heading: &'static str, content: impl Display) {
        self.cells.push((heading, content.to_string()));
    }

    /// Adds a count that must be zero.
    pub fn none(&mut self, heading: &'static str, count: usize) {
        self.cell(heading, count);
        self.require(count == 0, format!("{count} {heading}"));
    }

    /// Adds lines that stand behind the table.
    pub fn note(&mut self, note: impl Display) {
        self.notes.push(note.to_string());
    }

    /// Says what is wrong, unless `holds`.
    pub fn require(&mut self, holds: bool, failure: impl Display) {
        if !holds {
            self.failures.push(failure.to_string());
        }
    }

    /// The number in the cell under this heading.
    ///
    /// # Panics
    ///
    /// When there is none.
    pub fn count(&self, heading: &str) -> u64 {
        let mut cells = self.cells.iter();
        let cell = cells.find(|(other, _)| *other == heading);
        let number = cell.and_then(|(_, content)| content.parse().ok());
        number.unwrap_or_else(|| panic!("no number of {heading}: {self}"))
    }

    /// Whether nothing was wrong.
    pub fn is_good(&self) -> bool {
        self.failures.is_empty()
    }

    /// The head of the table.
    pub fn head(&self) -> String {
        let headings: Vec<&str> = self.cells.iter().map(|(heading, _)| *heading).collect();
        let rule = "---|".repeat(headings.len());
        format!("| {} |\n|{rule}", headings.join(" | "))
    }
}

impl Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let cells: Vec<&str> = self.cells.iter().map(|(_, cell)| cell.as_str()).collect();
        write!(f, "| {} |", cells.join(" | "))?;
        for note in &self.notes {
            write!(f, "\n{note}")?;
        }
        for failure in &self.failures {
            write!(f, "\nFAILED: {failure}")?;
        }
        Ok(())
    }
}

/// How long something took, many times.
#[derive(Clone, Debug, Default)]
pub struct Times(pub Vec<Duration>);

impl Times {
    /// Adds one.
    pub fn push(&mut self, time: Duration) {
        self.0.push(time);
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.0.len()
    }

    /// The longest; zero if there are none.
    pub fn worst(&self) -> Duration {
        self.quantile(1.0)
    }

    fn quantile(&self, share: f64) -> Duration {
        let mut sorted = self.0.clone();
        sorted.sort_unstable();
        let last = sorted.len().saturating_sub(1);
        let index = (last as f64 * share).ceil() as usize;
        sorted.get(index).copied().unwrap_or_default()
    }

    /// What these shares of them do not exceed, 0 … 1, in ms.
    pub fn quantiles_ms(&self, shares: &[f64]) -> String {
        let shown = |share: &f64| format!("{:.1}", self.quantile(*share).as_secs_f64() * 1e3);
        shares.iter().map(shown).collect::<Vec<_>>().join(", ")
    }

    /// What these shares of them do not exceed, 0 … 1, in s.
    pub fn quantiles_s(&self, shares: &[f64]) -> String {
        let shown = |share: &f64| format!("{:.2}", self.quantile(*share).as_secs_f64());
        shares.iter().map(shown).collect::<Vec<_>>().join(", ")
    }
}

impl Extend<Duration> for Times {
    fn extend<I: IntoIterator<Item = Duration>>(&mut self, times: I) {
        self.0.extend(times);
    }
}

impl FromIterator<Duration> for Times {
    fn from_iter<I: IntoIterator<Item = Duration>>(times: I) -> Times {
        Times(times.into_iter().collect())
    }
}

/// With one decimal; with two by `{:.2}`, for times that may be shorter than 0.1 ms.
impl Display for Times {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_empty() {
            return f.write_str("–");
        }
        let ms = |share| self.quantile(share).as_secs_f64() * 1e3;
        let (median, most, worst) = (ms(0.5), ms(0.99), ms(1.0));
        let (count, digits) = (self.count(), f.precision().unwrap_or(1));
        write!(
            f,
            "median {median:.digits$} ms, 99 % within {most:.digits$} ms, worst {worst:.digits$} ms of {count}"
        )
    }
}
