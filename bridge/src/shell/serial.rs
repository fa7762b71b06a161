//! The serial port: opened, configured, read and written without blocking, and given back as it was found.
//!
//! A port that another process uses is left alone. It may be a person's terminal: a link to a pseudo-terminal outlives
//! a simulator that is killed, and the kernel gives the number to the next login. So the bridge looks for the simulator
//! that made the link, and for [`holders`], before it opens the device, and again before it changes anything.
//!
//! Two descriptors of one device: `serialport` owns the lock and the configuration; ours is opened and checked before,
//! so that the settings found can be saved, and is non-blocking, so that one wait serves everything.

mod adapter;
mod claim;
pub mod holders;

use std::fs::{File, Metadata, OpenOptions};
use std::io;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::time::Duration;

use ipc_types::MonotonicNs;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{FlockOperation, OFlags, flock};
use rustix::io::Errno;
use rustix::termios::{OptionalActions, QueueSelector, Termios, tcflush, tcgetattr, tcsetattr};
use serialport::TTYPort;

pub use self::adapter::Adapter;
use self::holders::{Hold, Holder, Holders, PortHolder, TerminalDevice, has_proc, own_number};
use crate::config::SerialConfig;

/// A read that brings fewer bytes has emptied the line, unless there was a backlog: of that a terminal's queue holds
/// 4095 bytes, and a worker of the kernel, which may be late, brings the rest.
pub const SHORT_READ: usize = 2048;

/// How long the kernel's worker may take to bring the rest of a backlog, and how long all of it may take to read: a
/// worker that gets no processor brings each piece late, and the kernel lets who reads a terminal wait for it.
const BACKLOG_COMES: Duration = Duration::from_millis(10);
const BACKLOG_ENDS: Duration = Duration::from_millis(100);

/// The wait for the rest of a backlog: one time for all of it, so that a line on which bytes come without a pause ends
/// it as well.
#[derive(Debug, Default)]
pub struct Backlog {
    begun: Option<MonotonicNs>,
    until: Option<MonotonicNs>,
}

impl Backlog {
    /// Whether `port` has no more of it, or it took too long, after a read of `count` bytes, `len` in all.
    pub fn is_over(&mut self, port: &SerialPort, count: usize, len: usize) -> bool {
        let now = MonotonicNs::now();
        let begun = *self.begun.get_or_insert(now);
        len < SHORT_READ
            || now > begun + BACKLOG_ENDS
            || count < SHORT_READ && !self.brings_more(port, now)
    }

    /// Waits until the 10 ms since the first question are over, or there is more.
    fn brings_more(&mut self, port: &SerialPort, now: MonotonicNs) -> bool {
        let until = *self.until.get_or_insert(now + BACKLOG_COMES);
        let Ok(timeout) = Timespec::try_from(until.since(now)) else {
            return false;
        };
        let mut line = [PollFd::new(&port.file, PollFlags::IN)];
        now < until && poll(&mut line, Some(&timeout)).is_ok_and(|count| count > 0)
    }
}

/// Why a port could not be opened. Each says what the operator can do.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// There is no such device.
    #[error("{} does not exist: is the cable plugged in, and is `serial.port` right?", .0.display())]
    Missing(PathBuf),
    /// The user may not open it.
    #[error("{} may not be opened by this user: {hint}", .port.display())]
    NotPermitted {
        /// The port.
        port: PathBuf,
        /// What the operator can do.
        hint: String,
    },
    /// Another process uses it, or the kernel.
    #[error("{}", in_use(.port, .by))]
    InUse {
        /// The port.
        port: PathBuf,
        /// Who.
        by: PortHolder,
    },
    /// The simulator that made the link has ended, or has another terminal.
    #[error("{port} was made by a simulator that has ended, and its terminal may be another one's by now: start it again, `ril run sim --link {port}`", port = .0.display())]
    Stale(PathBuf),
    /// Nothing shows who uses it, or lets it be configured.
    #[error("{} is not opened: /proc is not mounted here, so whoever else uses the port cannot be seen", .0.display())]
    NoProc(PathBuf),
    /// It is no terminal device.
    #[error("{} is not a serial port: `serial.port` must name a terminal device, such as /dev/ttyUSB0", .0.display())]
    NotATerminal(PathBuf),
    /// It cannot be set to the configured speed and 8N1.
    #[error("{} cannot be configured: {reason}; is `serial.baud_rate` a speed that it has?", .port.display())]
    NotConfigurable {
        /// The port.
        port: PathBuf,
        /// What was wrong.
        reason: String,
    },
    /// The operating system refused for another reason.
    #[error("{} cannot be opened", .port.display())]
    Other {
        /// The port.
        port: PathBuf,
        /// Why.
        #[source]
        source: io::Error,
    },
}

