//! What lives now, for completion: looked up without taking part in shared memory, and for a bounded time.

use std::time::Duration;

use dsp_protocol::port::{PORTS_16, PORTS_32};
use ipc_types::{Domain, RobotId};

use super::context::Context;
use crate::recorded::SHORT_NAMES;
use crate::render::fields::field_names;
use crate::robot::domain::Looking;
use crate::session::alive;

/// How long a look-up may take. A person notices a delay of about 200 ms after the key; this leaves 50 ms to start the
/// program. A look-up takes about a millisecond. One that takes longer is abandoned, and nothing is offered.
const LOOK_UP_LIMIT: Duration = Duration::from_millis(150);

/// How the keys of services end that start and stop a module.
const CONTROL: &str = "/control";

/// A value that can be offered, and what it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Offer {
    pub value: String,
    pub help: String,
}

impl Offer {
    fn new(value: impl Into<String>, help: impl Into<String>) -> Offer {
        Offer {
            value: value.into(),
            help: help.into(),
        }
    }
}

/// What `look` finds within [`LOOK_UP_LIMIT`]. When it takes longer, or fails in any way, that is nothing.
pub(super) fn within_limit(look: impl FnOnce() -> Vec<Offer> + Send + 'static) -> Vec<Offer> {
    Looking::start(look).end(LOOK_UP_LIMIT).unwrap_or_default()
}

/// The robots of this user of which a bridge, a status or a relay lives.
pub(super) fn robots() -> Vec<Offer> {
    let Ok(domain) = Domain::from_environment() else {
        return Vec::new();
    };
    let living = alive(&domain).unwrap_or_default();
    let offer = |robot: RobotId| Offer::new(robot.to_string(), "robot that is alive");
    living.into_iter().map(offer).collect()
}

/// The short names of the robot's own topics, and the topics of its modules.
pub(super) fn topics(context: &Context) -> Vec<Offer> {
    let mut offers = own_topics();
    if let Ok(domain) = Domain::from_environment() {
        let live = domain.topics(context.robot).into_iter();
        let live = live.filter(|topic| topic.provider.is_some());
        offers.extend(live.map(|topic| Offer::new(topic.key, topic.schema.type_name())));
    }
    offers
}

/// The short names of the robot's own topics.
pub(super) fn own_topics() -> Vec<Offer> {
    let offer = |(name, _, help)| Offer::new(name, help);
    SHORT_NAMES.map(offer).into()
}

/// The fields of the topic that is named.
pub(super) fn fields(context: &Context) -> Vec<Offer> {
    let (Ok(domain), Some(topic)) = (Domain::from_environment(), &context.topic) else {
        return Vec::new();
    };
    let Ok(schema) = domain.schema_of(context.robot, topic) else {
        return Vec::new();
    };
    let names = field_names(schema.root()).into_iter();
    names.map(|name| Offer::new(name, "")).collect()
}

/// The modules of the robot that can be started and stopped.
pub(super) fn modules(context: &Context) -> Vec<Offer> {
    let Ok(domain) = Domain::from_environment() else {
        return Vec::new();
    };
    let services = domain.request_services(context.robot).into_iter();
    services
        .filter(|service| service.provider.is_some())
        .filter_map(|service| {
            let name = service.key.strip_suffix(CONTROL)?;
            Some(Offer::new(name, "module that is alive"))
        })
        .collect()
}

/// The DSP's parameters: the bridge lists the same table.
pub(super) fn parameters() -> Vec<Offer> {
    let short = PORTS_16.iter().map(|port| {
        let help = format!("{} to {}, at boot {}", port.min, port.max, port.boot);
        Offer::new(port.name, help)
    });
    let long = PORTS_32.iter().map(|port| {
        let help = format!("{} to {}, at boot {}", port.min, port.max, port.boot);
        Offer::new(port.name, help)
    });
    short.chain(long).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_look_up_that_hangs_or_fails_offers_nothing() {
        let (_never, hangs) = std::sync::mpsc::channel::<()>();
        let hang = move || {
            let _ = hangs.recv();
            vec![Offer::new("late", "")]
        };
        assert_eq!(within_limit(hang), []);
        assert_eq!(within_limit(|| panic!("meant to be")), []);
        assert_eq!(within_limit(own_topics), own_topics());
    }

    #[test]
    fn fields_of_the_robots_own_topics_are_known_without_a_robot() {
        let context = Context {
            robot: RobotId::new(u32::MAX).unwrap(),
            topic: Some("hero_telemetry".to_owned()),
        };
        let fields = fields(&context);
        let is_there = |name: &str| fields.iter().any(|field| field.value == name);
        assert!(
            is_there("geodetic.altitude_m") && is_there("velocity"),
            "{fields:?}"
        );
    }

    #[test]
    fn parameters_have_the_names_of_the_bridge() {
        let parameters = parameters();
        assert!(parameters.iter().any(|one| one.value == "cruise_speed_mps"));
        assert!(parameters.iter().any(|one| one.value == "trim_tail_us"));
    }
}
