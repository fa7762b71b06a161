//! [`DynamicSubscriber`]: reads a topic whose struct this program was not built with, by its schema; [`topics`] lists them.
//!
//! It opens what is there and creates nothing: a topic exists while its publisher does, or somebody else who opened it. The
//! samples come as bytes, as long as the schema says. That the schema is the right one is checked when the topic is
//! opened: the hash of its layout must be the one that the service carries.

use std::os::fd::{AsRawFd, BorrowedFd};
use std::time::Duration;

use iceoryx2::config::Config;
use iceoryx2::prelude::{
    CallbackProgression, FileDescriptorBased, MessagingPattern, NodeName, Service, ServiceName,
    SignalHandlingMode,
};
use iceoryx2::service::attribute::{AttributeKey, AttributeSet};
use iceoryx2::service::marker::CustomPayloadMarker;
use iceoryx2::service::static_config::message_type_details::{TypeDetail, TypeVariant};

use crate::continuity::{Continuity, Losses};
use crate::domain::MakingLock;
use crate::event;
use crate::files;
use crate::iox::{Listener, Node, NodeBuilder, Notifier, Svc};
use crate::payload::Number;
use crate::schema::{self, LoadError, Schema, Value};
use crate::service::{
    CONTRACTS, EPOCH_OFFSET, MAX_PROVIDERS, SEQUENCE_OFFSET, SUBSCRIBER_BUFFER, is_key,
    service_name,
};
use crate::session::Ipc;
use crate::time::MonotonicNs;
use crate::waiter::{WaitError, Waiter, Wake, sealed};

/// Most samples of one [`DynamicSubscriber::drain`], as that of a [`Subscriber`](crate::Subscriber).
const MAX_SAMPLES_PER_DRAIN: usize = SUBSCRIBER_BUFFER * MAX_PROVIDERS;

/// Most services of a domain that are listed. A robot has a few dozen.
const MAX_LISTED: usize = 4096;

/// A topic cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum DynamicError {
    /// Nobody has it open.
    #[error("there is no topic `{0}`: its publisher does not run")]
    Absent(String),
    /// The schema is of another layout than the service.
    #[error(
        "the schema of `{key}` describes `{wanted}`, but the topic carries `{found}`: the schema is of another version"
    )]
    OtherLayout {
        /// Key of the topic.
        key: String,
        /// Type name and hash of the schema.
        wanted: String,
        /// Type name and hash of the service.
        found: String,
    },
    /// The samples do not begin with `sequence` and `epoch_ns`, so it is none of the contract's.
    #[error(
        "the samples of `{0}` do not begin with `uint64 sequence` and `uint64 epoch_ns`: it is no topic of a robot's module"
    )]
    NoTopic(String),
    /// iceoryx2 failed.
    #[error("the topic `{key}` cannot be opened ({reason})")]
    Failed {
        /// Key of the topic.
        key: String,
        /// What iceoryx2 says.
        reason: String,
    },
    /// Samples could not be received; the next call tries again.
    #[error("samples of `{key}` cannot be received ({reason}); the next call tries again")]
    Receive {
        /// Key of the topic.
        key: String,
        /// What iceoryx2 says.
        reason: String,
    },
}

/// A topic that is there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TopicFacts {
    /// Last part of its name, such as `battery_watch/cell_voltages`.
    pub key: String,
    /// Name of the payload's type, such as `battery_watch.Voltages.v1`.
    pub type_name: String,
    /// Size of the payload, bytes.
    pub size: usize,
    /// Alignment of the payload, bytes.
    pub align: usize,
    /// Hash of the layout; nothing when the service carries none, and so is none of the contract's.
    pub layout_hash: Option<u64>,
}

