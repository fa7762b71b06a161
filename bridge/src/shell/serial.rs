//! The serial port: opened and configured by the `serialport` crate, read and written without blocking, and given back
//! as it was found.
//!
//! Two descriptors of one device: `serialport` owns the exclusive lock and the configuration; ours is opened before it,
//! so that the settings found can be saved, and is non-blocking, so that one wait serves everything.

use std::fs::{File, OpenOptions};
use std::io;
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use rustix::fs::OFlags;
use rustix::io::Errno;
use rustix::termios::{OptionalActions, QueueSelector, Termios, tcflush, tcgetattr, tcsetattr};
use serialport::TTYPort;

use crate::config::SerialConfig;

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
        /// How to mend it.
        hint: String,
    },
    /// Another process holds it.
    #[error("{} is in use: another process holds it (`fuser {}` names it)", .0.display(), .0.display())]
    Busy(PathBuf),
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
    /// Holds the lock and the configuration; nothing is read or written through it.
    _configured: TTYPort,
}

impl SerialPort {
    /// Opens and configures the port. A port that cannot be configured is left closed, with the settings it had.
    ///
    /// # Errors
    /// See [`OpenError`].
    pub fn open(config: &SerialConfig) -> Result<SerialPort, OpenError> {
        let port = config.port.as_path();
        let flags = OFlags::NOCTTY | OFlags::NONBLOCK;
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .custom_flags(flags.bits() as i32)
            .open(port)
            .map_err(|error| cannot_open(port, error))?;
        let found = tcgetattr(&file).map_err(|errno| match errno {
            Errno::NOTTY => OpenError::NotATerminal(port.to_owned()),
            errno => cannot_open(port, errno.into()),
        })?;
        match configure(port, config.baud_rate) {
            Ok(configured) => {
                let port = SerialPort {
                    file,
                    found,
                    _configured: configured,
                };
                // What lay in the queues was said to or by somebody else.
                let _ = tcflush(&port.file, QueueSelector::IOFlush);
                Ok(port)
            }
            Err(error) => {
                if !matches!(error, OpenError::Busy(_)) {
                    let _ = tcsetattr(&file, OptionalActions::Now, &found);
                }
                Err(error)
            }
        }
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
        // Not `Drain`: a device that is stuck must not keep the process from ending.
        let _ = tcsetattr(&self.file, OptionalActions::Now, &self.found);
    }
}

fn configure(port: &Path, baud_rate: u32) -> Result<TTYPort, OpenError> {
    // 8 data bits, no parity, 1 stop bit and exclusive access are the builder's defaults.
    TTYPort::open(&serialport::new(port.to_string_lossy(), baud_rate)).map_err(|error| match error
        .kind()
    {
        serialport::ErrorKind::NoDevice => OpenError::Busy(port.to_owned()),
        serialport::ErrorKind::Io(io::ErrorKind::NotFound) => OpenError::Missing(port.to_owned()),
        _ => OpenError::NotConfigurable {
            port: port.to_owned(),
            reason: error.to_string(),
        },
    })
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
        Some(Errno::BUSY) => OpenError::Busy(port.to_owned()),
        Some(Errno::ISDIR) => OpenError::NotATerminal(port.to_owned()),
        _ => OpenError::Other {
            port: port.to_owned(),
            source: error,
        },
    }
}

/// How to mend a missing permission: by the group that owns the device, which survives a reboot, unlike `chmod`.
pub fn permission_hint(port: &Path) -> String {
    let group = std::fs::metadata(port)
        .ok()
        .and_then(|metadata| group_name(metadata.gid()));
    match group {
        Some(group) => format!("add the user to the group that owns it (`sudo usermod -aG {group} $USER`) and log in again"),
        None => "add the user to the group that owns it (`ls -l` names it), usually `dialout`, and log in again".to_owned(),
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
        for port in ["/dev/null", "/tmp", "/proc/self/status"] {
            let error = SerialPort::open(&at(port)).unwrap_err();
            let expected = matches!(
                error,
                OpenError::NotATerminal(_) | OpenError::NotPermitted { .. }
            );
            assert!(expected, "{port}: {error}");
        }
        let denied = cannot_open(Path::new("/dev/tty"), Errno::ACCESS.into());
        assert!(denied.to_string().contains("usermod -aG"), "{denied}");
    }

    #[test]
    fn a_port_in_use_is_busy_and_stays_as_it_is() {
        let (_master, config) = pty();
        let first = SerialPort::open(&config).unwrap();
        let settings = tcgetattr(&first.file).unwrap();
        let second = SerialPort::open(&config).unwrap_err();
        assert!(matches!(second, OpenError::Busy(_)), "{second}");
        assert_eq!(
            tcgetattr(&first.file).unwrap().local_modes,
            settings.local_modes
        );
    }

    #[test]
    fn the_port_is_raw_while_open_and_restored_afterwards() {
        let (_master, mut config) = pty();
        config.baud_rate = 12_345;
        let watch = OpenOptions::new()
            .read(true)
            .write(true)
            .open(&config.port)
            .unwrap();
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

    #[test]
    fn a_hang_up_is_gone_after_the_last_bytes() {
        let (master, config) = pty();
        let port = SerialPort::open(&config).unwrap();
        drop(master);
        assert!(port.read(&mut [0; 10]).is_err());
        assert!(port.write(b"x").is_err());
    }
}
