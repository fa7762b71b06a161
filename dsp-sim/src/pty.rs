//! A pseudo-terminal that stands in for the serial port, and the symbolic link under which the PC finds it.
//!
//! A PC may open and close its end at any time. This end keeps the PC's end open too, so that the kernel neither
//! hangs it up nor wakes it without a reason while no PC is there. A watch reports when a PC opens or closes its end.
//!
//! Nothing here blocks. A PC that reads late finds the bytes that were sent in the meantime, as far as the queues
//! reach: the kernel's and then the simulator's, as in the receive queue of a serial port. When a PC opens or closes
//! its end, unread bytes are discarded, so that the next PC reads only what the DSP sends from then on.

mod claim;
mod error;

use std::ffi::OsString;
use std::fs;
use std::io;
use std::mem::MaybeUninit;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::ffi::OsStringExt;
use std::path::{Path, PathBuf};

use rustix::fs::inotify;
use rustix::io::Errno;
use rustix::pty::OpenptFlags;
use rustix::termios::{self, OptionalActions, QueueSelector};

use self::claim::Claim;
pub use self::error::PtyError;
use crate::faults::PortState;
use crate::port::{Terminal, VirtualPort};

/// Room for a few hundred events of the watch, bytes; more are read at the next wake.
const EVENTS_LEN: usize = 4_096;

/// Both ends of a pseudo-terminal.
#[derive(Debug)]
pub struct Pty {
    master: OwnedFd,
    /// The PC's end, held open.
    slave: OwnedFd,
    /// Shows when the PC's end is opened and closed.
    watch: OwnedFd,
    path: PathBuf,
}

impl Pty {
    /// Opens a pseudo-terminal and makes it raw: no byte is echoed, changed or dropped.
    ///
    /// # Errors
    /// The system has none left, or lacks `/dev/pts`.
    pub fn open() -> Result<Pty, PtyError> {
        let failed = |step| {
            move |error: Errno| PtyError::Terminal {
                step,
                source: error.into(),
            }
        };
        let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
        let master = rustix::pty::openpt(flags).map_err(failed("opening /dev/ptmx"))?;
        rustix::pty::grantpt(&master).map_err(failed("grantpt"))?;
        rustix::pty::unlockpt(&master).map_err(failed("unlockpt"))?;
        let name = rustix::pty::ptsname(&master, Vec::new()).map_err(failed("ptsname"))?;
        let slave =
            rustix::pty::ioctl_tiocgptpeer(&master, flags).map_err(failed("TIOCGPTPEER"))?;
        make_raw(slave.as_fd()).map_err(failed("tcsetattr"))?;
        rustix::io::ioctl_fionbio(&master, true).map_err(failed("FIONBIO"))?;
        let path = PathBuf::from(OsString::from_vec(name.into_bytes()));
        let watch = watch(&path).map_err(failed("inotify"))?;
        Ok(Pty {
            master,
            slave,
            watch,
            path,
        })
    }

    /// Where the PC's end is, such as `/dev/pts/7`.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What to wait on for the PC's coming and going; [`check_peer`](Terminal::check_peer) makes it quiet again.
    pub fn watch(&self) -> BorrowedFd<'_> {
        self.watch.as_fd()
    }

    /// Discards what the PC has not read.
    fn discard(&self) -> io::Result<()> {
        termios::tcflush(&self.slave, QueueSelector::IFlush).map_err(Into::into)
    }
}