/// The device is gone or broken; the port has to be opened again.
#[derive(Debug, thiserror::Error)]
#[error("the serial port is gone ({0})")]
pub struct Gone(String);

/// An open port, 8N1, raw, exclusive. Dropping it restores the settings that it had before.
#[derive(Debug)]
pub struct SerialPort {
    file: File,
    found: Termios,
    /// The driver was asked to hand on each byte at once, which it did not do before.
    is_hurried: bool,
    /// For how long the adapter keeps bytes back at most, ms; 0 where nothing says so.
    latency_ms: u32,
    /// Holds the lock, the exclusive mode and the configuration; nothing is read or written through it. Dropped last.
    _configured: TTYPort,
}

impl SerialPort {
    /// Opens and configures the port. A port that another process uses is not touched. A port that cannot be configured
    /// is left closed, with the settings it had.
    ///
    /// # Errors
    /// See [`OpenError`].
    pub fn open(config: &SerialConfig) -> Result<SerialPort, OpenError> {
        let port = config.port.as_path();
        // Opening raises the lines of a port, on which a DSP may restart: first a look from outside.
        let metadata = std::fs::metadata(port).map_err(|error| cannot_open(port, error))?;
        check_free(port, &metadata)?;
        let flags = OFlags::NOCTTY | OFlags::NONBLOCK;
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .custom_flags(flags.bits() as i32)
            .open(port)
            .map_err(|error| cannot_open(port, error))?;
        let file = Locked::new(port, file)?;
        // The link may have been changed between the check and the opening, and another process may have come.
        let metadata = file
            .0
            .metadata()
            .map_err(|error| cannot_open(port, error))?;
        check_free(port, &metadata)?;
        let found = tcgetattr(&file.0).map_err(|errno| match errno {
            Errno::NOTTY => OpenError::NotATerminal(port.to_owned()),
            errno => cannot_open(port, errno.into()),
        })?;
        let file = file.unlock();
        match configure(port, &file, config.baud_rate) {
            Ok(configured) => {
                // Bytes in the queues were meant for an earlier user of the port.
                let _ = tcflush(&file, QueueSelector::IOFlush);
                // It may take an adapter 250 ms: before anything is said to the DSP.
                let is_hurried = config.low_latency && adapter::ask(&file);
                let adapter = Adapter::look(port);
                Ok(SerialPort {
                    file,
                    found,
                    is_hurried,
                    latency_ms: adapter.and_then(|adapter| adapter.latency_ms).unwrap_or(0),
                    _configured: configured,
                })
            }
            Err(error) => {
                if !matches!(error, OpenError::InUse { .. }) {
                    let _ = tcsetattr(&file, OptionalActions::Now, &found);
                }
                Err(error)
            }
        }
    }

    /// Whether the port leads to a pseudo-terminal, whose number becomes another one's when it is gone.
    pub fn is_pty(config: &SerialConfig) -> bool {
        let port = config.port.as_path();
        let metadata = std::fs::metadata(port);
        metadata.is_ok_and(|metadata| {
            TerminalDevice::new(port, &metadata).is_some_and(|terminal| terminal.is_pty())
        })
    }

