//! [`Waiter`]: sleeps until one of several ports or file descriptors has something, or a deadline passes. [`Source`]:
//! what can be waited for.
//!
//! It only says that there is something. A process that is woken, for whatever reason, drains everything: each
//! subscriber, server and client, and each file descriptor.
//!
//! A wait for ports of one robot alone sleeps on the doorbell, and ends in about the time of a futex. With a file
//! descriptor or a server among the sources it is one `poll` of all of them.
//!
//! iceoryx2 can lose a wake-up: a notification that comes while a listener is being emptied may be swallowed, and the
//! listener then stays marked as notified, so that later notifiers send nothing. Two things make that harmless here.
//! A listener is emptied until there is nothing in it, which takes the mark away; and no sleep is longer than
//! [`LONGEST_SLEEP`], after which every port is asked for data, whatever the kernel says of its listener. The doorbell
//! loses nothing; a provider that was held up, or killed, between its data and the doorbell costs the bound.

mod fleet;

use std::cell::Cell;
use std::os::fd::BorrowedFd;
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;

use crate::doorbell::{Bits, Doorbell, Slept};
use crate::forked::Forked;
use crate::open::OpenError;
use crate::time::MonotonicNs;
use crate::wake::WakeReceiver;
use sealed::{Look, Sense};

/// Longest sleep of a port that must look by itself for something of which no event tells: a client for the death of
/// its server, and a subscriber that sleeps on a descriptor for another generation.
pub const SAFETY_BOUND: Duration = Duration::from_millis(250);

/// Longest uninterrupted sleep. A wake-up that iceoryx2 lost costs at most this much. It is a safety net: in order,
/// every wake-up comes from an event.
pub const LONGEST_SLEEP: Duration = Duration::from_secs(1);

/// Most sources of one [`Waiter::wait`]: the ports of one process and its file descriptors, several times over. A tool
/// that looks at a whole fleet has [`Waiter::wait_for_any`].
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

/// How much longer a sleep may be when its own deadline comes so shortly after the bound: one wake then serves both.
const BOUND_SLACK: Duration = Duration::from_millis(50);

/// What a [`Waiter`] can wait for: every port, and raw file descriptors as [`Descriptor`].
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

        /// What the port does by itself when it has something, instead of ending the wait: says whether it is such a
        /// port.
        fn service(&mut self) -> bool {
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
        /// Whatever may be there has an event.
        pub const LONG: Bound = Bound {
            by_doorbell: LONGEST_SLEEP,
            by_descriptor: LONGEST_SLEEP,
        };
        /// Whatever may be there has an event of the doorbell; of the descriptor it may have none.
        pub const LONG_BY_DOORBELL: Bound = Bound {
            by_doorbell: LONGEST_SLEEP,
            by_descriptor: SAFETY_BOUND,
        };
        /// There may be something without any event.
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
    /// When all sources were last looked at thoroughly.
    looked: Cell<MonotonicNs>,
    /// Sleeps that nothing but the safety bound ended although there was something.
    missed: Cell<u64>,
    /// Whether the last wait had to sleep on the doorbell. This one will have to as well: it looks once, after it has
    /// announced itself, and not also before.
    has_slept: Cell<bool>,
}

impl Waiter {
    /// A waiter for whatever its waits are given.
    pub fn new() -> Waiter {
        Waiter::default()
    }

    /// Sleeps that were ended by nothing but [`LONGEST_SLEEP`] although there was something: wake-ups that were lost,
    /// or that came too late. Each cost that much at most.
    pub fn missed(&self) -> u64 {
        self.missed.get()
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
    /// The sources are borrowed for this one wait only: they may come and go, and are free to be drained after it.
    /// Publishers never end a wait; they serve their subscribers in it. A signal that comes just before the sleep does
    /// not end it; who must not miss one waits for a descriptor as well, or with a timeout.
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
        let begun = MonotonicNs::now();
        let deadline = match timeout {
            Some(timeout) => begun + timeout,
            None => MonotonicNs(u64::MAX),
        };
        loop {
            let mut tended = ReadySet::default();
            for (place, (_, source)) in sources.iter_mut().enumerate() {
                if source.service() {
                    tended.insert(place);
                }
            }
            let places = match Sleep::of(sources).until(begun, deadline, self)? {
                Ended::Ready(places) => places.without(tended),
                Ended::TimedOut => return Ok(Wake::TimedOut),
                Ended::Interrupted => return Ok(Wake::Interrupted),
            };
            if !places.is_empty() {
                return Ok(Wake::Ready(Ready::of(places, sources)));
            }
        }
    }

