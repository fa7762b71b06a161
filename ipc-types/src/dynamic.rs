//! [`DynamicSubscriber`] and [`DynamicPublisher`]: read and publish a topic whose struct this program was not built with, by
//! its schema; [`topics`] lists them. [`DynamicClient`] and [`DynamicServer`]: the same of requests.
//!
//! Samples and requests come as bytes, as long as the schema says. That the schema is the right one is checked when the
//! service is opened: the hash of its layout must be the one that the service carries.

mod requests;

use std::os::fd::BorrowedFd;
use std::time::Duration;

use crate::domain::Domain;
use crate::generation;
use crate::ipc::Ipc;
use crate::open::{Expected, Offer, OpenError};
use crate::payload::Number;
use crate::provider::{Provider, ProviderWatch};
use crate::publisher::{BytesPublisher, PublishError};
use crate::robot::RobotId;
use crate::schema::{LoadError, Schema, SchemaError};
use crate::sequence::Losses;
use crate::service::{
    EPOCH_OFFSET, Pattern, REQUEST_ID_OFFSET, SEQUENCE_OFFSET, ServiceId, is_key, own, service_name,
};
use crate::session::service_folder;
use crate::subscriber::{BytesSubscriber, ReceiveError};
use crate::waiter::{WaitError, Wake, sealed};

pub use requests::{DynamicClient, DynamicServer};

/// A service cannot be used by its schema.
#[derive(Debug, thiserror::Error)]
pub enum DynamicError {
    /// The samples do not begin with `sequence` and `epoch_ns`, so it is none of the contract's.
    #[error(
        "the samples of `{0}` do not begin with `uint64 sequence` and `uint64 epoch_ns`: it is no topic of a robot's module"
    )]
    NoTopic(String),
    /// The requests do not begin with `request_id`, so it is none of the contract's.
    #[error(
        "the requests of `{0}` do not begin with `uint64 request_id`: it is no request service of a robot's module"
    )]
    NoRequest(String),
    /// The key cannot be that of a module's service.
    #[error(
        "`{0}` is no key of a module: use `<module>/<service>` in lower snake case, such as `battery_watch/cell_voltages`"
    )]
    InvalidKey(String),
    /// The robot has a service of this key, which carries something else.
    #[error("`{key}` is a service of the robot's own: it can only carry `{expected}`")]
    OwnService {
        /// Key of the service.
        key: String,
        /// What it carries.
        expected: String,
    },
    /// The text is not that of a schema.
    #[error("the schema of `{key}` is not usable")]
    Schema {
        /// Key of the service.
        key: String,
        /// What is wrong with it.
        source: SchemaError,
    },
    /// The service cannot be opened.
    #[error(transparent)]
    Open(#[from] OpenError),
}

/// A topic or a request service that has, or had, a provider.
#[derive(Clone, Debug, PartialEq)]
pub struct ServiceFacts {
    /// Last part of its name, such as `battery_watch/cell_voltages`.
    pub key: String,
    /// What lies in it.
    pub schema: Schema,
    /// The text of the schema, as its provider has laid it down.
    pub text: String,
    /// Its live provider.
    pub provider: Option<Provider>,
}

/// The topics of the robot, in the alphabetical order of their keys. One whose schema cannot be read is left out.
pub fn topics(ipc: &Ipc) -> Vec<ServiceFacts> {
    ipc.domain().topics(ipc.robot())
}

/// The request services of the robot, in the same way.
pub fn request_services(ipc: &Ipc) -> Vec<ServiceFacts> {
    ipc.domain().request_services(ipc.robot())
}

/// The schema of the topic `key` of the robot, or of the requests of the service `key`: the one that lies beside it, and of the
/// robot's own the one that this program was built with when they are not there.
///
/// # Errors
///
/// See [`LoadError`].
pub fn schema_of(ipc: &Ipc, key: &str) -> Result<Schema, LoadError> {
    ipc.domain().schema_of(ipc.robot(), key)
}

/// The same for a process that does not take part: it only reads, and creates nothing.
impl Domain {
    /// As [`topics`].
    pub fn topics(&self, robot: RobotId) -> Vec<ServiceFacts> {
        services(self, robot, is_sample)
    }

