//! What is in the shared memory of a user: its robots, their live providers, and what dead processes left. Nothing is
//! joined.
//!
//! Each look happens on a thread of its own and is given up at a deadline, because whatever stands in the place of a
//! file, such as a pipe or a file system that does not answer, may keep a process that opens it waiting without end.

use std::convert::Infallible;
use std::error::Error;
use std::fmt;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::thread;
use std::time::{Duration, Instant};

use ipc_types::inspect::{Entry, Inspection, Life};
use ipc_types::service::SERVICES;
use ipc_types::{Domain, DomainError, Provider, RobotId, ServiceId};
use runtime::duration::DurationText;
use runtime::exit::Failure;

/// How long looks may take that begin together. They take milliseconds; a machine that is overloaded a thousand times
/// is still waited for.
pub const LOOK_TIMEOUT: Duration = Duration::from_secs(5);

/// The directory that shows processes and what they have open.
pub const PROC: &str = "/proc";

/// What a look found, or why it found nothing.
pub type Look<T> = Result<T, Trouble>;

/// Why a look found nothing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// It took longer than this and was given up: something stands in the way that keeps the looking process waiting.
    TookTooLong(Duration),
    /// It failed.
    Failed(String),
}

impl fmt::Display for Trouble {
    /// The end of a sentence that begins with what was looked at.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Trouble::TookTooLong(limit) => write!(f, "was given up after {}", DurationText(*limit)),
            Trouble::Failed(reason) => write!(f, "failed: {reason}"),
        }
    }
}

/// Shared memory.
#[derive(Clone, Debug, PartialEq)]
pub struct DomainFacts {
    /// The folder of the domain.
    pub root: PathBuf,
    /// What is there.
    pub inspection: Look<Inspection>,
    /// The live providers of all robots of the domain.
    pub providers: Look<Vec<Provided>>,
    /// Live processes that do not run because they are stopped.
    pub stopped: Vec<u32>,
    /// The domains of other users in the usual place.
    pub others: Vec<Entry>,
}

/// A service that a live process provides.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Provided {
    /// Of which robot.
    pub robot: RobotId,
    /// Which service.
    pub service: ServiceId,
    /// The process.
    pub by: Provider,
    /// Its PID namespace: elsewhere than in this one its process id means nothing.
    pub pids: Namespace,
    /// Its time namespace: elsewhere than in this one its times mean other moments.
    pub clock: Namespace,
}

/// The namespace of another process, beside the one of this process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Namespace {
    /// The namespace of this process.
    Ours,
    /// A namespace other than this process'.
    Other,
    /// The other process did not say.
    Unknown,
}

/// A look that goes on in the background.
pub struct Looking<T> {
    found: Receiver<Look<T>>,
    began: Instant,
}

impl<T: Send + 'static> Looking<T> {
    /// Begins a look that cannot fail.
    pub fn start(look: impl FnOnce() -> T + Send + 'static) -> Looking<T> {
        Looking::attempt(move || Ok::<T, Infallible>(look()))
    }

    /// Begins a look that may fail.
    pub fn attempt<E: Into<Box<dyn Error + Send + Sync>>>(
        look: impl FnOnce() -> Result<T, E> + Send + 'static,
    ) -> Looking<T> {
        let (sender, found) = mpsc::sync_channel(1);
        // When there is no thread the sender is gone at once, and `end` says so. A look that is given up keeps its
        // thread; it ends with the process.
        let _ = thread::Builder::new().spawn(move || {
            let failed = |error| Trouble::Failed(Failure::internal(error).chain().join(": "));
            let _ = sender.send(look().map_err(failed));
        });
        let began = Instant::now();
        Looking { found, began }
    }

    /// What it found by the time that `timeout` is over, counted from its start.
    pub fn end(self, timeout: Duration) -> Look<T> {
        let left = timeout.saturating_sub(self.began.elapsed());
        match self.found.recv_timeout(left) {
            Ok(found) => found,
            Err(RecvTimeoutError::Timeout) => Err(Trouble::TookTooLong(timeout)),
            Err(RecvTimeoutError::Disconnected) => Err(Trouble::Failed("it broke off".to_owned())),
        }
    }
}

