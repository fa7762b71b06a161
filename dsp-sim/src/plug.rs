//! The serial port as the PC finds it: a pseudo-terminal under a symbolic link, which a script of faults may pull out and
//! put in again.
//!
//! While it is out, the terminal is closed, so that the PC's end is hung up, and the link is removed: its target may
//! become somebody else's terminal meanwhile.

use std::io;
use std::path::{Path, PathBuf};

use crate::faults::PortState;
use crate::pty::{Link, LinkError, Pty, PtyError};

/// What the loop of the process serves.
pub trait Port {
    /// Does to the port what happened to it in the simulation.
    ///
    /// # Errors
    /// It comes back and cannot be put in.
    fn follow(&mut self, state: PortState) -> io::Result<()>;

    /// The terminal; nothing while it is out.
    fn pty(&mut self) -> Option<&mut Pty>;
}

/// A bare terminal stays where it is: while it should be gone, it is silent.
impl Port for Pty {
    fn follow(&mut self, _state: PortState) -> io::Result<()> {
        Ok(())
    }

    fn pty(&mut self) -> Option<&mut Pty> {
        Some(self)
    }
}

/// The port, there or not.
#[derive(Debug)]
pub struct Plug {
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

/// The port cannot be put in.
#[derive(Debug, thiserror::Error)]
pub enum PlugError {
    /// There is no terminal for it.
    #[error(transparent)]
    Pty(#[from] PtyError),
    /// There is no link to it.
    #[error(transparent)]
    Link(#[from] LinkError),
}

impl Plug {
    /// Opens a terminal and makes `link_path` lead to it.
    ///
    /// # Errors
    /// There is no terminal, or the link cannot be made.
    pub fn new(link_path: &Path) -> Result<Plug, PlugError> {
        let mut plug = Plug {
            link_path: link_path.to_owned(),
            link: None,
            pty: None,
            next: None,
            seen: PortState::default(),
        };
        plug.put_in()?;
        Ok(plug)
    }

    /// Where the link is, or will be again.
    pub fn link(&self) -> &Path {
        self.link.as_ref().map_or(&self.link_path, Link::path)
    }

    fn pull_out(&mut self, elsewhere: bool) -> Result<(), PlugError> {
        if elsewhere && self.pty.is_some() {
            self.next = Some(Pty::open()?);
        }
        self.link = None;
        if let Some(pty) = self.pty.take() {
            tracing::info!(port = %pty.path().display(), "the port is hung up");
        }
        Ok(())
    }

    fn put_in(&mut self) -> Result<(), PlugError> {
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

impl Port for Plug {
    fn follow(&mut self, state: PortState) -> io::Result<()> {
        if state == self.seen {
            return Ok(());
        }
        // A hang-up whose end has passed already is one all the same.
        if state.hang_ups != self.seen.hang_ups {
            self.pull_out(state.elsewhere).map_err(io::Error::other)?;
        }
        if !state.is_gone {
            self.put_in().map_err(io::Error::other)?;
        }
        self.seen = state;
        Ok(())
    }

    fn pty(&mut self) -> Option<&mut Pty> {
        self.pty.as_mut()
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
    fn assert_hung_up(mut port: File) {
        let mut byte = [0];
        assert!(!matches!(port.read(&mut byte), Ok(1..)));
    }

    #[test]
    fn the_port_goes_and_comes_back_under_its_link() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("port");
        let mut plug = Plug::new(&path).unwrap();
        for hang_ups in 1..=3 {
            let port = open(&path);
            plug.follow(gone(hang_ups, false)).unwrap();
            assert!(plug.pty().is_none());
            assert!(fs::symlink_metadata(&path).is_err(), "the link is there");
            assert_hung_up(port);
            plug.follow(gone(hang_ups, false)).unwrap();
            plug.follow(back(hang_ups)).unwrap();
            assert_eq!(plug.pty().unwrap().write(b"here").unwrap(), 4);
            let mut read = [0; 4];
            open(&path).read_exact(&mut read).unwrap();
            assert_eq!(&read, b"here");
        }
    }

    #[test]
    fn it_comes_back_as_another_device() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("port");
        let mut plug = Plug::new(&path).unwrap();
        let first = fs::read_link(&path).unwrap();
        plug.follow(gone(1, true)).unwrap();
        // Hung up again while it is gone: nothing more to do.
        plug.follow(gone(2, true)).unwrap();
        plug.follow(back(2)).unwrap();
        assert_ne!(fs::read_link(&path).unwrap(), first);
        open(&path);
    }

    #[test]
    fn a_hang_up_that_has_passed_is_one_all_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("port");
        let mut plug = Plug::new(&path).unwrap();
        let port = open(&path);
        plug.follow(back(1)).unwrap();
        assert_hung_up(port);
        assert_eq!(
            fs::read_link(&path).unwrap(),
            plug.pty().unwrap().path(),
            "and it is there again"
        );
    }

    #[test]
    fn the_link_goes_with_its_owner_also_while_the_port_is_out() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("port");
        let plug = Plug::new(&path).unwrap();
        assert_eq!(plug.link(), path);
        drop(plug);
        assert!(fs::symlink_metadata(&path).is_err());
        let mut plug = Plug::new(&path).unwrap();
        plug.follow(gone(1, false)).unwrap();
        drop(plug);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
