//! Tables, goals and one plot: printed, and written into one Markdown file that has a section for each command.
//!
//! A section is replaced as a whole by the next run of its command. What stands outside of the sections is kept.

use std::fmt::Display;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use measure::{Times, median, table};

use crate::measured::{LOST, Measured, Part, Ratio};
use crate::usage::CPU;

/// Name of the Markdown file.
const FILE: &str = "performance.md";

/// Beginning of a file that does not exist yet.
const PREAMBLE: &str = "# Performance\n";

/// The columns of latencies.
pub const PERCENTILES: [(&str, f64); 3] = [("p50", 0.5), ("p99", 0.99), ("p99.9", 0.999)];

/// What a command has found.
pub struct Section {
    name: &'static str,
    blocks: Vec<String>,
    goals: Vec<Vec<String>>,
    plots: Vec<(String, String)>,
}

/// On which side of a value a figure must lie.
#[derive(Clone, Copy, Debug)]
pub enum Bound {
    /// Not above it.
    AtMost(f64),
    /// Not below it.
    AtLeast(f64),
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
                format!("{}.", machine()),
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

    /// Adds a table of latencies, whole times in µs: a row for each of `cases`, with the ratio of its median to that of
    /// each of `others`.
    pub fn latencies<C: Copy + PartialEq + Display>(
        &mut self,
        measured: &Measured<C>,
        cases: &[(String, C)],
        others: &[(&str, C)],
    ) {
        let mut header = vec!["way", "p50", "p99", "p99.9", "lost"];
        header.extend(others.iter().map(|(name, _)| *name));
        let row = |(name, case): &(String, C)| {
            let mut row = vec![name.clone()];
            row.extend(percentiles(&measured.times(*case, "", Part::Whole)));
            row.push(format!("{:.0}", measured.sum(*case, "", LOST)));
            let medians = measured.medians(*case);
            row.extend(others.iter().map(|(_, other)| {
                let ratio = Ratio::of_rounds(&medians, &measured.medians(*other));
                ratio.map_or_else(|| "–".to_owned(), |ratio| format!("{:.2}", ratio.median))
            }));
            row
        };
        self.table(&header, &cases.iter().map(row).collect::<Vec<_>>());
    }

    /// Adds a table of figures, medians of the rounds: a row for each process of each case, and a column for each
    /// quantity.
    pub fn figures<C: Copy + PartialEq + Display>(
        &mut self,
        measured: &Measured<C>,
        rows: &[(C, &'static str)],
        quantities: &[&'static str],
    ) {
        let row = |(case, process): &(C, &'static str)| {
            let cell = |quantity: &&'static str| {
                let values = measured.figures(*case, process, quantity);
                figure(quantity, median(&values).unwrap_or_default())
            };
            std::iter::once(format!("{process}, {case}"))
                .chain(quantities.iter().map(cell))
                .collect()
        };
        let header = [&["process"][..], quantities].concat();
        self.table(&header, &rows.iter().map(row).collect::<Vec<_>>());
    }

    /// Adds a plot, which is a file beside the Markdown file.
    pub fn plot(&mut self, file: &str, description: &str, svg: String) {
        self.blocks.push(format!("![{description}]({file})"));
        self.plots.push((file.to_owned(), svg));
    }

    /// Adds a goal; they make one table at the end. `ratio` is `None` when a peer was not measured.
    pub fn goal(&mut self, what: impl Into<String>, bound: Bound, ratio: Option<Ratio>) {
        self.goals.push(goal(what.into(), bound, ratio));
    }

    /// Prints the section, and writes it into the folder `out` if there is one.
    ///
    /// # Errors
    /// The folder cannot be written.
    pub fn publish(mut self, out: Option<&Path>) -> Result<()> {
        if !self.goals.is_empty() {
            let header = ["figure", "goal", "measured", "least … most", ""];
            self.blocks.push(table(&header, &self.goals));
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

/// What the figures depend on: processor and kernel. Nothing that tells whose machine it is.
fn machine() -> String {
    let release = fs::read_to_string("/proc/sys/kernel/osrelease").unwrap_or_default();
    let cpus = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let mut fields = cpus.lines().filter_map(|line| line.split_once(':'));
    let model = fields.find(|(name, _)| name.trim() == "model name");
    let model = model.map_or("unknown processor", |(_, model)| model.trim());
    let cores = std::thread::available_parallelism().map_or(0, usize::from);
    let kind = match cpus.contains(" hypervisor") {
        true => ", virtual",
        false => "",
    };
    let kernel = release.split(['-', '+']).next().unwrap_or_default().trim();
    format!("{model}, {cores} cores{kind}, Linux {kernel}")
}

/// Nanoseconds as microseconds with three digits.
pub fn us(ns: f64) -> String {
    match ns / 1000.0 {
        us if us < 10.0 => format!("{us:.2}"),
        us if us < 100.0 => format!("{us:.1}"),
        us => format!("{us:.0}"),
    }
}

/// The percentiles of the tables, µs.
pub fn percentiles(times: &Times) -> [String; 3] {
    PERCENTILES.map(|(_, fraction)| us(times.quantile_ns(fraction)))
}

fn figure(quantity: &str, value: f64) -> String {
    match quantity {
        CPU => format!("{value:.2}"),
        _ => format!("{value:.0}"),
    }
}

fn goal(what: String, bound: Bound, ratio: Option<Ratio>) -> Vec<String> {
    let (goal, holds): (String, Box<dyn Fn(f64) -> bool>) = match bound {
        Bound::AtMost(most) => (format!("≤ {most}"), Box::new(move |value| value <= most)),
        Bound::AtLeast(least) => (format!("≥ {least}"), Box::new(move |value| value >= least)),
    };
    let [measured, spread, met] = match ratio {
        Some(ratio) => [
            format!("{:.2}", ratio.median),
            format!("{:.2} … {:.2}", ratio.least, ratio.most),
            if holds(ratio.median) {
                "reached"
            } else {
                "**missed**"
            }
            .to_owned(),
        ],
        None => ["–", "–", "not measured"].map(str::to_owned),
    };
    vec![what, goal, measured, spread, met]
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
        let met = |bound, value: Option<f64>| {
            let ratio = value.and_then(|value| Ratio::of_values(&[value]));
            goal("x".to_owned(), bound, ratio)[4].clone()
        };
        for (bound, value, expected) in [
            (Bound::AtMost(0.75), Some(0.75), "reached"),
            (Bound::AtMost(0.75), Some(0.76), "**missed**"),
            (Bound::AtLeast(2.0), Some(2.1), "reached"),
            (Bound::AtLeast(2.0), Some(1.9), "**missed**"),
            (Bound::AtMost(1.0), None, "not measured"),
        ] {
            assert_eq!(met(bound, value), expected, "{bound:?} {value:?}");
        }
    }

    #[test]
    fn microseconds_have_three_digits() {
        let shown = [940.0, 12_340.0, 123_456.0].map(us);
        assert_eq!(shown, ["0.94", "12.3", "123"]);
    }
}
