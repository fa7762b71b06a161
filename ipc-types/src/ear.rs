//! Both ends of a wake-up: [`Signal`] wakes, [`Ear`] is woken, by the bell or by iceoryx2's event.
//!
//! A signal goes both ways: the bell for the RIL's own processes, and the event for whoever waits on a file descriptor,
//! such as the bridge with its serial port, and for consumers in other languages. The event costs nothing while nobody
//! listens to it, therefore an ear makes its listener only when somebody wants a descriptor.

use std::cell::{Cell, OnceCell};
use std::os::fd::{AsRawFd, BorrowedFd};
use std::rc::Rc;

use crate::bell::{self, Bell, Bits};
use crate::event::{self, Channel, Event};
use crate::iox::{Listener, Notifier};
use crate::open::OpenError;
use crate::service::ServiceId;
use crate::session::Session;

/// Wakes the other side of a service.
pub(crate) struct Signal {
    notifier: Notifier,
    event: Event,
    bell: Option<Rc<Bell>>,
    bits: Bits,
}

impl Signal {
    /// Making a signal announces its port to those who listen to events.
    pub(crate) fn make(
        session: &Rc<Session>,
        service: ServiceId,
        channel: Channel,
    ) -> Result<Signal, OpenError> {
        let event = event::open(session, session.robot(), service, channel)?;
        Ok(Signal {
            notifier: event.notifier(session)?,
            event,
            bell: session.bell().cloned(),
            bits: bell::bits(service, channel),
        })
    }

    /// Wakes the other side. Failing to is not an error of the sender: every wait of the contract has a bound.
    pub(crate) fn raise(&self) {
        if let Some(bell) = &self.bell {
            bell.ring(self.bits);
        }
        if let Err(error) = self.notifier.notify() {
            tracing::debug!(event = self.event.name(), ?error, "nobody was notified");
        }
    }
}

/// Hears what the other side of a service signals.
pub struct Ear {
    event: Event,
    bits: Bits,
    listener: OnceCell<Listener>,
    /// Notifications that the owner has not been told of.
    pending: Cell<u64>,
    /// Who empties the listener.
    keeper: Cell<Keeper>,
    session: Rc<Session>,
}

/// Who empties a listener, which takes system calls even when nothing is in it.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Keeper {
    /// The ear, whenever its owner asks.
    Ear,
    /// A waiter, who knows from the kernel when there is something.
    Waiter,
    /// The ear as well: a reactor outside of this crate watches the descriptor.
    Outside,
}

impl Ear {
    pub(crate) fn make(
        session: &Rc<Session>,
        service: ServiceId,
        channel: Channel,
    ) -> Result<Ear, OpenError> {
        Ok(Ear {
            event: event::open(session, session.robot(), service, channel)?,
            bits: bell::bits(service, channel),
            listener: OnceCell::new(),
            pending: Cell::new(0),
            keeper: Cell::new(Keeper::Ear),
            session: Rc::clone(session),
        })
    }

    /// The bell that wakes whoever sleeps here, and by which bits; nothing when there is none.
    pub(crate) fn bell(&self) -> Option<(&Rc<Bell>, Bits)> {
        Some((self.session.bell()?, self.bits))
    }

    /// The listener, made when it is first asked for. Data that came before is not announced: look for it afterwards.
    pub(crate) fn listener(&self) -> Result<&Listener, OpenError> {
        if let Some(listener) = self.listener.get() {
            return Ok(listener);
        }
        let listener = self.event.listener(&self.session)?;
        Ok(self.listener.get_or_init(|| listener))
    }

    /// A descriptor that can be read when there is something to hear, until [`hear`](Ear::hear).
    pub(crate) fn descriptor(&self) -> Result<BorrowedFd<'_>, OpenError> {
        use iceoryx2::prelude::FileDescriptorBased;

        let descriptor = self.listener()?.file_descriptor();
        // SAFETY: the listener owns the descriptor and lives as long as the ear, which is borrowed.
        #[allow(unsafe_code)]
        let descriptor = unsafe { BorrowedFd::borrow_raw(descriptor.native_handle()) };
        debug_assert!(descriptor.as_raw_fd() >= 0);
        Ok(descriptor)
    }

    /// As [`descriptor`](Ear::descriptor), for a reactor that does not call [`hear`](Ear::hear): the owner will do that.
    pub(crate) fn lend_descriptor(&self) -> Result<BorrowedFd<'_>, OpenError> {
        self.keeper.set(Keeper::Outside);
        self.descriptor()
    }

    /// Empties the listener for the owner, who is told by [`take`](Ear::take). A waiter calls it when there is something,
    /// and from time to time in any case: iceoryx2 can lose a wake-up, and emptying the listener mends it.
    pub(crate) fn hear(&self) {
        if self.keeper.get() == Keeper::Ear {
            self.keeper.set(Keeper::Waiter);
        }
        self.empty();
    }

    fn empty(&self) {
        if let Some(listener) = self.listener.get() {
            let heard = event::drain_listener(listener);
            self.pending.set(self.pending.get().saturating_add(heard));
        }
    }

    /// Whether there was a notification that the owner has not taken.
    pub(crate) fn is_pending(&self) -> bool {
        self.pending.get() > 0
    }

    /// Notifications since the last call, none while there is no listener.
    pub(crate) fn take(&self) -> u64 {
        if self.keeper.get() != Keeper::Waiter {
            self.empty();
        }
        self.pending.take()
    }
}
