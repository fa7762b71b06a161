//! Both ends of a wake-up: [`WakeSender`] and [`WakeReceiver`], by the doorbell or by iceoryx2's event.
//!
//! A wake-up goes both ways: the doorbell for the RIL's own processes, and the event for those that wait on a file
//! descriptor, such as the bridge with its serial port, and for consumers in other languages. The event costs nothing while
//! nobody listens to it, therefore a receiver makes its listener only when a descriptor is wanted.

use std::cell::{Cell, OnceCell};
use std::os::fd::{AsRawFd, BorrowedFd};
use std::sync::Arc;

use crate::doorbell::{Bits, Channel, Place};
use crate::event::{self, Event};
use crate::iox::{Listener, Notifier};
use crate::open::OpenError;
use crate::robot_folder::Membership;
use crate::session::Session;

/// Wakes the other side of a service.
pub(crate) struct WakeSender {
    notifier: Notifier,
    event: Event,
    /// Not the session: a former port may be the last thing that the session's own thread drops.
    membership: Arc<Membership>,
    place: Place,
    bits: Bits,
}

impl WakeSender {
    /// Making a sender announces its port to those who listen to events.
    pub(crate) fn make(
        session: &Arc<Session>,
        event: Event,
        place: Place,
        channel: Channel,
    ) -> Result<WakeSender, OpenError> {
        Ok(WakeSender {
            notifier: event.notifier()?,
            event,
            membership: Arc::clone(session.membership()),
            place,
            bits: place.bits(channel),
        })
    }

    /// See [`Event::places`].
    pub(crate) fn places(&self) -> (usize, usize) {
        self.event.places()
    }

    /// As [`wake`](WakeSender::wake) after a sample was published, and says where that was: a consumer that looks out for the
    /// next one must not do so on this processor.
    pub(crate) fn wake_for_sample(&self) {
        self.wake();
        let processor = rustix::thread::sched_getcpu();
        self.membership
            .doorbell()
            .note_publisher(self.place, processor);
    }

    /// Wakes the other side. Failing to is not an error of the sender: every wait of the contract has a bound.
    pub(crate) fn wake(&self) {
        self.membership.doorbell().ring(self.bits);
        if let Err(error) = self.notifier.notify() {
            tracing::debug!(event = self.event.name(), ?error, "nobody was notified");
        }
    }
}

/// Is woken by the other side of a service.
pub struct WakeReceiver {
    event: Event,
    listener: OnceCell<Listener>,
    /// Notifications that the owner has not yet taken.
    pending: Cell<u64>,
    /// The side that empties the listener.
    keeper: Cell<Keeper>,
}

/// The side that empties a listener, which takes system calls even when nothing is in it.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Keeper {
    /// The receiver, whenever its owner asks.
    Receiver,
    /// A waiter, which knows from the kernel when there is something.
    Waiter,
    /// The receiver as well: a reactor outside of this crate watches the descriptor.
    Outside,
}

impl WakeReceiver {
    pub(crate) fn new(event: Event) -> WakeReceiver {
        WakeReceiver {
            event,
            listener: OnceCell::new(),
            pending: Cell::new(0),
            keeper: Cell::new(Keeper::Receiver),
        }
    }

    /// The listener, made when it is first asked for. Data that came before is not announced: look for it afterwards.
    pub(crate) fn listener(&self) -> Result<&Listener, OpenError> {
        if let Some(listener) = self.listener.get() {
            return Ok(listener);
        }
        let listener = self.event.listener()?;
        Ok(self.listener.get_or_init(|| listener))
    }

    /// See [`Event::places`].
    pub(crate) fn places(&self) -> (usize, usize) {
        self.event.places()
    }

    /// A descriptor that can be read when there is something to drain, until [`drain`](WakeReceiver::drain).
    pub(crate) fn descriptor(&self) -> Result<BorrowedFd<'_>, OpenError> {
        use iceoryx2::prelude::FileDescriptorBased;

        let descriptor = self.listener()?.file_descriptor();
        // SAFETY: the listener owns the descriptor and lives as long as the receiver, which is borrowed.
        #[allow(unsafe_code)]
        let descriptor = unsafe { BorrowedFd::borrow_raw(descriptor.native_handle()) };
        debug_assert!(descriptor.as_raw_fd() >= 0);
        Ok(descriptor)
    }

    /// As [`descriptor`](WakeReceiver::descriptor), for a reactor that does not call [`drain`](WakeReceiver::drain): the
    /// owner will do that.
    pub(crate) fn lend_descriptor(&self) -> Result<BorrowedFd<'_>, OpenError> {
        self.keeper.set(Keeper::Outside);
        self.descriptor()
    }

    /// Empties the listener for the owner, which learns it from [`take`](WakeReceiver::take). A waiter calls it when there is
    /// something, and from time to time in any case: iceoryx2 can lose a wake-up, and emptying the listener repairs that.
    pub(crate) fn drain(&self) {
        if self.keeper.get() == Keeper::Receiver {
            self.keeper.set(Keeper::Waiter);
        }
        self.empty();
    }

    fn empty(&self) {
        if let Some(listener) = self.listener.get() {
            let drained = event::drain_listener(listener);
            self.pending.set(self.pending.get().saturating_add(drained));
        }
    }

    /// Whether there was a notification that the owner has not taken.
    pub(crate) fn is_pending(&self) -> bool {
        self.pending.get() > 0
    }

    /// Whether the listener is emptied whenever the owner asks, for want of a waiter that does it.
    pub(crate) fn empties_itself(&self) -> bool {
        self.keeper.get() != Keeper::Waiter
    }

    /// Notifications since the last call, none while there is no listener.
    pub(crate) fn take(&self) -> u64 {
        if self.empties_itself() {
            self.empty();
        }
        self.pending.take()
    }
}
