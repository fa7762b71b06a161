//! [`Waiter`]: sleeps until one of several ports or file descriptors has something, or a deadline passes.
//!
//! It only says that there is something. A process that is woken, for whatever reason, drains everything: each subscriber,
//! server and client, and each file descriptor.
//!
//! A wait for ports of one robot alone sleeps on the doorbell, and ends in about the time of a futex. With a file
//! descriptor or a server among the sources it is one `poll` of all of them.
//!
//! iceoryx2 can lose a wake-up: a notification that comes while a listener is being emptied may be swallowed, and the
//! listener then stays marked as notified, so that later notifiers send nothing. Two things make that harmless here.
//! Before each sleep every port is asked for data; and no sleep is longer than [`SAFETY_BOUND`], which is also how often
//! every listener is emptied, whatever the kernel says of it. The doorbell loses nothing; a provider that was held up, or
//! killed, between its data and the doorbell costs the bound.

use std::cell::Cell;
use std::os::fd::BorrowedFd;
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;

use crate::doorbell::{Bits, Doorbell, Slept};
use crate::open::OpenError;
use crate::time::MonotonicNs;
use crate::wake::WakeReceiver;

/// Longest uninterrupted sleep.
///
/// A lost wake-up costs at most this much; an idle process wakes four times a second for a few microseconds. It is a
/// safety net, not a polling period: in order, every wake-up comes from an event.
pub const SAFETY_BOUND: Duration = Duration::from_millis(250);

/// How much longer a sleep may be when its own deadline comes so shortly after the bound: one wake then serves both.
const BOUND_SLACK: Duration = Duration::from_millis(50);

/// How long after the last time a wake that comes anyway is used to empty all listeners, so that a process with other
/// deadlines does not also wake for that. Each listener takes two system calls.
const DRAIN_PERIOD: Duration = Duration::from_millis(150);

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

/// Why a wait ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wake {
    /// Something is ready; see [`Ready`]. Drain everything.
    Ready(Ready),
    /// The time is over.
    TimedOut,
    /// A signal came. Look at the signals, then drain everything.
    Interrupted,
}

impl Wake {
    /// Whether the source at `index` of the wait may be ready.
    pub fn is_ready(self, index: usize) -> bool {
        matches!(self, Wake::Ready(ready) if ready.contains(index))
    }

    /// Whether nothing but the source at `index` of the wait may be ready. The next wait looks at all ports again before
    /// it sleeps.
    pub fn is_only(self, index: usize) -> bool {
        index < MAX_SOURCES && self == Wake::Ready(Ready(1 << index))
    }
}

/// Which sources are ready, by their index in the wait.
///
/// A hint for raw file descriptors, which may block when read without need; ports are to be drained in any case, and a
/// wait that is for ports alone may not say which of them it was.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ready(u16);

impl Ready {
    /// Whether the source at `index` is ready.
    pub fn contains(self, index: usize) -> bool {
        index < MAX_SOURCES && self.0 & (1 << index) != 0
    }

    /// The first `count` sources, one of which is.
    fn all(count: usize) -> Ready {
        Ready(u16::MAX >> (MAX_SOURCES - count))
    }

    fn insert(&mut self, index: usize) {
        self.0 |= 1 << index;
    }

    pub(crate) fn is_empty(self) -> bool {
        self.0 == 0
    }
}

/// What a [`Waiter`] can wait for: every port, and raw file descriptors as [`Descriptor`].
pub trait Source: sealed::Source {}

impl<T: sealed::Source> Source for T {}

pub(crate) mod sealed {
    use super::{Bits, BorrowedFd, Doorbell, WakeReceiver};

    /// The part of a source that only this crate may implement.
    pub trait Source {
        /// Whether there is something, so that sleeping would be wrong. Makes no system call in the usual case.
        fn has_something(&self) -> bool;

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

/// Waits for several sources at once. Keep it from wait to wait: it remembers when it last emptied the listeners.
#[derive(Debug, Default)]
pub struct Waiter {
    /// When all listeners were last emptied.
    drained_all: Cell<MonotonicNs>,
    missed: Cell<u64>,
}

impl Waiter {
    /// A waiter for whatever its waits are given.
    pub fn new() -> Waiter {
        Waiter::default()
    }

    /// Sleeps that were ended by nothing but [`SAFETY_BOUND`] although there was something: wake-ups that were lost, or that
    /// came too late. Each cost that much at most.
    pub fn missed(&self) -> u64 {
        self.missed.get()
    }

    /// Sleeps until a source is ready, a signal comes or `timeout` has passed; `None` waits for ever.
    ///
    /// The sources are borrowed for this one wait only: they may come and go, and are free to be drained after it. A
    /// signal that comes just before the sleep does not end it; who must not miss one waits for a descriptor as well, or
    /// with a timeout.
    ///
    /// # Errors
    ///
    /// See [`WaitError`]; an interrupting signal is no error.
    pub fn wait(
        &self,
        sources: &[&dyn Source],
        timeout: Option<Duration>,
    ) -> Result<Wake, WaitError> {
        if sources.is_empty() {
            return Err(WaitError::NoSources);
        }
        if sources.len() > MAX_SOURCES {
            return Err(WaitError::TooManySources(sources.len()));
        }
        let deadline = match timeout {
            Some(timeout) => MonotonicNs::now() + timeout,
            None => MonotonicNs(u64::MAX),
        };
        match doorbell_of(sources) {
            Some((doorbell, bits)) => self.wait_for_doorbell(doorbell, bits, sources, deadline),
            None => self.wait_for_descriptors(sources, deadline),
        }
    }

