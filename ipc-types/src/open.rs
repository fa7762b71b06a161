//! Makes and opens the services of the contract.
//!
//! A provider makes its service in a generation of its own, with every quality-of-service value of the table. All
//! others open it; a service that carries another layout is refused, and the error names both layouts.

use std::borrow::Cow;
use std::fmt::Debug;

use iceoryx2::prelude::{
    AttributeSpecifier, AttributeVerifier, MessagingPattern, Service, ServiceName,
};
use iceoryx2::service::attribute::{AttributeKey, AttributeValue};
use iceoryx2::service::builder::publish_subscribe::PublishSubscribeOpenError;
use iceoryx2::service::builder::request_response::{self, RequestResponseOpenError};
use iceoryx2::service::marker::{CustomHeaderMarker, CustomPayloadMarker};
use iceoryx2::service::static_config::message_type_details::{TypeDetail, TypeVariant};

use crate::domain_error::DomainError;
use crate::doorbell::{DoorbellSlot, doorbell_slot};
use crate::files;
use crate::forked::Forked;
use crate::generation::{EnterError, Generation};
use crate::iox::{AnyRequest, BytesService, RequestService, Svc, TopicService};
use crate::limits;
use crate::patience::Patience;
use crate::payload::{Layout, Number, RequestReport};
use crate::provider::Provider;
use crate::robot::RobotId;
use crate::schema::{self, Schema};
use crate::service::{self, Pattern, Request, Topic, subscribers_within_memory};

/// A port cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The service carries another layout than this program was built with.
    #[error(
        "service `{service}` carries `{found}`, this program was built for `{wanted}`: install the same version of all programs, then stop every process that uses the service and start again"
    )]
    LayoutMismatch {
        /// Name of the service.
        service: String,
        /// Layout and hash that this program wants.
        wanted: String,
        /// Layout and hash that the service has.
        found: String,
    },
    /// Another live process provides the service.
    #[error(
        "service `{service}` is already provided by {}: stop that process first, or give this one another robot id", describe(.by.as_ref())
    )]
    AlreadyProvided {
        /// Name of the service.
        service: String,
        /// The process that provides it, if it has written its name.
        by: Option<Provider>,
    },
    /// As many ports as the table allows are there already.
    #[error(
        "service `{service}` already has {max} {what}, as many as it can have: stop one of the processes that use it{members}"
    )]
    Full {
        /// Name of the service.
        service: String,
        /// Kind of port.
        what: &'static str,
        /// How many there can be.
        max: usize,
        /// The live processes that use it, as the end of a sentence; empty when that is not known.
        members: String,
    },
    /// The folder of the domain cannot be used.
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// The process was forked from the one that joined.
    #[error(transparent)]
    Forked(#[from] Forked),
    /// `/dev/shm` is full.
    #[error(
        "service `{service}` finds no room in /dev/shm: remove what fills it (see `df -h /dev/shm` and `df -i /dev/shm`), or enlarge it (`mount -o remount,size=256m /dev/shm`)"
    )]
    NoRoom {
        /// Name of the service.
        service: String,
    },
    /// iceoryx2 failed in a process with low limits.
    #[error(
        "service `{service}` cannot be opened ({reason}); this process has low limits: {limits}; raise them (`ulimit -a` shows those of a shell; a service has `LimitNOFILE=` and the like)"
    )]
    Limited {
        /// Name of the service.
        service: String,
        /// What iceoryx2 says.
        reason: String,
        /// The limits that are so low, with their values.
        limits: String,
    },
    /// iceoryx2 failed.
    #[error(
        "service `{service}` cannot be opened ({reason}): try again; `ril doctor` looks for the cause"
    )]
    Failed {
        /// Name of the service.
        service: String,
        /// What iceoryx2 says.
        reason: String,
    },
}

fn describe(provider: Option<&Provider>) -> String {
    match provider {
        Some(provider) => format!("`{}` (process {})", provider.process, provider.pid),
        None => "another process".to_owned(),
    }
}

impl OpenError {
    /// In words, with the cause.
    pub(crate) fn with_cause(&self) -> String {
        match std::error::Error::source(self) {
            Some(cause) => format!("{self}: {cause}"),
            None => self.to_string(),
        }
    }

