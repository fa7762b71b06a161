//! Gathers the facts: a thin shell around the file system and `/proc` that decides nothing.
//!
//! Each look times out, as [`domain`](operator::robot::domain) says. Nothing is opened that could notice it: the serial
//! port is only looked at from outside.

use std::fs;
use std::io;
use std::os::unix::fs::FileTypeExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use bridge::BridgeConfig;
use bridge::shell::serial::holders::{Holders, TerminalDevice};
use bridge::shell::serial::{Adapter, is_stale, permission_hint};
use ipc_types::configuration::BridgeConfiguration;
use ipc_types::payload::RelayLink;
use ipc_types::{Domain, Ipc, MonotonicNs, Repair, RobotId, Subscriber, Topic};
use mavlink_gateway::config::{self as mavlink_config, MavlinkConfig};
use mavlink_gateway::shell::key::read_key;
use operator::robot::domain::{DomainFacts, LOOK_TIMEOUT, Look, Looking, PROC, open_files};
use operator::robot::running::{ConfigOrigin, RunningBridge, file_of};
use operator::user_files::secret_fault;
use runtime::config::{Loaded, load};
use runtime::exit::Failure;
use runtime::realtime::latency::DEVICE;
use runtime::realtime::{self, RealtimeConfig};
use runtime::wall_clock::WallClock;
use rustix::fs::Access;
use serde::de::DeserializeOwned;
use status::log::config::LogConfig;
use view::config::{self, ViewConfig};
use view::shell::peer::holder;
use view::shell::{certificate, run_file, token_key};

use super::MachineArgs;
use super::facts::{
    ClockFacts, Device, FileContent, FileFacts, FreeMemory, LinkFacts, LogPlace, Logs, LoopFacts,
    MachineFacts, MavlinkFacts, PortFacts, PortHolders, RealtimeFacts, UnitLimits, ViewFacts,
};
use super::services::{bridge_pid, pid, process};

/// How long a sample of the relay's link is waited for, which is published once a second: twice that.
const LINK_TIMEOUT: Duration = Duration::from_secs(2);

/// How long the live bridge's configuration is waited for: the bridge publishes it within milliseconds, unless it is
/// stopped.
const RUNNING_TIMEOUT: Duration = Duration::from_secs(3);

/// How long a repair may take. It takes a fraction of a millisecond for each file that it deletes. A repair that is
/// given up ends with this process, as if killed: what it had set aside for deletion, the next start or repair deletes.
const REPAIR_TIMEOUT: Duration = Duration::from_secs(15);

/// What the time service of systemd makes when the clock is synchronized.
const SYNCHRONIZED: &str = "/run/systemd/timesync/synchronized";

/// A configuration of the bridge, and where it comes from.
pub(super) type FoundConfig = (BridgeConfig, ConfigOrigin);

/// Everything that is known of the machine, after a repair if one `is_to_repair`, with the bridge's configuration: that
/// which the live bridge runs with, unless the operator named a file.
pub(super) fn machine(
    args: &MachineArgs,
    sim: Option<&Path>,
    is_to_repair: bool,
) -> (MachineFacts, Option<FoundConfig>) {
    let robot = RobotId::from(args.common.robot());
    let place = Domain::from_environment();
    let repair = match &place {
        Ok(place) if is_to_repair => Some(repair(place)),
        _ => None,
    };
    let domain = match &place {
        Ok(place) => Ok(DomainFacts::look(place)),
        Err(error) => Err(error.to_string()),
    };
    let root_fault = place.as_ref().ok().and_then(root_fault);
    // Where no provider can be found, that is a finding of its own.
    let is_readable = domain.as_ref().is_ok_and(|facts| facts.providers.is_ok());
    let (relay, running) = match place {
        Ok(place) if is_readable => (relay(&place, robot), running(&place, robot)),
        _ => (None, None),
    };
    let (files, bridge, status) = files(args, sim, domain.as_ref().ok(), running.as_ref());
    let of_bridge = running.as_ref().or(bridge.as_ref());
    let asked = [
        ("bridge", of_bridge.map(|config| config.realtime.clone())),
        ("status", status.map(|config| config.realtime)),
    ];
    let bridge_process = domain
        .as_ref()
        .ok()
        .and_then(|domain| bridge_pid(domain, robot.get()));
    let facts = MachineFacts {
        robot: robot.get(),
        realtime: realtime(asked, domain.as_ref().ok(), robot.get()),
        domain,
        relay,
        root_fault,
        limits: ipc_types::low_limits(),
        free_memory: memory(),
        clock: clock(),
        port: chosen_port(args, &files, bridge.as_ref(), bridge_process),
        files,
        view: None,
        mavlink: None,
        repair,
    };
    let bridge_file = &facts.files[0];
    let in_file = || {
        let origin = ConfigOrigin::File(bridge_file.path.clone());
        bridge
            .filter(|_| !bridge_file.is_absent())
            .map(|config| (config, origin))
    };
    let running = running.filter(|_| args.bridge.is_none());
    let running = running.map(|config| (config, ConfigOrigin::Running));
    let bridge = running.or_else(in_file);
    (facts, bridge)
}