    /// Reads what is there, up to the length of `buffer`; 0 when nothing is.
    ///
    /// # Errors
    /// When the device is gone.
    pub fn read(&self, buffer: &mut [u8]) -> Result<usize, Gone> {
        loop {
            match rustix::io::read(&self.file, &mut *buffer) {
                Ok(0) => return Err(Gone("end of file".to_owned())),
                Ok(count) => return Ok(count),
                Err(Errno::AGAIN) => return Ok(0),
                Err(Errno::INTR) => {}
                Err(errno) => return Err(Gone(errno.to_string())),
            }
        }
    }

    /// Writes what the device takes now; 0 when it takes nothing.
    ///
    /// # Errors
    /// When the device is gone.
    pub fn write(&self, bytes: &[u8]) -> Result<usize, Gone> {
        loop {
            match rustix::io::write(&self.file, bytes) {
                Ok(count) => return Ok(count),
                Err(Errno::AGAIN) => return Ok(0),
                Err(Errno::INTR) => {}
                Err(errno) => return Err(Gone(errno.to_string())),
            }
        }
    }

    /// For how long the adapter keeps bytes back at most, ms; 0 where nothing says so.
    pub fn latency_ms(&self) -> u32 {
        self.latency_ms
    }

    /// Drops what the kernel has taken but not sent.
    pub fn discard_unsent(&self) {
        // A port that is gone has nothing to send either; the next read says so.
        let _ = tcflush(&self.file, QueueSelector::OFlush);
    }
}

impl AsFd for SerialPort {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.file.as_fd()
    }
}

impl Drop for SerialPort {
    fn drop(&mut self) {
        if self.is_hurried {
            adapter::give_back(&self.file);
        }
        // Not `Drain`: a device that is stuck must not keep the process from ending.
        let _ = tcsetattr(&self.file, OptionalActions::Now, &self.found);
    }
}

/// A device of which this process has the lock for the moment: no other bridge or serial tool uses it, whatever its
/// user or domain.
#[derive(Debug)]
struct Locked(File);

impl Locked {
    fn new(port: &Path, file: File) -> Result<Locked, OpenError> {
        match flock(&file, FlockOperation::NonBlockingLockExclusive) {
            Ok(()) => Ok(Locked(file)),
            Err(Errno::WOULDBLOCK) => Err(refused_by_its_holder(port)),
            Err(errno) => Err(cannot_open(port, errno.into())),
        }
    }

    /// Gives the lock up for `serialport`, which takes it through a descriptor of its own.
    fn unlock(self) -> File {
        let _ = flock(&self.0, FlockOperation::Unlock);
        self.0
    }
}

/// Lets `serialport` lock the device, make it exclusive and set it to 8N1. It opens by path: that of our own descriptor
/// leads to the device that was checked, wherever the port's link leads by now.
fn configure(port: &Path, file: &File, baud_rate: u32) -> Result<TTYPort, OpenError> {
    let path = format!("/proc/self/fd/{}", file.as_raw_fd());
    // 8 data bits, no parity, 1 stop bit and exclusive access are the builder's defaults.
    TTYPort::open(&serialport::new(path, baud_rate)).map_err(|error| match error.kind() {
        serialport::ErrorKind::NoDevice => refused_by_its_holder(port),
        serialport::ErrorKind::Io(io::ErrorKind::NotFound) => OpenError::Missing(port.to_owned()),
        _ => OpenError::NotConfigurable {
            port: port.to_owned(),
            reason: error.to_string(),
        },
    })
}

/// Checks that the device at `port`, to which `metadata` belongs, is a terminal that no other process uses.
fn check_free(port: &Path, metadata: &Metadata) -> Result<(), OpenError> {
    let terminal = TerminalDevice::new(port, metadata)
        .ok_or_else(|| OpenError::NotATerminal(port.to_owned()))?;
    if terminal.is_pty() && is_stale(port, metadata)? {
        return Err(OpenError::Stale(port.to_owned()));
    }
    if !has_proc() {
        return Err(OpenError::NoProc(port.to_owned()));
    }
    let holders = Holders::find(&terminal).map_err(|error| cannot_open(port, error))?;
    match holders.holder(own_number()) {
        Some(by) => Err(OpenError::InUse {
            port: port.to_owned(),
            by,
        }),
        None => Ok(()),
    }
}

