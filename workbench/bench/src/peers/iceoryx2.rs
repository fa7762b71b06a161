//! iceoryx2 without our ports: the standard variant, publish/subscribe, and its default event where the receiver blocks.
//!
//! The buffer and the overflow are those of our services, so that nothing but our ports is compared.

use anyhow::{Result, anyhow};
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{Config, FileName, NodeBuilder, Path, SemanticString, SignalHandlingMode};
use ipc_types::Domain;
use ipc_types::payload::HeroTelemetry;

use super::ends::{Mark, PATIENCE};

type Variant = iceoryx2::prelude::ipc::Service;
type Node = iceoryx2::prelude::Node<Variant>;

/// Samples that a subscriber keeps.
const BUFFER: usize = 64;

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

fn publisher(node: &Node) -> Result<Publisher<Variant, HeroTelemetry, ()>> {
    let service = node
        .service_builder(&"bench".try_into()?)
        .publish_subscribe::<HeroTelemetry>()
        .subscriber_max_buffer_size(BUFFER)
        .open_or_create()?;
    Ok(service.publisher_builder().create()?)
}

fn subscriber(node: &Node) -> Result<Subscriber<Variant, HeroTelemetry, ()>> {
    let service = node
        .service_builder(&"bench".try_into()?)
        .publish_subscribe::<HeroTelemetry>()
        .subscriber_max_buffer_size(BUFFER)
        .open_or_create()?;
    Ok(service.subscriber_builder().buffer_size(BUFFER).create()?)
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

/// Publishes, and wakes whoever blocks.
pub struct Sender {
    publisher: Publisher<Variant, HeroTelemetry, ()>,
    notifier: Option<Notifier<Variant>>,
    _node: Node,
}

impl Sender {
    pub fn without_event() -> Result<Sender> {
        let node = node()?;
        Ok(Sender {
            publisher: publisher(&node)?,
            notifier: None,
            _node: node,
        })
    }

    pub fn with_event() -> Result<Sender> {
        let sender = Sender::without_event()?;
        Ok(Sender {
            notifier: Some(notifier(&sender._node, "bench")?),
            ..sender
        })
    }
}

impl super::ends::Sender for Sender {
    fn send(&mut self, sample: &HeroTelemetry) -> Result<()> {
        self.publisher
            .loan_uninit()?
            .write_payload(*sample)
            .send()?;
        if let Some(notifier) = &self.notifier {
            notifier.notify()?;
        }
        Ok(())
    }
}

/// Asks all the time.
pub struct Spinning {
    subscriber: Subscriber<Variant, HeroTelemetry, ()>,
    _node: Node,
}

impl Spinning {
    pub fn new() -> Result<Spinning> {
        let node = node()?;
        Ok(Spinning {
            subscriber: subscriber(&node)?,
            _node: node,
        })
    }

    fn drain(&self, take: &mut dyn FnMut(Mark)) -> Result<usize> {
        let mut taken = 0;
        while let Some(sample) = self.subscriber.receive()? {
            take(Mark::of(&sample));
            taken += 1;
        }
        Ok(taken)
    }
}

impl super::ends::Receiver for Spinning {
    fn receive(&mut self, take: &mut dyn FnMut(Mark)) -> Result<()> {
        while self.drain(take)? == 0 {
            std::hint::spin_loop();
        }
        Ok(())
    }
}

/// Blocks on the listener, then takes what is there.
pub struct Blocking {
    data: Spinning,
    listener: Listener<Variant>,
}

impl Blocking {
    pub fn new() -> Result<Blocking> {
        let data = Spinning::new()?;
        Ok(Blocking {
            listener: listener(&data._node, "bench")?,
            data,
        })
    }
}

impl super::ends::Receiver for Blocking {
    fn receive(&mut self, take: &mut dyn FnMut(Mark)) -> Result<()> {
        self.listener.timed_wait(|_| {}, PATIENCE)?;
        self.data.drain(take)?;
        Ok(())
    }
}
