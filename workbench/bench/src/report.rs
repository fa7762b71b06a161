//! Tables, goals and plots: printed, and written into one Markdown file that has a section for each command.
//!
//! A section is replaced as a whole by the next run of its command. Whatever stands outside of the sections is kept.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

use crate::machine;
use crate::statistics::Ratio;

/// Name of the Markdown file.
const FILE: &str = "performance.md";

/// Beginning of a file that does not exist yet.
const PREAMBLE: &str = "# Performance\n";

/// What a command has found.
pub struct Section {
    name: &'static str,
    blocks: Vec<String>,
    goals: Vec<Goal>,
    plots: Vec<(String, String)>,
}

/// A figure to reach.
pub struct Goal {
    /// What is compared.
    pub what: String,
    /// The bound of the ratio.
    pub bound: Bound,
    /// What was measured; nothing when the peer was not.
    pub ratio: Option<Ratio>,
}

/// On which side of a value a figure must lie.
#[derive(Clone, Copy, Debug)]
pub enum Bound {
    /// Not above it.
    AtMost(f64),
    /// Not below it.
    AtLeast(f64),
}

impl Bound {
    fn holds(self, value: f64) -> bool {
        match self {
            Bound::AtMost(most) => value <= most,
            Bound::AtLeast(least) => value >= least,
        }
    }

    fn text(self) -> String {
        match self {
            Bound::AtMost(most) => format!("≤ {most}"),
            Bound::AtLeast(least) => format!("≥ {least}"),
        }
    }
}

impl Section {
    /// The section of the command `name`, with the command line that this process was started with.
    pub fn new(name: &'static str, title: &str) -> Section {
        let arguments: Vec<String> = std::env::args().skip(1).collect();
        let command = "cargo run --release --manifest-path workbench/bench/Cargo.toml --";
        Section {
            name,
            blocks: vec![
                format!("## {title}"),
                format!("`{command} {}`", arguments.join(" ")),
                format!("{}.", machine::describe()),
            ],
            goals: Vec::new(),
            plots: Vec::new(),
        }
    }

    /// Adds a paragraph.
    pub fn text(&mut self, text: impl Into<String>) {
        self.blocks.push(text.into());
    }

    /// Adds a table.
    pub fn table(&mut self, header: &[&str], rows: &[Vec<String>]) {
        self.blocks.push(table(header, rows));
    }

    /// Adds a plot, which is a file beside the Markdown file.
    pub fn plot(&mut self, file: &str, description: &str, svg: String) {
        self.blocks.push(format!("![{description}]({file})"));
        self.plots.push((file.to_owned(), svg));
    }

    /// Adds a goal; they make one table at the end.
    pub fn goal(&mut self, what: impl Into<String>, bound: Bound, ratio: Option<Ratio>) {
        self.goals.push(Goal {
            what: what.into(),
            bound,
            ratio,
        });
    }

    /// Prints the section, and writes it into the folder `out` if there is one.
    ///
    /// # Errors
    /// The folder cannot be written.
    pub fn publish(mut self, out: Option<&Path>) -> Result<()> {
        if !self.goals.is_empty() {
            let rows: Vec<_> = self.goals.iter().map(goal_row).collect();
            let header = ["figure", "goal", "measured", "least … most", ""];
            self.blocks.push(table(&header, &rows));
        }
        let text = self.blocks.join("\n\n");
        println!("{text}\n");
        let Some(folder) = out else {
            return Ok(());
        };
        fs::create_dir_all(folder)?;
        for (file, svg) in &self.plots {
            fs::write(folder.join(file), svg)?;
        }
        let path = folder.join(FILE);
        let before = if path.exists() {
            fs::read_to_string(&path).with_context(|| format!("{}", path.display()))?
        } else {
            PREAMBLE.to_owned()
        };
        fs::write(&path, replace(&before, self.name, &text))?;
        eprintln!("written to {}", path.display());
        Ok(())
    }
}

/// Where the results belong: the documentation of the repository that this program was built from.
pub fn default_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs")
}

