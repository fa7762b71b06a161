//! [`DynamicSubscriber`] and [`DynamicPublisher`]: read and publish a topic whose struct this program was not built with, by
//! its schema; [`topics`] lists them. [`DynamicClient`] and [`DynamicServer`]: the same of requests.
//!
//! Samples and requests come as bytes, as long as the schema says. That the schema is the right one is checked when the
//! service is opened: the hash of its layout must be the one that the service carries.

mod check;
mod error;
mod requests;

use std::os::fd::BorrowedFd;
use std::path::PathBuf;
use std::time::Duration;

use crate::domain::Domain;
use crate::forked::Owned;
use crate::generation;
use crate::ipc::Ipc;
use crate::open::{Expected, Offer};
use crate::provider::{Provider, ProviderWatch};
use crate::publisher::{BytesPublisher, PublishError};
use crate::robot::RobotId;
use crate::schema::{LoadError, Schema};
use crate::sequence::Losses;
use crate::service::{HISTORY, LATEST, Pattern, ServiceId, own, service_name};
use crate::session::service_folder;
use crate::subscriber::{BytesSubscriber, ReceiveError};
use crate::waiter::{WaitError, Wake, sealed};

use check::{check_key, check_provider, is_request, is_sample, parse};
pub use error::DynamicError;
pub use requests::{DynamicClient, DynamicServer};

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
        services(self, robot, Pattern::PublishSubscribe)
    }

    /// As [`request_services`].
    pub fn request_services(&self, robot: RobotId) -> Vec<ServiceFacts> {
        services(self, robot, Pattern::RequestResponse)
    }

    /// As [`schema_of`].
    ///
    /// # Errors
    ///
    /// See [`LoadError`].
    pub fn schema_of(&self, robot: RobotId, key: &str) -> Result<Schema, LoadError> {
        let service = service_folder(self, robot, key);
        let current = generation::current(&service).ok().flatten();
        match current.filter(|current| current.key == key) {
            Some(current) => generation::schema(&service, &current.name),
            None => own(key)
                .map(ServiceId::contract)
                .map(|contract| Schema::from_layout(contract.payload))
                .ok_or_else(|| LoadError::Missing(key.to_owned())),
        }
    }
}

fn services(domain: &Domain, robot: RobotId, meant: Pattern) -> Vec<ServiceFacts> {
    let found = announced_in(domain, robot).into_iter();
    found
        .filter_map(|service| {
            let (pattern, facts) = service.read().ok()??;
            (pattern == meant).then_some(facts)
        })
        .collect()
}

/// A service of the robot as its provider has announced it: what is known without reading and parsing its schema. A program that looks
/// again and again reads the schemas of those generations alone that it has not seen.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Announced {
    /// Last part of its name, such as `battery_watch/cell_voltages`.
    pub key: String,
    /// Name of its generation: another one whenever a provider began, or had to begin anew. Its schema never changes.
    pub generation: String,
    /// The folder of the service.
    folder: PathBuf,
}

/// The services of the robot, in the alphabetical order of their keys, those of killed providers included.
pub fn announced(ipc: &Ipc) -> Vec<Announced> {
    announced_in(ipc.domain(), ipc.robot())
}

fn announced_in(domain: &Domain, robot: RobotId) -> Vec<Announced> {
    if !domain.is_enterable() {
        return Vec::new();
    }
    let folders = generation::services(&domain.robot_folder(robot)).into_iter();
    let found = folders.filter_map(|folder| {
        let current = generation::current(&folder).ok()??;
        Some(Announced {
            key: current.key,
            generation: current.name,
            folder,
        })
    });
    let mut found: Vec<Announced> = found.collect();
    found.sort_by(|one, other| one.key.cmp(&other.key));
    found
}

impl Announced {
    /// Its live provider.
    pub fn provider(&self) -> Option<Provider> {
        ProviderWatch::new(&self.folder).look().ok().flatten()
    }

