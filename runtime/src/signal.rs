//! Ctrl+C and SIGTERM as a file descriptor, so that they wake the one wait of a process like any other input.
//!
//! Nothing here runs code in a signal handler but a one-byte write, and nothing ends the process by itself.

use std::cell::Cell;
use std::io::{self, Read, Write};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::UnixStream;
use std::sync::atomic::{AtomicBool, Ordering};

use signal_hook::SigId;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::low_level::{pipe, unregister};

/// Whether a [`Termination`] of this process owns the signals.
static OWNED: AtomicBool = AtomicBool::new(false);

/// The wish that this process end. Put [`as_fd`](AsFd::as_fd) into the wait; it becomes readable when the wish comes.
///
/// A process has one owner of signals: libraries that install handlers of their own must be told not to.
#[derive(Debug)]
pub struct Termination {
    receiver: UnixStream,
    /// Kept once seen: whoever asks a second time must get the same answer.
    requested: Cell<bool>,
    /// Empty when no signal is involved.
    handlers: Vec<SigId>,
}

/// Why the signals could not be taken.
#[derive(Debug, thiserror::Error)]
pub enum SignalError {
    /// Another part of this process owns the signals.
    #[error("SIGINT and SIGTERM already have an owner in this process")]
    AlreadyOwned,
    /// The operating system refused.
    #[error("the handlers of SIGINT and SIGTERM cannot be installed")]
    System(#[from] io::Error),
}

impl Termination {
    /// Takes SIGINT and SIGTERM. From now on they no longer end the process by themselves, not even after this value
    /// was dropped.
    pub fn install() -> Result<Termination, SignalError> {
        let (mut termination, request) = Termination::by_hand()?;
        if OWNED.swap(true, Ordering::AcqRel) {
            return Err(SignalError::AlreadyOwned);
        }
        let register = |signal| pipe::register(signal, request.sender.try_clone()?);
        for signal in [SIGINT, SIGTERM] {
            match register(signal) {
                Ok(handler) => termination.handlers.push(handler),
                Err(error) => {
                    if termination.handlers.is_empty() {
                        OWNED.store(false, Ordering::Release);
                    }
                    return Err(error.into());
                }
            }
        }
        Ok(termination)
    }

    /// A termination without signals, and the handle that requests it: for tests, and for whoever runs a process's loop
    /// in a thread.
    pub fn by_hand() -> io::Result<(Termination, TerminationRequest)> {
        let (receiver, sender) = UnixStream::pair()?;
        receiver.set_nonblocking(true)?;
        sender.set_nonblocking(true)?;
        let termination = Termination {
            receiver,
            requested: Cell::new(false),
            handlers: Vec::new(),
        };
        Ok((termination, TerminationRequest { sender }))
    }

    /// Whether the process should end. Never blocks; empties the descriptor, so that it wakes nobody again until the
    /// next signal.
    pub fn requested(&self) -> bool {
        // One read takes more signals than the two kinds can have pending; what is left wakes the next wait.
        let mut signals = [0; 64];
        match (&self.receiver).read(&mut signals) {
            Ok(0) if self.handlers.is_empty() => self.requested.set(true),
            Ok(count) if count > 0 => self.requested.set(true),
            _ => {}
        }
        self.requested.get()
    }
}

impl AsFd for Termination {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.receiver.as_fd()
    }
}

impl Drop for Termination {
    fn drop(&mut self) {
        if !self.handlers.is_empty() {
            for handler in self.handlers.drain(..) {
                unregister(handler);
            }
            OWNED.store(false, Ordering::Release);
        }
    }
}

/// Requests a [`Termination`] by hand. Dropping it does so too: whoever could have asked has gone.
#[derive(Debug)]
pub struct TerminationRequest {
    sender: UnixStream,
}

impl TerminationRequest {
    /// Requests the end.
    pub fn request(&self) {
        // A full socket means that the wish is known; a closed one, that the end has come.
        let _ = (&self.sender).write(b"T");
    }
}

#[cfg(test)]
mod tests {
    use signal_hook::low_level::raise;

    use super::*;

    #[test]
    fn both_signals_request_the_end_and_have_one_owner() {
        for signal in [SIGINT, SIGTERM] {
            let termination = Termination::install().unwrap();
            assert!(matches!(
                Termination::install(),
                Err(SignalError::AlreadyOwned)
            ));
            assert!(!termination.requested());
            raise(signal).unwrap();
            assert!(termination.requested());
            assert!(termination.requested(), "the wish stays");
        }
    }

    #[test]
    fn a_request_by_hand_is_seen_and_so_is_its_loss() {
        let (termination, request) = Termination::by_hand().unwrap();
        assert!(!termination.requested());
        request.request();
        assert!(termination.requested());

        let (termination, request) = Termination::by_hand().unwrap();
        drop(request);
        assert!(termination.requested());
    }
}
