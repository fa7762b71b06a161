//! The event services that belong to each service, which wake the other side.
//!
//! An event carries nothing but a reason to drain; all of them are opened with every setting of the table.

use iceoryx2::prelude::EventId;
use iceoryx2::service::builder::event::{EventCreateError, EventOpenError, EventOpenOrCreateError};

use crate::iox::{EventService, Listener, Notifier};
use crate::open::{self, OpenError, Verdict};
use crate::robot::RobotId;
use crate::service::{self, EventCode, ServiceId};
use crate::session::Session;

/// Which of a service's events.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Channel {
    /// From publisher to subscribers: the service's own name.
    Samples,
    /// From subscribers to the publisher: `<service>/subscribers`.
    Subscribers,
    /// From clients to the server: `<service>/requests`.
    Requests,
    /// From the server to clients: `<service>/responses`.
    Responses,
}

/// Name, listeners and notifiers of an event service.
fn event_limits(channel: Channel) -> (&'static str, usize, usize) {
    match channel {
        Channel::Samples => ("", service::MAX_SUBSCRIBERS, service::MAX_PROVIDERS),
        Channel::Subscribers => (
            "/subscribers",
            service::MAX_PROVIDERS,
            service::MAX_SUBSCRIBERS,
        ),
        Channel::Requests => ("/requests", service::MAX_PROVIDERS, service::MAX_CLIENTS),
        Channel::Responses => ("/responses", service::MAX_CLIENTS, service::MAX_PROVIDERS),
    }
}

/// An event service and its name.
pub(crate) struct Event {
    name: String,
    service: EventService,
    limits: (usize, usize),
}

/// Opens one of the event services that belong to `id`.
pub(crate) fn open(
    session: &Session,
    robot: RobotId,
    id: ServiceId,
    channel: Channel,
) -> Result<Event, OpenError> {
    let (suffix, listeners, notifiers) = event_limits(channel);
    let name = format!("{}{suffix}", id.name(robot));
    let service = open::service_name(&name)?;
    let opened = open::with_retries(
        session,
        &name,
        judge,
        // Events carry no layout; iceoryx2 objects to attributes only when some are asked for.
        || open::failed(&name, EventOpenOrCreateError::SystemInFlux),
        || {
            session
                .node()
                .service_builder(&service)
                .event()
                .max_listeners(listeners)
                .max_notifiers(notifiers)
                .max_nodes(service::MAX_NODES)
                .event_id_max_value(service::EVENT_ID_MAX)
                .notifier_created_event(event_id(EventCode::Arrived))
                .notifier_dropped_event(event_id(EventCode::Left))
                .notifier_dead_event(event_id(EventCode::Died))
                .disable_deadline()
                .open_or_create()
        },
    )?;
    Ok(Event {
        name,
        service: opened,
        limits: (listeners, notifiers),
    })
}

fn judge(error: EventOpenOrCreateError) -> Verdict {
    match error {
        EventOpenOrCreateError::SystemInFlux => Verdict::Transient,
        EventOpenOrCreateError::EventCreateError(error) => match error {
            EventCreateError::InsufficientPermissions => Verdict::Fatal,
            _ => Verdict::Transient,
        },
        EventOpenOrCreateError::EventOpenError(error) => match error {
            EventOpenError::Interrupt
            | EventOpenError::DoesNotExist
            | EventOpenError::InternalFailure
            | EventOpenError::ServiceInCorruptedState
            | EventOpenError::HangsInCreation
            | EventOpenError::IsMarkedForDestruction
            | EventOpenError::UnableToCreateServiceTag => Verdict::Transient,
            EventOpenError::InsufficientPermissions | EventOpenError::ExceedsMaxNumberOfNodes => {
                Verdict::Fatal
            }
            _ => Verdict::Settings,
        },
    }
}

pub(crate) fn event_id(code: EventCode) -> EventId {
    EventId::new(code as usize)
}

impl Event {
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    pub(crate) fn listener(&self, session: &Session) -> Result<Listener, OpenError> {
        use iceoryx2::port::listener::ListenerCreateError as Error;
        open::port(
            session,
            &self.name,
            ("listeners", self.limits.0),
            |error| error == Error::ExceedsMaxSupportedListeners,
            || self.service.listener_builder().create(),
        )
    }

    pub(crate) fn notifier(&self, session: &Session) -> Result<Notifier, OpenError> {
        use iceoryx2::port::notifier::NotifierCreateError as Error;
        open::port(
            session,
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

/// Drains a listener and says how many notifications it had.
///
/// A failure counts as one: the caller then looks at the data, which is always right.
pub(crate) fn drain_listener(listener: &Listener) -> u64 {
    listener.try_wait(|_| {}).unwrap_or(1)
}