    /// Whether the service may be there and cannot be opened just now.
    pub(crate) fn may_pass(&self) -> bool {
        matches!(
            self,
            OpenError::Failed { .. } | OpenError::Limited { .. } | OpenError::Domain(_)
        )
    }

    /// Whether `/dev/shm` is full.
    pub fn is_no_room(&self) -> bool {
        matches!(
            self,
            OpenError::NoRoom { .. } | OpenError::Domain(DomainError::NoRoom { .. })
        )
    }

    /// Names the processes that have the places.
    pub(crate) fn with_members(mut self, names: &[String]) -> OpenError {
        if let OpenError::Full { members, .. } = &mut self
            && !names.is_empty()
        {
            *members = format!("; these are {}", names.join(", "));
        }
        self
    }

    /// Of a generation of `service`.
    pub(crate) fn enter(service: &str, error: EnterError) -> OpenError {
        match error {
            EnterError::Domain(error) => OpenError::Domain(error),
            EnterError::Ended => failed(service, "its generation has ended"),
            EnterError::Node(reason) => failed(service, reason),
        }
    }
}

/// The field of a request that every report about it repeats, if the request has it.
const PATH_ID: &str = "path_id";

/// Name of the field of a request that says when its order was issued.
const ISSUED: &str = "issued_ns";

/// Where a request of the contract says how often its sender renews it.
const LEASE: &str = "lease_ms";

/// Free bytes and inodes below which a failure is laid to them.
const LOW_BYTES: u64 = 4 << 20;
const LOW_INODES: u64 = 32;

/// Whether `/dev/shm` is as good as full.
pub(crate) fn is_memory_full() -> bool {
    limits::free_memory().is_ok_and(|free| !free.has(LOW_BYTES, LOW_INODES))
}

/// A failure of iceoryx2, which does not say when memory is full or a limit is reached.
pub(crate) fn failed(service: &str, error: impl Debug) -> OpenError {
    let service = service.to_owned();
    if is_memory_full() {
        return OpenError::NoRoom { service };
    }
    let reason = format!("{error:?}");
    let limits = limits::too_low();
    match limits.is_empty() {
        true => OpenError::Failed { service, reason },
        false => OpenError::Limited {
            service,
            reason,
            limits,
        },
    }
}

pub(crate) fn service_name(name: &str) -> Result<ServiceName, OpenError> {
    ServiceName::new(name).map_err(|error| failed(name, error))
}

fn attribute(
    service: &str,
    key: &str,
    value: &str,
) -> Result<(AttributeKey, AttributeValue), OpenError> {
    let key = AttributeKey::try_from(key).map_err(|error| failed(service, error))?;
    let value = AttributeValue::try_from(value).map_err(|error| failed(service, error))?;
    Ok((key, value))
}

/// The layout of a service that is there: type names and hash.
fn layout_of(generation: &Generation, name: &ServiceName, pattern: Pattern) -> Option<String> {
    let iox_pattern = match pattern {
        Pattern::PublishSubscribe => MessagingPattern::PublishSubscribe,
        Pattern::RequestResponse => MessagingPattern::RequestResponse,
    };
    let details = Svc::details(name, generation.config(), iox_pattern)
        .ok()
        .flatten()?;
    let types = match pattern {
        Pattern::PublishSubscribe => {
            let payload = details.static_details.publish_subscribe();
            payload
                .message_type_details()
                .payload
                .type_name()
                .to_string()
        }
        Pattern::RequestResponse => {
            let config = details.static_details.request_response();
            format!(
                "{}/{}",
                config.request_message_type_details().payload.type_name(),
                config.response_message_type_details().payload.type_name()
            )
        }
    };
    let key = AttributeKey::try_from("layout_hash").ok()?;
    let hash = details.static_details.attributes().key_value(&key, 0);
    Some(match hash {
        Some(hash) => format!("{types} {hash}"),
        None => format!("{types} without a layout hash"),
    })
}