    /// How to look at `now`: thoroughly when that was long ago.
    fn look(&self, now: MonotonicNs) -> Look {
        self.look_again_after(SAFETY_BOUND, now)
    }

    /// As [`look`](Self::look), before a sleep. A look is thorough sooner when the sleep would be cut short for nothing
    /// but such a look.
    fn look_before(&self, now: MonotonicNs, deadline: MonotonicNs, bound: Duration) -> Look {
        match self.until(deadline, bound) < deadline {
            true => self.look_again_after(BOUND_SLACK, now),
            false => self.look(now),
        }
    }

    fn look_again_after(&self, pause: Duration, now: MonotonicNs) -> Look {
        if now.since(self.looked.get()) < pause {
            return Look::Quick;
        }
        self.looked.set(now);
        Look::Thorough
    }

    /// Until when to sleep: `deadline`, but no longer than `bound` after the last thorough look.
    fn until(&self, deadline: MonotonicNs, bound: Duration) -> MonotonicNs {
        let bound = self.looked.get() + bound;
        match deadline <= bound + BOUND_SLACK {
            true => deadline,
            false => bound,
        }
    }

    fn count_missed(&self) {
        self.missed.set(self.missed.get() + 1);
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

/// Which sources have something, by their places in the sleep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct ReadySet(u16);

impl ReadySet {
    fn insert(&mut self, place: usize) {
        self.0 |= 1 << place;
    }

    fn contains(self, place: usize) -> bool {
        self.0 & (1 << place) != 0
    }

    fn without(self, others: ReadySet) -> ReadySet {
        ReadySet(self.0 & !others.0)
    }

    fn is_empty(self) -> bool {
        self.0 == 0
    }
}

/// How a sleep ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ended {
    Ready(ReadySet),
    TimedOut,
    Interrupted,
}

/// The sources of one sleep.
struct Sleep<'a> {
    /// Filled from the front.
    sources: [Option<&'a dyn Source>; MAX_SOURCES],
}

impl<'a> Sleep<'a> {
    /// A sleep over the first [`MAX_SOURCES`] of `sources`.
    fn of<K>(sources: &'a [(K, &mut dyn Source)]) -> Sleep<'a> {
        Sleep {
            sources: std::array::from_fn(|place| sources.get(place).map(|(_, source)| &**source)),
        }
    }

    fn sources(&self) -> impl Iterator<Item = &'a dyn Source> {
        self.sources.iter().flatten().copied()
    }

    /// Sleeps until a source has something, a signal comes or the time is `deadline`; it is `begun` now.
    fn until(
        &self,
        begun: MonotonicNs,
        deadline: MonotonicNs,
        waiter: &Waiter,
    ) -> Result<Ended, WaitError> {
        match self.doorbell()? {
            Some(bell) => self.by_doorbell(bell, (begun, deadline), waiter),
            None => self.by_descriptors(deadline, waiter),
        }
    }

    /// The one doorbell that wakes for all sources, by which bits, and the shortest bound of all sources.
    fn doorbell(&self) -> Result<Option<(&'a Doorbell, Bits, Duration)>, Forked> {
        let mut found: Option<(&Doorbell, Bits, Duration)> = None;
        for source in self.sources() {
            let Sense::Port {
                doorbell,
                bits,
                by_descriptor: false,
                bound,
                ..
            } = source.sense()
            else {
                return Ok(None);
            };
            doorbell.check_process()?;
            let bound = bound.by_doorbell;
            found = match found {
                None => Some((doorbell, bits, bound)),
                Some((other, all, least)) if std::ptr::eq(doorbell, other) => {
                    Some((doorbell, all | bits, least.min(bound)))
                }
                Some(_) => return Ok(None),
            };
        }
        Ok(found)
    }