impl Terminal for Pty {
    fn descriptor(&self) -> BorrowedFd<'_> {
        self.as_fd()
    }

    fn peer_watch(&self) -> Option<BorrowedFd<'_>> {
        Some(self.watch())
    }

    /// After a PC closed its end, the next one finds the port as it was at first: raw, and not held exclusively by a
    /// process that was killed.
    fn check_peer(&mut self) -> io::Result<bool> {
        let (mut came, mut went) = (false, false);
        let mut buffer = [MaybeUninit::uninit(); EVENTS_LEN];
        let mut reader = inotify::Reader::new(&self.watch, &mut buffer);
        loop {
            match reader.next() {
                Ok(event) if event.events().contains(inotify::ReadFlags::OPEN) => came = true,
                Ok(_) => went = true,
                Err(Errno::INTR) => {}
                Err(Errno::AGAIN) => break,
                Err(error) => return Err(error.into()),
            }
        }
        if went {
            termios::ioctl_tiocnxcl(&self.slave)?;
            make_raw(self.slave.as_fd())?;
        }
        if came || went {
            tracing::debug!(came, went, "the PC's end");
            self.discard()?;
        }
        Ok(came || went)
    }
}

impl AsFd for Pty {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.master.as_fd()
    }
}

/// A watch of who opens and closes `path`.
fn watch(path: &Path) -> Result<OwnedFd, Errno> {
    use inotify::{CreateFlags, WatchFlags};
    let watch = inotify::init(CreateFlags::CLOEXEC | CreateFlags::NONBLOCK)?;
    let events = WatchFlags::OPEN | WatchFlags::CLOSE_WRITE | WatchFlags::CLOSE_NOWRITE;
    inotify::add_watch(&watch, path, events)?;
    Ok(watch)
}

/// Switches off all that a terminal does by itself.
fn make_raw(slave: BorrowedFd<'_>) -> Result<(), Errno> {
    let mut settings = termios::tcgetattr(slave)?;
    settings.make_raw();
    termios::tcsetattr(slave, OptionalActions::Now, &settings)
}

/// A symbolic link that exists as long as this value.
#[derive(Debug)]
pub struct SymbolicLink {
    path: PathBuf,
    target: PathBuf,
}

impl SymbolicLink {
    /// Makes `path` a link to `target`. A link that is there already is replaced in one step: a simulator that was
    /// killed left it behind.
    ///
    /// # Errors
    /// Something else than a link is there, or the place cannot be written to.
    pub fn create(path: &Path, target: &Path) -> Result<SymbolicLink, PtyError> {
        let failed = |source| PtyError::Link {
            path: path.to_owned(),
            source,
        };
        let path = std::path::absolute(path).map_err(failed)?;
        match fs::symlink_metadata(&path) {
            Ok(found) if !found.is_symlink() => return Err(PtyError::Occupied(path)),
            Ok(_) if path.exists() => {
                tracing::warn!(
                    link = %path.display(),
                    "the link led somewhere that exists; if another simulator is there, it is out of reach now"
                );
            }
            Ok(_) | Err(_) => {}
        }
        let mut fresh = path.clone().into_os_string();
        fresh.push(format!(".{}", std::process::id()));
        // Left behind by a process of the same number.
        let _ = fs::remove_file(&fresh);
        std::os::unix::fs::symlink(target, &fresh).map_err(failed)?;
        if let Err(error) = fs::rename(&fresh, &path) {
            let _ = fs::remove_file(&fresh);
            return Err(failed(error));
        }
        Ok(SymbolicLink {
            path,
            target: target.to_owned(),
        })
    }

