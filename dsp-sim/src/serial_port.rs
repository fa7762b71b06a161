//! A real serial port in place of the pseudo-terminal, so that a bridge on another computer, or on another port of this
//! one, has a DSP at the end of its cable.
//!
//! The port is held exclusively, raw, 8N1, and given back with the settings that it had. A port that goes away, such as
//! the adapter that is unplugged, is opened again when it is back; the simulated helicopter flies on meanwhile.

use std::fs::{File, OpenOptions};
use std::io;
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use rustix::fs::{FlockOperation, OFlags, flock};
use rustix::io::Errno;
use rustix::termios::{
    ControlModes, InputModes, OptionalActions, QueueSelector, Termios, ioctl_tiocexcl,
    ioctl_tiocnxcl, tcflush, tcgetattr, tcsetattr,
};

use crate::faults::PortState;
use crate::port::{Terminal, VirtualPort};

/// How long to wait before a port that is gone is tried again: the bridge waits no longer.
const RETRY_PAUSE: Duration = Duration::from_millis(100);

/// The port cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum PtyError {
    /// Another process holds it.
    #[error("{} is in use: another process holds it (`fuser {}` names it)", .0.display(), .0.display())]
    Busy(PathBuf),
    /// It is no terminal device.
    #[error("{} is not a serial port: --port must name a terminal device, such as /dev/ttyUSB0", .0.display())]
    NotATerminal(PathBuf),
    /// The operating system refused.
    #[error("{} cannot be opened at {baud_rate} baud; is the cable plugged in, may this user open it (group `dialout`), and does it have that speed?", .port.display())]
    System {
        /// The port.
        port: PathBuf,
        /// Bits per second.
        baud_rate: u32,
        /// Why not.
        source: io::Error,
    },
}

/// A serial port by its path, there or not.
#[derive(Debug)]
pub struct SerialPort {
    path: PathBuf,
    baud_rate: u32,
    open: Option<OpenPort>,
    retry_at: Instant,
}

impl SerialPort {
    /// Opens the port.
    ///
    /// # Errors
    /// See [`PtyError`].
    pub fn open(path: &Path, baud_rate: u32) -> Result<SerialPort, PtyError> {
        Ok(SerialPort {
            path: path.to_owned(),
            baud_rate,
            open: Some(OpenPort::open(path, baud_rate)?),
            retry_at: Instant::now(),
        })
    }
}

impl VirtualPort for SerialPort {
    /// A script of faults cannot unplug a real port: while it should be gone, it is silent.
    fn follow(&mut self, _state: PortState) -> io::Result<()> {
        if self.open.is_some() || Instant::now() < self.retry_at {
            return Ok(());
        }
        match OpenPort::open(&self.path, self.baud_rate) {
            Ok(port) => {
                tracing::info!(port = %self.path.display(), "the serial port is back");
                self.open = Some(port);
            }
            Err(error) => {
                tracing::debug!(%error, "the serial port is not back");
                self.retry_at = Instant::now() + RETRY_PAUSE;
            }
        }
        Ok(())
    }

    fn terminal(&mut self) -> Option<&mut dyn Terminal> {
        self.open.as_mut().map(|port| port as &mut dyn Terminal)
    }

    fn lose(&mut self, error: io::Error) -> io::Result<()> {
        tracing::warn!(port = %self.path.display(), %error, "the serial port is gone; waiting for its return");
        self.open = None;
        self.retry_at = Instant::now() + RETRY_PAUSE;
        Ok(())
    }

    fn retry_in(&self) -> Option<Duration> {
        let wait = || self.retry_at.saturating_duration_since(Instant::now());
        self.open.is_none().then(wait)
    }
}

/// An open port. Dropping it restores the settings that it had before.
#[derive(Debug)]
struct OpenPort {
    file: File,
    found: Termios,
}

impl OpenPort {
    fn open(path: &Path, baud_rate: u32) -> Result<OpenPort, PtyError> {
        let failed = |error: io::Error| match Errno::from_io_error(&error) {
            Some(Errno::BUSY | Errno::WOULDBLOCK) => PtyError::Busy(path.to_owned()),
            Some(Errno::NOTTY | Errno::ISDIR) => PtyError::NotATerminal(path.to_owned()),
            _ => PtyError::System {
                port: path.to_owned(),
                baud_rate,
                source: error,
            },
        };
        let flags = OFlags::NOCTTY | OFlags::NONBLOCK;
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .custom_flags(flags.bits() as i32)
            .open(path)
            .map_err(failed)?;
        let found = tcgetattr(&file).map_err(|errno| failed(errno.into()))?;
        // The lock stops a process of root as well, which the terminal's exclusive mode does not.
        flock(&file, FlockOperation::NonBlockingLockExclusive)
            .map_err(|errno| failed(errno.into()))?;
        let port = OpenPort { file, found };
        port.configure(baud_rate)
            .map_err(|errno| failed(errno.into()))?;
        Ok(port)
    }

    /// Raw, 8 data bits, no parity, 1 stop bit, no flow control, exclusive, and without bytes from before.
    fn configure(&self, baud_rate: u32) -> Result<(), Errno> {
        let mut settings = self.found.clone();
        settings.make_raw();
        settings.input_modes -= InputModes::IXON | InputModes::IXOFF | InputModes::INPCK;
        settings.control_modes -= ControlModes::CSTOPB | ControlModes::CRTSCTS;
        settings.control_modes |= ControlModes::CLOCAL | ControlModes::CREAD;
        settings.set_speed(baud_rate)?;
        tcsetattr(&self.file, OptionalActions::Now, &settings)?;
        ioctl_tiocexcl(&self.file)?;
        tcflush(&self.file, QueueSelector::IOFlush)
    }
}

