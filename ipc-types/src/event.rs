//! The event services that belong to each service, which wake the other side.
//!
//! An event carries nothing but a reason to drain. The provider makes both of its service's, with every setting of the table;
//! the others open them.

use std::sync::Arc;

use iceoryx2::prelude::{EventId, PortFactory};

use crate::doorbell::Channel;
use crate::files;
use crate::generation::Generation;
use crate::housekeeper::Tended;
use crate::iox::{EventService, Listener, Members, Notifier};
use crate::open::{self, OpenError};
use crate::robot::RobotId;
use crate::service::{self, EventCode, service_name};

/// End of the name, listeners and notifiers of an event service.
fn limits(channel: Channel) -> (&'static str, usize, usize) {
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

impl Event {
    /// Makes one of the event services that belong to the service `key`.
    pub(crate) fn create(
        generation: &Generation,
        robot: RobotId,
        key: &str,
        channel: Channel,
    ) -> Result<Event, OpenError> {
        let (suffix, listeners, notifiers) = limits(channel);
        Event::make(generation, robot, key, channel, |builder| {
            builder
                .max_listeners(listeners)
                .max_notifiers(notifiers)
                .max_nodes(service::MAX_NODES)
                .event_id_max_value(service::EVENT_ID_MAX)
                .notifier_created_event(event_id(EventCode::Arrived))
                .notifier_dropped_event(event_id(EventCode::Left))
                .notifier_dead_event(event_id(EventCode::Died))
                .disable_deadline()
                .create()
                .map_err(|error| {
                    open::failed(&format!("{}{suffix}", service_name(robot, key)), error)
                })
        })
    }

    /// Opens one of the event services that belong to the service `key`.
    pub(crate) fn open(
        generation: &Generation,
        robot: RobotId,
        key: &str,
        channel: Channel,
    ) -> Result<Event, OpenError> {
        let (suffix, ..) = limits(channel);
        Event::make(generation, robot, key, channel, |builder| {
            builder.open().map_err(|error| {
                open::failed(&format!("{}{suffix}", service_name(robot, key)), error)
            })
        })
    }

    fn make(
        generation: &Generation,
        robot: RobotId,
        key: &str,
        channel: Channel,
        make: impl FnOnce(
            iceoryx2::service::builder::event::Builder<crate::iox::Svc>,
        ) -> Result<EventService, OpenError>,
    ) -> Result<Event, OpenError> {
        let (suffix, listeners, notifiers) = limits(channel);
        let name = format!("{}{suffix}", service_name(robot, key));
        let service_name = open::service_name(&name)?;
        let builder = generation.node().service_builder(&service_name).event();
        let service = files::while_no_port_opens(|| make(builder))?;
        Ok(Event {
            name,
            service,
            limits: (listeners, notifiers),
        })
    }

    /// Has judged who has the places of the other side's listeners or notifiers.
    pub(crate) fn count_places(&self, tended: &Arc<Tended>) {
        let taken = self.service.dynamic_config();
        let (listeners, notifiers) = self.limits;
        match listeners > notifiers {
            true => tended.count_places((taken.number_of_listeners(), listeners), || {
                let mut members = Members::default();
                taken.list_listeners(|it| members.add(it.node_id));
                members.count()
            }),
            false => tended.count_places((taken.number_of_notifiers(), notifiers), || {
                let mut members = Members::default();
                taken.list_notifiers(|it| members.add(it.node_id));
                members.count()
            }),
        }
    }

    /// Listeners that there are.
    pub(crate) fn listeners(&self) -> usize {
        self.service.dynamic_config().number_of_listeners()
    }

    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    pub(crate) fn listener(&self) -> Result<Listener, OpenError> {
        use iceoryx2::port::listener::ListenerCreateError as Error;
        open::port(
            &self.name,
            ("listeners", self.limits.0),
            |error| error == Error::ExceedsMaxSupportedListeners,
            || self.service.listener_builder().create(),
        )
    }

    pub(crate) fn notifier(&self) -> Result<Notifier, OpenError> {
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
