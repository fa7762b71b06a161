//! [`Pollable`]: the one descriptor of a port for an event loop that is not the [`Waiter`](crate::Waiter), the same for
//! as long as the port lives.
//!
//! Inside is an epoll set of two: the listener of the port's generation, another one after each change, and a timer.
//! The timer makes the descriptor readable every [`SAFETY_BOUND`], whatever the listener says: so the event loop needs
//! no timeout of its own to notice a new generation, a partner that has gone, or a wake-up that was lost. The timers of
//! all ports of a process expire at the same moments, so that a process with many ports wakes once for all of them.
//! [`PortSet`]: one descriptor for many ports.

use std::cell::{Cell, OnceCell};
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::sync::OnceLock;
use std::time::Duration;

use rustix::event::epoll;
use rustix::io::Errno;
use rustix::time::{
    Itimerspec, TimerfdClockId, TimerfdFlags, TimerfdTimerFlags, Timespec, timerfd_create,
    timerfd_settime,
};

use crate::time::MonotonicNs;
use crate::waiter::{SAFETY_BOUND, WaitError};
use crate::wake::WakeReceiver;

/// The first moment that a timer takes: it makes the descriptor readable at once.
const AT_ONCE: MonotonicNs = MonotonicNs(1);

/// A moment at which the timers of this process expire. Each process has another one, so that they do not all wake at
/// once.
static PHASE: OnceLock<MonotonicNs> = OnceLock::new();

/// The first moment after `now` at which timers expire: `phase` plus a multiple of [`SAFETY_BOUND`].
fn next_expiry(now: MonotonicNs, phase: MonotonicNs) -> MonotonicNs {
    let period_ns = SAFETY_BOUND.as_nanos() as u64;
    let since_ns = now.0.saturating_sub(phase.0) % period_ns;
    MonotonicNs(now.0 + period_ns - since_ns)
}

/// The descriptor of a port, made when it is first asked for.
#[derive(Default)]
pub struct Pollable(OnceCell<Set>);

impl Pollable {
    /// The descriptor, which can be read when the port may have something. `receiver` is woken by the other side;
    /// nothing while that has not been there.
    ///
    /// # Errors
    ///
    /// When the process has too many descriptors, or the service too many listeners.
    pub(crate) fn descriptor(
        &self,
        receiver: Option<&WakeReceiver>,
    ) -> Result<BorrowedFd<'_>, WaitError> {
        let set = match self.0.get() {
            Some(set) => set,
            None => {
                let set = Set::new(receiver)?;
                self.0.get_or_init(|| set)
            }
        };
        Ok(set.epoll.as_fd())
    }

    /// Watches the receiver of another generation as well; that of the former one goes with its listener.
    pub(crate) fn change(&self, receiver: &WakeReceiver) {
        if let Some(Err(error)) = self.0.get().map(|set| set.watch(receiver)) {
            crate::log::warn!(%error, "an event loop is woken for a port by the safety bound alone");
        }
    }

    /// Watches the receiver of a former generation no longer, because the port does not empty it any more: it would
    /// keep the descriptor readable until its listener is closed.
    pub(crate) fn forget(&self, receiver: &WakeReceiver) {
        if let (Some(set), Some(descriptor)) = (self.0.get(), receiver.lent())
            && let Err(error) = epoll::delete(&set.epoll, descriptor)
        {
            crate::log::debug!(%error, "a listener was not watched");
        }
    }

    /// Called when the port is drained, so that the descriptor is not readable any more for what has been dealt with.
    pub(crate) fn drained(&self) {
        let Some(set) = self.0.get() else {
            return;
        };
        let now = MonotonicNs::now();
        if now < set.due.get() {
            return;
        }
        // Setting it anew forgets that it had expired.
        let next = next_expiry(now, *PHASE.get_or_init(|| now));
        if let Err(error) = set.set_timer(next) {
            crate::log::debug!(%error, "a timer was not set");
        }
    }
}

/// What is behind the descriptor.
struct Set {
    epoll: OwnedFd,
    timer: OwnedFd,
    /// When the timer makes the descriptor readable.
    due: Cell<MonotonicNs>,
}

