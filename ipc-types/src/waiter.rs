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
//! A listener is emptied until there is nothing in it, which takes the mark away; and no sleep is longer than
//! [`LONGEST_SLEEP`], after which every port is asked for data, whatever the kernel says of its listener. The doorbell loses nothing; a
//! provider that was held up, or killed, between its data and the doorbell costs the bound.

use std::time::Duration;

use crate::sleep::{Ended, History, ReadySet, Sleep};
pub(crate) use crate::source::sealed;
pub use crate::source::{Descriptor, LONGEST_SLEEP, MAX_SOURCES, SAFETY_BOUND, Source, WaitError};
use crate::time::MonotonicNs;

/// Why a wait ended. `K` is what the caller calls its sources.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wake<K = ()> {
    /// Something is ready; see [`Ready`]. Drain everything.
    Ready(Ready<K>),
    /// The time is over.
    TimedOut,
    /// A signal came. Look at the signals, then drain everything.
    Interrupted,
}

impl<K> Wake<K> {
    /// Whether any source may be ready.
    pub fn is_ready(&self) -> bool {
        matches!(self, Wake::Ready(_))
    }

    /// Changes what the sources are called; those that get no name are left out.
    pub fn rename<L>(self, rename: impl FnMut(K) -> Option<L>) -> Wake<L> {
        match self {
            Wake::Ready(ready) => Wake::Ready(ready.rename(rename)),
            Wake::TimedOut => Wake::TimedOut,
            Wake::Interrupted => Wake::Interrupted,
        }
    }
}

impl<K: PartialEq> Wake<K> {
    /// Whether the source `key` may be ready.
    pub fn has(&self, key: K) -> bool {
        matches!(self, Wake::Ready(ready) if ready.contains(key))
    }

    /// Whether nothing but the source `key` may be ready. The next wait looks at all ports again before it sleeps.
    pub fn is_only(&self, key: K) -> bool {
        matches!(self, Wake::Ready(ready) if ready.is_only(key))
    }
}

/// Which sources are ready, by the keys that the caller has given them.
///
/// A hint for raw file descriptors, which may block when read without need; ports are to be drained in any case, and a
/// wait that is for ports alone may not say which of them it was.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ready<K = ()> {
    /// At the place of each source in the wait.
    keys: [Option<K>; MAX_SOURCES],
}

impl<K> Ready<K> {
    /// The keys of the sources that are ready, in the order of the wait.
    pub fn keys(&self) -> impl Iterator<Item = &K> {
        self.keys.iter().flatten()
    }

    /// Whether the source `key` is ready.
    pub fn contains(&self, key: K) -> bool
    where
        K: PartialEq,
    {
        self.keys().any(|ready| *ready == key)
    }

    fn is_only(&self, key: K) -> bool
    where
        K: PartialEq,
    {
        let mut keys = self.keys().map(|ready| *ready == key);
        keys.next() == Some(true) && keys.all(|is_it| is_it)
    }

    fn of(places: ReadySet, sources: &[(K, &mut dyn Source)]) -> Ready<K>
    where
        K: Copy,
    {
        Ready {
            keys: std::array::from_fn(|place| {
                let (key, _) = sources.get(place)?;
                places.contains(place).then_some(*key)
            }),
        }
    }

    fn rename<L>(self, mut rename: impl FnMut(K) -> Option<L>) -> Ready<L> {
        Ready {
            keys: self.keys.map(|key| key.and_then(&mut rename)),
        }
    }
}

/// Waits for several sources at once. Keep it from wait to wait: it remembers when it last asked all ports for data.
#[derive(Debug, Default)]
pub struct Waiter {
    history: History,
}

impl Waiter {
    /// A waiter for whatever its waits are given.
    pub fn new() -> Waiter {
        Waiter::default()
    }

    /// Sleeps that were ended by nothing but [`LONGEST_SLEEP`] although there was something: wake-ups that were lost, or that
    /// came too late. Each cost that much at most.
    pub fn missed(&self) -> u64 {
        self.history.missed.get()
    }

    /// Sleeps until a source is ready, a signal comes or `timeout` has passed; `None` waits for ever.
    ///
    /// Each source has a key of the caller's choice, by which the [`Wake`] tells it from the others:
    ///
    /// ```no_run
    /// # use ipc_types::{Client, Subscriber, Waiter, payload::{HeroTelemetry, MovementData}};
    /// # fn f(mut telemetry: Subscriber<HeroTelemetry>, mut flight: Client<MovementData>) -> Result<(), Box<dyn std::error::Error>> {
    /// let waiter = Waiter::new();
    /// let wake = waiter.wait(&mut [("telemetry", &mut telemetry), ("reports", &mut flight)], None)?;
    /// if wake.has("telemetry") {
    ///     telemetry.drain(|sample| println!("{:.1} m", sample.geodetic.altitude_m))?;
    /// }
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// The sources are borrowed for this one wait only: they may come and go, and are free to be drained after it. Publishers
    /// never end a wait; they serve their subscribers in it. A
    /// signal that comes just before the sleep does not end it; who must not miss one waits for a descriptor as well, or
    /// with a timeout.
    ///
    /// # Errors
    ///
    /// See [`WaitError`]; an interrupting signal is no error.
    pub fn wait<K: Copy>(
        &self,
        sources: &mut [(K, &mut dyn Source)],
        timeout: Option<Duration>,
    ) -> Result<Wake<K>, WaitError> {
        if sources.is_empty() && timeout.is_none() {
            return Err(WaitError::NoSources);
        }
        if sources.len() > MAX_SOURCES {
            return Err(WaitError::TooManySources(sources.len()));
        }
        let deadline = match timeout {
            Some(timeout) => MonotonicNs::now() + timeout,
            None => MonotonicNs(u64::MAX),
        };
        loop {
            let mut tended = ReadySet::default();
            for (place, (_, source)) in sources.iter_mut().enumerate() {
                if source.tend() {
                    tended.insert(place);
                }
            }
            let places = match Sleep::of(sources).until(deadline, &self.history)? {
                Ended::Ready(places) => places.without(tended),
                Ended::TimedOut => return Ok(Wake::TimedOut),
                Ended::Interrupted => return Ok(Wake::Interrupted),
            };
            if !places.is_empty() {
                return Ok(Wake::Ready(Ready::of(places, sources)));
            }
        }
    }

    /// As [`Waiter::wait`], for one source.
    pub(crate) fn wait_for_one(
        &self,
        source: &mut dyn Source,
        timeout: Duration,
    ) -> Result<Wake, WaitError> {
        self.wait(&mut [((), source)], Some(timeout))
    }
}