    /// As [`request_services`].
    pub fn request_services(&self, robot: RobotId) -> Vec<ServiceFacts> {
        services(self, robot, is_request)
    }

    /// As [`schema_of`].
    ///
    /// # Errors
    ///
    /// See [`LoadError`].
    pub fn schema_of(&self, robot: RobotId, key: &str) -> Result<Schema, LoadError> {
        let service = service_folder(self, robot, key);
        match generation::current(&service).filter(|current| current.key == key) {
            Some(current) => generation::schema(&service, &current.name),
            None => own(key)
                .map(ServiceId::contract)
                .map(|contract| Schema::from_layout(contract.payload))
                .ok_or_else(|| LoadError::Missing(key.to_owned())),
        }
    }
}

fn services(domain: &Domain, robot: RobotId, is_meant: fn(&Schema) -> bool) -> Vec<ServiceFacts> {
    if !domain.is_enterable() {
        return Vec::new();
    }
    let mut found: Vec<ServiceFacts> = generation::services(&domain.robot_folder(robot))
        .iter()
        .filter_map(|service| {
            let current = generation::current(service)?;
            let (schema, text) = generation::schema_with_text(service, &current.name).ok()?;
            is_meant(&schema).then(|| ServiceFacts {
                key: current.key,
                schema,
                text,
                provider: ProviderWatch::new(service).look().ok().flatten(),
            })
        })
        .collect();
    found.sort_by(|one, other| one.key.cmp(&other.key));
    found
}

/// The reading end of a topic whose struct is known by its schema alone.
pub struct DynamicSubscriber {
    bytes: BytesSubscriber,
    schema: Schema,
    key: String,
}

impl DynamicSubscriber {
    /// Opens the topic `key` of the robot, whose samples `schema` describes. It may be there before its publisher.
    ///
    /// # Errors
    ///
    /// When the topic carries something else: see [`DynamicError`].
    pub fn open(ipc: &Ipc, key: &str, schema: &Schema) -> Result<DynamicSubscriber, DynamicError> {
        if !is_sample(schema) {
            return Err(DynamicError::NoTopic(key.to_owned()));
        }
        let expected = Expected {
            name: service_name(ipc.robot(), key),
            layout: schema.type_name().to_owned(),
            layout_hash: schema.layout_hash(),
        };
        Ok(DynamicSubscriber {
            bytes: BytesSubscriber::open(ipc.session(), key, expected, schema.size())?,
            schema: schema.clone(),
            key: key.to_owned(),
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
    /// [`ReceiveError`] when the publisher cannot be reached; what was handed on before counts. The next call tries again.
    pub fn drain(&mut self, take: impl FnMut(&[u8])) -> Result<usize, ReceiveError> {
        self.bytes.drain(take)
    }

    /// Hands on the bytes of the oldest sample that was not handed on yet, and says whether there was one.
    ///
    /// # Errors
    ///
    /// As [`DynamicSubscriber::drain`].
    pub fn try_recv(&mut self, take: impl FnOnce(&[u8])) -> Result<bool, ReceiveError> {
        self.bytes.take_next(take)
    }

    /// Sleeps until there is a sample, a signal comes or `timeout` has passed.
    ///
    /// # Errors
    ///
    /// See [`WaitError`].
    pub fn wait(&mut self, timeout: Duration) -> Result<Wake, WaitError> {
        self.bytes.wait(timeout)
    }

    /// As [`Subscriber::descriptor`](crate::Subscriber::descriptor).
    ///
    /// # Errors
    ///
    /// As there.
    pub fn descriptor(&self) -> Result<BorrowedFd<'_>, WaitError> {
        self.bytes.descriptor()
    }

    /// What was received and missed so far.
    pub fn losses(&self) -> Losses {
        self.bytes.losses()
    }

    /// Generations of shared memory that this subscriber has entered.
    pub fn generations(&self) -> u64 {
        self.bytes.generations()
    }
}

impl sealed::Source for DynamicSubscriber {
    fn has_something(&self) -> bool {
        self.bytes.has_something()
    }

    fn sense(&self) -> sealed::Sense<'_> {
        self.bytes.sense()
    }
}

/// The writing end of a topic whose struct is known by its schema alone: for other languages, and for tools.
pub struct DynamicPublisher {
    bytes: BytesPublisher,
    schema: Schema,
}

impl DynamicPublisher {
    /// Becomes the one publisher of the topic `key` of the robot, whose samples the text of a schema describes; see
    /// [`schema`](crate::schema). One of the robot's own topics can only carry what it always does.
    ///
    /// # Errors
    ///
    /// See [`DynamicError`]; [`OpenError::AlreadyProvided`] in it names the live process that publishes.
    pub fn open(ipc: &Ipc, key: &str, schema: &str) -> Result<DynamicPublisher, DynamicError> {
        let text = schema;
        let schema = parse(key, text)?;
        if !is_sample(&schema) {
            return Err(DynamicError::NoTopic(key.to_owned()));
        }
        check_key(key, Pattern::PublishSubscribe, schema.layout_hash())?;
        let offer = Offer::of_schema(key, &schema, text);
        Ok(DynamicPublisher {
            bytes: BytesPublisher::open(ipc.session(), offer)?,
            schema,
        })
    }