/// The topics of the robot that somebody has open, in the alphabetical order of their keys.
///
/// # Errors
///
/// [`DynamicError::Failed`] when the domain cannot be looked at.
pub fn topics(ipc: &Ipc) -> Result<Vec<TopicFacts>, DynamicError> {
    let failed = |reason| DynamicError::Failed {
        key: "*".to_owned(),
        reason,
    };
    let config = ipc.domain().config();
    let config = config.map_err(|error| failed(error.to_string()))?;
    let prefix = service_name(ipc.robot(), "");
    let mut topics = Vec::new();
    let mut seen = 0;
    Svc::list(&config, |details| {
        let service = &details.static_details;
        let name = service.name().to_string();
        let key = name.strip_prefix(&prefix).filter(|key| is_key(key));
        if let (Some(key), MessagingPattern::PublishSubscribe) = (key, pattern(service)) {
            let payload = &service.publish_subscribe().message_type_details().payload;
            topics.push(facts(key, payload, service.attributes()));
        }
        seen += 1;
        match seen < MAX_LISTED {
            true => CallbackProgression::Continue,
            false => CallbackProgression::Stop,
        }
    })
    .map_err(|error| failed(format!("{error:?}")))?;
    topics.sort_by(|one, other| one.key.cmp(&other.key));
    Ok(topics)
}

/// The pattern of a service, which iceoryx2 has in a type that it does not show.
fn pattern(service: &iceoryx2::service::static_config::StaticConfig) -> MessagingPattern {
    use iceoryx2::service::static_config::messaging_pattern::MessagingPattern as Pattern;
    match service.messaging_pattern() {
        Pattern::PublishSubscribe(_) => MessagingPattern::PublishSubscribe,
        Pattern::RequestResponse(_) => MessagingPattern::RequestResponse,
        _ => MessagingPattern::Event,
    }
}

fn facts(key: &str, payload: &TypeDetail, attributes: &AttributeSet) -> TopicFacts {
    let hash = AttributeKey::try_from("layout_hash")
        .ok()
        .and_then(|key| attributes.key_value(&key, 0).map(ToString::to_string));
    TopicFacts {
        key: key.to_owned(),
        type_name: payload.type_name().to_string(),
        size: payload.size(),
        align: payload.alignment(),
        layout_hash: hash.and_then(|hash| u64::from_str_radix(&hash, 16).ok()),
    }
}

/// The schema of the service `key` of the robot; of a request it is the request's.
///
/// It is looked for where publishers store them ([`schema::store`]); of the robot's own services this program knows it.
///
/// # Errors
///
/// See [`LoadError`].
pub fn schema_of(ipc: &Ipc, key: &str) -> Result<Schema, LoadError> {
    match schema::load(&schema_folder(ipc), key) {
        Err(LoadError::Missing(_)) => {
            let own = CONTRACTS.iter().find(|contract| contract.key == key);
            own.map(|contract| Schema::from_layout(contract.payload))
                .ok_or_else(|| LoadError::Missing(key.to_owned()))
        }
        found => found,
    }
}

/// Where the schemas of the robot's topics lie.
pub fn schema_folder(ipc: &Ipc) -> std::path::PathBuf {
    let topics = ipc.domain().root().join("topics");
    topics.join(ipc.robot().to_string())
}

/// The reading end of a topic whose struct is known by its schema alone.
pub struct DynamicSubscriber {
    // In this order they are dropped: ports before the node, the node before the part in the domain.
    port: Port,
    listener: Listener,
    /// Announces this subscriber to the publisher, which then gives it the latest sample; to be kept as long.
    _arrival: Notifier,
    _node: Node,
    schema: Schema,
    key: String,
    waiter: Waiter,
    continuity: Continuity,
    _ipc: Ipc,
}

type Port = iceoryx2::port::subscriber::Subscriber<Svc, [CustomPayloadMarker], ()>;