/// Whether the port is a link whose simulator has ended, or has another terminal than that with `metadata`.
///
/// # Errors
/// When that cannot be seen.
pub fn is_stale(port: &Path, metadata: &Metadata) -> Result<bool, OpenError> {
    claim::is_stale(port, metadata).map_err(|error| cannot_open(port, error))
}

/// The error when the system refuses the port because another process holds it; that process is named if this user can
/// see it.
fn refused_by_its_holder(port: &Path) -> OpenError {
    let terminal = std::fs::metadata(port)
        .ok()
        .and_then(|metadata| TerminalDevice::new(port, &metadata));
    let holders = terminal.and_then(|terminal| Holders::find(&terminal).ok());
    let holder = holders.and_then(|holders| holders.holder(own_number()));
    OpenError::InUse {
        port: port.to_owned(),
        by: holder.unwrap_or(PortHolder::Unseen),
    }
}

/// Whose a port is, and what to do.
fn in_use(port: &Path, by: &PortHolder) -> String {
    let device = std::fs::canonicalize(port).unwrap_or_else(|_| port.to_owned());
    let name = match device == port {
        true => port.display().to_string(),
        false => format!("{} leads to {}, which", port.display(), device.display()),
    };
    let device = device.display();
    match by {
        PortHolder::Kernel => format!(
            "{name} is a console of the kernel: take its `console=` off the kernel's command line, or name another port in `serial.port`"
        ),
        PortHolder::Process(Holder {
            pid,
            program,
            hold: Hold::Controlling,
            ..
        }) => format!(
            "{name} is the terminal of `{program}` (process {pid}), and nothing is written into it: if the simulator is gone, start it again; if a login waits on the port, stop its service; else name another port in `serial.port`"
        ),
        PortHolder::Process(Holder { pid, program, .. }) => format!(
            "{name} is in use by `{program}` (process {pid}): end it, or name another port in `serial.port`"
        ),
        PortHolder::Unseen => format!(
            "{name} is in use by a process that this user cannot see: `sudo fuser {device}` names it"
        ),
    }
}

fn cannot_open(port: &Path, error: io::Error) -> OpenError {
    match Errno::from_io_error(&error) {
        Some(Errno::NOENT | Errno::NODEV | Errno::NXIO | Errno::NOTDIR) => {
            OpenError::Missing(port.to_owned())
        }
        Some(Errno::ACCESS | Errno::PERM) => OpenError::NotPermitted {
            port: port.to_owned(),
            hint: permission_hint(port),
        },
        Some(Errno::BUSY) => refused_by_its_holder(port),
        Some(Errno::ISDIR) => OpenError::NotATerminal(port.to_owned()),
        _ => OpenError::Other {
            port: port.to_owned(),
            source: error,
        },
    }
}

/// Groups whose members may use serial ports and get no other right: of Debian, and of Arch.
const PORT_GROUPS: [&str; 2] = ["dialout", "uucp"];

/// How to get a missing permission: by the group of serial ports, which survives a reboot, unlike `chmod`.
pub fn permission_hint(port: &Path) -> String {
    let group = std::fs::metadata(port)
        .ok()
        .and_then(|metadata| group_name(metadata.gid()));
    permission_by_group(group.as_deref())
}

/// A group that gives more than serial ports, such as `root` or `tty`, is never advised.
fn permission_by_group(group: Option<&str>) -> String {
    match group {
        Some(group) if PORT_GROUPS.contains(&group) => {
            format!(
                "add the user to the group that owns it (`sudo usermod -aG {group} $USER`) and log in again"
            )
        }
        group => format!(
            "it belongs to the group `{}`, which is not one of serial ports: give it to `dialout` with a udev rule (`GROUP=\"dialout\", \
             MODE=\"0660\"`), add the user to that group and log in again",
            group.unwrap_or("unknown")
        ),
    }
}