impl DomainFacts {
    /// Looks at the domain, at the providers in it, and at the domains of other users.
    pub fn look(domain: &Domain) -> DomainFacts {
        let (inspected, asked) = (domain.clone(), domain.clone());
        let inspection = Looking::start(move || inspected.inspect());
        let providers = Looking::attempt(move || providers(&asked));
        let others = Looking::start(Domain::others);
        let inspection = inspection.end(LOOK_TIMEOUT);
        let providers = providers.end(LOOK_TIMEOUT);
        let stopped = match (&inspection, &providers) {
            (Ok(inspection), Ok(providers)) => stopped(domain.root(), inspection, providers),
            _ => Vec::new(),
        };
        DomainFacts {
            root: domain.root().to_owned(),
            inspection,
            providers,
            stopped,
            // They are only a hint; what keeps this look from its end is reported for the memory.
            others: others.end(LOOK_TIMEOUT).unwrap_or_default(),
        }
    }
}

/// Number and path of everything that a process has open.
pub fn open_files(process: &Path) -> io::Result<Vec<(u32, PathBuf)>> {
    let entries = fs::read_dir(process.join("fd"))?.flatten();
    let open = entries.filter_map(|entry| {
        let number = entry.file_name().to_str()?.parse().ok()?;
        Some((number, fs::read_link(entry.path()).ok()?))
    });
    Ok(open.collect())
}

/// The live providers of all robots.
fn providers(domain: &Domain) -> Result<Vec<Provided>, DomainError> {
    let mut provided = Vec::new();
    for spec in &SERVICES {
        for robot in domain.robots(spec.contract.key)? {
            let Some(by) = domain.provider(robot, spec.contract.key)? else {
                continue;
            };
            provided.push(Provided {
                robot,
                service: spec.id,
                pids: namespace(by.pid_namespace, by.shares_pids()),
                clock: namespace(by.time_namespace, by.shares_clock()),
                by,
            });
        }
    }
    Ok(provided)
}

fn namespace(number: u64, is_ours: bool) -> Namespace {
    match (is_ours, number) {
        (true, _) => Namespace::Ours,
        (false, 0) => Namespace::Unknown,
        (false, _) => Namespace::Other,
    }
}

/// Live processes of the domain that are stopped.
///
/// A member does not say in which PID namespace its process id means something; its provider does, and where the
/// provider is in another one, so are perhaps the others of its service. What is then left must have something of the
/// domain open: the operator may kill it, and must not be led to a process that happens to have the same number.
fn stopped(root: &Path, inspection: &Inspection, providers: &[Provided]) -> Vec<u32> {
    let mut pids = Vec::new();
    for robot in &inspection.robots {
        let is_elsewhere = |service: &str| {
            providers.iter().any(|provided| {
                provided.robot == robot.robot
                    && provided.service.key() == service
                    && provided.pids != Namespace::Ours
            })
        };
        let members = robot.members.iter();
        pids.extend(
            members
                .filter(|member| member.life == Life::Live && !is_elsewhere(&member.service))
                .map(|member| member.pid),
        );
    }
    pids.sort_unstable();
    pids.dedup();
    pids.retain(|pid| {
        let process = Path::new(PROC).join(pid.to_string());
        let stat = fs::read_to_string(process.join("stat"));
        stat.is_ok_and(|stat| is_stopped(&stat)) && may_use(root, &process)
    });
    pids
}

/// Whether a process has something beneath `root` open. One that keeps its files to itself may have.
fn may_use(root: &Path, process: &Path) -> bool {
    match open_files(process) {
        Ok(open) => open.iter().any(|(_, path)| path.starts_with(root)),
        Err(_) => true,
    }
}

/// Whether `/proc/PID/stat` is that of a process that is stopped or being traced.
fn is_stopped(stat: &str) -> bool {
    // The program's name, in parentheses, may have any character in it.
    let state = stat.rsplit(')').next().unwrap_or_default().trim_start();
    state.starts_with(['T', 't'])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_look_that_does_not_come_back_is_given_up() {
        let (keeps_it_waiting, never) = mpsc::channel::<()>();
        let timeout = Duration::from_millis(10);
        let look = Looking::start(move || never.recv());
        let given_up = Err(Trouble::TookTooLong(timeout));
        assert_eq!(look.end(timeout), given_up);
        drop(keeps_it_waiting);
        let look = Looking::start(|| 7);
        assert_eq!(look.end(LOOK_TIMEOUT), Ok(7));
    }

    #[test]
    fn the_state_of_a_process_is_read_behind_its_name() {
        for (stat, expected) in [
            ("7 (ril) T 1 7 7", true),
            ("7 (ril) t 1 7 7", true),
            ("7 (ril) S 1 7 7", false),
            ("7 (a) T) R 1 7 7", false),
            ("", false),
        ] {
            assert_eq!(is_stopped(stat), expected, "{stat}");
        }
    }
}