    /// Where the link is.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for SymbolicLink {
    fn drop(&mut self) {
        // Another simulator may have taken the name over.
        if fs::read_link(&self.path).is_ok_and(|target| target == self.target) {
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// The pseudo-terminal and its link, there or not: a script of faults may unplug the port and plug it in again.
///
/// While it is unplugged, the terminal is closed, so that the PC's end is hung up. The link is removed too, because the
/// terminal that it names may become another process's meanwhile.
#[derive(Debug)]
pub struct PtyPort {
    link_path: PathBuf,
    /// Removed before the terminal is closed, which is why both stand before it.
    link: Option<SymbolicLink>,
    claim: Option<Claim>,
    pty: Option<Pty>,
    /// The terminal that the port will be when it comes back elsewhere: opened while the old one is still there, or the
    /// kernel would give it the same number.
    next: Option<Pty>,
    /// What was seen of the script.
    seen: PortState,
}

impl PtyPort {
    /// Opens a terminal and makes `link_path` lead to it.
    ///
    /// # Errors
    /// There is no terminal, or the link cannot be made.
    pub fn new(link_path: &Path) -> Result<PtyPort, PtyError> {
        let mut port = PtyPort {
            link_path: link_path.to_owned(),
            link: None,
            claim: None,
            pty: None,
            next: None,
            seen: PortState::default(),
        };
        port.plug_in()?;
        Ok(port)
    }

    /// Where the link is, or will be again.
    pub fn link(&self) -> &Path {
        self.link
            .as_ref()
            .map_or(&self.link_path, SymbolicLink::path)
    }

    fn unplug(&mut self, elsewhere: bool) -> Result<(), PtyError> {
        if elsewhere && self.pty.is_some() {
            self.next = Some(Pty::open()?);
        }
        self.link = None;
        self.claim = None;
        if let Some(pty) = self.pty.take() {
            tracing::info!(port = %pty.path().display(), "the port is hung up");
        }
        Ok(())
    }

    fn plug_in(&mut self) -> Result<(), PtyError> {
        let pty = match self.next.take() {
            Some(pty) => pty,
            None => Pty::open()?,
        };
        // Until the link leads to the terminal that the claim names, it is stale.
        let claim = Claim::new(&self.link_path, pty.path())?;
        let link = SymbolicLink::create(&self.link_path, pty.path())?;
        self.claim = Some(claim);
        tracing::info!(link = %link.path().display(), port = %pty.path().display(), "the port is there");
        self.link = Some(link);
        self.pty = Some(pty);
        Ok(())
    }
}

impl VirtualPort for PtyPort {
    fn follow(&mut self, state: PortState) -> io::Result<()> {
        if state == self.seen {
            return Ok(());
        }
        // A hang-up whose end has passed already is one all the same.
        if state.hang_ups != self.seen.hang_ups {
            self.unplug(state.elsewhere).map_err(io::Error::other)?;
        }
        if !state.is_gone {
            self.plug_in().map_err(io::Error::other)?;
        }
        self.seen = state;
        Ok(())
    }

    fn terminal(&mut self) -> Option<&mut dyn Terminal> {
        self.pty.as_mut().map(|pty| pty as &mut dyn Terminal)
    }
}

#[cfg(test)]
mod tests {
    use std::fs::{File, OpenOptions};
    use std::io::{Read, Write};

    use super::*;

    fn open_path(path: &Path) -> File {
        let mut options = OpenOptions::new();
        options.read(true).write(true).open(path).unwrap()
    }

    fn open_peer(pty: &Pty) -> File {
        open_path(pty.path())
    }

    fn all_bytes() -> Vec<u8> {
        (0..=255).collect()
    }

    #[test]
    fn every_byte_goes_through_unchanged_both_ways_and_again_after_the_peer_came_back() {
        let mut pty = Pty::open().unwrap();
        for _ in 0..3 {
            let mut peer = open_peer(&pty);
            pty.check_peer().unwrap();
            pty.write(&all_bytes()).unwrap();
            let mut read = [0; 256];
            peer.read_exact(&mut read).unwrap();
            assert_eq!(read[..], all_bytes());

            peer.write_all(&all_bytes()).unwrap();
            let mut read = [0; 300];
            let mut count = 0;
            while count < 256 {
                wait_readable(&pty);
                count += pty.read(&mut read[count..]).unwrap();
            }
            assert_eq!(read[..count], all_bytes());
            drop(peer);
            assert_eq!(pty.read(&mut read).unwrap(), 0, "no hang-up and no echo");
        }
    }

    fn wait_readable(pty: &Pty) {
        use rustix::event::{PollFd, PollFlags, poll};
        poll(&mut [PollFd::new(pty, PollFlags::IN)], None).unwrap();
    }

    #[test]
    fn without_a_reader_nothing_blocks_and_a_newcomer_reads_only_what_is_new() {
        let mut pty = Pty::open().unwrap();
        for _ in 0..10_000 {
            pty.write(&[0x55; 128]).unwrap();
        }
        let mut peer = open_peer(&pty);
        pty.check_peer().unwrap();
        pty.write(b"new").unwrap();
        let mut read = [0; 3];
        peer.read_exact(&mut read).unwrap();
        assert_eq!(&read, b"new");
    }

    #[test]
    fn a_late_reader_finds_every_byte_that_was_taken() {
        let mut pty = Pty::open().unwrap();
        let mut peer = open_peer(&pty);
        pty.check_peer().unwrap();
        let (mut written, mut read) = (Vec::new(), Vec::new());
        for round in 0..3_u8 {
            // Until the queue takes no more.
            for byte in (0..=255).cycle() {
                if pty.write(&[byte ^ round]).unwrap() == 0 {
                    break;
                }
                written.push(byte ^ round);
            }
            while read.len() < written.len() {
                let mut buffer = [0; 1000];
                let count = peer.read(&mut buffer).unwrap();
                read.extend_from_slice(&buffer[..count]);
            }
        }
        assert!(written.len() > 3 * 1000);
        assert_eq!(read, written);
    }

    #[test]
    fn a_peer_that_was_killed_leaves_the_port_open_to_the_next_and_raw() {
        let mut pty = Pty::open().unwrap();
        let peer = open_peer(&pty);
        termios::ioctl_tiocexcl(&peer).unwrap();
        let mut settings = termios::tcgetattr(&peer).unwrap();
        settings.local_modes |= termios::LocalModes::ECHO | termios::LocalModes::ICANON;
        termios::tcsetattr(&peer, OptionalActions::Now, &settings).unwrap();
        drop(peer);
        pty.check_peer().unwrap();
        let mut peer = open_peer(&pty);
        let settings = termios::tcgetattr(&peer).unwrap();
        assert!(!settings.local_modes.contains(termios::LocalModes::ECHO));
        peer.write_all(b"\x04").unwrap();
        wait_readable(&pty);
        let mut read = [0; 8];
        assert_eq!(pty.read(&mut read).unwrap(), 1);
    }

    #[test]
    fn the_watch_is_quiet_unless_somebody_comes_or_goes() {
        use rustix::event::{PollFd, PollFlags, Timespec, poll};
        let mut pty = Pty::open().unwrap();
        let at_once = Timespec::default();
        let due = |pty: &Pty| {
            let mut fds = [
                PollFd::from_borrowed_fd(pty.watch(), PollFlags::IN),
                PollFd::new(pty, PollFlags::IN),
            ];
            poll(&mut fds, Some(&at_once)).unwrap();
            [fds[0].revents(), fds[1].revents()]
        };
        let quiet = [PollFlags::empty(); 2];
        assert_eq!(due(&pty), quiet);
        for _ in 0..3 {
            let peer = open_peer(&pty);
            assert_eq!(due(&pty), [PollFlags::IN, PollFlags::empty()]);
            pty.check_peer().unwrap();
            assert_eq!(due(&pty), quiet);
            drop(peer);
            assert_eq!(due(&pty), [PollFlags::IN, PollFlags::empty()]);
            pty.check_peer().unwrap();
            assert_eq!(due(&pty), quiet, "no hang-up that would wake for ever");
        }
    }

    #[test]
    fn a_link_replaces_a_link_and_nothing_else_and_goes_with_its_owner() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("port");
        let link = SymbolicLink::create(&path, Path::new("/dev/pts/none")).unwrap();
        assert_eq!(fs::read_link(&path).unwrap(), Path::new("/dev/pts/none"));

        let heir = SymbolicLink::create(&path, Path::new("/dev/pts/other")).unwrap();
        drop(link);
        assert_eq!(fs::read_link(&path).unwrap(), Path::new("/dev/pts/other"));
        drop(heir);
        assert!(fs::symlink_metadata(&path).is_err());

        fs::write(&path, "precious").unwrap();
        let error = SymbolicLink::create(&path, Path::new("/dev/null")).unwrap_err();
        assert!(matches!(error, PtyError::Occupied(_)), "{error}");
        assert_eq!(fs::read_to_string(&path).unwrap(), "precious");

        let nowhere = folder.path().join("none").join("port");
        let error = SymbolicLink::create(&nowhere, Path::new("/dev/null")).unwrap_err();
        assert!(matches!(error, PtyError::Link { .. }), "{error}");
        assert_eq!(
            fs::read_dir(folder.path()).unwrap().count(),
            1,
            "nothing left"
        );
    }

    fn gone(hang_ups: u64, elsewhere: bool) -> PortState {
        PortState {
            hang_ups,
            is_gone: true,
            elsewhere,
        }
    }

    fn back(hang_ups: u64) -> PortState {
        PortState {
            hang_ups,
            is_gone: false,
            elsewhere: false,
        }
    }

    /// The PC's end is hung up: it reads an end, or an error.
    fn assert_hung_up(mut pc: File) {
        let mut byte = [0];
        assert!(!matches!(pc.read(&mut byte), Ok(1..)));
    }

    #[test]
    fn the_port_goes_and_comes_back_under_its_link() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("port");
        let mut port = PtyPort::new(&path).unwrap();
        for hang_ups in 1..=3 {
            let pc = open_path(&path);
            port.follow(gone(hang_ups, false)).unwrap();
            assert!(port.terminal().is_none());
            assert!(fs::symlink_metadata(&path).is_err(), "the link is there");
            assert_hung_up(pc);
            port.follow(gone(hang_ups, false)).unwrap();
            port.follow(back(hang_ups)).unwrap();
            assert_eq!(port.terminal().unwrap().write(b"here").unwrap(), 4);
            let mut read = [0; 4];
            open_path(&path).read_exact(&mut read).unwrap();
            assert_eq!(&read, b"here");
        }
    }

    #[test]
    fn it_comes_back_as_another_device() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("port");
        let mut port = PtyPort::new(&path).unwrap();
        let first = fs::read_link(&path).unwrap();
        port.follow(gone(1, true)).unwrap();
        // Hung up again while it is gone: nothing more to do.
        port.follow(gone(2, true)).unwrap();
        port.follow(back(2)).unwrap();
        assert_ne!(fs::read_link(&path).unwrap(), first);
        open_path(&path);
    }