    /// What lies in the samples.
    pub fn schema(&self) -> &Schema {
        &self.schema
    }

    /// As [`Publisher::publish`](crate::Publisher::publish), of bytes: `fill` gets as many as the schema says, all zero.
    ///
    /// # Errors
    ///
    /// See [`PublishError`].
    pub fn publish(&mut self, fill: impl FnOnce(&mut [u8])) -> Result<u64, PublishError> {
        self.bytes.publish(fill)
    }

    /// As [`Publisher::tend`](crate::Publisher::tend).
    pub fn tend(&mut self) {
        self.bytes.tend();
    }

    /// As [`Publisher::descriptor`](crate::Publisher::descriptor).
    ///
    /// # Errors
    ///
    /// As there.
    pub fn descriptor(&self) -> Result<BorrowedFd<'_>, WaitError> {
        self.bytes.descriptor()
    }

    /// Number of the last sample, 0 before the first.
    pub fn sequence(&self) -> u64 {
        self.bytes.sequence()
    }
}

impl sealed::Source for DynamicPublisher {
    fn has_something(&self) -> bool {
        self.bytes.has_something()
    }

    fn tend(&mut self) -> bool {
        self.bytes.tend();
        true
    }

    fn sense(&self) -> sealed::Sense<'_> {
        self.bytes.sense()
    }
}

fn parse(key: &str, schema: &str) -> Result<Schema, DynamicError> {
    Schema::parse(schema).map_err(|source| DynamicError::Schema {
        key: key.to_owned(),
        source,
    })
}

/// Whether a service of this pattern, with this layout, may have this key.
fn check_key(key: &str, pattern: Pattern, layout_hash: u64) -> Result<(), DynamicError> {
    let Some(own) = own(key).map(ServiceId::contract) else {
        return match is_key(key) && key.contains('/') {
            true => Ok(()),
            false => Err(DynamicError::InvalidKey(key.to_owned())),
        };
    };
    match own.pattern == pattern && own.layout_hash() == layout_hash {
        true => Ok(()),
        false => Err(DynamicError::OwnService {
            key: key.to_owned(),
            expected: own.layout(),
        }),
    }
}

/// Whether samples begin as those of every topic do.
fn is_sample(schema: &Schema) -> bool {
    has_number(schema, "sequence", SEQUENCE_OFFSET) && has_number(schema, "epoch_ns", EPOCH_OFFSET)
}

/// Whether requests begin as all of the contract's do.
fn is_request(schema: &Schema) -> bool {
    has_number(schema, "request_id", REQUEST_ID_OFFSET)
}

/// Whether there is a `uint64` of this name at this offset.
fn has_number(schema: &Schema, path: &str, offset: usize) -> bool {
    schema.number(path).is_some_and(|leaf| {
        leaf.number == Number::U64 && leaf.len.is_none() && leaf.offset == offset
    })
}

#[cfg(test)]
mod tests;