    fn by_doorbell(
        &self,
        (doorbell, bits, bound): (&Doorbell, Bits, Duration),
        (begun, deadline): (MonotonicNs, MonotonicNs),
        waiter: &Waiter,
    ) -> Result<Ended, WaitError> {
        let mut ready = match waiter.has_slept.take() {
            true => ReadySet::default(),
            false => self.look(waiter.look(begun)),
        };
        while ready.is_empty() {
            let seen = doorbell.listen(bits);
            let now = MonotonicNs::now();
            ready = self.look(waiter.look_before(now, deadline, bound));
            if !ready.is_empty() {
                break;
            }
            if now >= deadline {
                return Ok(Ended::TimedOut);
            }
            let until = waiter.until(deadline, bound);
            match doorbell.sleep(seen, bits, until)? {
                // Draining looks by itself, and looking twice takes microseconds when the caches are cold.
                Slept::Signalled => {
                    waiter.has_slept.set(true);
                    return Ok(Ended::Ready(self.all()));
                }
                Slept::Passed => ready = self.look(Look::Quick),
                Slept::Interrupted => return Ok(Ended::Interrupted),
                Slept::TimedOut => {
                    ready = self.look(Look::Thorough);
                    if !ready.is_empty() && until < deadline && doorbell.is_awaited(bits) {
                        waiter.count_missed();
                    }
                }
            }
        }
        Ok(Ended::Ready(ready))
    }

    fn by_descriptors(&self, deadline: MonotonicNs, waiter: &Waiter) -> Result<Ended, WaitError> {
        // Before anything is looked at: a listener that is made here announces nothing of what came before it.
        let (descriptors, bound) = self.descriptors()?;
        let mut slept = None;
        loop {
            let now = MonotonicNs::now();
            let mut ready = match waiter.look(now) {
                Look::Thorough => self.look_thoroughly(),
                Look::Quick => self.look(Look::Quick),
            };
            if slept == Some(Slept::TimedOut) && !ready.is_empty() {
                waiter.count_missed();
            }
            if slept.is_some() && now >= deadline && ready.is_empty() {
                return Ok(Ended::TimedOut);
            }
            // With something to do already, the kernel is only asked what else there is.
            let until = match ready.is_empty() {
                true => waiter.until(deadline, bound),
                false => now,
            };
            let outcome = self.poll(&descriptors, until.since(now), &mut ready)?;
            if !ready.is_empty() {
                return Ok(Ended::Ready(ready));
            }
            if outcome == Slept::Interrupted {
                return Ok(Ended::Interrupted);
            }
            slept = Some(outcome);
        }
    }

    fn all(&self) -> ReadySet {
        let mut all = ReadySet::default();
        (0..self.sources().count()).for_each(|place| all.insert(place));
        all
    }

    /// Which sources have something.
    fn look(&self, look: Look) -> ReadySet {
        let mut ready = ReadySet::default();
        for (place, source) in self.sources().enumerate() {
            if source.has_something(look) {
                ready.insert(place);
            }
        }
        ready
    }

    /// Which sources have something, also when iceoryx2 has lost the event of it. Their listeners are emptied, which
    /// makes iceoryx2 send events again.
    fn look_thoroughly(&self) -> ReadySet {
        let announced = self.look(Look::Quick);
        let ready = self.look(Look::Thorough);
        let missed = ready.without(announced);
        for (place, source) in self.sources().enumerate() {
            if missed.contains(place) {
                drain(source);
            }
        }
        ready
    }

    /// The descriptors of all sources, and the shortest of their bounds.
    fn descriptors(&self) -> Result<(Descriptors<'a>, Duration), WaitError> {
        let mut descriptors = [None; MAX_SOURCES];
        let mut least = LONGEST_SLEEP;
        for (descriptor, source) in descriptors.iter_mut().zip(self.sources()) {
            *descriptor = match source.sense() {
                Sense::Port {
                    doorbell,
                    receiver,
                    bound,
                    ..
                } => {
                    doorbell.check_process()?;
                    least = least.min(bound.by_descriptor);
                    receiver
                        .inspect(|receiver| receiver.leave_to_waiters())
                        .map(WakeReceiver::descriptor)
                        .transpose()?
                }
                Sense::Descriptor(descriptor) => Some(descriptor),
            };
        }
        Ok((descriptors, least))
    }

