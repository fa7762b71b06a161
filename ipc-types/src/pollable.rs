//! [`Pollable`]: the one descriptor of a port for an event loop that is not the [`Waiter`](crate::Waiter), the same for as long as
//! the port lives.
//!
//! Inside is an epoll set of two: the listener of the port's generation, another one after each change, and a timer. The timer
//! makes the descriptor readable every [`SAFETY_BOUND`], whatever the listener says: so the event loop needs no timeout of its own
//! to notice a new generation, a partner that has gone, or a wake-up that was lost.

use std::cell::{Cell, OnceCell};
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::time::Duration;

use rustix::event::epoll;
use rustix::io::Errno;
use rustix::time::{
    Itimerspec, TimerfdClockId, TimerfdFlags, TimerfdTimerFlags, Timespec, timerfd_create,
    timerfd_settime,
};

use crate::source::{SAFETY_BOUND, WaitError};
use crate::time::MonotonicNs;
use crate::wake::WakeReceiver;

/// The shortest time that a timer takes: it makes the descriptor readable at once.
const AT_ONCE: Duration = Duration::from_nanos(1);

/// The descriptor of a port, made when it is first asked for.
#[derive(Default)]
pub(crate) struct Pollable(OnceCell<Set>);

impl Pollable {
    /// The descriptor, which can be read when the port may have something. `receiver` is woken by the other side; nothing while
    /// that has not been there.
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
            tracing::warn!(%error, "an event loop is woken for a port by the safety bound alone");
        }
    }

    /// Called when the port is drained, so that the descriptor is not readable any more for what has been dealt with.
    pub(crate) fn drained(&self) {
        let due = self
            .0
            .get()
            .filter(|set| MonotonicNs::now() >= set.due.get());
        // Setting it anew forgets that it had expired.
        if let Some(Err(error)) = due.map(|set| set.set_timer(SAFETY_BOUND)) {
            tracing::debug!(%error, "a timer was not set");
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

    /// The first time after `first`, and then in every [`SAFETY_BOUND`].
    fn set_timer(&self, first: Duration) -> Result<(), Errno> {
        let timespec = |duration: Duration| Timespec {
            tv_sec: duration.as_secs() as i64,
            tv_nsec: i64::from(duration.subsec_nanos()),
        };
        let times = Itimerspec {
            it_value: timespec(first),
            it_interval: timespec(SAFETY_BOUND),
        };
        self.due.set(MonotonicNs::now() + first);
        timerfd_settime(&self.timer, TimerfdTimerFlags::empty(), &times).map(|_| ())
    }
}
