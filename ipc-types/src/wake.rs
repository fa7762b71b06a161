//! What wakes the other side of a service: [`WakeSender`] and [`WakeReceiver`], by the doorbell and by iceoryx2's
//! [`Event`].
//!
//! A wake-up goes both ways: the doorbell for the RIL's own processes, and the event for those that wait on a file
//! descriptor, such as the bridge with its serial port, and for consumers in other languages. The event costs nothing
//! while no listener exists, therefore a receiver makes its listener only when a descriptor is wanted.
//!
//! The provider makes both of its service's events; the others open them.

use std::cell::{Cell, OnceCell};
use std::fmt::Debug;
use std::os::fd::{AsRawFd, BorrowedFd};
use std::sync::Arc;

use iceoryx2::prelude::{EventId, PortFactory};

use crate::doorbell::{Bits, ServiceEvent, doorbell_slot};
use crate::files;
use crate::generation::Generation;
use crate::housekeeper::Maintained;
use crate::iox::{EventService, Listener, Members, Notifier, Svc};
use crate::open::{self, OpenError};
use crate::reserve;
use crate::robot::RobotId;
use crate::robot_folder::Membership;
use crate::service::{self, EventCode, service_name};
use crate::session::Session;

/// End of the name, listeners and notifiers of an event service.
fn limits(kind: ServiceEvent) -> (&'static str, usize, usize) {
    match kind {
        ServiceEvent::Samples => ("", service::MAX_SUBSCRIBERS, service::MAX_PROVIDERS),
        ServiceEvent::Subscribers => (
            "/subscribers",
            service::MAX_PROVIDERS,
            service::MAX_SUBSCRIBERS,
        ),
        ServiceEvent::Requests => ("/requests", service::MAX_PROVIDERS, service::MAX_CLIENTS),
        ServiceEvent::Responses => ("/responses", service::MAX_CLIENTS, service::MAX_PROVIDERS),
    }
}

type EventBuilder = iceoryx2::service::builder::event::Builder<Svc>;

/// An event service that belongs to a service: it carries nothing but a reason to drain.
pub(crate) struct Event {
    name: String,
    service: EventService,
    limits: (usize, usize),
    kind: ServiceEvent,
    /// The events that the doorbell signals.
    bits: Bits,
}

impl Event {
    /// Makes one of the event services that belong to the service `key`, with every setting of the table.
    pub(crate) fn create(
        generation: &Generation,
        robot: RobotId,
        key: &str,
        kind: ServiceEvent,
    ) -> Result<Event, OpenError> {
        Event::make(generation, robot, key, kind, |builder, limits| {
            builder
                .max_listeners(limits.0)
                .max_notifiers(limits.1)
                .max_nodes(service::MAX_NODES)
                .event_id_max_value(service::EVENT_ID_MAX)
                .notifier_created_event(event_id(EventCode::Arrived))
                .notifier_dropped_event(event_id(EventCode::Left))
                .notifier_dead_event(event_id(EventCode::Died))
                .disable_deadline()
                .create()
                .map_err(|error| Box::new(error) as Box<dyn Debug>)
        })
    }

    /// Opens one of the event services that belong to the service `key`.
    pub(crate) fn open(
        generation: &Generation,
        robot: RobotId,
        key: &str,
        kind: ServiceEvent,
    ) -> Result<Event, OpenError> {
        Event::make(generation, robot, key, kind, |builder, _| {
            builder
                .open()
                .map_err(|error| Box::new(error) as Box<dyn Debug>)
        })
    }

    fn make(
        generation: &Generation,
        robot: RobotId,
        key: &str,
        kind: ServiceEvent,
        make: impl FnOnce(EventBuilder, (usize, usize)) -> Result<EventService, Box<dyn Debug>>,
    ) -> Result<Event, OpenError> {
        let (suffix, listeners, notifiers) = limits(kind);
        let name = format!("{}{suffix}", service_name(robot, key));
        let limits = (listeners, notifiers);
        let builder = generation
            .node()
            .service_builder(&open::service_name(&name)?)
            .event();
        let made = files::while_no_port_opens(|| make(builder, limits));
        Ok(Event {
            service: made.map_err(|error| open::failed(&name, error))?,
            name,
            limits,
            kind,
            bits: doorbell_slot(key).bits(kind),
        })
    }

