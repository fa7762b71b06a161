//! [`Source`]: what can be waited for, and the bounds of every wait.

use std::os::fd::BorrowedFd;
use std::time::Duration;

use rustix::io::Errno;

use crate::open::OpenError;

/// Longest uninterrupted sleep.
///
/// A lost wake-up costs at most this much; an idle process wakes four times a second for a few microseconds. It is a
/// safety net, not a polling period: in order, every wake-up comes from an event.
pub const SAFETY_BOUND: Duration = Duration::from_millis(250);

/// Most sources of one wait: the ports of one process and its file descriptors, several times over.
pub const MAX_SOURCES: usize = 16;

/// Waiting failed.
#[derive(Debug, thiserror::Error)]
pub enum WaitError {
    /// There is nothing to wait for.
    #[error("a wait needs at least one port or file descriptor")]
    NoSources,
    /// There is too much to wait for.
    #[error("{0} sources were given to one wait, {MAX_SOURCES} are possible")]
    TooManySources(usize),
    /// A port has no descriptor to wait for.
    #[error("a port cannot be listened to")]
    Listener(#[from] OpenError),
    /// The operating system refused.
    #[error("the operating system cannot wait ({0})")]
    Failed(#[from] Errno),
}

/// What a [`Waiter`](crate::Waiter) can wait for: every port, and raw file descriptors as [`Descriptor`].
pub trait Source: sealed::Source {}

impl<T: sealed::Source> Source for T {}

pub(crate) mod sealed {
    use super::BorrowedFd;
    use crate::doorbell::{Bits, Doorbell};
    use crate::wake::WakeReceiver;

    /// The part of a source that only this crate may implement.
    pub trait Source {
        /// Whether there is something, so that sleeping would be wrong. Makes no system call in the usual case.
        fn has_something(&self) -> bool;

        /// What the port does by itself when it has something, instead of ending the wait: says whether it is such a port.
        fn tend(&mut self) -> bool {
            false
        }

        /// How to wait for it.
        fn sense(&self) -> Sense<'_>;
    }

    /// How to wait for a source.
    #[derive(Clone, Copy)]
    pub enum Sense<'a> {
        /// A port.
        Port {
            doorbell: &'a Doorbell,
            bits: Bits,
            /// Nothing while the other side has not been there yet.
            receiver: Option<&'a WakeReceiver>,
            /// Whether to wait by the receiver's descriptor, because not every partner rings the doorbell for it.
            by_descriptor: bool,
        },
        /// A file descriptor, of which the kernel knows.
        Descriptor(BorrowedFd<'a>),
    }
}

use sealed::Sense;

/// A raw file descriptor to wait for until it can be read: a serial port, a signal pipe.
///
/// One that has hung up is ready for ever, as a plain file is: do not wait for it. Made anew for each wait, so that
/// descriptors may come and go.
#[derive(Clone, Copy, Debug)]
pub struct Descriptor<'fd>(BorrowedFd<'fd>);

impl<'fd> Descriptor<'fd> {
    /// The source that is ready when `fd` can be read without blocking.
    pub fn new(fd: BorrowedFd<'fd>) -> Descriptor<'fd> {
        Descriptor(fd)
    }
}

impl sealed::Source for Descriptor<'_> {
    /// The kernel knows, and says so at once.
    fn has_something(&self) -> bool {
        false
    }

    fn sense(&self) -> Sense<'_> {
        Sense::Descriptor(self.0)
    }
}