/// Why the folder of the domain cannot be made. A folder of another name is made beside where it would be, and removed
/// at once: nothing else knows of file systems that are read-only, full or not made for files.
fn root_fault(domain: &Domain) -> Option<String> {
    let root = domain.root().to_owned();
    let looking = Looking::start(move || {
        if root.symlink_metadata().is_ok() {
            return None;
        }
        let parent = root.ancestors().skip(1).find(|parent| parent.exists())?;
        let probe = parent.join(format!(".ril-doctor-{}", std::process::id()));
        let made = fs::create_dir(&probe).and_then(|()| fs::remove_dir(&probe));
        let why = made.err()?;
        Some(format!("{}: {why}", parent.display()))
    });
    looking.end(LOOK_TIMEOUT).ok().flatten()
}

/// What the live bridge of `robot` publishes that it runs with.
fn running(domain: &Domain, robot: RobotId) -> Option<BridgeConfig> {
    let domain = domain.clone();
    let looking = Looking::attempt(move || {
        if domain.provider(robot, BridgeConfiguration::KEY)?.is_none() {
            return Ok::<_, Box<dyn std::error::Error + Send + Sync>>(None);
        }
        let ipc = Ipc::join(&domain, robot, "ril")?;
        Ok(RunningBridge::open(&ipc)?.wait(RUNNING_TIMEOUT))
    });
    looking.end(LOOK_TIMEOUT).ok().flatten()
}

/// The serial port that the command line names, or else the bridge's configuration, if either does.
fn chosen_port(
    args: &MachineArgs,
    files: &[FileFacts],
    bridge: Option<&BridgeConfig>,
    process: Option<u32>,
) -> Option<PortFacts> {
    let (path, is_chosen) = match (&args.port, bridge) {
        (Some(path), _) => (path, true),
        (None, Some(config)) => {
            let is_default = config.serial.port == BridgeConfig::default().serial.port;
            // A live bridge has its port perhaps from its command line, and not from the file that it has read, which
            // has a whole path.
            let is_named = |file: &FileFacts| args.bridge.is_some() || file.path.is_relative();
            let has_file = files.iter().any(|file| {
                file.command == Some("bridge")
                    && file.content == Ok(FileContent::Right)
                    && is_named(file)
            });
            (&config.serial.port, has_file || !is_default)
        }
        (None, None) => return None,
    };
    let low_latency = bridge.is_none_or(|config| config.serial.low_latency);
    Some(port(path.clone(), is_chosen, low_latency, process))
}

/// Looks at the relay's link to `robot`; `None` if no process provides one here.
///
/// The state of a link is in the samples of the relay alone, so this look takes part in the shared memory for a moment.
fn relay(domain: &Domain, robot: RobotId) -> Option<LinkFacts> {
    let asked = domain.clone();
    let looking = Looking::attempt(move || latest_link(&asked, robot));
    let link = match looking.end(LOOK_TIMEOUT) {
        Ok(None) => return None,
        Ok(Some(link)) => Ok(link),
        Err(trouble) => Err(trouble),
    };
    Some(LinkFacts {
        link,
        now: MonotonicNs::now(),
    })
}

