//! The serial port as the loop of the process sees it: a terminal that may go and come back.

use std::io;
use std::os::fd::BorrowedFd;
use std::time::Duration;

use rustix::io::Errno;

use crate::faults::PortState;

/// What the loop of the process serves.
pub trait VirtualPort {
    /// Brings the port up to date: it does what happened to it in the simulation, and opens again what was lost.
    ///
    /// # Errors
    /// The port cannot come back.
    fn follow(&mut self, state: PortState) -> io::Result<()>;

    /// The terminal; `None` while it is gone.
    fn terminal(&mut self) -> Option<&mut dyn Terminal>;

    /// The terminal has failed with `error`. A port that can wait for its return does so.
    ///
    /// # Errors
    /// This one cannot: it gives `error` back.
    fn lose(&mut self, error: io::Error) -> io::Result<()> {
        Err(error)
    }

    /// After which time [`follow`](Self::follow) should be called again although nothing happened.
    fn retry_in(&self) -> Option<Duration> {
        None
    }
}

/// An open terminal. Nothing here blocks.
pub trait Terminal {
    /// What to wait on for bytes and for room.
    fn descriptor(&self) -> BorrowedFd<'_>;

    /// What to wait on for a peer that comes or goes; `None` if it cannot be seen.
    fn peer_watch(&self) -> Option<BorrowedFd<'_>> {
        None
    }

    /// Whether a peer came or went since the last call; then bytes that wait for the old one are worth nothing.
    ///
    /// # Errors
    /// The terminal is gone.
    fn check_peer(&mut self) -> io::Result<bool> {
        Ok(false)
    }

    /// Reads what the PC wrote; 0 when there is nothing.
    ///
    /// # Errors
    /// The terminal is gone.
    fn read(&self, buffer: &mut [u8]) -> io::Result<usize> {
        if buffer.is_empty() {
            return Ok(0);
        }
        match without_waiting(|| rustix::io::read(self.descriptor(), &mut *buffer))? {
            Some(0) => Err(io::ErrorKind::UnexpectedEof.into()),
            count => Ok(count.unwrap_or_default()),
        }
    }

    /// Writes to the PC what the kernel's queue takes, and returns how much that is.
    ///
    /// # Errors
    /// The terminal is gone.
    fn write(&self, bytes: &[u8]) -> io::Result<usize> {
        let written = without_waiting(|| rustix::io::write(self.descriptor(), bytes))?;
        Ok(written.unwrap_or_default())
    }
}

/// What a descriptor that does not block gives; `None` if it would block.
fn without_waiting(mut act: impl FnMut() -> Result<usize, Errno>) -> io::Result<Option<usize>> {
    loop {
        match act() {
            Ok(count) => return Ok(Some(count)),
            Err(Errno::INTR) => {}
            Err(Errno::AGAIN) => return Ok(None),
            Err(error) => return Err(error.into()),
        }
    }
}
