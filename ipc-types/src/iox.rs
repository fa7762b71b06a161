//! What this crate takes from iceoryx2: its service variant, and short names. Nothing of this module is public.

use std::collections::HashSet;
use std::fmt::Debug;

use iceoryx2::identifiers::UniqueNodeId;
use iceoryx2::prelude::CallbackProgression;
use iceoryx2::service::Service;
use iceoryx2::service::internal::ServiceInternal;
use iceoryx2_bb_elementary_traits::testing::abandonable::Abandonable;
use iceoryx2_cal::shm_allocator::pool_allocator::PoolAllocator;
use iceoryx2_cal::{
    arc_sync_policy, bag, event, hash, monitoring, reactor, resizable_shared_memory, serialize,
    shared_memory, static_storage, zero_copy_connection,
};

pub(crate) use iceoryx2::prelude::{NodeBuilder, ZeroCopySend};

use crate::segment::Segment;

/// The service variant of the whole contract: iceoryx2's `ipc`, with [`Segment`]s. A program with iceoryx2's own
/// variant `ipc` shares its services.
///
/// What belongs to one port counts its references without a lock, as in iceoryx2's `ipc`: a lock would cost a fifth of
/// a hop. The ports of this crate can be handed to another thread all the same: each owns its generation, with the
/// node, and all that was made of them, so everything that shares those counts moves at once.
#[derive(Clone, Debug)]
pub struct Svc;

impl Service for Svc {
    type StaticStorage = static_storage::recommended::Ipc;
    type ConfigSerializer = serialize::recommended::Recommended;
    type PersistentDynamicStorage<T: Debug + Send + Sync + ZeroCopySend + 'static> = Segment<T>;
    type Bag = bag::recommended::Recommended;
    type DynamicStorage<T: Debug + Send + Sync + ZeroCopySend + 'static> = Segment<T>;
    type ServiceNameHasher = hash::recommended::Recommended;
    type SharedMemory = Memory<PoolAllocator>;
    type ResizableSharedMemory =
        resizable_shared_memory::dynamic::DynamicMemory<PoolAllocator, Self::SharedMemory>;
    type Connection = zero_copy_connection::common::details::Connection<
        Segment<zero_copy_connection::common::details::SharedManagementData>,
    >;
    type Event = event::recommended::Ipc;
    type Monitoring = monitoring::recommended::Ipc;
    type Reactor = reactor::recommended::Ipc;
    type ArcThreadSafetyPolicy<T: Send + Debug + Abandonable> =
        arc_sync_policy::single_threaded::SingleThreaded<T>;
    type BlackboardMgmt<T: Send + Sync + Debug + ZeroCopySend + 'static> = Segment<T>;
    type BlackboardPayload = Memory<iceoryx2_cal::shm_allocator::bump_allocator::BumpAllocator>;
    type UniqueId = iceoryx2::unique_id_generator::unique_system_id::UniqueSystemId;
}

impl ServiceInternal<Svc> for Svc {}

type Memory<Allocator> = shared_memory::common::details::Memory<
    Allocator,
    Segment<shared_memory::common::details::AllocatorDetails<Allocator>>,
>;

pub(crate) type Node = iceoryx2::prelude::Node<Svc>;
pub(crate) type Listener = iceoryx2::port::listener::Listener<Svc>;
pub(crate) type Notifier = iceoryx2::port::notifier::Notifier<Svc>;
pub(crate) type EventService = iceoryx2::service::port_factory::event::PortFactory<Svc>;
/// A published service whose samples are written as bytes.
pub(crate) type TopicService = iceoryx2::service::port_factory::publish_subscribe::PortFactory<
    Svc,
    [iceoryx2::service::marker::CustomPayloadMarker],
    iceoryx2::service::marker::CustomHeaderMarker,
>;
/// A published service whose samples are read as bytes.
pub(crate) type BytesService = iceoryx2::service::port_factory::publish_subscribe::PortFactory<
    Svc,
    [iceoryx2::service::marker::CustomPayloadMarker],
    (),
>;
/// A request service whose requests are read and written as bytes.
pub(crate) type RequestService = iceoryx2::service::port_factory::request_response::PortFactory<
    Svc,
    AnyRequest,
    (),
    crate::payload::RequestReport,
    (),
>;

/// Stands for a request of any size, which only the service's settings know. A reference to it covers no byte; its
/// address is that of the request.
///
/// Not iceoryx2's own marker for bytes, `[CustomPayloadMarker]`: a server of slices is given no request of a client
/// that has gone, and does not give it back either (`port/server.rs:796`), which ends the process in time. See
/// [`FIRE_AND_FORGET`](crate::service::FIRE_AND_FORGET).
#[repr(C)]
#[derive(Debug)]
pub(crate) struct AnyRequest([u8; 0]);

// SAFETY: it has no bytes. The name is replaced by that of the struct that a service carries.
#[allow(unsafe_code)]
unsafe impl ZeroCopySend for AnyRequest {
    unsafe fn type_name() -> &'static str {
        "any request"
    }
}

/// The members that have ports of one kind: a program may have several ports in one node.
#[derive(Default)]
pub(crate) struct Members(HashSet<UniqueNodeId>);

impl Members {
    pub(crate) fn add(&mut self, node: UniqueNodeId) -> CallbackProgression {
        self.0.insert(node);
        CallbackProgression::Continue
    }

    pub(crate) fn count(&self) -> usize {
        self.0.len()
    }
}

/// What lies in shared memory: implemented for every struct of the contract, and for nothing else.
pub trait Wire: ZeroCopySend + Debug + Default + Copy + Send + 'static {}

impl<T: ZeroCopySend + crate::payload::SharedStruct + Debug + Send> Wire for T {}
