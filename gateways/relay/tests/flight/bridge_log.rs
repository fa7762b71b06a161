//! [`BridgeLog`]: what bridges did, by what they logged about every request.

// The tests and the examples each use a part of it.
#![allow(dead_code)]

use std::collections::{BTreeMap, BTreeSet};

use ril_tests::process::Finished;

/// The logs of all bridges of one robot, in their order.
pub struct BridgeLog {
    pub lines: Vec<String>,
}

impl BridgeLog {
    /// Of these processes.
    pub fn of<'a>(bridges: impl IntoIterator<Item = &'a Finished>) -> BridgeLog {
        let lines = bridges
            .into_iter()
            .flat_map(|bridge| bridge.stderr.iter().cloned());
        BridgeLog {
            lines: lines.collect(),
        }
    }

    /// How many requests of this command came that were no repetition.
    pub fn begun(&self, command: &str) -> usize {
        let command = format!("command=\"{command}\"");
        let is_it = |line: &&String| line.contains(&command) && !line.contains("repeat=");
        self.lines.iter().filter(is_it).count()
    }

    /// Requests that a bridge accepted.
    pub fn accepted(&self) -> BTreeSet<u64> {
        self.counts().into_keys().collect()
    }

    /// Requests that bridges accepted more than once.
    pub fn executed_twice(&self) -> Vec<u64> {
        let twice = self.counts().into_iter().filter(|(_, count)| *count > 1);
        twice.map(|(request, _)| request).collect()
    }

    fn counts(&self) -> BTreeMap<u64, usize> {
        let mut counts = BTreeMap::new();
        for line in &self.lines {
            if line.contains("stage=\"accepted\"")
                && let Some(request) = field(line, "request")
            {
                *counts.entry(request).or_insert(0) += 1;
            }
        }
        counts
    }
}

/// A number of a line of the log.
fn field(line: &str, name: &str) -> Option<u64> {
    let rest = line.split_once(&format!("{name}="))?.1;
    let digits = rest.split(|letter: char| !letter.is_ascii_digit()).next();
    digits?.parse().ok()
}
