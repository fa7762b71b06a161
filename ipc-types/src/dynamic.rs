//! Topics and requests whose structs this program was not built with: [`topics`] and [`request_services`] list them,
//! and a port of [`Schema`] ([`DynamicSubscriber`], [`DynamicPublisher`], [`DynamicClient`], [`DynamicServer`]) carries
//! them as bytes, as many as the schema says.
//!
//! That the schema is the right one is checked when the service is opened: the hash of its layout must be the one that
//! the service carries.

use std::io::ErrorKind::NotFound;
use std::path::PathBuf;

use crate::client::{BytesClient, Client};
use crate::domain::Domain;
use crate::generation;
use crate::ipc::Ipc;
use crate::module::{Module as _, RelayModule};
use crate::open::{Offer, OpenError};
use crate::patience::Patience;
use crate::payload::{Number, RelayStations};
use crate::provider::{self, Provider};
use crate::publisher::{BytesPublisher, Publisher};
use crate::robot::RobotId;
use crate::schema::{LoadError, Schema, SchemaError};
use crate::server::{BytesServer, Server};
use crate::service::{
    Contract, EPOCH_OFFSET, HISTORY, LATEST, MAX_SUBSCRIBERS, MAX_TOPIC_MEMORY, OWN_NAMES, Pattern,
    REQUEST_ID_OFFSET, SEQUENCE_OFFSET, ServiceId, is_key, own,
};
use crate::session::service_folder;
use crate::subscriber::{BytesSubscriber, Subscriber};

/// The reading end of a topic whose struct is known by its schema alone.
pub type DynamicSubscriber = Subscriber<Schema>;

/// The writing end of a topic whose struct is known by its schema alone: for other languages, and for tools.
pub type DynamicPublisher = Publisher<Schema>;

/// Sends requests whose struct is known by its schema alone, and follows their reports.
pub type DynamicClient = Client<Schema>;

/// Serves requests whose struct is known by its schema alone: for other languages, and for tools.
pub type DynamicServer = Server<Schema>;

impl DynamicSubscriber {
    /// Opens the topic `key` of the robot, whose samples `schema` describes. It may be there before its publisher.
    ///
    /// # Errors
    ///
    /// When the topic carries something else: see [`DynamicError`].
    pub fn open(ipc: &Ipc, key: &str, schema: &Schema) -> Result<DynamicSubscriber, DynamicError> {
        DynamicSubscriber::open_with(ipc, key, schema, LATEST)
    }

    /// Opens the topic `key` with the samples that were published before, at most [`HISTORY`] of them: for a process
    /// that hears of a topic shortly after its publisher began, and wants all of it.
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
        check_sample(key, schema)?;
        if !is_key(key) {
            return Err(DynamicError::InvalidKey(key.to_owned()));
        }
        let offer = Offer::topic(key, schema, String::new(), MAX_SUBSCRIBERS);
        let core = BytesSubscriber::open(ipc.session(), offer, history)?;
        Ok(DynamicSubscriber::of(core))
    }
}

impl DynamicPublisher {
    /// Becomes the one publisher of the topic `key` of the robot, whose samples the text of a schema describes; see
    /// [`schema`](crate::schema). One of the robot's own topics can only carry what it always does.
    ///
    /// # Errors
    ///
    /// See [`DynamicError`]; [`OpenError::AlreadyProvided`] in it names the live process that publishes.
    pub fn open(ipc: &Ipc, key: &str, schema: &str) -> Result<DynamicPublisher, DynamicError> {
        DynamicPublisher::open_with(ipc, key, schema, None)
    }

    /// Becomes the publisher as by [`DynamicPublisher::open`]: in a test, with the patience of
    /// [`Ipc::patient_publisher`].
    ///
    /// # Errors
    ///
    /// Those of [`DynamicPublisher::open`].
    pub fn open_with(
        ipc: &Ipc,
        key: &str,
        schema: &str,
        patience: Option<Patience>,
    ) -> Result<DynamicPublisher, DynamicError> {
        let text = schema.to_owned();
        let schema = parse(key, schema)?;
        check_sample(key, &schema)?;
        check_key(key, Pattern::PublishSubscribe, schema.layout_hash())?;
        check_provider(key, ipc.session().process_name())?;
        let mut offer = Offer::topic(key, &schema, text, MAX_SUBSCRIBERS);
        offer.patience = patience;
        if offer.max_subscribers == 0 {
            return Err(DynamicError::TooMuchMemory {
                key: key.to_owned(),
                size: schema.size(),
            });
        }
        let core = BytesPublisher::open(ipc.session(), offer)?;
        Ok(DynamicPublisher::of(core))
    }
}

