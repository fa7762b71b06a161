//! [`DynamicSubscriber`]: reads a topic whose struct this program was not built with, by its schema; [`topics`] lists them.
//!
//! The samples come as bytes, as long as the schema says. That the schema is the right one is checked when the topic is
//! opened: the hash of its layout must be the one that the service carries.

use std::time::Duration;

use crate::generation;
use crate::open::{Expected, OpenError};
use crate::payload::Number;
use crate::provider::{Provider, ProviderWatch};
use crate::schema::{LoadError, Schema};
use crate::sequence::Losses;
use crate::service::{CONTRACTS, EPOCH_OFFSET, Pattern, SEQUENCE_OFFSET, service_name};
use crate::session::{Ipc, service_folder};
use crate::subscriber::{BytesSubscriber, ReceiveError};
use crate::waiter::{WaitError, Wake, sealed};

/// A topic cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum DynamicError {
    /// The samples do not begin with `sequence` and `epoch_ns`, so it is none of the contract's.
    #[error(
        "the samples of `{0}` do not begin with `uint64 sequence` and `uint64 epoch_ns`: it is no topic of a robot's module"
    )]
    NoTopic(String),
    /// The service cannot be opened.
    #[error(transparent)]
    Open(#[from] OpenError),
}

/// A topic that has, or had, a publisher.
#[derive(Clone, Debug, PartialEq)]
pub struct TopicFacts {
    /// Last part of its name, such as `battery_watch/cell_voltages`.
    pub key: String,
    /// What lies in it.
    pub schema: Schema,
    /// Its live publisher.
    pub provider: Option<Provider>,
}

/// The topics of the robot, in the alphabetical order of their keys. One whose schema cannot be read is left out.
pub fn topics(ipc: &Ipc) -> Vec<TopicFacts> {
    let robot_folder = ipc.domain().robot_folder(ipc.robot());
    let mut topics: Vec<TopicFacts> = generation::services(&robot_folder)
        .iter()
        .filter_map(|service| {
            let current = generation::current(service)?;
            let schema = generation::schema(service, &current.name).ok()?;
            // A request begins otherwise.
            is_sample(&schema).then(|| TopicFacts {
                key: current.key,
                schema,
                provider: ProviderWatch::new(service).look().ok().flatten(),
            })
        })
        .collect();
    topics.sort_by(|one, other| one.key.cmp(&other.key));
    topics
}

/// The schema of the topic `key` of the robot: the one that lies beside it, and of the robot's own topics the one that this
/// program was built with when they are not there.
///
/// # Errors
///
/// See [`LoadError`].
pub fn schema_of(ipc: &Ipc, key: &str) -> Result<Schema, LoadError> {
    let service = service_folder(ipc.domain(), ipc.robot(), key);
    match generation::current(&service).filter(|current| current.key == key) {
        Some(current) => generation::schema(&service, &current.name),
        None => CONTRACTS
            .iter()
            .find(|contract| contract.key == key && contract.pattern == Pattern::PublishSubscribe)
            .map(|contract| Schema::from_layout(contract.payload))
            .ok_or_else(|| LoadError::Missing(key.to_owned())),
    }
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

    /// Sleeps until there is a sample, a signal comes or `timeout` has passed.
    ///
    /// # Errors
    ///
    /// See [`WaitError`].
    pub fn wait(&self, timeout: Duration) -> Result<Wake, WaitError> {
        self.bytes.wait(timeout)
    }

    /// What was received and missed so far.
    pub fn losses(&self) -> Losses {
        self.bytes.losses()
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

/// Whether samples begin as those of every topic do.
fn is_sample(schema: &Schema) -> bool {
    let is = |path, offset| {
        schema
            .number(path)
            .is_some_and(|leaf| leaf.number == Number::U64 && leaf.offset == offset)
    };
    is("sequence", SEQUENCE_OFFSET) && is("epoch_ns", EPOCH_OFFSET)
}

#[cfg(test)]
mod tests;
