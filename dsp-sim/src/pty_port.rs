//! A pseudo-terminal under a symbolic link, in place of a serial port. A script of faults may unplug it and plug it in
//! again.
//!
//! While it is unplugged, the terminal is closed, so that the PC's end is hung up. The link is removed too, because the
//! terminal that it names may become another process's meanwhile.

use std::io;
use std::path::{Path, PathBuf};

use crate::faults::PortState;
use crate::port::{Port, Terminal};
use crate::pty::{Link, LinkError, Pty, PtyError};

/// The pseudo-terminal and its link, there or not.
#[derive(Debug)]
pub struct PtyPort {
    link_path: PathBuf,
    /// Removed before the terminal is closed, which is why it stands before it.
    link: Option<Link>,
    pty: Option<Pty>,
    /// The terminal that the port will be when it comes back elsewhere: opened while the old one is still there, or the
    /// kernel would give it the same number.
    next: Option<Pty>,
    /// What was seen of the script.
    seen: PortState,
}

/// The port cannot be plugged in.
#[derive(Debug, thiserror::Error)]
pub enum PtyPortError {
    /// There is no terminal for it.
    #[error(transparent)]
    Pty(#[from] PtyError),
    /// There is no link to it.
    #[error(transparent)]
    Link(#[from] LinkError),
}

impl PtyPort {
    /// Opens a terminal and makes `link_path` lead to it.
    ///
    /// # Errors
    /// There is no terminal, or the link cannot be made.
    pub fn new(link_path: &Path) -> Result<PtyPort, PtyPortError> {
        let mut port = PtyPort {
            link_path: link_path.to_owned(),
            link: None,
            pty: None,
            next: None,
            seen: PortState::default(),
        };
        port.plug_in()?;
        Ok(port)
    }

    /// Where the link is, or will be again.
    pub fn link(&self) -> &Path {
        self.link.as_ref().map_or(&self.link_path, Link::path)
    }

    fn unplug(&mut self, elsewhere: bool) -> Result<(), PtyPortError> {
        if elsewhere && self.pty.is_some() {
            self.next = Some(Pty::open()?);
        }
        self.link = None;
        if let Some(pty) = self.pty.take() {
            tracing::info!(port = %pty.path().display(), "the port is hung up");
        }
        Ok(())
    }

    fn plug_in(&mut self) -> Result<(), PtyPortError> {
        let pty = match self.next.take() {
            Some(pty) => pty,
            None => Pty::open()?,
        };
        let link = Link::create(&self.link_path, pty.path())?;
        tracing::info!(link = %link.path().display(), port = %pty.path().display(), "the port is there");
        self.link = Some(link);
        self.pty = Some(pty);
        Ok(())
    }
}

impl Port for PtyPort {
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
    use std::fs::{self, File, OpenOptions};
    use std::io::Read;

    use super::*;

    fn open(path: &Path) -> File {
        let mut options = OpenOptions::new();
        options.read(true).write(true).open(path).unwrap()
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
            let pc = open(&path);
            port.follow(gone(hang_ups, false)).unwrap();
            assert!(port.terminal().is_none());
            assert!(fs::symlink_metadata(&path).is_err(), "the link is there");
            assert_hung_up(pc);
            port.follow(gone(hang_ups, false)).unwrap();
            port.follow(back(hang_ups)).unwrap();
            assert_eq!(port.terminal().unwrap().write(b"here").unwrap(), 4);
            let mut read = [0; 4];
            open(&path).read_exact(&mut read).unwrap();
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
        open(&path);
    }

    #[test]
    fn a_hang_up_that_has_passed_is_one_all_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("port");
        let mut port = PtyPort::new(&path).unwrap();
        let pc = open(&path);
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
    }
}
