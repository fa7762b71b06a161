//! [`Usage`]: what processes use: time on processors, memory and files, as the kernel counts them.

use std::collections::BTreeMap;
use std::fs;
use std::time::{Duration, Instant};

use ril_tests::Process;

/// What a process has used up to a moment, and holds then.
#[derive(Clone, Debug)]
pub struct Usage {
    at: Instant,
    /// Time on processors of each thread that it has.
    busy: BTreeMap<u32, Duration>,
    /// Memory, MiB; what several processes share counts for each in part.
    pub memory_mib: f64,
    /// Open files.
    pub files: usize,
}

/// What a process has used between two moments, percent of one processor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    /// All its threads.
    pub all_percent: f64,
    /// The thread that has used most: at 100 the process can do no more, however many processors there are.
    pub busiest_percent: f64,
}

impl Usage {
    /// Of a process that runs.
    ///
    /// # Panics
    ///
    /// When it has ended.
    pub fn of(process: &Process) -> Usage {
        let folder = format!("/proc/{}", process.id());
        let entries = |name: &str| {
            let entries = fs::read_dir(format!("{folder}/{name}")).expect("it runs");
            entries.flatten()
        };
        let busy = entries("task").filter_map(|thread| {
            // A thread may end at this moment.
            let schedule = fs::read_to_string(thread.path().join("schedstat")).ok()?;
            let number = thread.file_name().to_str()?.parse().ok()?;
            let busy_ns = schedule.split_whitespace().next()?.parse().ok()?;
            Some((number, Duration::from_nanos(busy_ns)))
        });
        let rollup = fs::read_to_string(format!("{folder}/smaps_rollup")).unwrap_or_default();
        Usage {
            at: Instant::now(),
            busy: busy.collect(),
            memory_mib: pss_kib(&rollup) as f64 / 1024.0,
            files: entries("fd").count(),
        }
    }

    /// What it has used since `before`.
    pub fn since(&self, before: &Usage) -> Load {
        let seconds = self.at.duration_since(before.at).as_secs_f64();
        let threads = self.busy.iter().map(|(thread, busy)| {
            let before = before.busy.get(thread).copied().unwrap_or_default();
            busy.saturating_sub(before).as_secs_f64() / seconds * 100.0
        });
        let threads: Vec<f64> = threads.collect();
        Load {
            all_percent: threads.iter().sum(),
            busiest_percent: threads.into_iter().fold(0.0, f64::max),
        }
    }
}

/// From `/proc/N/smaps_rollup`; 0 where the kernel does not say.
fn pss_kib(rollup: &str) -> u64 {
    let line = rollup.lines().find_map(|line| line.strip_prefix("Pss:"));
    let number = line.and_then(|line| line.split_whitespace().next());
    number.and_then(|number| number.parse().ok()).unwrap_or(0)
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
