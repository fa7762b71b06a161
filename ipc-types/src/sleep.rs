//! [`Sleep`]: one sleep over several sources, by their robot's doorbell where that wakes for all of them, else by `poll`.

use std::cell::Cell;
use std::os::fd::BorrowedFd;
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;

use crate::doorbell::{Bits, Doorbell, Slept};
use crate::forked::Forked;
use crate::source::sealed::{Bound, Look, Sense};
use crate::source::{LONGEST_SLEEP, MAX_SOURCES, SAFETY_BOUND, Source, WaitError};
use crate::time::MonotonicNs;
use crate::wake::WakeReceiver;

/// How much longer a sleep may be when its own deadline comes so shortly after the bound: one wake then serves both.
const BOUND_SLACK: Duration = Duration::from_millis(50);

/// What one sleep leaves for the next.
#[derive(Debug, Default)]
pub(crate) struct History {
    /// When all sources were last looked at thoroughly.
    looked: Cell<MonotonicNs>,
    /// Sleeps that nothing but the safety bound ended although there was something.
    pub(crate) missed: Cell<u64>,
}

impl History {
    fn count_missed(&self) {
        self.missed.set(self.missed.get() + 1);
    }
}

/// Which sources have something, by their places in the sleep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct ReadySet(u16);

impl ReadySet {
    pub(crate) fn insert(&mut self, place: usize) {
        self.0 |= 1 << place;
    }

    pub(crate) fn contains(self, place: usize) -> bool {
        self.0 & (1 << place) != 0
    }

    pub(crate) fn without(self, others: ReadySet) -> ReadySet {
        ReadySet(self.0 & !others.0)
    }

    pub(crate) fn is_empty(self) -> bool {
        self.0 == 0
    }
}

/// How a sleep ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ended {
    Ready(ReadySet),
    TimedOut,
    Interrupted,
}

/// The sources of one sleep.
pub(crate) struct Sleep<'a> {
    /// Filled from the front.
    sources: [Option<&'a dyn Source>; MAX_SOURCES],
}

impl<'a> Sleep<'a> {
    /// A sleep over the first [`MAX_SOURCES`] of `sources`.
    pub(crate) fn of<K>(sources: &'a [(K, &mut dyn Source)]) -> Sleep<'a> {
        Sleep {
            sources: std::array::from_fn(|place| sources.get(place).map(|(_, source)| &**source)),
        }
    }

    fn sources(&self) -> impl Iterator<Item = &'a dyn Source> {
        self.sources.iter().flatten().copied()
    }

    /// Sleeps until a source has something, a signal comes or the time is `deadline`.
    pub(crate) fn until(
        &self,
        deadline: MonotonicNs,
        history: &History,
    ) -> Result<Ended, WaitError> {
        match self.doorbell()? {
            Some((doorbell, bits)) => self.by_doorbell(doorbell, bits, deadline, history),
            None => self.by_descriptors(deadline, history),
        }
    }

    /// The one doorbell that wakes for all sources, and by which bits.
    fn doorbell(&self) -> Result<Option<(&'a Doorbell, Bits)>, Forked> {
        let mut found: Option<(&Doorbell, Bits)> = None;
        for source in self.sources() {
            let Sense::Port {
                doorbell,
                bits,
                by_descriptor: false,
                ..
            } = source.sense()
            else {
                return Ok(None);
            };
            doorbell.check_process()?;
            found = match found {
                None => Some((doorbell, bits)),
                Some((other, all)) if std::ptr::eq(doorbell, other) => Some((doorbell, all | bits)),
                Some(_) => return Ok(None),
            };
        }
        Ok(found)
    }

    fn by_doorbell(
        &self,
        doorbell: &Doorbell,
        bits: Bits,
        deadline: MonotonicNs,
        history: &History,
    ) -> Result<Ended, WaitError> {
        let bound = self.bound(|bound| bound.by_doorbell);
        let mut ready = self.look(Look::Quick);
        while ready.is_empty() {
            let seen = doorbell.listen(bits);
            ready = self.look(Look::Quick);
            if !ready.is_empty() {
                break;
            }
            let now = MonotonicNs::now();
            if now >= deadline {
                return Ok(Ended::TimedOut);
            }
            let until = deadline.min(now + bound);
            match doorbell.sleep(seen, bits, until)? {
                // Draining looks by itself, and looking twice takes microseconds when the caches are cold.
                Slept::Rung => return Ok(Ended::Ready(self.all())),
                Slept::Passed => ready = self.look(Look::Quick),
                Slept::Interrupted => return Ok(Ended::Interrupted),
                Slept::TimedOut => {
                    ready = self.look(Look::Thorough);
                    if !ready.is_empty() && until < deadline && doorbell.is_awaited(bits) {
                        history.count_missed();
                    }
                }
            }
        }
        Ok(Ended::Ready(ready))
    }

    fn by_descriptors(&self, deadline: MonotonicNs, history: &History) -> Result<Ended, WaitError> {
        // Before anything is looked at: a listener that is made here announces nothing of what came before it.
        let descriptors = self.descriptors()?;
        let bound = self.bound(|bound| bound.by_descriptor);
        let mut slept = None;
        loop {
            let now = MonotonicNs::now();
            let is_due = now.since(history.looked.get()) >= SAFETY_BOUND;
            let mut ready = match is_due {
                true => self.look_thoroughly(now, history),
                false => self.look(Look::Quick),
            };
            if slept == Some(Slept::TimedOut) && !ready.is_empty() {
                history.count_missed();
            }
            if slept.is_some() && now >= deadline && ready.is_empty() {
                return Ok(Ended::TimedOut);
            }
            let bound = history.looked.get() + bound;
            // With something to do already, the kernel is only asked what else there is.
            let until = match ready.is_empty() {
                true if deadline <= bound + BOUND_SLACK => deadline,
                true => bound,
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

    /// The shortest of all sources.
    fn bound(&self, by: impl Fn(Bound) -> Duration) -> Duration {
        self.sources()
            .filter_map(|source| match source.sense() {
                Sense::Port { bound, .. } => Some(by(bound)),
                Sense::Descriptor(_) => None,
            })
            .fold(LONGEST_SLEEP, Duration::min)
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

    /// Which sources have something, also when iceoryx2 has lost the event of it. Their listeners are emptied, which makes iceoryx2
    /// send events again.
    fn look_thoroughly(&self, now: MonotonicNs, history: &History) -> ReadySet {
        history.looked.set(now);
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

    fn descriptors(&self) -> Result<Descriptors<'a>, WaitError> {
        let mut descriptors = [None; MAX_SOURCES];
        for (descriptor, source) in descriptors.iter_mut().zip(self.sources()) {
            *descriptor = match source.sense() {
                Sense::Port {
                    doorbell, receiver, ..
                } => {
                    doorbell.check_process()?;
                    receiver
                        .inspect(|receiver| receiver.leave_to_waiters())
                        .map(WakeReceiver::descriptor)
                        .transpose()?
                }
                Sense::Descriptor(descriptor) => Some(descriptor),
            };
        }
        Ok(descriptors)
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
        Ok(Slept::Rung)
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
    use crate::source::sealed;
    use crate::wake::drain_listener;
    use crate::{Client, Domain, Ipc, RobotId, Server, Waiter};

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