/// What a service carries: what its provider makes it of, and what the others expect.
#[derive(Clone, Debug)]
pub struct Offer {
    /// Last part of the service's name.
    pub(crate) key: String,
    /// Where the doorbell has the service.
    pub(crate) slot: DoorbellSlot,
    pub(crate) pattern: Pattern,
    /// Of a sample or a request.
    pub(crate) schema: Schema,
    /// Only a provider needs its text, which it lays down beside its service.
    pub(crate) text: SchemaText,
    /// Of a request: where its `path_id` lies, if it has one, bytes.
    pub(crate) path_offset: Option<usize>,
    /// Of a request: where its `issued_ns` lies, if it has one, bytes.
    pub(crate) issued_offset: Option<usize>,
    /// Of a request: where its `lease_ms` lies, if it has one, bytes.
    pub(crate) lease_offset: Option<usize>,
    /// Of a topic: subscribers that it can have.
    pub(crate) max_subscribers: usize,
    /// Of a topic of a test: its queues drop nothing.
    pub(crate) patience: Option<Patience>,
}

/// What the text of a schema is made of.
#[derive(Clone, Debug)]
pub(crate) enum SchemaText {
    /// A struct that this program was built with.
    Of(&'static Layout),
    /// A text.
    Given(String),
}

impl SchemaText {
    /// # Panics
    ///
    /// When nobody could read it: the comments of the struct are longer than [`MAX_TEXT_LEN`](schema::MAX_TEXT_LEN).
    pub(crate) fn get(&self) -> Cow<'_, str> {
        match self {
            SchemaText::Of(layout) => {
                let text = schema::text(layout);
                assert!(text.len() <= schema::MAX_TEXT_LEN, "{}", layout.type_name);
                Cow::Owned(text)
            }
            SchemaText::Given(text) => Cow::Borrowed(text),
        }
    }
}

impl From<String> for SchemaText {
    fn from(text: String) -> SchemaText {
        SchemaText::Given(text)
    }
}

impl Offer {
    /// A topic that asks for `wanted` subscribers.
    pub(crate) fn topic(
        key: &str,
        schema: &Schema,
        text: impl Into<SchemaText>,
        wanted: usize,
    ) -> Offer {
        Offer {
            key: key.to_owned(),
            slot: doorbell_slot(key),
            pattern: Pattern::PublishSubscribe,
            schema: schema.clone(),
            text: text.into(),
            path_offset: None,
            issued_offset: None,
            lease_offset: None,
            max_subscribers: subscribers_within_memory(schema.size(), wanted),
            patience: None,
        }
    }

    /// A request service.
    pub(crate) fn request(key: &str, schema: &Schema, text: impl Into<SchemaText>) -> Offer {
        Offer {
            key: key.to_owned(),
            slot: doorbell_slot(key),
            pattern: Pattern::RequestResponse,
            schema: schema.clone(),
            text: text.into(),
            path_offset: schema.offset_of(PATH_ID, Number::U64),
            issued_offset: schema.offset_of(ISSUED, Number::U64),
            lease_offset: schema.offset_of(LEASE, Number::U32),
            max_subscribers: 0,
            patience: None,
        }
    }

    /// The topic `T`.
    pub(crate) fn of_topic<T: Topic>() -> Offer {
        const {
            let fitting = subscribers_within_memory(size_of::<T>(), T::MAX_SUBSCRIBERS);
            assert!(
                fitting > 0,
                "a sample is larger than MAX_TOPIC_MEMORY allows"
            );
        }
        let text = SchemaText::Of(T::LAYOUT);
        Offer::topic(T::KEY, &Schema::of_fields::<T>(), text, T::MAX_SUBSCRIBERS)
    }

    /// The service `key`, which carries `R`.
    pub(crate) fn of_request<R: Request>(key: &str) -> Offer {
        Offer::request(key, &Schema::of_fields::<R>(), SchemaText::Of(R::LAYOUT))
    }

    /// Name of the service.
    fn name(&self, robot: RobotId) -> String {
        service::service_name(robot, &self.key)
    }

    /// The attributes `layout` and `layout_hash`: what both sides must agree on.
    fn layout(&self) -> [String; 2] {
        let hash = self.pattern.layout_hash(&self.schema);
        [self.pattern.layout(&self.schema), format!("{hash:016x}")]
    }