    /// What lies in it, and how it is carried; nothing when it is no service of the contract's.
    ///
    /// # Errors
    ///
    /// See [`LoadError`]. What is [`Invalid`](LoadError::Invalid) stays so.
    pub fn read(&self) -> Result<Option<(Pattern, ServiceFacts)>, LoadError> {
        let (schema, text) = generation::schema_with_text(&self.folder, &self.generation)?;
        let pattern = match (is_sample(&schema), is_request(&schema)) {
            (true, _) => Pattern::PublishSubscribe,
            (false, true) => Pattern::RequestResponse,
            (false, false) => return Ok(None),
        };
        let facts = ServiceFacts {
            key: self.key.clone(),
            schema,
            text,
            provider: self.provider(),
        };
        Ok(Some((pattern, facts)))
    }
}

/// The reading end of a topic whose struct is known by its schema alone.
pub struct DynamicSubscriber {
    bytes: Owned<BytesSubscriber>,
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
        DynamicSubscriber::open_with(ipc, key, schema, LATEST)
    }

    /// The same with the samples that were published before, at most [`HISTORY`] of them: for a process that hears of a topic
    /// shortly after its publisher began, and wants all of it.
    ///
    /// # Errors
    ///
    /// As [`DynamicSubscriber::open`].
    pub fn open_with_history(
        ipc: &Ipc,
        key: &str,
        schema: &Schema,
    ) -> Result<DynamicSubscriber, DynamicError> {
        DynamicSubscriber::open_with(ipc, key, schema, HISTORY)
    }

    fn open_with(
        ipc: &Ipc,
        key: &str,
        schema: &Schema,
        history: usize,
    ) -> Result<DynamicSubscriber, DynamicError> {
        if !is_sample(schema) {
            return Err(DynamicError::NoTopic(key.to_owned()));
        }
        let expected = Expected {
            name: service_name(ipc.robot(), key),
            layout: schema.type_name().to_owned(),
            layout_hash: schema.layout_hash(),
        };
        Ok(DynamicSubscriber {
            bytes: BytesSubscriber::open(ipc.session(), key, expected, schema.size(), history)?,
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

    /// As [`drain`](DynamicSubscriber::drain), but the [`descriptor`](DynamicSubscriber::descriptor) stays readable, and a publisher
    /// that finds it so does not notify this subscriber again, which spares it a system call for each sample. For a process that
    /// looks at the time while samples flow. Before it waits for the descriptor, it drains as usual.
    ///
    /// # Errors
    ///
    /// As [`DynamicSubscriber::drain`].
    pub fn drain_quietly(&mut self, take: impl FnMut(&[u8])) -> Result<usize, ReceiveError> {
        self.bytes.drain_quietly(take)
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
    fn has_something(&self, look: sealed::Look) -> bool {
        self.bytes.has_something(look)
    }

    fn sense(&self) -> sealed::Sense<'_> {
        self.bytes.sense()
    }
}

/// The writing end of a topic whose struct is known by its schema alone: for other languages, and for tools.
pub struct DynamicPublisher {
    bytes: Owned<BytesPublisher>,
    schema: Schema,
}

impl DynamicPublisher {
    /// Becomes the one publisher of the topic `key` of the robot, whose samples the text of a schema describes; see
    /// [`schema`](crate::schema). One of the robot's own topics can only carry what it always does.
    ///
    /// # Errors
    ///
    /// See [`DynamicError`]; [`OpenError::AlreadyProvided`](crate::OpenError::AlreadyProvided) in it names the live process that publishes.
    pub fn open(ipc: &Ipc, key: &str, schema: &str) -> Result<DynamicPublisher, DynamicError> {
        let text = schema;
        let schema = parse(key, text)?;
        if !is_sample(&schema) {
            return Err(DynamicError::NoTopic(key.to_owned()));
        }
        check_key(key, Pattern::PublishSubscribe, schema.layout_hash())?;
        check_provider(key, ipc.session().process_name())?;
        let offer = Offer::of_schema(key, &schema, text);
        if offer.max_subscribers == 0 {
            return Err(DynamicError::TooMuchMemory {
                key: key.to_owned(),
                size: schema.size(),
            });
        }
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
    fn has_something(&self, look: sealed::Look) -> bool {
        self.bytes.has_something(look)
    }

    fn tend(&mut self) -> bool {
        self.bytes.tend();
        true
    }

    fn sense(&self) -> sealed::Sense<'_> {
        self.bytes.sense()
    }
}

#[cfg(test)]
mod tests;
