//! The serial port as the loop of the process sees it: a terminal that may go and come back.

use std::io;
use std::os::fd::BorrowedFd;
use std::time::Duration;

use crate::faults::PortState;

/// What the loop of the process serves.
pub trait Port {
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
    fn read(&self, buffer: &mut [u8]) -> io::Result<usize>;

    /// Writes to the PC what the kernel's queue takes, and returns how much that is.
    ///
    /// # Errors
    /// The terminal is gone.
    fn write(&self, bytes: &[u8]) -> io::Result<usize>;
}
