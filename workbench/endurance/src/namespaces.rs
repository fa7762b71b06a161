//! Processes in namespaces of their own that share the memory, as containers with one `/dev/shm` do: the same process
//! numbers, other clocks, and other mounts. And those that do not share it, or are of another user: what do they say?

use std::fs;
use std::os::unix::fs::chown;
use std::path::Path;
use std::process::Command;

use ril_tests::process::Finished;

use crate::memory;
use crate::outcome::Outcome;
use crate::plan::Plan;
use crate::site::Site;

/// Starts at the same moment, half of them in each kind of namespace.
const TOGETHER: usize = 6;

/// How far the monotonic clock of another container is ahead, s.
const AHEAD_S: i64 = 100_000;

/// Mounts a file system of its own over a folder, and becomes the program. `$1` is the folder.
const MOUNT: &str = "mount -t tmpfs tmpfs \"$1\" && shift && exec \"$@\"\n";

/// A user that need not exist by name.
const OTHER_USER: u32 = 65_533;

/// Counts what was tried, and notes what went wrong.
#[derive(Default)]
struct Tried {
    count: u32,
    outcome: Outcome,
}

impl Tried {
    /// A command must have this exit code, and say all of `texts`.
    fn expect(&mut self, args: &str, finished: &Finished, code: i32, texts: &[&str]) {
        let words = format!(
            "{} {}",
            finished.stdout.join(" "),
            finished.stderr.join(" ")
        );
        let is_right =
            finished.code() == Some(code) && texts.iter().all(|text| words.contains(text));
        let found = finished.code();
        self.count += 1;
        self.outcome
            .require(is_right, format!("{args}: {found:?}: {words}"));
    }

    fn end(mut self, what: &'static str) -> Option<Outcome> {
        self.outcome.cell(what, self.count);
        Some(self.outcome)
    }
}

/// What a consumer does that must get samples.
const CONSUMER: &str = "echo hero --count 3 --timeout 20s";

/// The beginning of a command line that makes a namespace, `None` when the kernel forbids it; the reason is printed.
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

/// Starts consumers that all are the same process number; `None` when the kernel forbids it.
///
/// # Panics
///
/// When a consumer hangs, or when something is left.
pub fn same_numbers(site: &Site, plan: &Plan, goes_on: &dyn Fn() -> bool) -> Option<Outcome> {
    let starter = starter("-p --mount-proc")?;
    let chain = site.start_chain();
    let mut tried = Tried::default();
    while tried.count < plan.count.unwrap_or(600) && goes_on() {
        let consumers = [(); TOGETHER].map(|()| site.start_by(&starter, CONSUMER));
        for mut consumer in consumers {
            tried.expect(CONSUMER, &consumer.wait_exit(), 0, &[]);
        }
    }
    site.end(chain, true);
    tried.end("consumers of the same process number")
}

/// Starts a consumer with mounts of its own and the common `/dev/shm`, and commands with a `/dev/shm` of their own, which must find no
/// robot and disturb none; `None` when the kernel forbids it.
///
/// # Panics
///
/// When a command hangs, or when something is left.
pub fn other_mounts(site: &Site) -> Option<Outcome> {
    let starter = starter("-m")?;
    site.write("mount.sh", MOUNT);
    let chain = site.start_chain();
    let mut tried = Tried::default();
    let own = format!("{starter} sh mount.sh /dev/shm");
    let none = format!("no robot is alive in {}", site.domain.root().display());
    let none = none.as_str();
    for (starter, args, code, text) in [
        (&starter, CONSUMER, 0, ""),
        (&own, "status --timeout 1s", 3, none),
        (&own, "takeoff --altitude 5 --timeout 1s", 3, none),
        (&own, "echo hero --duration 1s --timeout 1s", 3, none),
    ] {
        let finished = site.start_by(starter, args).wait_exit();
        tried.expect(args, &finished, code, &[text]);
    }
    tried.expect(CONSUMER, &site.finish(CONSUMER), 0, &[]);
    site.end(chain, false);
    tried.end("commands with mounts of their own")
}

/// Runs commands where only another user has a domain: they must name it. `None` when this user cannot make one.
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
    let mut tried = Tried::default();
    let looked_at = site.domain.root().display().to_string();
    let other = path.display().to_string();
    let way = format!("sudo -u '#{OTHER_USER}' ril");
    for (args, code) in [("status --timeout 1s", 3), ("land", 3), ("doctor", 0)] {
        let expected = [&looked_at, &other, &way].map(String::as_str);
        tried.expect(args, &site.finish(args), code, &expected);
    }
    fs::remove_dir(path).expect("it is empty");
    tried.end("commands of another user")
}

/// Starts consumers whose clocks are ahead of the bridge's, and behind; `None` when the kernel forbids it.
///
/// # Panics
///
/// When a consumer hangs, or when something is left.
pub fn other_clocks(site: &Site) -> Option<Outcome> {
    let uptime = fs::read_to_string("/proc/uptime").ok()?;
    let uptime_s: f64 = uptime.split(' ').next()?.parse().ok()?;
    let behind_s = -(uptime_s as i64) / 2;
    let starters =
        [AHEAD_S, behind_s].map(|offset_s| starter(&format!("-T --monotonic={offset_s}")));
    let [ahead, behind] = starters;
    let starters = [ahead?, behind?];
    let chain = site.start_chain();
    let mut tried = Tried::default();
    for starter in starters {
        let finished = site.start_by(&starter, CONSUMER).wait_exit();
        tried.expect(&starter, &finished, 0, &[]);
    }
    site.end(chain, true);
    tried.end("consumers with another clock")
}