impl DynamicClient {
    /// Opens the request service `key` of the robot, whose requests `schema` describes; [`schema_of`] finds it. The
    /// client may be there before the server.
    ///
    /// # Errors
    ///
    /// When the service carries something else: see [`DynamicError`].
    pub fn open(ipc: &Ipc, key: &str, schema: &Schema) -> Result<DynamicClient, DynamicError> {
        check_request(key, schema)?;
        let core = BytesClient::open(ipc.session(), Offer::request(key, schema, String::new()))?;
        Ok(DynamicClient::of(core))
    }
}

impl DynamicServer {
    /// Becomes the one server of the request service `key` of the robot, whose requests the text of a schema describes;
    /// see [`schema`](crate::schema). One of the robot's own services can only carry what it always does.
    ///
    /// # Errors
    ///
    /// See [`DynamicError`]; [`OpenError::AlreadyProvided`] in it names the live process that serves.
    pub fn open(ipc: &Ipc, key: &str, schema: &str) -> Result<DynamicServer, DynamicError> {
        let text = schema.to_owned();
        let schema = parse(key, schema)?;
        check_request(key, &schema)?;
        check_provider(key, ipc.session().process_name())?;
        let core = BytesServer::open(ipc.session(), Offer::request(key, &schema, text))?;
        Ok(DynamicServer::of(core))
    }
}

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
    /// The key belongs to one of the RIL's own modules.
    #[error(
        "`{key}` has the name of the RIL's own module `{module}`, which no other can have: choose another name for the module"
    )]
    OwnModule {
        /// Key of the service.
        key: String,
        /// Name of the module.
        module: &'static str,
    },
    /// The samples are so large that memory holds those of no subscriber.
    #[error(
        "a sample of `{key}` has {size} bytes: with those that wait for one subscriber the topic would take more than {MAX_TOPIC_MEMORY} bytes"
    )]
    TooMuchMemory {
        /// Key of the service.
        key: String,
        /// Size of a sample, bytes.
        size: usize,
    },
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

/// The schema of the service `key` by its text.
fn parse(key: &str, schema: &str) -> Result<Schema, DynamicError> {
    Schema::parse(schema).map_err(|source| DynamicError::Schema {
        key: key.to_owned(),
        source,
    })
}

/// The process that plays recorded flights to consumers, with the topics of bridge and status.
const REPLAY_PROCESS: &str = "replay";

/// Whether a process may provide the service `key`. The keys of the RIL's own modules belong to the processes of their
/// names, to the relay, which provides those of another machine, and to a replay.
fn check_provider(key: &str, process: &str) -> Result<(), DynamicError> {
    let own = OWN_NAMES.iter().find(|own| is_below(key, own));
    match own {
        Some(module) if ![module, RelayModule::NAME, REPLAY_PROCESS].contains(&process) => {
            Err(own_module(key, module))
        }
        _ => Ok(()),
    }
}

fn is_below(key: &str, module: &str) -> bool {
    key.split('/').next() == Some(module)
}

fn own_module(key: &str, module: &'static str) -> DynamicError {
    DynamicError::OwnModule {
        key: key.to_owned(),
        module,
    }
}

