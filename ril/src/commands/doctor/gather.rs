//! Gathers the facts: a thin shell around the file system and `/proc` that decides nothing.
//!
//! Each look happens on a thread of its own and is given up at a deadline, because whatever stands in the place of a
//! file, such as a pipe or a file system that does not answer, may keep a process that opens it waiting without end. Nothing
//! is opened that could notice it: the serial port is only looked at from outside.

use std::fs;
use std::io;
use std::os::unix::fs::FileTypeExt;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::thread;
use std::time::{Duration, Instant};

use bridge::BridgeConfig;
use bridge::shell::serial::holders::{Holders, Terminal};
use bridge::shell::serial::permission_hint;
use ipc_types::inspect::{Inspection, Life};
use ipc_types::payload::RelayLink;
use ipc_types::service::SERVICES;
use ipc_types::{Domain, Ipc, MonotonicNs, Repair, RobotId, Subscriber, Topic};
use runtime::config::load;
use runtime::exit::Failure;
use rustix::fs::Access;
use serde::de::DeserializeOwned;

use super::facts::{
    Device, DomainFacts, FileContent, FileFacts, FreeMemory, LinkFacts, Look, Namespace, PortFacts,
    PortHolders, Provided, Trouble,
};
use crate::cli::DoctorArgs;

/// How long looks may take that begin together. They take milliseconds; a machine that is overloaded a thousand times
/// is still waited for.
pub(super) const LOOK_PATIENCE: Duration = Duration::from_secs(5);

/// How long a sample of the relay's link is waited for, which is published once a second: twice that.
const LINK_PATIENCE: Duration = Duration::from_secs(2);

/// How long a repair may take. It takes a fraction of a millisecond for each file that it deletes. A repair that is given
/// up ends with this process, as if killed: what it had set aside for deletion, the next start or repair deletes.
const REPAIR_PATIENCE: Duration = Duration::from_secs(15);

/// The directory that shows processes and what they have open.
const PROC: &str = "/proc";

/// Where shared memory lies.
const SHARED_MEMORY: &str = "/dev/shm";

/// A look that goes on in the background.
pub(super) struct Looking<T>(Receiver<T>);

impl<T: Send + 'static> Looking<T> {
    pub(super) fn start(look: impl FnOnce() -> T + Send + 'static) -> Looking<T> {
        let (sender, receiver) = mpsc::sync_channel(1);
        // When there is no thread the sender is gone at once, and `end` says so. A look that is given up keeps its
        // thread; it ends with the process.
        let _ = thread::Builder::new().spawn(move || {
            let _ = sender.send(look());
        });
        Looking(receiver)
    }

    /// What it found by the time that `timeout` is over, counted from `began`.
    pub(super) fn end(self, began: Instant, timeout: Duration) -> Look<T> {
        let left = timeout.saturating_sub(began.elapsed());
        self.0.recv_timeout(left).map_err(|error| match error {
            RecvTimeoutError::Timeout => Trouble::TookTooLong(timeout),
            RecvTimeoutError::Disconnected => Trouble::Failed("it broke off".to_owned()),
        })
    }
}

/// Looks at the domain, at the providers in it, and at the domains of other users.
pub(super) fn domain(domain: &Domain) -> DomainFacts {
    let began = Instant::now();
    let (inspected, asked) = (domain.clone(), domain.clone());
    let inspection = Looking::start(move || inspected.inspect());
    let providers = Looking::start(move || providers(&asked));
    let others = Looking::start(Domain::others);
    let inspection = inspection.end(began, LOOK_PATIENCE);
    let providers = providers
        .end(began, LOOK_PATIENCE)
        .and_then(|result| result);
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
        others: others.end(began, LOOK_PATIENCE).unwrap_or_default(),
    }
}

/// Looks at the relay's link to `robot`; nothing when no process provides one here.
///
/// The state of a link is in the samples of the relay alone, so this look takes part in the shared memory for a moment.
pub(super) fn relay(domain: &Domain, robot: RobotId) -> Option<LinkFacts> {
    let began = Instant::now();
    let asked = domain.clone();
    let looking = Looking::start(move || latest_link(&asked, robot).map_err(failed));
    let link = match looking.end(began, LOOK_PATIENCE).and_then(|result| result) {
        Ok(None) => return None,
        Ok(Some(link)) => Ok(link),
        Err(trouble) => Err(trouble),
    };
    Some(LinkFacts {
        link,
        now: MonotonicNs::now(),
    })
}

/// What the relay says of its link now: the outer nothing when there is no relay, the inner one when it says nothing.
fn latest_link(
    domain: &Domain,
    robot: RobotId,
) -> Result<Option<Option<RelayLink>>, Box<dyn std::error::Error + Send + Sync>> {
    if !domain.robots(RelayLink::KEY)?.contains(&robot) {
        return Ok(None);
    }
    let ipc = Ipc::join(domain, robot, "ril")?;
    let mut links: Subscriber<RelayLink> = ipc.subscriber()?;
    let give_up = Instant::now() + LINK_PATIENCE;
    loop {
        if let Some(link) = links.latest()? {
            return Ok(Some(Some(link)));
        }
        let left = give_up.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Ok(Some(None));
        }
        links.wait(left)?;
    }
}

