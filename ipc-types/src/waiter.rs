//! [`Waiter`]: sleeps until one of several ports or file descriptors has something, or a deadline passes.
//!
//! It only says that there is something. Whoever is woken, for whatever reason, drains everything: each subscriber,
//! server and client, and each file descriptor.
//!
//! iceoryx2 can lose a wake-up: a notification that comes while a listener is being drained may be swallowed, and the
//! listener then stays marked as notified, so that later notifiers send nothing. Two things make that harmless here.
//! Before each sleep every port is drained of notifications and asked for data, which unmarks it; and no sleep is
//! longer than [`SAFETY_BOUND`], after which all ports are asked again, without waking the caller.

use std::fmt::Debug;
use std::marker::PhantomData;
use std::os::fd::{AsRawFd, BorrowedFd};
use std::time::{Duration, Instant};

use iceoryx2::prelude::{
    CallbackProgression, FileDescriptor, FileDescriptorBased, SignalHandlingMode,
    SynchronousMultiplexing, WaitSet, WaitSetBuilder, WaitSetGuard,
};
use iceoryx2::waitset::{WaitSetAttachmentError, WaitSetRunResult};

use crate::iox::{Listener, Svc};

/// Longest uninterrupted sleep.
///
/// A lost wake-up costs at most this much; an idle process wakes ten times a second for a few microseconds. It is a
/// safety net, not a polling period: in order, every wake-up comes from an event.
pub const SAFETY_BOUND: Duration = Duration::from_millis(100);

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
    /// The same source was given twice.
    #[error("the same port or file descriptor was given to one wait twice")]
    SameSourceTwice,
    /// The descriptor is closed, or of a kind that cannot be waited for.
    #[error("file descriptor {0} is closed or cannot be waited for")]
    InvalidDescriptor(i32),
    /// The operating system has no resources left for it.
    #[error("cannot wait ({0}): the process may have too many open files")]
    Failed(String),
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
    /// Whether the source at `index` of the wait is known to be ready.
    pub fn is_ready(self, index: usize) -> bool {
        matches!(self, Wake::Ready(ready) if ready.contains(index))
    }
}

/// Which sources are ready, by their index in the wait.
///
/// A hint for raw file descriptors, which may block when read without need; ports are to be drained in any case.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ready(u16);

impl Ready {
    /// Whether the source at `index` is ready.
    pub fn contains(self, index: usize) -> bool {
        index < MAX_SOURCES && self.0 & (1 << index) != 0
    }

    fn insert(&mut self, index: usize) {
        self.0 |= 1 << index;
    }

    fn is_empty(self) -> bool {
        self.0 == 0
    }
}

/// What a [`Waiter`] can wait for: every port, and raw file descriptors as [`Descriptor`].
pub trait Source: sealed::Source {}

impl<T: sealed::Source> Source for T {}

pub(crate) mod sealed {
    use super::{Debug, SynchronousMultiplexing};

    /// What the reactor wants of something that it watches.
    pub trait Watched: SynchronousMultiplexing + Debug {}

    impl<T: SynchronousMultiplexing + Debug> Watched for T {}

    /// The part of a source that only this crate may implement.
    pub trait Source {
        /// Unmarks the source and says whether it has something, so that sleeping would be wrong.
        fn has_something(&self) -> bool;

        /// What to watch while sleeping.
        fn watched(&self) -> &dyn Watched;
    }
}

/// A raw file descriptor to wait for until it can be read: a serial port, a signal pipe.
///
/// One that has hung up is ready for ever: stop waiting for it. Made anew for each wait, so that descriptors may come
/// and go.
#[derive(Debug)]
pub struct Descriptor<'fd> {
    descriptor: Watchable,
    _borrowed: PhantomData<BorrowedFd<'fd>>,
}

#[derive(Debug)]
struct Watchable(FileDescriptor);

impl FileDescriptorBased for Watchable {
    fn file_descriptor(&self) -> &FileDescriptor {
        &self.0
    }
}

impl SynchronousMultiplexing for Watchable {}

impl<'fd> Descriptor<'fd> {
    /// The source that is ready when `fd` can be read without blocking.
    ///
    /// # Errors
    ///
    /// [`WaitError::InvalidDescriptor`] when it is closed.
    pub fn new(fd: BorrowedFd<'fd>) -> Result<Descriptor<'fd>, WaitError> {
        let raw = fd.as_raw_fd();
        let descriptor =
            FileDescriptor::non_owning_new(raw).ok_or(WaitError::InvalidDescriptor(raw))?;
        Ok(Descriptor {
            descriptor: Watchable(descriptor),
            _borrowed: PhantomData,
        })
    }
}

impl sealed::Source for Descriptor<'_> {
    /// The kernel knows, and says so at once.
    fn has_something(&self) -> bool {
        false
    }

    fn watched(&self) -> &dyn sealed::Watched {
        &self.descriptor
    }
}

/// Waits for several sources at once.
#[derive(Debug)]
pub struct Waiter {
    waitset: WaitSet<Svc>,
}