impl DynamicSubscriber {
    /// Opens the topic `key` of the robot, whose samples `schema` describes.
    ///
    /// # Errors
    ///
    /// [`DynamicError::Absent`] when nobody has the topic open, [`DynamicError::OtherLayout`] when it carries something
    /// else; see the others there.
    pub fn open(ipc: &Ipc, key: &str, schema: &Schema) -> Result<DynamicSubscriber, DynamicError> {
        if !is_sample(schema) {
            return Err(DynamicError::NoTopic(key.to_owned()));
        }
        let failed = |reason: String| DynamicError::Failed {
            key: key.to_owned(),
            reason,
        };
        let name = service_name(ipc.robot(), key);
        let config = ipc.domain().config();
        let config = config.map_err(|error| failed(error.to_string()))?;
        // First, because it may wait for another process.
        let _making = MakingLock::share(ipc.domain());
        files::while_no_port_opens(|| {
            let payload = find(&config, &name, key, schema)?;
            let node = NodeName::new("dynamic")
                .map_err(|error| failed(format!("{error:?}")))
                .and_then(|name| {
                    NodeBuilder::new()
                        .name(&name)
                        .config(&config)
                        .signal_handling_mode(SignalHandlingMode::Disabled)
                        .create::<Svc>()
                        .map_err(|error| failed(format!("{error:?}")))
                })?;
            let (listener, port, arrival) = open_ports(&node, &name, &payload).map_err(failed)?;
            Ok(DynamicSubscriber {
                port,
                listener,
                _arrival: arrival,
                _node: node,
                schema: schema.clone(),
                key: key.to_owned(),
                waiter: Waiter::new(),
                continuity: Continuity::default(),
                _ipc: ipc.clone(),
            })
        })
    }

    /// What lies in the samples.
    pub fn schema(&self) -> &Schema {
        &self.schema
    }

    /// Key of the topic.
    pub fn key(&self) -> &str {
        &self.key
    }

    /// Hands on the bytes of every sample that is there, in order, and says how many samples those were.
    ///
    /// They are as many as the schema says, and valid for the call alone.
    ///
    /// # Errors
    ///
    /// [`DynamicError::Receive`] when the publisher cannot be reached; what was handed on before counts.
    pub fn drain(&mut self, mut take: impl FnMut(&[u8])) -> Result<usize, DynamicError> {
        event::drain_listener(&self.listener);
        let mut taken = 0;
        for _ in 0..MAX_SAMPLES_PER_DRAIN {
            let sample = self.port.receive().map_err(|error| DynamicError::Receive {
                key: self.key.clone(),
                reason: format!("{error:?}"),
            })?;
            let Some(sample) = sample else {
                break;
            };
            let payload = bytes(sample.payload());
            let (sequence, epoch_ns) = (
                stamp(payload, SEQUENCE_OFFSET),
                stamp(payload, EPOCH_OFFSET),
            );
            if payload.len() == self.schema.size()
                && self.continuity.accept(MonotonicNs::now, epoch_ns, sequence)
            {
                take(payload);
                taken += 1;
            }
        }
        Ok(taken)
    }

    /// Sleeps until there is a sample, a signal comes or `timeout` has passed.
    ///
    /// # Errors
    ///
    /// See [`WaitError`].
    pub fn wait(&self, timeout: Duration) -> Result<Wake, WaitError> {
        self.waiter.wait(&[self], Some(timeout))
    }

    /// What was received and missed so far.
    pub fn losses(&self) -> Losses {
        self.continuity.losses()
    }
}

impl sealed::Source for DynamicSubscriber {
    fn has_something(&self) -> bool {
        // Trouble counts as something: draining then says what it is.
        self.port.has_samples().unwrap_or(true)
    }

    fn sense(&self) -> sealed::Sense<'_> {
        // SAFETY: the listener owns the descriptor and lives as long as the subscriber, which is borrowed.
        #[allow(unsafe_code)]
        let descriptor =
            unsafe { BorrowedFd::borrow_raw(self.listener.file_descriptor().native_handle()) };
        debug_assert!(descriptor.as_raw_fd() >= 0);
        sealed::Sense::Descriptor(descriptor)
    }
}