/// Removes what is certainly dead.
pub(super) fn repair(domain: &Domain) -> Look<Repair> {
    let domain = domain.clone();
    let repair = Looking::start(move || domain.repair().map_err(failed));
    repair
        .end(Instant::now(), REPAIR_PATIENCE)
        .and_then(|result| result)
}

/// What is free in `/dev/shm`.
pub(super) fn memory() -> Look<FreeMemory> {
    Looking::start(|| free_memory().map_err(failed))
        .end(Instant::now(), LOOK_PATIENCE)
        .and_then(|result| result)
}

fn free_memory() -> io::Result<FreeMemory> {
    let status = rustix::fs::statvfs(SHARED_MEMORY)?;
    Ok(FreeMemory {
        bytes: status.f_bavail.saturating_mul(status.f_frsize),
        // A file system without a limit of inodes has none in all.
        inodes: (status.f_files > 0).then_some(status.f_favail),
    })
}

/// Reads the configuration of each process with the process's own code. Says also what the bridge's is, if it is right.
pub(super) fn files(args: &DoctorArgs) -> (Vec<FileFacts>, Option<BridgeConfig>) {
    use crate::config as ril;
    let began = Instant::now();
    let bridge = Source::new(&args.bridge, bridge::cli::DEFAULT_CONFIG_FILE);
    let status = Source::new(&args.status, status::config::DEFAULT_FILE);
    let sim = Source::new(&args.sim, dsp_sim::config::DEFAULT_FILE);
    let own = Source::new(&args.common.config, ril::DEFAULT_FILE);
    let reading = bridge.start::<BridgeConfig>();
    let others = [
        (
            Some("status"),
            &status,
            status.start_check::<status::config::Config>(),
        ),
        (
            Some("sim"),
            &sim,
            sim.start_check::<dsp_sim::config::Config>(),
        ),
        (None, &own, own.start_check::<ril::Config>()),
    ];
    let (content, config) = match reading.end(began, LOOK_PATIENCE) {
        Ok((content, config)) => (Ok(content), config),
        Err(trouble) => (Err(trouble), None),
    };
    let mut files = vec![bridge.facts(Some("bridge"), content)];
    for (command, source, check) in others {
        files.push(source.facts(command, check.end(began, LOOK_PATIENCE)));
    }
    (files, config)
}

/// Where a configuration comes from.
struct Source {
    explicit: Option<PathBuf>,
    default: &'static str,
}

impl Source {
    fn new(explicit: &Option<PathBuf>, default: &'static str) -> Source {
        Source {
            explicit: explicit.clone(),
            default,
        }
    }

    fn start<T: DeserializeOwned + Default + Send + 'static>(
        &self,
    ) -> Looking<(FileContent, Option<T>)> {
        let (explicit, default) = (self.explicit.clone(), self.default);
        Looking::start(move || read(explicit.as_deref(), Path::new(default)))
    }

    fn start_check<T: DeserializeOwned + Default>(&self) -> Looking<FileContent> {
        let (explicit, default) = (self.explicit.clone(), self.default);
        Looking::start(move || read::<T>(explicit.as_deref(), Path::new(default)).0)
    }

    fn facts(&self, command: Option<&'static str>, content: Look<FileContent>) -> FileFacts {
        let default = || PathBuf::from(self.default);
        FileFacts {
            command,
            path: self.explicit.clone().unwrap_or_else(default),
            content,
        }
    }
}

/// What is in a configuration file, and its value if that is right.
fn read<T: DeserializeOwned + Default>(
    explicit: Option<&Path>,
    default: &Path,
) -> (FileContent, Option<T>) {
    match load::<T>(explicit, default) {
        Ok(loaded) if loaded.file.is_none() => (FileContent::Absent, Some(loaded.value)),
        Ok(loaded) => (FileContent::Right, Some(loaded.value)),
        Err(error) => {
            let words = Failure::from(error).chain().join(": ");
            (FileContent::Wrong(words), None)
        }
    }
}

/// Looks at a serial port, chosen or the default, and at the processes that have terminals open, `bridge` among them.
pub(super) fn port(path: PathBuf, is_chosen: bool, bridge: Option<u32>) -> PortFacts {
    let began = Instant::now();
    let (looked_at, held) = (path.clone(), path.clone());
    let device = Looking::start(move || device(&looked_at).map_err(failed));
    let holders = Looking::start(move || holders(&held, bridge).map_err(failed));
    PortFacts {
        path,
        is_chosen,
        device: device.end(began, LOOK_PATIENCE).and_then(|result| result),
        holders: holders.end(began, LOOK_PATIENCE).and_then(|result| result),
    }
}