    /// Has judged who has the places of the other side's listeners or notifiers.
    fn count_places(&self, maintained: &Arc<Maintained>) {
        let taken = self.service.dynamic_config();
        let (listeners, notifiers) = self.limits;
        match listeners > notifiers {
            true => maintained.count_places((taken.number_of_listeners(), listeners), || {
                let mut members = Members::default();
                taken.list_listeners(|it| members.add(it.node_id));
                members.count()
            }),
            false => maintained.count_places((taken.number_of_notifiers(), notifiers), || {
                let mut members = Members::default();
                taken.list_notifiers(|it| members.add(it.node_id));
                members.count()
            }),
        }
    }

    /// Listeners that there are.
    fn listeners(&self) -> usize {
        self.service.dynamic_config().number_of_listeners()
    }

    fn listener(&self) -> Result<Listener, OpenError> {
        use iceoryx2::port::listener::ListenerCreateError as Error;
        open::port(
            &self.name,
            ("listeners", self.limits.0),
            |error| error == Error::ExceedsMaxSupportedListeners,
            || self.service.listener_builder().create(),
        )
    }

    fn notifier(&self) -> Result<Notifier, OpenError> {
        use iceoryx2::port::notifier::NotifierCreateError as Error;
        open::port(
            &self.name,
            ("notifiers", self.limits.1),
            |error| error == Error::ExceedsMaxSupportedNotifiers,
            || {
                self.service
                    .notifier_builder()
                    .default_event_id(event_id(EventCode::Data))
                    .create()
            },
        )
    }
}

fn event_id(code: EventCode) -> EventId {
    EventId::new(code as usize)
}

/// Drains a listener and says how many notifications it had.
///
/// A failure counts as one: the caller then looks at the data, which is always right.
pub(crate) fn drain_listener(listener: &Listener) -> u64 {
    listener.try_wait(|_| {}).unwrap_or(1)
}

/// Wakes the other side of a service.
pub(crate) struct WakeSender {
    notifier: Notifier,
    event: Event,
    /// Not the session: a former port may be the last thing that the session's own thread drops.
    membership: Arc<Membership>,
    /// Listeners that there were when it last woke.
    known: Cell<usize>,
}

impl WakeSender {
    /// Making a sender announces its port to those who listen to events.
    pub(crate) fn make(session: &Arc<Session>, event: Event) -> Result<WakeSender, OpenError> {
        Ok(WakeSender {
            notifier: event.notifier()?,
            known: Cell::default(),
            event,
            membership: Arc::clone(session.membership()),
        })
    }

    /// See [`Event::count_places`].
    pub(crate) fn count_places(&self, maintained: &Arc<Maintained>) {
        self.event.count_places(maintained);
    }

    /// Wakes the other side. Failing to is not an error of the sender: every wait of the contract has a bound.
    pub(crate) fn wake(&self) {
        self.membership.doorbell().ring(self.event.bits);
        let listeners = self.event.listeners();
        let known = self.known.replace(listeners);
        if listeners == 0 && known == 0 {
            // Who makes a listener looks for data afterwards, and so finds what was sent before it was counted.
            return;
        }
        // Notifying connects new listeners. Those of subscribers get none of the descriptors that clients need.
        let is_of_subscribers = self.event.kind == ServiceEvent::Samples;
        let _held = (is_of_subscribers && known != listeners).then(reserve::hold_descriptors);
        if let Err(error) = self.notifier.notify() {
            crate::log::debug!(event = self.event.name, ?error, "nobody was notified");
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
    /// Whether a waiter empties the listener, which knows from the kernel when there is something. Else the owner does,
    /// which takes system calls each time.
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
    pub(crate) fn count_places(&self, maintained: &Arc<Maintained>) {
        self.event.count_places(maintained);
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

    /// As [`descriptor`](WakeReceiver::descriptor), for a reactor that does not call [`drain`](WakeReceiver::drain):
    /// the owner will do that.
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

    /// Empties the listener for the owner, which learns it from [`take`](WakeReceiver::take). To be called when the
    /// kernel says that there is something.
    ///
    /// iceoryx2 0.10 loses a wake-up that comes while the listener is emptied, and all later ones with it
    /// (`event/common.rs`, `drain_events`): the listener stays marked as notified. Emptying it again takes the mark
    /// away. So that is done until there is nothing.
    pub(crate) fn drain(&self) {
        let Some(listener) = self.listener.get() else {
            return;
        };
        for _ in 0..MAX_EMPTYINGS {
            let drained = drain_listener(listener);
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