/// Whether a service of this pattern, with this layout, may have this key. Those of bridge and status may be opened
/// too, because a relay and a replay provide them; those of the relay are used as structs alone, but for the robot's
/// stations, which are relayed.
fn check_key(key: &str, pattern: Pattern, layout_hash: u64) -> Result<(), DynamicError> {
    let stations = Contract::of_topic::<RelayStations>();
    let is_stations =
        (key, pattern, layout_hash) == (stations.key, stations.pattern, stations.layout_hash());
    if is_stations {
        return Ok(());
    }
    if is_below(key, RelayModule::NAME) {
        return Err(own_module(key, RelayModule::NAME));
    }
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

/// Whether a topic can have these samples.
fn check_sample(key: &str, schema: &Schema) -> Result<(), DynamicError> {
    match is_sample(schema) {
        true => Ok(()),
        false => Err(DynamicError::NoTopic(key.to_owned())),
    }
}

/// Whether a request service with this schema may have this key.
fn check_request(key: &str, schema: &Schema) -> Result<(), DynamicError> {
    match is_request(schema) {
        true => check_key(key, Pattern::RequestResponse, schema.request_layout_hash()),
        false => Err(DynamicError::NoRequest(key.to_owned())),
    }
}

/// Whether samples begin as those of every topic do.
fn is_sample(schema: &Schema) -> bool {
    schema.offset_of("sequence", Number::U64) == Some(SEQUENCE_OFFSET)
        && schema.offset_of("epoch_ns", Number::U64) == Some(EPOCH_OFFSET)
}

/// Whether requests begin as all of the contract's do.
fn is_request(schema: &Schema) -> bool {
    schema.offset_of("request_id", Number::U64) == Some(REQUEST_ID_OFFSET)
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

/// The request services of the robot, in the alphabetical order of their keys. One whose schema cannot be read is left
/// out.
pub fn request_services(ipc: &Ipc) -> Vec<ServiceFacts> {
    ipc.domain().request_services(ipc.robot())
}

/// The schema of the topic `key` of the robot, or of the requests of the service `key`: the one that lies beside it,
/// and of the robot's own the one that this program was built with when they are not there.
///
/// # Errors
///
/// See [`LoadError`].
pub fn schema_of(ipc: &Ipc, key: &str) -> Result<Schema, LoadError> {
    ipc.domain().schema_of(ipc.robot(), key)
}

/// What services there are, for a process that does not take part: it only reads, and creates nothing.
impl Domain {
    /// The topics of `robot`, in the alphabetical order of their keys. One whose schema cannot be read is left out.
    pub fn topics(&self, robot: RobotId) -> Vec<ServiceFacts> {
        services(self, robot, Pattern::PublishSubscribe)
    }

    /// The request services of `robot`, in the alphabetical order of their keys. One whose schema cannot be read is
    /// left out.
    pub fn request_services(&self, robot: RobotId) -> Vec<ServiceFacts> {
        services(self, robot, Pattern::RequestResponse)
    }

    /// The schema of the topic `key` of `robot`, or of the requests of the service `key`.
    ///
    /// # Errors
    ///
    /// See [`LoadError`].
    pub fn schema_of(&self, robot: RobotId, key: &str) -> Result<Schema, LoadError> {
        let service = service_folder(self, robot, key);
        let current = generation::current(&service).ok().flatten();
        if let Some(current) = current.filter(|current| current.key == key) {
            match generation::schema(&service, &current.name) {
                // It vanishes in this moment.
                Err(LoadError::Unreadable { source, .. }) if source.kind() == NotFound => {}
                read => return read.map(|(schema, _)| schema),
            }
        }
        own(key)
            .map(ServiceId::contract)
            .map(|contract| Schema::from_layout(contract.payload))
            .ok_or_else(|| LoadError::Missing(key.to_owned()))
    }
}

fn services(domain: &Domain, robot: RobotId, meant: Pattern) -> Vec<ServiceFacts> {
    let found = announced(domain, robot).into_iter();
    found
        .filter_map(|service| {
            let (pattern, facts) = service.read().ok()??;
            (pattern == meant).then_some(facts)
        })
        .collect()
}

/// A service of the robot as its provider has announced it: what is known without reading and parsing its schema. A
/// program that looks periodically reads the schemas of those generations alone that it has not seen.
#[derive(Debug)]
pub(crate) struct Announced {
    /// Last part of its name, such as `battery_watch/cell_voltages`.
    pub(crate) key: String,
    /// Name of its generation: another one whenever a provider began, or had to begin anew. Its schema never changes.
    pub(crate) generation: String,
    /// The folder of the service.
    folder: PathBuf,
}

/// The services of the robot, in the alphabetical order of their keys, those of killed providers included.
pub(crate) fn announced(domain: &Domain, robot: RobotId) -> Vec<Announced> {
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
    pub(crate) fn provider(&self) -> Option<Provider> {
        provider::look(&self.folder).ok().flatten()
    }

    /// What lies in it, and how it is carried; `None` if it is no service of the contract's.
    ///
    /// # Errors
    ///
    /// See [`LoadError`]. What is [`Invalid`](LoadError::Invalid) stays so.
    pub(crate) fn read(&self) -> Result<Option<(Pattern, ServiceFacts)>, LoadError> {
        let (schema, text) = generation::schema(&self.folder, &self.generation)?;
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

#[cfg(test)]
mod tests;
