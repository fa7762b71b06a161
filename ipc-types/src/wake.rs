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
use crate::housekeeper::Tended;
use crate::iox::{Listener, Notifier};
use crate::open::OpenError;
use crate::reserve;
use crate::robot_folder::Membership;
use crate::session::Session;

/// Wakes the other side of a service.
pub(crate) struct WakeSender {
    notifier: Notifier,
    event: Event,
    /// Not the session: a former port may be the last thing that the session's own thread drops.
    membership: Arc<Membership>,
    bits: Bits,
    /// Listeners of subscribers that there were when it last notified.
    known: Option<Cell<usize>>,
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
            bits: place.bits(channel),
            known: (channel == Channel::Samples).then(Cell::default),
        })
    }

    /// See [`Event::count_places`].
    pub(crate) fn count_places(&self, tended: &Arc<Tended>) {
        self.event.count_places(tended);
    }

    /// Wakes the other side. Failing to is not an error of the sender: every wait of the contract has a bound.
    pub(crate) fn wake(&self) {
        // Notifying connects new listeners. Those of subscribers get none of the descriptors that clients need.
        let _held = self.known.as_ref().and_then(|known| {
            let listeners = self.event.listeners();
            (known.replace(listeners) != listeners).then(reserve::hold_descriptors)
        });
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
    /// Whether an event loop outside of this crate watches the descriptor.
    is_lent: Cell<bool>,
    /// Whether a waiter empties the listener, which knows from the kernel when there is something. Else the owner does, which takes
    /// system calls each time.
    is_waited: Cell<bool>,
}

/// How often a listener is emptied at most before the kernel is asked again whether there is something in it.
const MAX_EMPTYINGS: u32 = 4;

impl WakeReceiver {
    pub(crate) fn new(event: Event) -> WakeReceiver {
        WakeReceiver {
            event,
            listener: OnceCell::new(),
            pending: Cell::new(0),
            is_lent: Cell::new(false),
            is_waited: Cell::new(false),
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

    /// See [`Event::count_places`].
    pub(crate) fn count_places(&self, tended: &Arc<Tended>) {
        self.event.count_places(tended);
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
        self.is_lent.set(true);
        self.descriptor()
    }

    /// The descriptor that was lent, if one was.
    pub(crate) fn lent(&self) -> Option<BorrowedFd<'_>> {
        self.is_lent.get().then(|| self.descriptor().ok()).flatten()
    }

    /// Empties the listener only for a waiter or an event loop: the owner finds by itself what is announced.
    pub(crate) fn leave_to_waiters(&self) {
        self.is_waited.set(true);
    }

    /// Empties the listener for the owner, which learns it from [`take`](WakeReceiver::take). To be called when the kernel says that
    /// there is something.
    ///
    /// iceoryx2 0.10 loses a wake-up that comes while the listener is emptied, and all later ones with it (`event/common.rs`,
    /// `drain_events`): the listener stays marked as notified. Emptying it again takes the mark away. So that is done until there is
    /// nothing.
    pub(crate) fn drain(&self) {
        let Some(listener) = self.listener.get() else {
            return;
        };
        for _ in 0..MAX_EMPTYINGS {
            let drained = event::drain_listener(listener);
            if drained == 0 {
                return;
            }
            self.pending.set(self.pending.get().saturating_add(drained));
        }
    }

    /// Whether there was a notification that the owner has not taken.
    pub(crate) fn is_pending(&self) -> bool {
        self.pending.get() > 0
    }

    /// Notifications since the last call, none while there is no listener.
    pub(crate) fn take(&self) -> u64 {
        if self.is_lent.get() || !self.is_waited.get() {
            self.drain();
        }
        self.pending.take()
    }
}