impl Terminal for OpenPort {
    fn descriptor(&self) -> BorrowedFd<'_> {
        self.file.as_fd()
    }
}

impl Drop for OpenPort {
    fn drop(&mut self) {
        // A port that is gone has no settings to restore. Not `Drain`: a stuck device must not keep the process from
        // ending.
        let _ = tcsetattr(&self.file, OptionalActions::Now, &self.found);
        let _ = ioctl_tiocnxcl(&self.file);
    }
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Write};

    use rustix::event::{PollFd, PollFlags, poll};
    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
    use rustix::termios::LocalModes;

    use super::*;

    /// A pseudo-terminal in the place of a cable: its master, and the path of its slave.
    fn cable() -> (File, PathBuf) {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
        grantpt(&master).unwrap();
        unlockpt(&master).unwrap();
        let slave = ptsname(&master, Vec::new()).unwrap().into_string().unwrap();
        (File::from(master), slave.into())
    }

    /// Calls `follow` whenever the port wants it, until it is open.
    fn wait_for_return(port: &mut SerialPort) {
        while let Some(pause) = port.retry_in() {
            poll(&mut [], Some(&pause.try_into().unwrap())).unwrap();
            port.follow(PortState::default()).unwrap();
        }
    }

    #[test]
    fn what_is_no_free_serial_port_is_refused_with_a_reason() {
        let error = |path: &Path| SerialPort::open(path, 115_200).unwrap_err();
        for path in ["/dev/null", "/tmp"] {
            let error = error(Path::new(path));
            assert!(matches!(error, PtyError::NotATerminal(_)), "{error}");
        }
        let missing = error(Path::new("/dev/no-such-port"));
        assert!(matches!(missing, PtyError::System { .. }), "{missing}");
        let (_master, path) = cable();
        let first = SerialPort::open(&path, 115_200).unwrap();
        let busy = error(&path);
        assert!(matches!(busy, PtyError::Busy(_)), "{busy}");
        drop(first);
        SerialPort::open(&path, 115_200).expect("free again");
    }

    #[test]
    fn the_port_is_raw_at_its_speed_while_open_and_restored_afterwards() {
        let (_master, path) = cable();
        let mut options = OpenOptions::new();
        let watch = options.read(true).write(true).open(&path).unwrap();
        let before = tcgetattr(&watch).unwrap();
        assert!(before.local_modes.contains(LocalModes::ECHO));
        let port = SerialPort::open(&path, 12_345).unwrap();
        let during = tcgetattr(&watch).unwrap();
        let cooked = LocalModes::ECHO | LocalModes::ICANON;
        assert!(!during.local_modes.intersects(cooked));
        assert!(during.control_modes.contains(ControlModes::CS8));
        let speeds = (during.input_speed(), during.output_speed());
        assert_eq!(speeds, (12_345, 12_345));
        drop(port);
        let after = tcgetattr(&watch).unwrap();
        assert_eq!(after.local_modes, before.local_modes);
        assert_eq!(after.output_speed(), before.output_speed());
    }

    #[test]
    fn all_bytes_pass_both_ways() {
        let (mut master, path) = cable();
        let mut port = SerialPort::open(&path, 115_200).unwrap();
        let terminal = port.terminal().unwrap();
        let all: Vec<u8> = (0..=255).collect();
        assert_eq!(terminal.write(&all).unwrap(), 256);
        let mut read = vec![0; 256];
        master.read_exact(&mut read).unwrap();
        assert_eq!(read, all);
        master.write_all(&all).unwrap();
        let mut read = Vec::new();
        let mut buffer = [0; 300];
        while read.len() < 256 {
            poll(
                &mut [PollFd::from_borrowed_fd(
                    terminal.descriptor(),
                    PollFlags::IN,
                )],
                None,
            )
            .unwrap();
            let count = terminal.read(&mut buffer).unwrap();
            read.extend_from_slice(&buffer[..count]);
        }
        assert_eq!(read, all);
        assert_eq!(terminal.read(&mut buffer).unwrap(), 0, "no echo");
    }

    #[test]
    fn a_port_that_was_unplugged_is_opened_again_when_it_is_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("port");
        let (master, slave) = cable();
        std::os::unix::fs::symlink(slave, &path).unwrap();
        let mut port = SerialPort::open(&path, 115_200).unwrap();
        assert_eq!(port.retry_in(), None);
        drop(master);
        std::fs::remove_file(&path).unwrap();
        let error = port.terminal().unwrap().read(&mut [0; 8]).unwrap_err();
        port.lose(error).unwrap();
        assert!(port.terminal().is_none());
        // It is not back yet.
        poll(&mut [], Some(&RETRY_PAUSE.try_into().unwrap())).unwrap();
        port.follow(PortState::default()).unwrap();
        assert!(port.retry_in().is_some());

        let (mut master, slave) = cable();
        std::os::unix::fs::symlink(slave, &path).unwrap();
        wait_for_return(&mut port);
        assert_eq!(port.terminal().unwrap().write(b"here").unwrap(), 4);
        let mut read = [0; 4];
        master.read_exact(&mut read).unwrap();
        assert_eq!(&read, b"here");
    }
}
