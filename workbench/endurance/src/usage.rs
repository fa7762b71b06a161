//! What measured processes use, and the machine that they are on.

use std::fs;

use ril_tests::Process;
use runtime::usage::Usage;

/// What a process that runs has used.
///
/// # Panics
///
/// When it has ended, or the kernel does not say.
pub fn usage_of(process: &Process) -> Usage {
    Usage::of(process.id()).expect("it runs")
}

/// Time on all processors of this machine so far, and how much of it nothing ran.
#[derive(Clone, Copy, Debug, Default)]
pub struct Machine {
    all: u64,
    idle: u64,
}

impl Machine {
    /// As of this moment.
    pub fn now() -> Machine {
        let stat = fs::read_to_string("/proc/stat").unwrap_or_default();
        let line = stat.lines().next().unwrap_or_default();
        // User, nice, system, idle, waiting for a disk, …
        let ticks: Vec<u64> = line
            .split_whitespace()
            .skip(1)
            .take(8)
            .filter_map(|ticks| ticks.parse().ok())
            .collect();
        Machine {
            all: ticks.iter().sum(),
            idle: ticks.iter().skip(3).take(2).sum(),
        }
    }

    /// The share of time since `before` in which nothing ran, percent.
    pub fn idle_percent(self, before: Machine) -> f64 {
        let all = self.all.saturating_sub(before.all).max(1);
        self.idle.saturating_sub(before.idle) as f64 / all as f64 * 100.0
    }
}
