//! Processes in namespaces of their own that share the memory, as containers with one `/dev/shm` do: the same process
//! numbers, and other clocks.

use std::fmt;
use std::fs;
use std::process::Command;

use ril_tests::Process;

use crate::crew::{Site, end, start_chain};

/// Starts at the same moment, half of them in each kind of namespace.
const TOGETHER: u32 = 6;

/// How far the monotonic clock of another container is ahead, s.
const AHEAD_S: i64 = 100_000;

/// What to do.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    /// How many consumers start in process namespaces.
    pub starts: u32,
}

/// What came of it.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// How many started with process numbers of their own.
    pub starts: u32,
    /// What those said that did not get a sample.
    pub failures: Vec<String>,
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "| {} starts, {} failed | ",
            self.starts,
            self.failures.len()
        )?;
        for failure in self.failures.iter().take(3) {
            write!(f, "{failure}; ")?;
        }
        f.write_str("|")
    }
}

/// The beginning of a command line that makes a namespace, or nothing when the kernel forbids it; the reason is printed.
fn starter(flags: &str) -> Option<String> {
    // Who is not root becomes root of a user namespace first.
    let user = match rustix::process::geteuid().is_root() {
        true => "",
        false => "-r ",
    };
    let starter = format!("unshare {user}{flags} --fork --kill-child");
    let mut words = starter.split_whitespace();
    let program = words.next()?;
    let attempt = Command::new(program).args(words).arg("true").output();
    if attempt.as_ref().is_ok_and(|output| output.status.success()) {
        return Some(starter);
    }
    eprintln!("SKIPPED: no namespace of its own: {attempt:?}");
    None
}

/// Starts consumers that all are the same process number, or nothing when the kernel forbids it.
///
/// # Panics
///
/// When a consumer hangs, or when something is left.
pub fn same_numbers(site: &Site, plan: &Plan, goes_on: &dyn Fn() -> bool) -> Option<Outcome> {
    let starter = starter("-p --mount-proc")?;
    let [sim, bridge, status] = start_chain(site);
    let mut outcome = Outcome::default();
    while outcome.starts < plan.starts && goes_on() {
        let consumer = |_| site.start_by(&starter, "echo hero --count 3 --timeout 20");
        let mut consumers: Vec<Process> = (0..TOGETHER).map(consumer).collect();
        for consumer in &mut consumers {
            let finished = consumer.wait_exit();
            if finished.code() != Some(0) {
                let code = finished.code();
                outcome
                    .failures
                    .push(format!("{code:?}: {}", finished.stderr.join(", ")));
            }
        }
        outcome.starts += TOGETHER;
    }
    [status, bridge, sim].into_iter().for_each(end);
    site.domain.sweep();
    Some(outcome)
}

/// Starts consumers whose clocks are ahead of the bridge's, and behind, or nothing when the kernel forbids it.
///
/// # Panics
///
/// When a consumer hangs, or when something is left.
pub fn other_clocks(site: &Site) -> Option<Outcome> {
    let uptime = fs::read_to_string("/proc/uptime").ok()?;
    let uptime_s: f64 = uptime.split(' ').next()?.parse().ok()?;
    let behind_s = -(uptime_s as i64) / 2;
    let starters = [AHEAD_S, behind_s].map(|offset_s| {
        let starter = starter(&format!("-T --monotonic={offset_s}"))?;
        Some((offset_s, starter))
    });
    let [ahead, behind] = starters;
    let starters = [ahead?, behind?];
    let [sim, bridge, status] = start_chain(site);
    let mut outcome = Outcome::default();
    for (offset_s, starter) in starters {
        let consumer = site
            .start_by(&starter, "echo hero --count 3 --timeout 10")
            .wait_exit();
        if consumer.code() != Some(0) {
            let (code, words) = (consumer.code(), consumer.stderr.join(", "));
            outcome
                .failures
                .push(format!("{offset_s} s: {code:?}: {words}"));
        }
        outcome.starts += 1;
    }
    [status, bridge, sim].into_iter().for_each(end);
    site.domain.sweep();
    Some(outcome)
}