/// Nanoseconds as microseconds with three digits.
pub fn us(ns: f64) -> String {
    let us = ns / 1000.0;
    match us {
        us if us < 10.0 => format!("{us:.2}"),
        us if us < 100.0 => format!("{us:.1}"),
        us => format!("{us:.0}"),
    }
}

fn goal_row(goal: &Goal) -> Vec<String> {
    let (measured, spread, met) = match goal.ratio {
        Some(ratio) => (
            format!("{:.2}", ratio.median),
            format!("{:.2} … {:.2}", ratio.least, ratio.most),
            if goal.bound.holds(ratio.median) {
                "reached"
            } else {
                "**missed**"
            },
        ),
        None => ("–".to_owned(), "–".to_owned(), "not measured"),
    };
    vec![
        goal.what.clone(),
        goal.bound.text(),
        measured,
        spread,
        met.to_owned(),
    ]
}

fn table(header: &[&str], rows: &[Vec<String>]) -> String {
    let mut text = String::new();
    // The first column is text, the others are figures. Writing to a string cannot fail.
    let _ = writeln!(text, "| {} |", header.join(" | "));
    let _ = writeln!(text, "|---|{}", "--:|".repeat(header.len() - 1));
    for row in rows {
        let _ = writeln!(text, "| {} |", row.join(" | "));
    }
    text.truncate(text.trim_end().len());
    text
}

/// `document` with the section `name` made of `text`: in its old place, or at the end.
fn replace(document: &str, name: &str, text: &str) -> String {
    let begin = format!("<!-- bench {name}: made by the command, do not edit -->");
    let end = format!("<!-- end of bench {name} -->");
    let section = format!("{begin}\n\n{text}\n\n{end}");
    match (document.find(&begin), document.find(&end)) {
        (Some(from), Some(to)) if from < to => {
            let behind = &document[to + end.len()..];
            format!("{}{section}{behind}", &document[..from])
        }
        _ => format!("{}\n\n{section}\n", document.trim_end()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_section_replaces_its_older_self_and_nothing_else() {
        let first = replace("# Title\n", "hop", "old");
        let both = replace(&first, "codec", "codec's");
        let with_notes = format!("{both}\nWritten by hand.\n");
        let second = replace(&with_notes, "hop", "new");
        assert!(second.starts_with("# Title\n\n<!-- bench hop"));
        assert!(second.contains("new") && !second.contains("old"));
        assert!(second.contains("codec's"));
        assert!(second.ends_with("Written by hand.\n"));
        assert_eq!(replace(&second, "hop", "new"), second);
    }

    #[test]
    fn goals_say_whether_they_are_reached() {
        let ratio = |median| Ratio {
            median,
            least: median,
            most: median,
        };
        for (bound, value, met) in [
            (Bound::AtMost(0.75), 0.75, "reached"),
            (Bound::AtMost(0.75), 0.76, "**missed**"),
            (Bound::AtLeast(2.0), 2.1, "reached"),
            (Bound::AtLeast(2.0), 1.9, "**missed**"),
        ] {
            let goal = Goal {
                what: "x".to_owned(),
                bound,
                ratio: Some(ratio(value)),
            };
            assert_eq!(goal_row(&goal)[4], met, "{bound:?} {value}");
        }
        let goal = Goal {
            what: "x".to_owned(),
            bound: Bound::AtMost(1.0),
            ratio: None,
        };
        assert_eq!(goal_row(&goal)[4], "not measured");
    }

    #[test]
    fn a_table_is_markdown() {
        let rows = vec![vec!["a".to_owned(), "1".to_owned()]];
        assert_eq!(table(&["x", "y"], &rows), "| x | y |\n|---|--:|\n| a | 1 |");
    }

    #[test]
    fn microseconds_have_three_digits() {
        for (ns, text) in [(940.0, "0.94"), (12_340.0, "12.3"), (123_456.0, "123")] {
            assert_eq!(us(ns), text);
        }
    }
}
