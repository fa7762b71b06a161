//! What came of a measurement ([`Outcome`]): a row of a table, and what was not as it must be; and the [`Table`].

use std::fmt::{self, Display};

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

    fn headings(&self) -> impl Iterator<Item = &'static str> {
        self.cells.iter().map(|(heading, _)| *heading)
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

/// Rows that are printed as they come.
#[derive(Debug, Default)]
pub struct Table {
    /// Those that were shown.
    pub rows: Vec<Outcome>,
}

impl Table {
    /// Prints a row; before it its headings, unless they are those of the row before.
    pub fn show(&mut self, row: Outcome) {
        let last = self.rows.last();
        if last.is_none_or(|last| !last.headings().eq(row.headings())) {
            println!("{}", table(&row.headings().collect::<Vec<_>>(), &[]));
        }
        println!("{row}");
        self.rows.push(row);
    }

    /// Whether nothing was wrong in any row.
    pub fn is_good(&self) -> bool {
        self.rows.iter().all(Outcome::is_good)
    }
}

/// A table in Markdown: its first column is text, the others are figures.
pub fn table(header: &[&str], rows: &[Vec<String>]) -> String {
    let figures = "--:|".repeat(header.len().saturating_sub(1));
    let mut lines = vec![
        format!("| {} |", header.join(" | ")),
        format!("|---|{figures}"),
    ];
    lines.extend(rows.iter().map(|row| format!("| {} |", row.join(" | "))));
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_is_markdown_and_says_what_was_wrong() {
        let mut row = Outcome::default();
        row.cell("killed", "bridge");
        row.cell("kills", 12);
        row.none("lost", 3);
        row.note("a note");
        assert_eq!((row.count("kills"), row.is_good()), (12, false));
        assert_eq!(
            row.to_string(),
            "| bridge | 12 | 3 |\na note\nFAILED: 3 lost"
        );
        let expected = "| x | y |\n|---|--:|\n| a | 1 |";
        assert_eq!(
            table(&["x", "y"], &[vec!["a".into(), "1".into()]]),
            expected
        );
    }
}