    #[test]
    fn a_hang_up_that_has_passed_is_one_all_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("port");
        let mut port = PtyPort::new(&path).unwrap();
        let pc = open_path(&path);
        port.follow(back(1)).unwrap();
        assert_hung_up(pc);
        assert_eq!(
            fs::read_link(&path).unwrap(),
            port.pty.as_ref().unwrap().path(),
            "and it is there again"
        );
    }

    #[test]
    fn the_link_goes_with_its_owner_also_while_the_port_is_out() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("port");
        let port = PtyPort::new(&path).unwrap();
        assert_eq!(port.link(), path);
        drop(port);
        assert!(fs::symlink_metadata(&path).is_err());
        let mut port = PtyPort::new(&path).unwrap();
        port.follow(gone(1, false)).unwrap();
        drop(port);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        // Another simulator is refused, and changes nothing.
        let first = PtyPort::new(&path).unwrap();
        let target = fs::read_link(&path).unwrap();
        let error = PtyPort::new(&path).unwrap_err().to_string();
        let owner = format!("another simulator, process {};", std::process::id());
        assert!(error.contains(&owner), "{error}");
        assert_eq!(fs::read_link(&path).unwrap(), target);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
        drop(first);
        fs::write(&path, "precious").unwrap();
        let error = PtyPort::new(&path).unwrap_err();
        assert!(matches!(error, PtyError::Occupied(_)), "{error}");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