impl Set {
    fn new(receiver: Option<&WakeReceiver>) -> Result<Set, WaitError> {
        let flags = TimerfdFlags::CLOEXEC | TimerfdFlags::NONBLOCK;
        let set = Set {
            epoll: epoll::create(epoll::CreateFlags::CLOEXEC)?,
            timer: timerfd_create(TimerfdClockId::Monotonic, flags)?,
            due: Cell::default(),
        };
        set.add(set.timer.as_fd())?;
        match receiver {
            Some(receiver) => set.watch(receiver)?,
            None => set.set_timer(AT_ONCE)?,
        }
        Ok(set)
    }

    /// The descriptor can be read at once then: a listener announces nothing of what came before it.
    fn watch(&self, receiver: &WakeReceiver) -> Result<(), WaitError> {
        self.add(receiver.lend_descriptor()?)?;
        Ok(self.set_timer(AT_ONCE)?)
    }

    fn add(&self, descriptor: BorrowedFd<'_>) -> Result<(), Errno> {
        let data = epoll::EventData::new_u64(0);
        epoll::add(&self.epoll, descriptor, data, epoll::EventFlags::IN)
    }

    /// The first time at `first`, and then in every [`SAFETY_BOUND`].
    fn set_timer(&self, first: MonotonicNs) -> Result<(), Errno> {
        let timespec = |duration: Duration| Timespec {
            tv_sec: duration.as_secs() as i64,
            tv_nsec: i64::from(duration.subsec_nanos()),
        };
        let times = Itimerspec {
            it_value: timespec(Duration::from_nanos(first.0)),
            it_interval: timespec(SAFETY_BOUND),
        };
        self.due.set(first);
        timerfd_settime(&self.timer, TimerfdTimerFlags::ABSTIME, &times).map(|_| ())
    }
}

/// A descriptor that can be read when one of its members can. A [`Waiter`](crate::Waiter) takes 16 sources; a process
/// that follows every topic of a robot, as the relay and the recorder do, has one source with this.
#[derive(Debug)]
pub struct PortSet {
    set: OwnedFd,
}

impl PortSet {
    /// A set without members.
    ///
    /// # Errors
    ///
    /// When the process has too many descriptors.
    pub fn new() -> Result<PortSet, Errno> {
        Ok(PortSet {
            set: epoll::create(epoll::CreateFlags::CLOEXEC)?,
        })
    }

    /// Adds a member, a port's descriptor for example. Closing a member takes it out.
    ///
    /// # Errors
    ///
    /// When the port has no descriptor, or the kernel no room.
    pub fn add(&self, member: Result<BorrowedFd<'_>, WaitError>) -> Result<(), WaitError> {
        let data = epoll::EventData::new_u64(0);
        let added = epoll::add(&self.set, member?, data, epoll::EventFlags::IN);
        match added {
            Ok(()) | Err(Errno::EXIST) => Ok(()),
            Err(errno) => Err(WaitError::from(errno)),
        }
    }

    /// What to wait for.
    pub fn descriptor(&self) -> BorrowedFd<'_> {
        self.set.as_fd()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn at(ms: u64) -> MonotonicNs {
        MonotonicNs(ms * 1_000_000)
    }

    #[test]
    fn timers_expire_within_the_bound_and_those_of_one_wake_together() {
        let phase = at(1037);
        for (now, next) in [
            (1037, 1287),
            (1038, 1287),
            (1286, 1287),
            (1287, 1537),
            (61_037, 61_287),
        ] {
            assert_eq!(next_expiry(at(now), phase), at(next), "{now}");
        }
    }

    #[test]
    fn ports_that_were_drained_one_after_the_other_wake_the_process_once() {
        let sets: [Pollable; 3] = std::array::from_fn(|_| Pollable::default());
        for set in &sets {
            set.descriptor(None).unwrap();
            set.drained();
        }
        let dues = sets.each_ref().map(|set| set.0.get().unwrap().due.get().0);
        let period_ns = SAFETY_BOUND.as_nanos() as u64;
        let phases = dues.map(|due| due % period_ns);
        assert_eq!(phases, [phases[0]; 3]);
        let now = MonotonicNs::now();
        assert!(dues.iter().all(|due| *due <= now.0 + period_ns), "{dues:?}");
    }
}