    /// The attributes that a service is made with.
    fn specifier(&self, robot: RobotId) -> Result<AttributeSpecifier, OpenError> {
        let name = self.name(robot);
        let [layout, hash] = self.layout();
        let slot = service::slot(&self.key, robot).map(|slot| ("slot", slot.to_string()));
        let mut specifier = AttributeSpecifier::new();
        for (key, value) in [("layout", layout), ("layout_hash", hash)]
            .into_iter()
            .chain(slot)
        {
            let (key, value) = attribute(&name, key, &value)?;
            specifier = specifier
                .define(&key, &value)
                .map_err(|error| failed(&name, error))?;
        }
        Ok(specifier)
    }

    /// The attributes that a service must have.
    fn verifier(&self, name: &str) -> Result<AttributeVerifier, OpenError> {
        let [layout, hash] = self.layout();
        let mut verifier = AttributeVerifier::new();
        for (key, value) in [("layout", layout), ("layout_hash", hash)] {
            let (key, value) = attribute(name, key, &value)?;
            verifier = verifier
                .require(&key, &value)
                .map_err(|error| failed(name, error))?;
        }
        Ok(verifier)
    }

    /// The error for a service that carries something else.
    fn mismatch(&self, generation: &Generation, name: &ServiceName) -> OpenError {
        let found = layout_of(generation, name, self.pattern);
        OpenError::LayoutMismatch {
            service: name.as_str().to_owned(),
            wanted: self.layout().join(" "),
            found: found.unwrap_or_else(|| "something unreadable".to_owned()),
        }
    }

    /// The payload's type as iceoryx2 describes it.
    fn payload(&self, service: &str) -> Result<TypeDetail, OpenError> {
        TypeDetail::__internal_new_from_parts(
            TypeVariant::FixedSize,
            self.schema.type_name(),
            self.schema.size(),
            self.schema.align(),
        )
        .map_err(|error| failed(service, error))
    }
}

/// Makes a published service. Its samples are written as bytes.
pub(crate) fn create_topic(
    generation: &Generation,
    offer: &Offer,
    robot: RobotId,
) -> Result<TopicService, OpenError> {
    let name = &offer.name(robot);
    let payload = offer.payload(name)?;
    let attributes = offer.specifier(robot)?;
    let builder = generation
        .node()
        .service_builder(&service_name(name)?)
        .publish_subscribe::<[CustomPayloadMarker]>()
        .user_header::<CustomHeaderMarker>();
    // SAFETY: the samples are written as bytes, as many and as aligned as the details say. There is no user header: the
    // details are those of `()`, with which typed programs open the service.
    #[allow(unsafe_code)]
    let builder = unsafe {
        builder
            .__internal_set_payload_type_details(&payload)
            .__internal_set_user_header_type_details(&TypeDetail::new::<()>(TypeVariant::FixedSize))
    };
    let builder = builder
        .max_publishers(service::MAX_PROVIDERS)
        .max_subscribers(offer.max_subscribers)
        .max_nodes(service::MAX_NODES)
        .subscriber_max_buffer_size(service::SUBSCRIBER_BUFFER)
        .subscriber_max_borrowed_samples(service::MAX_BORROWED_SAMPLES)
        .history_size(service::HISTORY)
        .enable_safe_overflow(offer.patience.is_none());
    files::while_no_port_opens(|| builder.create_with_attributes(&attributes))
        .map_err(|error| failed(name, error))
}

/// Opens a published service. Its samples come as bytes: what lies in them, the attributes say.
pub(crate) fn open_topic(
    generation: &Generation,
    offer: &Offer,
    robot: RobotId,
) -> Result<BytesService, OpenError> {
    use PublishSubscribeOpenError as Error;
    let text = &offer.name(robot);
    let name = service_name(text)?;
    let pattern = MessagingPattern::PublishSubscribe;
    let details = Svc::details(&name, generation.config(), pattern)
        .map_err(|error| failed(text, error))?
        .ok_or_else(|| failed(text, "it is not there"))?;
    let payload = details.static_details.publish_subscribe();
    let payload = payload.message_type_details().payload;
    let builder = generation
        .node()
        .service_builder(&name)
        .publish_subscribe::<[CustomPayloadMarker]>();
    // SAFETY: the type is the one that the service was made with. That it is the expected one, the attributes say, and
    // the samples are only read as bytes, or as a struct of this very layout, for which every pattern of bits is a
    // value.
    #[allow(unsafe_code)]
    let builder = unsafe { builder.__internal_set_payload_type_details(&payload) };
    let attributes = offer.verifier(text)?;
    files::while_no_port_opens(|| builder.open_with_attributes(&attributes)).map_err(|error| {
        match error {
            Error::IncompatibleTypes | Error::IncompatibleAttributes => {
                offer.mismatch(generation, &name)
            }
            Error::ExceedsMaxNumberOfNodes => full(text, ("processes", service::MAX_NODES)),
            error => failed(text, error),
        }
    })
}

