//! Short names for what this crate takes from iceoryx2. Nothing of this module is public.

use std::fmt::Debug;

pub(crate) use iceoryx2::prelude::{NodeBuilder, ZeroCopySend};

/// The service variant of the whole contract: processes of one machine, ports that stay on their thread.
///
/// A foreign consumer must use the same one: two variants in one domain clean up after each other wrongly.
pub(crate) type Svc = iceoryx2::prelude::ipc::Service;

pub(crate) type Node = iceoryx2::prelude::Node<Svc>;
pub(crate) type Listener = iceoryx2::port::listener::Listener<Svc>;
pub(crate) type Notifier = iceoryx2::port::notifier::Notifier<Svc>;
pub(crate) type EventService = iceoryx2::service::port_factory::event::PortFactory<Svc>;
pub(crate) type TopicService<T> =
    iceoryx2::service::port_factory::publish_subscribe::PortFactory<Svc, T, ()>;
pub(crate) type RequestService<R> = iceoryx2::service::port_factory::request_response::PortFactory<
    Svc,
    R,
    (),
    crate::payload::RequestReport,
    (),
>;

/// What lies in shared memory: implemented for every struct of the contract, and for nothing else.
pub trait Wire: ZeroCopySend + Debug + Default + Copy + 'static {}

impl<T: ZeroCopySend + crate::payload::SharedStruct + Debug> Wire for T {}
