//! iceoryx2 without our ports: the standard variant, publish/subscribe, and its default event where the receiver
//! blocks.
//!
//! The buffer and the overflow are those of our services, so that nothing but our ports is compared.

use anyhow::{Result, anyhow};
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{Config, FileName, NodeBuilder, Path, SemanticString, SignalHandlingMode};
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use ipc_types::Domain;
use ipc_types::payload::HeroTelemetry;

use super::ends::{Mark, Receive, Send, TIMEOUT};

type Variant = iceoryx2::prelude::ipc::Service;
type Node = iceoryx2::prelude::Node<Variant>;

/// Samples that a subscriber keeps.
const BUFFER: usize = 64;

/// Name of both services, the samples and the events.
const SERVICE: &str = "bench";

/// A node in the domain of the environment.
pub fn node() -> Result<Node> {
    let domain = Domain::from_environment()?;
    let mut config = Config::default();
    let prefix = FileName::new(format!("{}plains_", domain.tag()).as_bytes())
        .map_err(|error| anyhow!("{error:?}"))?;
    let root = domain.root().to_string_lossy();
    let root = Path::new(root.as_bytes()).map_err(|error| anyhow!("{error:?}"))?;
    config.global.prefix = prefix;
    config.global.set_root_path(&root);
    Ok(NodeBuilder::new()
        .config(&config)
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<Variant>()?)
}

fn service(node: &Node) -> Result<PortFactory<Variant, HeroTelemetry, ()>> {
    Ok(node
        .service_builder(&SERVICE.try_into()?)
        .publish_subscribe::<HeroTelemetry>()
        .subscriber_max_buffer_size(BUFFER)
        .open_or_create()?)
}

/// The notifier of the event service `name`.
pub fn notifier(node: &Node, name: &str) -> Result<Notifier<Variant>> {
    let service = node.service_builder(&name.try_into()?).event();
    Ok(service.open_or_create()?.notifier_builder().create()?)
}

/// The listener of the event service `name`.
pub fn listener(node: &Node, name: &str) -> Result<Listener<Variant>> {
    let service = node.service_builder(&name.try_into()?).event();
    Ok(service.open_or_create()?.listener_builder().create()?)
}

/// Publishes, and wakes a receiver that blocks.
pub fn sender(has_event: bool) -> Result<Send> {
    let node = node()?;
    let publisher = service(&node)?.publisher_builder().create()?;
    let notifier = match has_event {
        true => Some(notifier(&node, SERVICE)?),
        false => None,
    };
    Ok(Box::new(move |sample| {
        let _alive = &node;
        publisher.loan_uninit()?.write_payload(*sample).send()?;
        if let Some(notifier) = &notifier {
            notifier.notify()?;
        }
        Ok(())
    }))
}

type Samples = Subscriber<Variant, HeroTelemetry, ()>;

fn subscriber(node: &Node) -> Result<Samples> {
    let service = service(node)?;
    let builder = service.subscriber_builder();
    Ok(builder.buffer_size(BUFFER).create()?)
}

fn drain(subscriber: &Samples, take: &mut dyn FnMut(Mark)) -> Result<usize> {
    let mut taken = 0;
    while let Some(sample) = subscriber.receive()? {
        take(Mark::of(&sample));
        taken += 1;
    }
    Ok(taken)
}

/// Asks all the time.
pub fn spinning() -> Result<Receive> {
    let node = node()?;
    let subscriber = subscriber(&node)?;
    Ok(Box::new(move |take| {
        let _alive = &node;
        while drain(&subscriber, take)? == 0 {
            std::hint::spin_loop();
        }
        Ok(())
    }))
}

/// Blocks on the listener, then takes what is there.
pub fn blocking() -> Result<Receive> {
    let node = node()?;
    let subscriber = subscriber(&node)?;
    let listener = listener(&node, SERVICE)?;
    Ok(Box::new(move |take| {
        let _alive = &node;
        listener.timed_wait(|_| {}, TIMEOUT)?;
        drain(&subscriber, take)?;
        Ok(())
    }))
}
