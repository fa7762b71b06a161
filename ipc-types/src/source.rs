//! [`Source`]: what can be waited for, and the bounds of every wait.

use std::os::fd::BorrowedFd;
use std::time::Duration;

use rustix::io::Errno;

use crate::forked::Forked;
use crate::open::OpenError;

/// Longest sleep of a port that must look by itself for something of which no event tells: a client for the death of its server,
/// and a subscriber that sleeps on a descriptor for another generation.
pub const SAFETY_BOUND: Duration = Duration::from_millis(250);

/// Longest uninterrupted sleep. A wake-up that iceoryx2 lost costs at most this much. It is a safety net: in order, every wake-up
/// comes from an event.
pub const LONGEST_SLEEP: Duration = Duration::from_secs(1);

/// Most sources of one wait: the ports of one process and its file descriptors, several times over.
pub const MAX_SOURCES: usize = 16;

/// Waiting failed.
#[derive(Debug, thiserror::Error)]
pub enum WaitError {
    /// There is nothing to wait for, not even the time.
    #[error("a wait without a time limit needs at least one port or file descriptor")]
    NoSources,
    /// There is too much to wait for.
    #[error("{0} sources were given to one wait, {MAX_SOURCES} are possible")]
    TooManySources(usize),
    /// A port has no descriptor to wait for.
    #[error("a port cannot be listened to")]
    Listener(#[from] OpenError),
    /// The process was forked from the one that made the port.
    #[error(transparent)]
    Forked(#[from] Forked),
    /// The operating system refused.
    #[error("the operating system cannot wait ({0})")]
    Failed(#[from] Errno),
}

/// What a [`Waiter`](crate::Waiter) can wait for: every port, and raw file descriptors as [`Descriptor`].
pub trait Source: sealed::Source {}

impl<T: sealed::Source> Source for T {}

pub(crate) mod sealed {
    use std::time::Duration;

    use super::{BorrowedFd, LONGEST_SLEEP, SAFETY_BOUND};
    use crate::doorbell::{Bits, Doorbell};
    use crate::wake::WakeReceiver;

    /// The part of a source that only this crate may implement.
    pub trait Source {
        /// Whether there is something, so that sleeping would be wrong. Makes no system call in the usual case.
        fn has_something(&self, look: Look) -> bool;

        /// What the port does by itself when it has something, instead of ending the wait: says whether it is such a port.
        fn tend(&mut self) -> bool {
            false
        }

        /// How to wait for it.
        fn sense(&self) -> Sense<'_>;
    }

    /// How closely to look.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Look {
        /// For what an event may have announced.
        Quick,
        /// Also for what iceoryx2 may have lost the event of.
        Thorough,
    }

    /// How long a sleep for a source may be.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub struct Bound {
        /// On the doorbell.
        pub by_doorbell: Duration,
        /// On a descriptor.
        pub by_descriptor: Duration,
    }

    impl Bound {
        /// An event tells of all that there can be.
        pub const LONG: Bound = Bound {
            by_doorbell: LONGEST_SLEEP,
            by_descriptor: LONGEST_SLEEP,
        };
        /// The doorbell alone tells of all that there can be.
        pub const LONG_BY_DOORBELL: Bound = Bound {
            by_doorbell: LONGEST_SLEEP,
            by_descriptor: SAFETY_BOUND,
        };
        /// There may be something of which no event tells.
        pub const SHORT: Bound = Bound {
            by_doorbell: SAFETY_BOUND,
            by_descriptor: SAFETY_BOUND,
        };
    }

    /// How to wait for a source.
    #[derive(Clone, Copy)]
    pub enum Sense<'a> {
        /// A port.
        Port {
            doorbell: &'a Doorbell,
            bits: Bits,
            /// `None` while the other side has not been there yet.
            receiver: Option<&'a WakeReceiver>,
            /// Whether to wait by the receiver's descriptor, because not every partner rings the doorbell for it.
            by_descriptor: bool,
            bound: Bound,
        },
        /// A file descriptor, of which the kernel knows.
        Descriptor(BorrowedFd<'a>),
    }
}

use sealed::{Look, Sense};

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
    fn has_something(&self, _look: Look) -> bool {
        false
    }

    fn sense(&self) -> Sense<'_> {
        Sense::Descriptor(self.0)
    }
}
