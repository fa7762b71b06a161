//! [`DynamicError`]: why a service cannot be used by its schema.

use crate::open::OpenError;
use crate::schema::SchemaError;
use crate::service::MAX_TOPIC_MEMORY;

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