/// Whether samples begin as those of every topic do.
fn is_sample(schema: &Schema) -> bool {
    let is = |path, offset| {
        schema
            .number(path)
            .is_some_and(|leaf| leaf.number == Number::U64 && leaf.offset == offset)
    };
    is("sequence", SEQUENCE_OFFSET) && is("epoch_ns", EPOCH_OFFSET)
}

fn stamp(payload: &[u8], offset: usize) -> u64 {
    let value = Value::read(Number::U64, payload, offset);
    value.and_then(Value::as_u64).unwrap_or_default()
}

/// The payload's type as the service has it, if it is the one that `schema` describes.
fn find(
    config: &Config,
    name: &str,
    key: &str,
    schema: &Schema,
) -> Result<TypeDetail, DynamicError> {
    let failed = |reason: String| DynamicError::Failed {
        key: key.to_owned(),
        reason,
    };
    let service = ServiceName::new(name).map_err(|error| failed(format!("{error:?}")))?;
    let details = Svc::details(&service, config, MessagingPattern::PublishSubscribe)
        .map_err(|error| failed(format!("{error:?}")))?
        .ok_or_else(|| DynamicError::Absent(key.to_owned()))?;
    let service = &details.static_details;
    let payload = service.publish_subscribe().message_type_details().payload;
    let found = facts(key, &payload, service.attributes());
    let wanted = TopicFacts {
        key: key.to_owned(),
        type_name: schema.type_name().to_owned(),
        size: schema.size(),
        align: schema.align(),
        layout_hash: Some(schema.layout_hash()),
    };
    if found == wanted && payload.variant() == TypeVariant::FixedSize {
        return Ok(payload);
    }
    let text = |facts: &TopicFacts| match facts.layout_hash {
        Some(hash) => format!("{} {hash:016x}", facts.type_name),
        None => format!("{} without a layout hash", facts.type_name),
    };
    Err(DynamicError::OtherLayout {
        key: key.to_owned(),
        wanted: text(&wanted),
        found: text(&found),
    })
}

/// Listener, port and announcement, in this order: the announcement wakes the publisher, which gives the port the latest
/// sample and signals the listener.
fn open_ports(
    node: &Node,
    name: &str,
    payload: &TypeDetail,
) -> Result<(Listener, Port, Notifier), String> {
    let service = |name: &str| ServiceName::new(name).map_err(|error| format!("{error:?}"));
    let samples = node.service_builder(&service(name)?).event().open();
    let listener = samples
        .map_err(|error| format!("{error:?}"))?
        .listener_builder()
        .create()
        .map_err(|error| format!("{error:?}"))?;
    let builder = node
        .service_builder(&service(name)?)
        .publish_subscribe::<[CustomPayloadMarker]>();
    // SAFETY: the type is the one that the service was created with; its samples are only ever read as bytes, of which a
    // struct of the contract has no uninitialized ones.
    #[allow(unsafe_code)]
    let builder = unsafe { builder.__internal_set_payload_type_details(payload) };
    let port = builder
        .open()
        .map_err(|error| format!("{error:?}"))?
        .subscriber_builder()
        .create()
        .map_err(|error| format!("{error:?}"))?;
    let subscribers = service(&format!("{name}/subscribers"))?;
    let subscribers = node.service_builder(&subscribers).event().open();
    let arrival = subscribers
        .map_err(|error| format!("{error:?}"))?
        .notifier_builder()
        .create()
        .map_err(|error| format!("{error:?}"))?;
    Ok((listener, port, arrival))
}

/// The marker is one byte; it stands for any payload.
fn bytes(payload: &[CustomPayloadMarker]) -> &[u8] {
    // SAFETY: a marker has the size of a byte and holds one, and the slice is borrowed for as long.
    #[allow(unsafe_code)]
    unsafe {
        std::slice::from_raw_parts(payload.as_ptr().cast(), payload.len())
    }
}

#[cfg(test)]
mod tests;
