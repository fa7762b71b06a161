//! Processes in namespaces of their own that share the memory, as containers with one `/dev/shm` do: the same process
//! numbers, other clocks, and other mounts. And those that do not share it, or are of another user: what do they say?

use std::fmt;
use std::fs;
use std::os::unix::fs::chown;
use std::path::Path;
use std::process::Command;

use ril_tests::Process;

use crate::crew::{Site, end, start_chain};
use crate::memory;

/// Starts at the same moment, half of them in each kind of namespace.
const TOGETHER: u32 = 6;

/// How far the monotonic clock of another container is ahead, s.
const AHEAD_S: i64 = 100_000;

/// Mounts a file system of its own over a folder, and becomes the program. `$1` is the folder.
const MOUNT: &str = "mount -t tmpfs tmpfs \"$1\" && shift && exec \"$@\"\n";

/// A user that need not exist by name.
const OTHER_USER: u32 = 65_533;

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
        let consumer = |_| site.start_by(&starter, "echo hero --count 3 --timeout 20s");
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

/// Starts a consumer with mounts of its own and the common `/dev/shm`, and commands with a `/dev/shm` of their own, which must find no
/// robot and disturb none; or nothing when the kernel forbids it.
///
/// # Panics
///
/// When a command hangs, or when something is left.
pub fn other_mounts(site: &Site) -> Option<Outcome> {
    let starter = starter("-m")?;
    site.write("mount.sh", MOUNT);
    let [sim, bridge, status] = start_chain(site);
    let mut outcome = Outcome::default();
    let mut expect = |starter: &str, args: &str, code: i32, text: &str| {
        let finished = match starter {
            "" => site.run(args),
            starter => site.start_by(starter, args).wait_exit(),
        };
        let words = finished.stderr.join(", ");
        if finished.code() != Some(code) || !words.contains(text) {
            let code = finished.code();
            outcome.failures.push(format!("{args}: {code:?}: {words}"));
        }
        outcome.starts += 1;
    };
    expect(&starter, "echo hero --count 3 --timeout 20s", 0, "");
    let own = format!("{starter} sh mount.sh /dev/shm");
    let root = site.domain.root().display();
    let nobody = format!("no robot is alive in {root}");
    expect(&own, "status --timeout 1s", 3, &nobody);
    expect(&own, "takeoff --altitude 5", 3, &nobody);
    expect(&own, "echo hero --duration 1s", 3, &nobody);
    expect("", "echo hero --count 3 --timeout 20s", 0, "");
    [status, bridge, sim].into_iter().for_each(end);
    site.domain.assert_empty();
    Some(outcome)
}

/// Runs commands where only another user has a domain: they must name it. Nothing when this user cannot make one.
///
/// # Panics
///
/// When this is not in a `/dev/shm` of its own.
pub fn other_users(site: &Site) -> Option<Outcome> {
    assert!(
        memory::is_own(),
        "it would be in the place of a real user's domain"
    );
    let path = Path::new("/dev/shm").join(format!("hero{OTHER_USER}"));
    fs::create_dir(&path).expect("a folder");
    if let Err(error) = chown(&path, Some(OTHER_USER), None) {
        eprintln!("SKIPPED: a domain of another user cannot be made: {error}");
        return None;
    }
    let mut outcome = Outcome::default();
    for (args, code) in [("status --timeout 1s", 3), ("land", 3), ("doctor", 0)] {
        let finished = site.run(args);
        let mut words = finished.stdout.join(" ");
        words += &finished.stderr.join(" ");
        let looked_at = site.domain.root().display().to_string();
        let way = format!("sudo -u '#{OTHER_USER}' ril");
        let expected = [looked_at, path.display().to_string(), way];
        let is_told = expected.iter().all(|text| words.contains(text));
        if finished.code() != Some(code) || !is_told {
            let code = finished.code();
            outcome.failures.push(format!("{args}: {code:?}: {words}"));
        }
        outcome.starts += 1;
    }
    fs::remove_dir(path).expect("it is empty");
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
            .start_by(&starter, "echo hero --count 3 --timeout 10s")
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