type RequestBuilder<Request, Report> = request_response::Builder<Request, (), Report, (), Svc>;

/// The builder of a request service whose requests are as `offer` says.
fn request_builder(
    generation: &Generation,
    offer: &Offer,
    name: &str,
) -> Result<RequestBuilder<AnyRequest, RequestReport>, OpenError> {
    let payload = offer.payload(name)?;
    let builder = generation
        .node()
        .service_builder(&service_name(name)?)
        .request_response::<[CustomPayloadMarker], [CustomPayloadMarker]>();
    // SAFETY: the requests are read and written as bytes, as many and as aligned as the details say. Only a builder for
    // iceoryx2's own marker takes details; it differs from the one that is made of it in markers without size, as in
    // the change of type by which iceoryx2 itself sets a user header (`service/builder/request_response.rs:546`).
    #[allow(unsafe_code)]
    Ok(unsafe {
        std::mem::transmute::<
            RequestBuilder<[CustomPayloadMarker], [CustomPayloadMarker]>,
            RequestBuilder<AnyRequest, RequestReport>,
        >(builder.__internal_set_request_payload_type_details(&payload))
    })
}

/// Makes a request service.
pub(crate) fn create_request(
    generation: &Generation,
    offer: &Offer,
    robot: RobotId,
) -> Result<RequestService, OpenError> {
    let name = &offer.name(robot);
    let attributes = offer.specifier(robot)?;
    let builder = request_builder(generation, offer, name)?
        .max_servers(service::MAX_PROVIDERS)
        .max_clients(service::MAX_CLIENTS)
        .max_nodes(service::MAX_NODES)
        .max_active_requests_per_client(service::MAX_OUTSTANDING)
        .max_loaned_requests(service::MAX_LOANED_REQUESTS)
        .max_response_buffer_size(service::RESPONSE_BUFFER)
        .max_borrowed_responses_per_pending_response(service::MAX_BORROWED_REPORTS)
        .enable_fire_and_forget_requests(service::FIRE_AND_FORGET)
        .enable_safe_overflow_for_requests(false)
        .enable_safe_overflow_for_responses(false);
    files::while_no_port_opens(|| builder.create_with_attributes(&attributes))
        .map_err(|error| failed(name, error))
}

/// Opens a request service.
pub(crate) fn open_request(
    generation: &Generation,
    offer: &Offer,
    robot: RobotId,
) -> Result<RequestService, OpenError> {
    use RequestResponseOpenError as Error;
    let text = &offer.name(robot);
    let name = service_name(text)?;
    let attributes = offer.verifier(text)?;
    let builder = request_builder(generation, offer, text)?;
    files::while_no_port_opens(|| builder.open_with_attributes(&attributes)).map_err(|error| {
        match error {
            Error::IncompatibleRequestOrResponseType | Error::IncompatibleAttributes => {
                offer.mismatch(generation, &name)
            }
            Error::ExceedsMaxNumberOfNodes => full(text, ("processes", service::MAX_NODES)),
            error => failed(text, error),
        }
    })
}

/// Makes a port.
pub(crate) fn port<P, E: Debug + Copy>(
    service: &str,
    limit: (&'static str, usize),
    is_full: impl Fn(E) -> bool,
    create: impl FnOnce() -> Result<P, E>,
) -> Result<P, OpenError> {
    files::while_no_port_opens(create).map_err(|error| match is_full(error) {
        true => full(service, limit),
        false => failed(service, error),
    })
}

fn full(service: &str, (what, max): (&'static str, usize)) -> OpenError {
    OpenError::Full {
        service: service.to_owned(),
        what,
        max,
        members: String::new(),
    }
}