fn group_name(gid: u32) -> Option<String> {
    std::fs::read_to_string("/etc/group")
        .ok()?
        .lines()
        .find_map(|line| {
            let mut fields = line.split(':');
            let name = fields.next()?;
            (fields.nth(1)?.parse() == Ok(gid)).then(|| name.to_owned())
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Read, Write};
    use std::sync::atomic::{AtomicBool, Ordering};

    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
    use rustix::termios::{ControlModes, LocalModes};

    /// A pseudo-terminal: its master and the path of its slave.
    fn pty() -> (File, SerialConfig) {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
        grantpt(&master).unwrap();
        unlockpt(&master).unwrap();
        let slave = ptsname(&master, Vec::new()).unwrap().into_string().unwrap();
        let config = SerialConfig {
            port: PathBuf::from(slave),
            ..SerialConfig::default()
        };
        (File::from(master), config)
    }

    fn at(port: &str) -> SerialConfig {
        SerialConfig {
            port: PathBuf::from(port),
            ..SerialConfig::default()
        }
    }

    #[test]
    fn what_cannot_be_opened_says_what_to_do() {
        let missing = SerialPort::open(&at("/dev/no-such-port")).unwrap_err();
        assert!(matches!(missing, OpenError::Missing(_)), "{missing}");
        assert!(missing.to_string().contains("plugged in"));
        for port in [
            "/dev/null",
            "/dev/tty",
            "/dev/ptmx",
            "/tmp",
            "/proc/self/status",
        ] {
            let error = SerialPort::open(&at(port)).unwrap_err();
            assert!(
                matches!(error, OpenError::NotATerminal(_)),
                "{port}: {error}"
            );
        }
        let denied = cannot_open(Path::new("/dev/tty"), Errno::ACCESS.into());
        assert!(denied.to_string().contains("`dialout`"), "{denied}");
    }

    #[test]
    fn only_a_group_of_serial_ports_is_advised() {
        let hint = permission_by_group(Some("dialout"));
        assert!(hint.contains("`sudo usermod -aG dialout $USER`"), "{hint}");
        for group in [
            Some("root"),
            Some("tty"),
            Some("disk"),
            Some("docker"),
            None,
        ] {
            let hint = permission_by_group(group);
            assert!(!hint.contains("usermod"), "{hint}");
            assert!(hint.contains("udev rule"), "{hint}");
        }
    }

    #[test]
    fn a_port_in_use_is_busy_and_stays_as_it_is() {
        let (_master, config) = pty();
        let first = SerialPort::open(&config).unwrap();
        let settings = tcgetattr(&first).unwrap();
        let second = SerialPort::open(&config).unwrap_err();
        assert!(matches!(second, OpenError::InUse { .. }), "{second}");
        assert_eq!(tcgetattr(&first).unwrap().local_modes, settings.local_modes);
        first.write(b"undisturbed").unwrap();
    }

    /// Another program that has the terminal open.
    fn beside(config: &SerialConfig) -> File {
        let mut options = OpenOptions::new();
        options.read(true).write(true);
        options.open(&config.port).unwrap()
    }

    #[test]
    fn the_port_is_raw_while_open_and_restored_afterwards() {
        let (_master, mut config) = pty();
        config.baud_rate = 12_345;
        let watch = beside(&config);
        let before = tcgetattr(&watch).unwrap();
        assert!(
            before
                .local_modes
                .contains(LocalModes::ECHO | LocalModes::ICANON)
        );
        let port = SerialPort::open(&config).unwrap();
        let during = tcgetattr(&watch).unwrap();
        assert!(
            !during
                .local_modes
                .intersects(LocalModes::ECHO | LocalModes::ICANON)
        );
        assert!(
            !during
                .control_modes
                .intersects(ControlModes::PARENB | ControlModes::CSTOPB)
        );
        assert!(during.control_modes.contains(ControlModes::CS8));
        assert_eq!(
            (during.input_speed(), during.output_speed()),
            (12_345, 12_345)
        );
        drop(port);
        let after = tcgetattr(&watch).unwrap();
        assert_eq!(after.local_modes, before.local_modes);
        assert_eq!(after.input_modes, before.input_modes);
        assert_eq!(after.output_modes, before.output_modes);
        assert_eq!(after.output_speed(), before.output_speed());
        SerialPort::open(&config).expect("the port is free again");
    }

    /// A pseudo-terminal takes every speed. It cannot be configured while somebody else changes its settings.
    #[test]
    fn a_port_that_cannot_be_configured_is_not_left_open() {
        let (_master, config) = pty();
        let meddler = beside(&config);
        let settings = tcgetattr(&meddler).unwrap();
        let is_over = AtomicBool::new(false);
        let error = std::thread::scope(|scope| {
            scope.spawn(|| {
                while !is_over.load(Ordering::Relaxed) {
                    tcsetattr(&meddler, OptionalActions::Now, &settings).unwrap();
                }
            });
            // Some attempts come through between two changes.
            let mut errors = (0..10_000).filter_map(|_| SerialPort::open(&config).err());
            let error = errors.find(|error| matches!(error, OpenError::NotConfigurable { .. }));
            is_over.store(true, Ordering::Relaxed);
            error
        });
        let text = error.expect("a change at the wrong moment").to_string();
        assert!(text.contains("cannot be configured"), "{text}");
        let open = std::fs::read_dir("/proc/self/fd").unwrap().flatten();
        let links = open.filter_map(|file| std::fs::read_link(file.path()).ok());
        let left = links.filter(|link| *link == config.port).count();
        assert_eq!(left, 1, "the meddler's");
        SerialPort::open(&config).expect("a port that nobody changes");
    }

    #[test]
    fn all_256_byte_values_pass_both_ways() {
        let (master, config) = pty();
        let port = SerialPort::open(&config).unwrap();
        let all: Vec<u8> = (0..=255).collect();
        assert_eq!(port.write(&all).unwrap(), 256);
        let mut got = vec![0; 256];
        (&master).read_exact(&mut got).unwrap();
        assert_eq!(got, all);
        (&master).write_all(&all).unwrap();
        let (mut got, mut buffer) = (vec![], [0; 100]);
        while got.len() < 256 {
            let count = port.read(&mut buffer).unwrap();
            got.extend_from_slice(&buffer[..count]);
        }
        assert_eq!(got, all);
        assert_eq!(
            port.read(&mut buffer).unwrap(),
            0,
            "nothing more, and no echo"
        );
    }

    /// A line at its full speed never pauses for long: its bytes are not a backlog.
    #[test]
    fn a_backlog_ends_although_the_line_brings_bytes_without_a_pause() {
        // Little in each read, and as much as it takes.
        for bytes in [16, 4095] {
            let (master, config) = pty();
            rustix::fs::fcntl_setfl(&master, OFlags::NONBLOCK).unwrap();
            let port = SerialPort::open(&config).unwrap();
            let is_over = AtomicBool::new(false);
            let pause = Timespec::try_from(Duration::from_millis(1)).unwrap();
            let reads = std::thread::scope(|scope| {
                scope.spawn(|| {
                    while !is_over.load(Ordering::Relaxed) {
                        let _ = (&master).write(&vec![0x55; bytes]);
                        let _ = poll(&mut [], Some(&pause));
                    }
                });
                let (mut backlog, mut reads, mut count) = (Backlog::default(), 0, 0);
                while reads < 100_000 && !backlog.is_over(&port, count, SHORT_READ) {
                    count = port.read(&mut [0; 4096]).unwrap();
                    reads += 1;
                }
                is_over.store(true, Ordering::Relaxed);
                reads
            });
            assert!(reads < 100_000, "it waits for a line that never pauses");
        }
    }

    #[test]
    fn a_hang_up_is_gone_after_the_last_bytes() {
        let (master, config) = pty();
        let port = SerialPort::open(&config).unwrap();
        drop(master);
        assert!(port.read(&mut [0; 10]).is_err());
        assert!(port.write(b"x").is_err());
    }
}