    /// Sleeps once, and adds what is ready; the listeners among them are emptied.
    fn poll(
        &self,
        descriptors: &Descriptors<'_>,
        timeout: Duration,
        ready: &mut ReadySet,
    ) -> Result<Slept, WaitError> {
        let mut places = [0; MAX_SOURCES];
        // Filled from the front; what stays is not polled.
        let mut polled: [PollFd<'_>; MAX_SOURCES] = std::array::from_fn(|_| {
            PollFd::from_borrowed_fd(rustix::stdio::stdin(), PollFlags::empty())
        });
        let mut count = 0;
        for (place, descriptor) in descriptors.iter().enumerate() {
            if let Some(descriptor) = descriptor {
                polled[count] = PollFd::from_borrowed_fd(*descriptor, PollFlags::IN);
                places[count] = place;
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
        for (polled, place) in polled.iter().zip(places) {
            if polled.revents().is_empty() {
                continue;
            }
            ready.insert(place);
            if let Some(source) = self.sources[place] {
                drain(source);
            }
        }
        Ok(Slept::Signalled)
    }
}

/// The sources' descriptors at their places; a port whose other side was never there has none.
type Descriptors<'a> = [Option<BorrowedFd<'a>>; MAX_SOURCES];

fn drain(source: &dyn Source) {
    if let Sense::Port {
        receiver: Some(receiver),
        ..
    } = source.sense()
    {
        receiver.drain();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::payload::ModuleControl;
    use crate::wake::drain_listener;
    use crate::{Client, Domain, Ipc, RobotId, Server};

    /// A thorough look takes no system call, and a wake does.
    #[test]
    fn no_sleep_is_cut_short_for_a_look_that_could_have_come_before_it() {
        let at = |ms: u64| MonotonicNs(10_000_000_000 + ms * 1_000_000);
        // When the last thorough look was, and the deadline; how to look at 1,000 ms, and until when to sleep then.
        for (looked_ms, deadline_ms, look, until_ms) in [
            (1000, 2000, Look::Quick, 2000),
            (951, 2000, Look::Quick, 2000),
            (800, 1850, Look::Quick, 1850),
            (800, 1851, Look::Thorough, 1851),
            (800, 2000, Look::Thorough, 2000),
            (750, 1100, Look::Thorough, 1100),
            (951, 9000, Look::Quick, 1951),
            (950, 9000, Look::Thorough, 2000),
        ] {
            let waiter = Waiter::new();
            waiter.looked.set(at(looked_ms));
            let (deadline, bound) = (at(deadline_ms), LONGEST_SLEEP);
            let case = (looked_ms, deadline_ms);
            assert_eq!(
                waiter.look_before(at(1000), deadline, bound),
                look,
                "{case:?}"
            );
            assert_eq!(waiter.until(deadline, bound), at(until_ms), "{case:?}");
        }
    }

    /// A request whose event iceoryx2 lost, as when it came while the listener was emptied.
    #[test]
    fn a_request_that_no_event_announces_is_found_and_the_next_event_comes() {
        let domain = Domain::isolated();
        let ipc = Ipc::join(&domain, RobotId::DEFAULT, "test").unwrap();
        let mut server: Server<ModuleControl> = ipc.server().unwrap();
        let mut client: Client<ModuleControl> = ipc.client().unwrap();
        let waiter = Waiter::new();
        let wait = |server: &mut Server<ModuleControl>| {
            let sources: &mut [(_, &mut dyn Source)] = &mut [("requests", server)];
            let wake = waiter.wait(sources, Some(30 * LONGEST_SLEEP)).unwrap();
            assert!(wake.has("requests"));
            let mut requests = 0;
            server.drain(|_, _| requests += 1).unwrap();
            requests
        };
        let send = |client: &mut Client<ModuleControl>| {
            client.send(&ModuleControl::default()).unwrap();
        };
        send(&mut client);
        assert_eq!(wait(&mut server), 1);
        assert_eq!(waiter.missed(), 0);
        send(&mut client);
        let Sense::Port { receiver, .. } = sealed::Source::sense(&server) else {
            panic!("a server is a port");
        };
        assert!(drain_listener(receiver.unwrap().listener().unwrap()) > 0);
        assert_eq!(wait(&mut server), 1);
        assert_eq!(waiter.missed(), 1);
        send(&mut client);
        assert_eq!(wait(&mut server), 1);
        assert_eq!(waiter.missed(), 1);
    }
}
