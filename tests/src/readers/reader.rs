//! The readers as programs, and what they print.

use std::fmt;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::languages::root;

use super::expected::{Line, Read};
use super::sums::Sums;

/// A reader.
#[derive(Clone, Debug)]
pub enum Reader {
    /// One of `read.py`.
    Python {
        /// With the packages.
        interpreter: PathBuf,
        /// Of the package that reads.
        name: &'static str,
    },
    /// One of `read.mjs`.
    Node {
        /// The folder with `node_modules`.
        packages: PathBuf,
        /// How it reads: `indexed` or `stream`.
        name: &'static str,
    },
}

impl fmt::Display for Reader {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Reader::Python { name, .. } => write!(f, "{name} in Python"),
            Reader::Node { name, .. } => write!(f, "@mcap/core, {name}"),
        }
    }
}

impl Reader {
    /// Whether it is the one with which programs of its language are run once.
    pub fn is_first_of_its_language(&self) -> bool {
        let (Reader::Python { name, .. } | Reader::Node { name, .. }) = self;
        matches!(*name, "mcap" | "indexed")
    }

    /// Whether it opens files without a summary. The one of `@mcap/core` that uses the index says that it does not.
    pub fn reads_unfinished(&self) -> bool {
        !matches!(
            self,
            Reader::Node {
                name: "indexed",
                ..
            }
        )
    }

    /// Whether it complains when bytes follow the file's end.
    pub fn goes_on_behind_the_end(&self) -> bool {
        matches!(self, Reader::Node { .. })
    }

    /// Whether it does not open such a file at all.
    pub fn needs_nothing_behind_the_end(&self) -> bool {
        matches!(
            self,
            Reader::Python {
                name: "rosbags",
                ..
            }
        )
    }

    /// Whether others wrote it.
    pub fn is_of_others(&self) -> bool {
        !matches!(
            self,
            Reader::Python {
                name: "hero_ril",
                ..
            }
        )
    }

    /// Reads files: every field of every message.
    ///
    /// # Panics
    ///
    /// When the program fails.
    #[track_caller]
    pub fn read(&self, files: &[&Path]) -> Vec<Read> {
        let output = self.run(None, files);
        let reads = parse(&output);
        assert_eq!(reads.len(), files.len(), "{self}: {output}");
        reads
    }

    /// Reads files with one process, and sums up what is in each. Only readers of others can.
    ///
    /// # Panics
    ///
    /// When the program fails.
    #[track_caller]
    pub fn sums(&self, files: &[&Path]) -> Vec<Sums> {
        let output = self.run(Some("--sums"), files);
        let sums = Sums::parse(&output);
        assert_eq!(sums.len(), files.len(), "{self}: {output}");
        sums
    }

    /// What the reader's program prints.
    #[track_caller]
    fn run(&self, option: Option<&str>, files: &[&Path]) -> String {
        let here = root().join("tests/src/readers");
        let mut command = match self {
            Reader::Python { interpreter, name } => {
                let mut command = Command::new(interpreter);
                command.arg("-B").arg(here.join("read.py")).arg(name);
                command
            }
            Reader::Node { packages, name } => {
                let mut command = Command::new("node");
                command.arg(here.join("read.mjs")).arg(packages).arg(name);
                command
            }
        };
        command.env("HERO_RIL_SOURCE", package());
        command.args(option).args(files);
        let output = command
            .output()
            .unwrap_or_else(|error| panic!("{self}: {error}"));
        let problems = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{self}: {problems}");
        String::from_utf8(output.stdout).unwrap()
    }
}

/// The package `hero_ril`, whose compiled part a flight does not need.
pub fn package() -> PathBuf {
    root().join("bindings/python/python/hero_ril")
}

/// What a program has printed, file by file.
fn parse(output: &str) -> Vec<Read> {
    let mut reads: Vec<Read> = Vec::new();
    for line in output.lines() {
        let mut words = line.split('\t');
        let kind = words.next();
        if kind == Some("file") {
            reads.push(Read::default());
            continue;
        }
        let read = reads.last_mut().expect("a file first");
        let mut word = || words.next().unwrap_or_default();
        match kind {
            Some("message") => {
                let topic = word().to_owned();
                let [log_time, publish_time, sequence] = [word(), word(), word()].map(number);
                let line = Line {
                    log_time,
                    publish_time,
                    sequence: sequence.map(|sequence| sequence.try_into().unwrap()),
                    fields: words.map(str::to_owned).collect(),
                };
                read.messages.entry(topic).or_default().push(line);
            }
            Some("profile") => {
                let topic = word().to_owned();
                let numbers = [word(), word(), word()].map(|word| number(word).expect("a number"));
                read.profiles.entry(topic).or_default().push(numbers);
            }
            Some("error") => read.error = Some(word().to_owned()),
            _ => panic!("{line}"),
        }
    }
    reads
}

/// Nothing when the reader does not say.
fn number(word: &str) -> Option<u64> {
    match word {
        "-" => None,
        _ => Some(
            word.parse()
                .unwrap_or_else(|error| panic!("{word}: {error}")),
        ),
    }
}