/// What is at `path`, without opening it: that would raise the lines of a port, and an autopilot may restart on that.
fn device(path: &Path) -> io::Result<Device> {
    let metadata = match fs::metadata(path) {
        Ok(metadata) => metadata,
        Err(error) => {
            return match error.kind() {
                io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => Ok(Device::Missing),
                _ => Err(error),
            };
        }
    };
    let kind = metadata.file_type();
    if !kind.is_char_device() {
        let what = if kind.is_dir() {
            "a folder"
        } else if kind.is_fifo() {
            "a pipe"
        } else if kind.is_file() {
            "a file"
        } else {
            "something else"
        };
        return Ok(Device::Other(what));
    }
    if Terminal::new(path, &metadata).is_none() {
        return Ok(Device::Other("another kind of device"));
    }
    let may_open = rustix::fs::access(path, Access::READ_OK | Access::WRITE_OK).is_ok();
    Ok(Device::Terminal {
        forbidden: (!may_open).then(|| permission_hint(path)),
    })
}

/// The processes that use `port`, as the bridge sees them, and which terminals `bridge` has.
fn holders(port: &Path, bridge: Option<u32>) -> io::Result<PortHolders> {
    let terminal = fs::metadata(port)
        .ok()
        .and_then(|metadata| Terminal::new(port, &metadata));
    let of_port = match terminal {
        Some(terminal) => Holders::find(&terminal)?,
        None => Holders::default(),
    };
    // Another user's bridge keeps its files to itself.
    let open = bridge.and_then(|pid| open_files(&Path::new(PROC).join(pid.to_string())).ok());
    Ok(PortHolders {
        of_port,
        by_bridge: terminals(&open.unwrap_or_default()),
    })
}

/// Number and path of everything that a process has open.
fn open_files(process: &Path) -> io::Result<Vec<(u32, PathBuf)>> {
    let entries = fs::read_dir(process.join("fd"))?.flatten();
    let open = entries.filter_map(|entry| {
        let number = entry.file_name().to_str()?.parse().ok()?;
        Some((number, fs::read_link(entry.path()).ok()?))
    });
    Ok(open.collect())
}

/// The terminals among open files, but for the standard streams.
fn terminals(open: &[(u32, PathBuf)]) -> Vec<PathBuf> {
    let is_terminal = |path: &Path| {
        let name = path.as_os_str().as_encoded_bytes();
        name.starts_with(b"/dev/pts/") || name.starts_with(b"/dev/tty")
    };
    let mut found: Vec<PathBuf> = open
        .iter()
        .filter(|(number, path)| *number > 2 && is_terminal(path))
        .map(|(_, path)| path.clone())
        .collect();
    found.sort();
    found.dedup();
    found
}

/// The live providers of all robots.
fn providers(domain: &Domain) -> Look<Vec<Provided>> {
    let mut provided = Vec::new();
    for spec in &SERVICES {
        for robot in domain.robots(spec.contract.key).map_err(failed)? {
            let Some(by) = domain.provider(robot, spec.contract.key).map_err(failed)? else {
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
/// A member does not say in which PID namespace its process id means something; its provider does, and where the provider
/// is in another one, so are perhaps the others of its service. What is then left must have something of the domain open:
/// the operator may kill it, and must not be led to a process that happens to have the same number.
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

/// Whether `/proc/PID/stat` tells of a process that is stopped or being traced.
fn is_stopped(stat: &str) -> bool {
    // The program's name, in parentheses, may have any character in it.
    let state = stat.rsplit(')').next().unwrap_or_default().trim_start();
    state.starts_with(['T', 't'])
}

fn failed(error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Trouble {
    Trouble::Failed(Failure::internal(error).chain().join(": "))
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
        assert_eq!(look.end(Instant::now(), timeout), given_up);
        drop(keeps_it_waiting);
        let look = Looking::start(|| 7);
        assert_eq!(look.end(Instant::now(), LOOK_PATIENCE), Ok(7));
    }

    #[test]
    fn what_is_no_terminal_is_reported_without_opening_it() {
        let folder = std::env::temp_dir();
        let is = |path: &str| device(Path::new(path)).unwrap();
        assert_eq!(is("/dev/no-such-port"), Device::Missing);
        assert_eq!(is("/dev/null/port"), Device::Missing);
        assert_eq!(is(folder.to_str().unwrap()), Device::Other("a folder"));
        assert_eq!(is("/proc/self/stat"), Device::Other("a file"));
        assert!(matches!(
            is("/dev/null"),
            Device::Other("another kind of device")
        ));
        let a_screen_of_any_process = is("/dev/tty");
        assert_eq!(
            a_screen_of_any_process,
            Device::Other("another kind of device")
        );
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

    #[test]
    fn the_terminals_of_a_process_are_those_beyond_its_standard_streams() {
        let open = [
            (0, "/dev/pts/1"),
            (3, "/dev/ttyUSB0"),
            (4, "/dev/ttyUSB0"),
            (5, "socket:[7]"),
            (6, "/dev/pts/9"),
        ];
        let open = open.map(|(number, path)| (number, PathBuf::from(path)));
        let expected = ["/dev/pts/9", "/dev/ttyUSB0"].map(PathBuf::from);
        assert_eq!(terminals(&open), expected);
    }
}