/// What the relay says of its link now: the outer `None` if there is no relay, the inner one if it says nothing.
fn latest_link(
    domain: &Domain,
    robot: RobotId,
) -> Result<Option<Option<RelayLink>>, Box<dyn std::error::Error + Send + Sync>> {
    if !domain.robots(RelayLink::KEY)?.contains(&robot) {
        return Ok(None);
    }
    let ipc = Ipc::join(domain, robot, "ril")?;
    let mut links: Subscriber<RelayLink> = ipc.subscriber()?;
    let give_up = Instant::now() + LINK_TIMEOUT;
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
fn repair(domain: &Domain) -> Look<Repair> {
    let domain = domain.clone();
    Looking::attempt(move || domain.repair()).end(REPAIR_TIMEOUT)
}

/// What is free in `/dev/shm`.
fn memory() -> Look<FreeMemory> {
    Looking::attempt(ipc_types::free_memory).end(LOOK_TIMEOUT)
}

/// What bridge and status ask of the system, and what they have.
fn realtime(
    asked: [(&'static str, Option<RealtimeConfig>); 2],
    domain: Option<&DomainFacts>,
    robot: u32,
) -> RealtimeFacts {
    let mut loops = Vec::new();
    for (command, asked) in asked {
        let Some(asked) = asked.filter(RealtimeConfig::is_asked) else {
            continue;
        };
        let process = domain.and_then(|domain| pid(domain, robot, command));
        let wanted = asked.clone();
        // A thread of its own, which ends with the look.
        let lacking = Looking::attempt(move || match process {
            Some(process) => realtime::look(&wanted, process),
            None => realtime::rehearse(&wanted),
        });
        let unit = Looking::start(move || unit(command, robot));
        loops.push(LoopFacts {
            command,
            asked,
            process,
            lacking: lacking.end(LOOK_TIMEOUT),
            unit: unit.end(LOOK_TIMEOUT).ok().flatten(),
        });
    }
    let runtime_us = fs::read_to_string("/proc/sys/kernel/sched_rt_runtime_us").ok();
    let fault = rustix::fs::access(DEVICE, Access::WRITE_OK).err();
    RealtimeFacts {
        loops,
        runtime_us: runtime_us.and_then(|text| text.trim().parse().ok()),
        latency_fault: fault.map(|error| format!("{DEVICE}: {error}")),
    }
}

/// What the unit of `command` allows, with its drop-ins in the order of their names.
fn unit(command: &str, robot: u32) -> Option<UnitLimits> {
    let folders =
        ["/etc", "/run", "/usr/lib", "/lib"].map(|root| Path::new(root).join("systemd/system"));
    let name = format!("ril-{command}@");
    let unit = |folder: &PathBuf| fs::read_to_string(folder.join(format!("{name}.service"))).ok();
    let mut texts = vec![folders.iter().find_map(unit)?];
    let instance = [
        format!("{name}.service.d"),
        format!("{name}{robot}.service.d"),
    ];
    let drop_ins = folders
        .iter()
        .flat_map(|folder| instance.each_ref().map(|name| folder.join(name)));
    let entries = drop_ins
        .filter_map(|folder| fs::read_dir(folder).ok())
        .flatten()
        .flatten();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    files.retain(|file| {
        file.extension()
            .is_some_and(|extension| extension == "conf")
    });
    files.sort_by(|one, other| one.file_name().cmp(&other.file_name()));
    texts.extend(
        files
            .iter()
            .filter_map(|file| fs::read_to_string(file).ok()),
    );
    Some(UnitLimits::read(&texts))
}

/// Reads the configuration of each process with the process's own code: the file that is named, or that the live
/// process of `domain` has read, or else that of this folder. Says also what those of bridge and status are, if they
/// are right. `running` is what the live bridge runs with.
pub(super) fn files(
    args: &MachineArgs,
    sim: Option<&Path>,
    domain: Option<&DomainFacts>,
    running: Option<&BridgeConfig>,
) -> (
    Vec<FileFacts>,
    Option<BridgeConfig>,
    Option<status::config::Config>,
) {
    use operator::config as ril;
    let robot = args.common.robot().get();
    let of_process = |explicit: Option<&Path>, name, default| {
        let provider = || process(domain?, robot, name);
        let file = || file_of(&provider()?.by, name, default);
        let file = explicit.is_none().then(file).flatten();
        file.unwrap_or_else(|| PathBuf::from(default))
    };
    let (bridge, status) = (args.bridge.as_deref(), args.status.as_deref());
    let bridge_file = of_process(bridge, "bridge", bridge::cli::DEFAULT_CONFIG_FILE);
    let status_file = of_process(status, "status", status::config::DEFAULT_FILE);
    let own = args.common.settings.config.as_deref();
    let bridge = Reading::start(Some("bridge"), bridge, bridge_file, by_default);
    let status =
        Reading::<status::config::Config>::start(Some("status"), status, status_file, by_default);
    let sim_file = dsp_sim::config::DEFAULT_FILE.into();
    let sim = Reading::<dsp_sim::config::Config>::start(Some("sim"), sim, sim_file, by_default);
    let own = Reading::<ril::Config>::start(None, own, ril::DEFAULT_FILE.into(), by_default);
    let (file, config): (FileFacts, Option<BridgeConfig>) = bridge.end();
    let is_in_force = config.as_ref().zip(running).map(|(config, running)| {
        // The port is perhaps that of the command line.
        let mut of_file = config.clone();
        of_file.serial.port.clone_from(&running.serial.port);
        of_file == *running
    });
    let bridge = FileFacts {
        is_in_force,
        ..file
    };
    let (status, of_status) = status.end();
    let files = vec![bridge, status, sim.end().0, own.end().0];
    (files, config, of_status)
}

/// Reads a file as a process does that has nothing to check beyond single values.
fn by_default<C: DeserializeOwned + Default>(
    explicit: Option<&Path>,
    default: &Path,
) -> Result<Loaded<C>, Failure> {
    Ok(load(explicit, default)?)
}

/// The view's configuration, unless there is none, and what it is set up with, if that is right.
pub(super) fn view(explicit: Option<&Path>) -> (Option<FileFacts>, Option<Look<ViewFacts>>) {
    of_process(explicit, config::DEFAULT_FILE, "view", config::load, setup)
}

/// The configuration of the gateway to MAVLink, unless there is none, and what it is set up with, if that is right.
pub(super) fn mavlink(explicit: Option<&Path>) -> (Option<FileFacts>, Option<Look<MavlinkFacts>>) {
    let (default, load) = (mavlink_config::DEFAULT_FILE, mavlink_config::load);
    of_process(explicit, default, "mavlink", load, mavlink_of)
}

fn mavlink_of(config: &MavlinkConfig) -> MavlinkFacts {
    let fault = |path: &PathBuf| read_key(path).err();
    let fault = |path: &PathBuf| fault(path).map(|failure| failure.chain().join(": "));
    MavlinkFacts {
        is_open: config.is_open().is_some(),
        is_insecure: config.insecure,
        has_commanders: !config.commands.systems.is_empty(),
        key: config.key.clone().map(|path| {
            let fault = fault(&path);
            (path, fault)
        }),
    }
}

/// The configuration of the process `command`, unless there is none, and what `look` sees of what it names, if it is
/// right.
fn of_process<C: Send + 'static, F: Send + 'static>(
    explicit: Option<&Path>,
    default: &str,
    command: &'static str,
    load: fn(Option<&Path>) -> Result<Loaded<C>, Failure>,
    look: fn(&C) -> F,
) -> (Option<FileFacts>, Option<Look<F>>) {
    let load = move |explicit: Option<&Path>, _: &Path| load(explicit);
    let (file, config) = Reading::start(Some(command), explicit, default.into(), load).end();
    if file.is_absent() {
        return (None, None);
    }
    let seen = config.map(|config| Looking::start(move || look(&config)).end(LOOK_TIMEOUT));
    (Some(file), seen)
}

fn setup(config: &ViewConfig) -> ViewFacts {
    let tls = config.tls.as_ref();
    let certificate = tls.map(|tls| {
        let path = tls.certificate.clone();
        let end = certificate::end_unix_s(&path);
        (path, end)
    });
    let secrets = [tls.map(|tls| tls.key.clone()), token_key::path(config).ok()];
    let open_secrets = secrets
        .into_iter()
        .flatten()
        .filter_map(|path| secret_fault(&path).map(|fault| (path, fault)));
    // Of a service that has a user namespace of its own, the system does not say which sockets it has.
    let own_view = run_file::find(config.port).ok().flatten();
    let own_view = own_view.map(|running| format!("ril (process {})", running.pid));
    ViewFacts {
        port: config.port,
        holder: own_view.or_else(|| holder(config.port)),
        is_open: config.is_open(),
        has_tokens: !config.tokens.is_empty(),
        certificate,
        open_secrets: open_secrets.collect(),
        unix_s: WallClock::look().unix_s,
    }
}

/// A configuration that is being read, by the code of its process.
struct Reading<C> {
    command: Option<&'static str>,
    path: PathBuf,
    looking: Looking<(FileContent, Option<C>)>,
}

impl<C: Send + 'static> Reading<C> {
    /// Begins to read the file that is named, or else the default one.
    fn start(
        command: Option<&'static str>,
        explicit: Option<&Path>,
        default: PathBuf,
        load: impl FnOnce(Option<&Path>, &Path) -> Result<Loaded<C>, Failure> + Send + 'static,
    ) -> Reading<C> {
        let explicit = explicit.map(Path::to_owned);
        Reading {
            command,
            path: explicit.clone().unwrap_or_else(|| default.clone()),
            looking: Looking::start(move || match load(explicit.as_deref(), &default) {
                Ok(loaded) if loaded.file.is_none() => (FileContent::Absent, Some(loaded.value)),
                Ok(loaded) => (FileContent::Right, Some(loaded.value)),
                Err(failure) => (FileContent::Wrong(failure.chain().join(": ")), None),
            }),
        }
    }

    /// What is in it, and its value if that is right.
    fn end(self) -> (FileFacts, Option<C>) {
        let (content, config) = match self.looking.end(LOOK_TIMEOUT) {
            Ok((content, config)) => (Ok(content), config),
            Err(trouble) => (Err(trouble), None),
        };
        let facts = FileFacts {
            command: self.command,
            path: self.path,
            content,
            is_in_force: None,
        };
        (facts, config)
    }
}

/// Looks at a serial port, chosen or the default, and at the processes that have terminals open, `bridge` among them.
fn port(path: PathBuf, is_chosen: bool, low_latency: bool, bridge: Option<u32>) -> PortFacts {
    let (looked_at, held) = (path.clone(), path.clone());
    let device = Looking::attempt(move || device(&looked_at));
    let holders = Looking::attempt(move || holders(&held, bridge));
    PortFacts {
        path,
        is_chosen,
        low_latency,
        device: device.end(LOOK_TIMEOUT),
        holders: holders.end(LOOK_TIMEOUT),
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
    let Some(terminal) = TerminalDevice::new(path, &metadata) else {
        return Ok(Device::Other("another kind of device"));
    };
    if terminal.is_pty() && is_stale(path, &metadata).is_ok_and(|is_stale| is_stale) {
        return Ok(Device::Stale);
    }
    let may_open = rustix::fs::access(path, Access::READ_OK | Access::WRITE_OK).is_ok();
    Ok(Device::Terminal {
        forbidden: (!may_open).then(|| permission_hint(path)),
        adapter: Adapter::look(path),
    })
}

/// The processes that use `port`, as the bridge sees them, and which terminals `bridge` has.
fn holders(port: &Path, bridge: Option<u32>) -> io::Result<PortHolders> {
    let terminal = fs::metadata(port)
        .ok()
        .and_then(|metadata| TerminalDevice::new(port, &metadata));
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

/// The folders of the logs in `file`, the configuration of status; `folder` is where its process began, `None` if that
/// is not known.
pub(super) fn logs(file: PathBuf, folder: Option<PathBuf>) -> Logs {
    let looked = Looking::start(move || {
        let loaded = load::<status::config::Config>(Some(&file), &file).ok()?;
        let logs = loaded.value.log.into_iter();
        let logs = logs.filter(|log| !log.groups.is_empty());
        Some(logs.map(|log| log_place(&log, folder.as_deref())).collect())
    });
    looked
        .end(LOOK_TIMEOUT)
        .ok()
        .flatten()
        .map_or(Logs::Unknown, Logs::Configured)
}

fn log_place(log: &LogConfig, folder: Option<&Path>) -> LogPlace {
    // Where the link to the process's folder cannot be read, the folder is taken for this one.
    let folder = folder.and_then(|folder| fs::read_link(folder).ok());
    let directory = match &folder {
        Some(folder) => folder.join(&log.directory),
        None => log.directory.clone(),
    };
    // A folder that is not there yet is made in the nearest one that is.
    let parents = directory.ancestors();
    let mut parents = parents.map(|path| match path.as_os_str().is_empty() {
        true => Path::new("."),
        false => path,
    });
    let present = parents.find(|path| path.exists()).unwrap_or(Path::new("."));
    let free = rustix::fs::statvfs(present);
    LogPlace {
        min_free_bytes: log.limits().min_free_bytes,
        free_bytes: free
            .map(|disk| disk.f_bavail.saturating_mul(disk.f_frsize))
            .map_err(|error| error.to_string()),
        is_writable: rustix::fs::access(present, Access::WRITE_OK | Access::EXEC_OK).is_ok(),
        directory,
    }
}

fn clock() -> ClockFacts {
    ClockFacts {
        clock: WallClock::look(),
        is_synchronized: Path::new(SYNCHRONIZED).exists(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