    fn wait_for_doorbell(
        &self,
        doorbell: &Doorbell,
        bits: Bits,
        sources: &[&dyn Source],
        deadline: MonotonicNs,
    ) -> Result<Wake, WaitError> {
        let mut ready = look(sources);
        while ready.is_empty() {
            let seen = doorbell.listen(bits);
            ready = look(sources);
            if !ready.is_empty() {
                break;
            }
            let now = MonotonicNs::now();
            if now >= deadline {
                return Ok(Wake::TimedOut);
            }
            match doorbell.sleep(seen, bits, deadline.min(now + SAFETY_BOUND))? {
                // Draining looks by itself.
                Slept::Rung => return Ok(Wake::Ready(Ready::all(sources.len()))),
                Slept::Passed => {}
                Slept::Interrupted => return Ok(Wake::Interrupted),
                Slept::TimedOut => {
                    drain_all(sources);
                    ready = look(sources);
                    if !ready.is_empty() && doorbell.is_awaited(bits) {
                        self.missed.set(self.missed.get() + 1);
                    }
                }
            }
        }
        Ok(Wake::Ready(ready))
    }

    fn wait_for_descriptors(
        &self,
        sources: &[&dyn Source],
        deadline: MonotonicNs,
    ) -> Result<Wake, WaitError> {
        // Before anything is looked at: a listener that is made here announces nothing of what came before it.
        let descriptors = descriptors(sources)?;
        let mut slept = None;
        loop {
            let now = MonotonicNs::now();
            if now.since(self.drained_all.get()) >= DRAIN_PERIOD {
                drain_all(sources);
                self.drained_all.set(now);
            }
            let mut ready = look(sources);
            if slept == Some(Slept::TimedOut) && !ready.is_empty() {
                self.missed.set(self.missed.get() + 1);
            }
            if slept.is_some() && now >= deadline && ready.is_empty() {
                return Ok(Wake::TimedOut);
            }
            let bound = self.drained_all.get() + SAFETY_BOUND;
            // With something to do already, the kernel is only asked what else there is.
            let until = match ready.is_empty() {
                true if deadline <= bound + BOUND_SLACK => deadline,
                true => bound,
                false => now,
            };
            let outcome = poll_once(sources, &descriptors, until.since(now), &mut ready)?;
            if !ready.is_empty() {
                return Ok(Wake::Ready(ready));
            }
            if outcome == Slept::Interrupted {
                return Ok(Wake::Interrupted);
            }
            slept = Some(outcome);
        }
    }
}

/// The one doorbell that wakes for all sources, and by which bits.
fn doorbell_of<'a>(sources: &[&'a dyn Source]) -> Option<(&'a Doorbell, Bits)> {
    let mut found: Option<(&Doorbell, Bits)> = None;
    for source in sources {
        let Sense::Port {
            doorbell,
            bits,
            by_descriptor: false,
            ..
        } = source.sense()
        else {
            return None;
        };
        found = match found {
            None => Some((doorbell, bits)),
            Some((other, all)) if std::ptr::eq(doorbell, other) => Some((doorbell, all | bits)),
            Some(_) => return None,
        };
    }
    found
}

/// Which sources have something.
pub(crate) fn look(sources: &[&dyn Source]) -> Ready {
    let mut ready = Ready::default();
    for (index, source) in sources.iter().enumerate() {
        if source.has_something() {
            ready.insert(index);
        }
    }
    ready
}

fn drain_all(sources: &[&dyn Source]) {
    for source in sources {
        drain(*source);
    }
}

fn drain(source: &dyn Source) {
    if let Sense::Port {
        receiver: Some(receiver),
        ..
    } = source.sense()
    {
        receiver.drain();
    }
}

/// The sources' descriptors, each with the index of its source; a port whose other side was never there has none.
type Descriptors<'a> = [Option<BorrowedFd<'a>>; MAX_SOURCES];

fn descriptors<'a>(sources: &[&'a dyn Source]) -> Result<Descriptors<'a>, WaitError> {
    let mut descriptors = [None; MAX_SOURCES];
    for (descriptor, source) in descriptors.iter_mut().zip(sources) {
        *descriptor = match source.sense() {
            Sense::Port { receiver, .. } => receiver.map(WakeReceiver::descriptor).transpose()?,
            Sense::Descriptor(descriptor) => Some(descriptor),
        };
    }
    Ok(descriptors)
}

/// Sleeps once, and adds what is ready; the listeners among them are emptied.
fn poll_once(
    sources: &[&dyn Source],
    descriptors: &Descriptors<'_>,
    timeout: Duration,
    ready: &mut Ready,
) -> Result<Slept, WaitError> {
    let mut indices = [0; MAX_SOURCES];
    // Filled from the front; what stays is not polled.
    let mut polled: [PollFd<'_>; MAX_SOURCES] = std::array::from_fn(|_| {
        PollFd::from_borrowed_fd(rustix::stdio::stdin(), PollFlags::empty())
    });
    let mut count = 0;
    for (index, descriptor) in descriptors.iter().enumerate() {
        if let Some(descriptor) = descriptor {
            polled[count] = PollFd::from_borrowed_fd(*descriptor, PollFlags::IN);
            indices[count] = index;
            count += 1;
        }
    }
    let polled = &mut polled[..count];
    // Too long for the kernel is as good as for ever: the bound is shorter.
    let timeout = Timespec::try_from(timeout).ok();
    match poll(polled, timeout.as_ref()) {
        Ok(0) => return Ok(Slept::TimedOut),
        Ok(_) => {}
        Err(Errno::INTR) => return Ok(Slept::Interrupted),
        Err(errno) => return Err(errno.into()),
    }
    for (polled, index) in polled.iter().zip(indices) {
        if !polled.revents().is_empty() {
            ready.insert(index);
            drain(sources[index]);
        }
    }
    Ok(Slept::Rung)
}
