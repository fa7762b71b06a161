//! iceoryx2 without our ports: the standard variant, publish/subscribe, and its default event where the receiver
//! blocks.
//!
//! The buffer and the overflow are those of our services, so that nothing but our ports is compared.

use std::fmt::Debug;
use std::os::fd::BorrowedFd;

use anyhow::{Result, anyhow};
use iceoryx2::active_request::ActiveRequest;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{
    Config, FileDescriptorBased, FileName, NodeBuilder, Path, SemanticString, SignalHandlingMode,
    ZeroCopySend,
};
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use iceoryx2::service::port_factory::request_response;
use ipc_types::Domain;
use ipc_types::code::{Reason, Stage};
use ipc_types::payload::{HeroTelemetry, MovementData, RequestReport, SharedStruct};

use super::ends::{Mark, Receive, Send, TIMEOUT};

type Variant = iceoryx2::prelude::ipc::Service;

/// A node of the standard variant.
pub type Node = iceoryx2::prelude::Node<Variant>;

/// What our topics are made of.
pub trait Sample: SharedStruct + ZeroCopySend + Debug + 'static {}

impl<T: SharedStruct + ZeroCopySend + Debug + 'static> Sample for T {}

/// A request that is being answered.
pub type Asked = ActiveRequest<Variant, MovementData, (), RequestReport, ()>;

/// A service of requests.
type Requests = request_response::PortFactory<Variant, MovementData, (), RequestReport, ()>;

/// Samples that a subscriber keeps.
const BUFFER: usize = 64;

/// Name of both services of a hop, the samples and the events.
pub const SERVICE: &str = "bench";

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

fn service<T: Sample>(node: &Node, name: &str) -> Result<PortFactory<Variant, T, ()>> {
    Ok(node
        .service_builder(&name.try_into()?)
        .publish_subscribe::<T>()
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

/// What can be read when an event has been notified.
pub fn descriptor(listener: &Listener<Variant>) -> BorrowedFd<'_> {
    // SAFETY: the listener owns the descriptor, and is borrowed for as long.
    #[allow(unsafe_code)]
    unsafe {
        BorrowedFd::borrow_raw(listener.file_descriptor().native_handle())
    }
}

/// Publishes samples of a hop, and wakes a receiver that blocks.
pub fn sender(has_event: bool) -> Result<Send> {
    let node = node()?;
    let mut publish = publisher(&node, SERVICE, has_event)?;
    Ok(Box::new(move |sample| {
        let _alive = &node;
        publish(sample)
    }))
}

/// Publishes samples of the service `name`, and notifies the event of that name if there is one.
pub fn publisher<T: Sample>(
    node: &Node,
    name: &str,
    has_event: bool,
) -> Result<impl FnMut(&T) -> Result<()> + use<T>> {
    let publisher = service::<T>(node, name)?.publisher_builder().create()?;
    let notifier = match has_event {
        true => Some(notifier(node, name)?),
        false => None,
    };
    Ok(move |sample: &T| {
        publisher.loan_uninit()?.write_payload(*sample).send()?;
        if let Some(notifier) = &notifier {
            notifier.notify()?;
        }
        Ok(())
    })
}

/// The request service `name`.
pub fn requests(node: &Node, name: &str) -> Result<Requests> {
    let service = node.service_builder(&name.try_into()?);
    let service = service.request_response::<MovementData, RequestReport>();
    Ok(service.open_or_create()?)
}

/// Answers a request; more answers may follow.
pub fn answer(request: &Asked, stage: Stage) -> Result<()> {
    let report = RequestReport {
        request_id: request.request_id,
        ..RequestReport::new(stage, Reason::None)
    };
    request.send_copy(report)?;
    Ok(())
}

/// A subscriber of the service `name`.
pub fn subscriber<T: Sample>(node: &Node, name: &str) -> Result<Subscriber<Variant, T, ()>> {
    let service = service(node, name)?;
    let builder = service.subscriber_builder();
    Ok(builder.buffer_size(BUFFER).create()?)
}

fn drain(
    subscriber: &Subscriber<Variant, HeroTelemetry, ()>,
    take: &mut dyn FnMut(Mark),
) -> Result<usize> {
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
    let subscriber = subscriber(&node, SERVICE)?;
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
    let subscriber = subscriber(&node, SERVICE)?;
    let listener = listener(&node, SERVICE)?;
    Ok(Box::new(move |take| {
        let _alive = &node;
        listener.timed_wait(|_| {}, TIMEOUT)?;
        drain(&subscriber, take)?;
        Ok(())
    }))
}