type Guards<'a> = [Option<WaitSetGuard<'a, 'a, Svc>>; MAX_SOURCES];

impl Waiter {
    pub(crate) fn new() -> Result<Waiter, WaitError> {
        WaitSetBuilder::new()
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<Svc>()
            .map(|waitset| Waiter { waitset })
            .map_err(|error| WaitError::Failed(format!("{error:?}")))
    }

    /// Sleeps until a source is ready, a signal comes or `timeout` has passed; `None` waits for ever.
    ///
    /// A timeout is rounded up to whole milliseconds. The sources are borrowed for this one wait only: they may come
    /// and go, and are free to be drained after it.
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
        let guards = self.attach(sources)?;
        let deadline = timeout.map(|timeout| Instant::now().checked_add(timeout));
        loop {
            let mut ready = Ready::default();
            for (index, source) in sources.iter().enumerate() {
                if source.has_something() {
                    ready.insert(index);
                }
            }
            let remaining = match deadline {
                Some(Some(deadline)) => deadline.saturating_duration_since(Instant::now()),
                _ => SAFETY_BOUND,
            };
            // When something is known to be ready, this only asks for the others.
            let bound = if ready.is_empty() {
                remaining.min(SAFETY_BOUND)
            } else {
                Duration::ZERO
            };
            let is_interrupted = self.sleep(&guards, bound, &mut ready)?;
            if !ready.is_empty() {
                return Ok(Wake::Ready(ready));
            }
            if is_interrupted {
                return Ok(Wake::Interrupted);
            }
            if remaining <= bound && matches!(deadline, Some(Some(_))) {
                return Ok(Wake::TimedOut);
            }
        }
    }

    fn attach<'a>(&'a self, sources: &[&'a dyn Source]) -> Result<Guards<'a>, WaitError> {
        let mut guards: Guards<'a> = [const { None }; MAX_SOURCES];
        for (guard, source) in guards.iter_mut().zip(sources) {
            let watched = source.watched();
            let attached = self.waitset.attach_notification(watched);
            *guard = Some(attached.map_err(|error| match error {
                WaitSetAttachmentError::AlreadyAttached => WaitError::SameSourceTwice,
                WaitSetAttachmentError::InternalError => WaitError::InvalidDescriptor(raw(watched)),
                other => WaitError::Failed(format!("{other:?}")),
            })?);
        }
        Ok(guards)
    }

    /// Sleeps once, adds what is ready, and says whether a signal interrupted it.
    fn sleep(
        &self,
        guards: &Guards<'_>,
        bound: Duration,
        ready: &mut Ready,
    ) -> Result<bool, WaitError> {
        let result = self.waitset.wait_and_process_once_with_timeout(
            |attachment| {
                for (index, guard) in guards.iter().enumerate() {
                    if guard
                        .as_ref()
                        .is_some_and(|guard| attachment.has_event_from(guard))
                    {
                        ready.insert(index);
                    }
                }
                CallbackProgression::Continue
            },
            bound,
        );
        match result {
            Ok(WaitSetRunResult::Interrupt | WaitSetRunResult::TerminationRequest) => Ok(true),
            Ok(WaitSetRunResult::AllEventsHandled | WaitSetRunResult::StopRequest) => Ok(false),
            Err(error) => Err(WaitError::Failed(format!("{error:?}"))),
        }
    }
}

/// The descriptor's number, only to show it.
fn raw(watched: &dyn sealed::Watched) -> i32 {
    // SAFETY: the number is neither stored nor used as a descriptor.
    #[allow(unsafe_code)]
    unsafe {
        watched.file_descriptor().native_handle()
    }
}

/// Waits for one port that has a listener: the ports' own `wait`.
///
/// `has_something` gets the number of notifications since the last call, and decides. The listener's wait looks at its
/// mark first, so that it heals itself; the bound is the same all the same.
pub(crate) fn wait_for(
    listener: &Listener,
    timeout: Duration,
    mut has_something: impl FnMut(u64) -> bool,
) -> Result<Wake, WaitError> {
    use iceoryx2::port::listener::ListenerWaitError;

    let deadline = Instant::now().checked_add(timeout);
    let mut notifications = crate::event::drain_listener(listener);
    loop {
        if has_something(notifications) {
            let mut ready = Ready::default();
            ready.insert(0);
            return Ok(Wake::Ready(ready));
        }
        let remaining = deadline.map_or(SAFETY_BOUND, |deadline| {
            deadline.saturating_duration_since(Instant::now())
        });
        if remaining.is_zero() {
            return Ok(Wake::TimedOut);
        }
        match listener.timed_wait(|_| {}, remaining.min(SAFETY_BOUND)) {
            Ok(count) => notifications = count,
            Err(ListenerWaitError::InterruptSignal) => return Ok(Wake::Interrupted),
            Err(error) => return Err(WaitError::Failed(format!("{error:?}"))),
        }
    }
}
