//! [`Waiter`]: sleeps until one of several ports or file descriptors has something, or a deadline passes.
//!
//! It only says that there is something. Whoever is woken, for whatever reason, drains everything: each subscriber,
//! server and client, and each file descriptor.
//!
//! Who waits for ports alone sleeps on the bell, and is woken in about the time of a futex. With a file descriptor, or a
//! port that has no bell, among the sources it is one `poll` of all of them.
//!
//! iceoryx2 can lose a wake-up: a notification that comes while a listener is being emptied may be swallowed, and the
//! listener then stays marked as notified, so that later notifiers send nothing. Two things make that harmless here.
//! Before each sleep every port is asked for data; and no sleep is longer than [`SAFETY_BOUND`], which is also how often
//! every listener is emptied, whatever the kernel says of it. The bell loses nothing, but a publisher of another
//! language may not ring it: the bound holds there too, and who is woken by nothing else goes over to events.

use std::cell::Cell;
use std::os::fd::BorrowedFd;
use std::rc::Rc;
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;

use crate::bell::{Bell, Bits, Slept};
use crate::ear::Ear;
use crate::open::OpenError;
use crate::time::MonotonicNs;

/// Longest uninterrupted sleep.
///
/// A lost wake-up costs at most this much; an idle process wakes four times a second for a few microseconds. It is a
/// safety net, not a polling period: in order, every wake-up comes from an event.
pub const SAFETY_BOUND: Duration = Duration::from_millis(250);

/// How much longer a sleep may be when its own deadline comes so shortly after the bound: one wake then serves both.
const BOUND_SLACK: Duration = Duration::from_millis(50);

/// How long after the last time a wake that comes anyway is used to empty all listeners, so that a process with other
/// deadlines does not also wake for that. Each listener takes two system calls.
const HEARING_PERIOD: Duration = Duration::from_millis(150);

/// Most sources of one wait: the ports of one process and its file descriptors, several times over.
pub const MAX_SOURCES: usize = 16;

/// How often in a row data must be found that nobody rang for, until a waiter relies on events instead. Once may be a
/// publisher that was held up between its data and the bell.
const MAX_UNRUNG: u8 = 2;

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
    use super::{BorrowedFd, Ear};

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
        /// A port's ear.
        Ear(&'a Ear),
        /// A port's ear that must be waited for by its descriptor, because not everybody rings the bell for it.
        Listener(&'a Ear),
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
    heard_all: Cell<MonotonicNs>,
    /// How often in a row data was found that nobody had rung for.
    unrung: Cell<u8>,
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
        match bell_of(sources) {
            Some((bell, bits)) if self.unrung.get() < MAX_UNRUNG => {
                self.wait_for_bell(bell, bits, sources, deadline)
            }
            _ => self.wait_for_descriptors(sources, deadline),
        }
    }

    fn wait_for_bell(
        &self,
        bell: &Bell,
        bits: Bits,
        sources: &[&dyn Source],
        deadline: MonotonicNs,
    ) -> Result<Wake, WaitError> {
        let mut ready = look(sources);
        while ready.is_empty() {
            let heard = bell.listen(bits);
            ready = look(sources);
            if !ready.is_empty() {
                break;
            }
            let now = MonotonicNs::now();
            if now >= deadline {
                return Ok(Wake::TimedOut);
            }
            match bell.sleep(heard, bits, deadline.min(now + SAFETY_BOUND))? {
                Slept::Rung => {
                    self.unrung.set(0);
                    // Who drains looks for himself.
                    return Ok(Wake::Ready(Ready::all(sources.len())));
                }
                Slept::Passed => {}
                Slept::Interrupted => return Ok(Wake::Interrupted),
                Slept::TimedOut => {
                    hear_all(sources);
                    ready = look(sources);
                    if !ready.is_empty() && bell.is_awaited(bits) {
                        self.unrung.set(self.unrung.get().saturating_add(1));
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
            if now.since(self.heard_all.get()) >= HEARING_PERIOD {
                hear_all(sources);
                self.heard_all.set(now);
            }
            let mut ready = look(sources);
            if slept == Some(Slept::TimedOut) && !ready.is_empty() {
                self.missed.set(self.missed.get() + 1);
            }
            if slept.is_some() && now >= deadline && ready.is_empty() {
                return Ok(Wake::TimedOut);
            }
            let bound = self.heard_all.get() + SAFETY_BOUND;
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

/// The one bell that wakes for all sources, and by which bits.
fn bell_of<'a>(sources: &[&'a dyn Source]) -> Option<(&'a Bell, Bits)> {
    let mut found: Option<(&Rc<Bell>, Bits)> = None;
    for source in sources {
        let Sense::Ear(ear) = source.sense() else {
            return None;
        };
        let (bell, bits) = ear.bell()?;
        found = match found {
            None => Some((bell, bits)),
            Some((other, all)) if Rc::ptr_eq(bell, other) => Some((bell, all | bits)),
            Some(_) => return None,
        };
    }
    found.map(|(bell, bits)| (bell.as_ref(), bits))
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

fn hear_all(sources: &[&dyn Source]) {
    for source in sources {
        hear(*source);
    }
}

fn hear(source: &dyn Source) {
    match source.sense() {
        Sense::Ear(ear) | Sense::Listener(ear) => ear.hear(),
        Sense::Descriptor(_) => {}
    }
}

/// The descriptors of all sources; the rest of the array repeats the first.
fn descriptors<'a>(sources: &[&'a dyn Source]) -> Result<[BorrowedFd<'a>; MAX_SOURCES], WaitError> {
    let mut descriptors = [descriptor(sources[0])?; MAX_SOURCES];
    for (descriptor_of, source) in descriptors.iter_mut().zip(sources) {
        *descriptor_of = descriptor(*source)?;
    }
    Ok(descriptors)
}

fn descriptor<'a>(source: &'a dyn Source) -> Result<BorrowedFd<'a>, WaitError> {
    Ok(match source.sense() {
        Sense::Ear(ear) | Sense::Listener(ear) => ear.descriptor()?,
        Sense::Descriptor(descriptor) => descriptor,
    })
}

/// Sleeps once, and adds what is ready; the listeners among them are emptied.
fn poll_once(
    sources: &[&dyn Source],
    descriptors: &[BorrowedFd<'_>; MAX_SOURCES],
    timeout: Duration,
    ready: &mut Ready,
) -> Result<Slept, WaitError> {
    let mut polled =
        descriptors.map(|descriptor| PollFd::from_borrowed_fd(descriptor, PollFlags::IN));
    let polled = &mut polled[..sources.len()];
    // Too long for the kernel is as good as for ever: the bound is shorter.
    let timeout = Timespec::try_from(timeout).ok();
    match poll(polled, timeout.as_ref()) {
        Ok(0) => return Ok(Slept::TimedOut),
        Ok(_) => {}
        Err(Errno::INTR) => return Ok(Slept::Interrupted),
        Err(errno) => return Err(errno.into()),
    }
    for (index, (polled, source)) in polled.iter().zip(sources).enumerate() {
        if !polled.revents().is_empty() {
            ready.insert(index);
            hear(*source);
        }
    }
    Ok(Slept::Rung)
}
