//! Opens or creates the services of the contract, always with every quality-of-service value of the table.
//!
//! A service that exists with another layout is refused, and the error names both layouts. Transient trouble (a
//! service that is being created or removed, the remains of a dead process) is cleaned up and tried again a bounded
//! number of times.

use std::fmt::Debug;

use iceoryx2::prelude::{AttributeVerifier, MessagingPattern, Service, ServiceName};
use iceoryx2::service::attribute::{AttributeKey, AttributeSet, AttributeValue};
use iceoryx2::service::builder::publish_subscribe::{
    PublishSubscribeCreateError, PublishSubscribeOpenError, PublishSubscribeOpenOrCreateError,
};
use iceoryx2::service::builder::request_response::{
    RequestResponseCreateError, RequestResponseOpenError, RequestResponseOpenOrCreateError,
};

use crate::domain::{DomainError, Provider};
use crate::iox::{RequestService, Svc, TopicService};
use crate::payload::RequestReport;
use crate::robot::RobotId;
use crate::service::{self, Request, ServiceId, Topic};
use crate::session::Session;

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
    /// The service was created with other settings than those of the table.
    #[error(
        "service `{service}` was created with other settings ({reason}): consumers in other languages must open services, not create them; stop every process that uses it and start again"
    )]
    OtherSettings {
        /// Name of the service.
        service: String,
        /// What iceoryx2 objects to.
        reason: String,
    },
    /// Another live process provides the service.
    #[error(
        "service `{service}` is already provided by {}: stop that process first, or give this one another robot id", describe(.by.as_ref())
    )]
    AlreadyProvided {
        /// Name of the service.
        service: String,
        /// Who provides it, if it has said so.
        by: Option<Provider>,
    },
    /// As many ports as the table allows are there already.
    #[error(
        "service `{service}` already has {max} {what}, as many as it can have: stop one of the processes that use it"
    )]
    Full {
        /// Name of the service.
        service: String,
        /// Kind of port.
        what: &'static str,
        /// How many there can be.
        max: usize,
    },
    /// The folder of the domain cannot be used.
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// iceoryx2 failed, also after cleaning up and trying again.
    #[error(
        "service `{service}` cannot be opened ({reason}): if it stays like this, stop every process of the domain; the next one cleans up"
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

/// How often opening is tried. iceoryx2 itself waits up to a second in each for a service in the making, so that this
/// is also the limit of time: four seconds.
const OPEN_ATTEMPTS: u32 = 4;

/// What to do with a failure of iceoryx2.
pub(crate) enum Verdict {
    /// Clean up and try again.
    Transient,
    /// Another layout.
    Layout,
    /// Other settings.
    Settings,
    /// Give up.
    Fatal,
}

/// Tries, cleans up and tries again.
pub(crate) fn with_retries<S, E: Debug + Copy>(
    session: &Session,
    service: &str,
    judge: impl Fn(E) -> Verdict,
    mismatch: impl Fn() -> OpenError,
    open: impl Fn() -> Result<S, E>,
) -> Result<S, OpenError> {
    let mut attempt = 1;
    loop {
        let error = match session.make(&open) {
            Ok(opened) => return Ok(opened),
            Err(error) => error,
        };
        match judge(error) {
            Verdict::Transient if attempt < OPEN_ATTEMPTS => {
                tracing::debug!(service, ?error, attempt, "opening again");
                session.clean_dead();
                attempt += 1;
            }
            Verdict::Layout => return Err(mismatch()),
            Verdict::Settings => {
                return Err(OpenError::OtherSettings {
                    service: service.to_owned(),
                    reason: format!("{error:?}"),
                });
            }
            Verdict::Transient | Verdict::Fatal => return Err(failed(service, error)),
        }
    }
}

pub(crate) fn failed(service: &str, error: impl Debug) -> OpenError {
    OpenError::Failed {
        service: service.to_owned(),
        reason: format!("{error:?}"),
    }
}

pub(crate) fn service_name(name: &str) -> Result<ServiceName, OpenError> {
    ServiceName::new(name).map_err(|error| failed(name, error))
}

/// The attributes that a service of the contract carries, and that every port asks for.
fn attributes(id: ServiceId, robot: RobotId) -> Result<AttributeVerifier, OpenError> {
    let name = id.name(robot);
    let spec = id.spec();
    let values = [
        ("slot", id.slot(robot).to_string()),
        ("layout", spec.layout.to_owned()),
        ("layout_hash", format!("{:016x}", spec.layout_hash)),
    ];
    let mut verifier = AttributeVerifier::new();
    for (key, value) in values {
        let key = AttributeKey::try_from(key).map_err(|error| failed(&name, error))?;
        let value =
            AttributeValue::try_from(value.as_str()).map_err(|error| failed(&name, error))?;
        verifier = verifier
            .require(&key, &value)
            .map_err(|error| failed(&name, error))?;
    }
    Ok(verifier)
}

/// The error for a service with another layout, with what can be read of the one that is there.
fn layout_mismatch(
    session: &Session,
    id: ServiceId,
    robot: RobotId,
    pattern: MessagingPattern,
) -> OpenError {
    let spec = id.spec();
    let service = id.name(robot);
    let found = service_name(&service)
        .ok()
        .and_then(|name| {
            Svc::details(&name, session.config(), pattern)
                .ok()
                .flatten()
        })
        .map(|details| {
            let present = details.static_details.attributes();
            let types = match pattern {
                MessagingPattern::PublishSubscribe => {
                    let payload = details
                        .static_details
                        .publish_subscribe()
                        .message_type_details();
                    payload.payload.type_name().to_string()
                }
                _ => {
                    let config = details.static_details.request_response();
                    format!(
                        "{}/{}",
                        config.request_message_type_details().payload.type_name(),
                        config.response_message_type_details().payload.type_name()
                    )
                }
            };
            match attribute(present, "layout_hash") {
                Some(hash) => format!("{types} {hash}"),
                None => format!("{types} without a layout hash"),
            }
        });
    OpenError::LayoutMismatch {
        service,
        wanted: format!("{} {:016x}", spec.layout, spec.layout_hash),
        found: found.unwrap_or_else(|| "something unreadable".to_owned()),
    }
}

fn attribute(present: &AttributeSet, key: &str) -> Option<String> {
    let key = AttributeKey::try_from(key).ok()?;
    present.key_value(&key, 0).map(ToString::to_string)
}

/// Opens the published service of `T`.
pub(crate) fn topic<T: Topic>(
    session: &Session,
    robot: RobotId,
) -> Result<TopicService<T>, OpenError> {
    let name = T::SERVICE.name(robot);
    let service = service_name(&name)?;
    let verifier = attributes(T::SERVICE, robot)?;
    with_retries(
        session,
        &name,
        judge_topic,
        || {
            layout_mismatch(
                session,
                T::SERVICE,
                robot,
                MessagingPattern::PublishSubscribe,
            )
        },
        || {
            session
                .node()
                .service_builder(&service)
                .publish_subscribe::<T>()
                .max_publishers(service::MAX_PROVIDERS)
                .max_subscribers(service::MAX_SUBSCRIBERS)
                .max_nodes(service::MAX_NODES)
                .subscriber_max_buffer_size(service::SUBSCRIBER_BUFFER)
                .subscriber_max_borrowed_samples(service::MAX_BORROWED_SAMPLES)
                .history_size(service::HISTORY)
                .enable_safe_overflow(true)
                .open_or_create_with_attributes(&verifier)
        },
    )
}

fn judge_topic(error: PublishSubscribeOpenOrCreateError) -> Verdict {
    use PublishSubscribeCreateError as Create;
    use PublishSubscribeOpenError as Open;
    match error {
        PublishSubscribeOpenOrCreateError::SystemInFlux => Verdict::Transient,
        PublishSubscribeOpenOrCreateError::PublishSubscribeCreateError(error) => match error {
            Create::InsufficientPermissions => Verdict::Fatal,
            _ => Verdict::Transient,
        },
        PublishSubscribeOpenOrCreateError::PublishSubscribeOpenError(error) => match error {
            Open::IncompatibleTypes | Open::IncompatibleAttributes => Verdict::Layout,
            Open::Interrupt
            | Open::DoesNotExist
            | Open::InternalFailure
            | Open::ServiceInCorruptedState
            | Open::HangsInCreation
            | Open::IsMarkedForDestruction
            | Open::UnableToCreateServiceTag => Verdict::Transient,
            Open::InsufficientPermissions | Open::ExceedsMaxNumberOfNodes => Verdict::Fatal,
            _ => Verdict::Settings,
        },
    }
}

/// Opens the request service of `R`.
pub(crate) fn request<R: Request>(
    session: &Session,
    robot: RobotId,
) -> Result<RequestService<R>, OpenError> {
    let name = R::SERVICE.name(robot);
    let service = service_name(&name)?;
    let verifier = attributes(R::SERVICE, robot)?;
    with_retries(
        session,
        &name,
        judge_request,
        || {
            layout_mismatch(
                session,
                R::SERVICE,
                robot,
                MessagingPattern::RequestResponse,
            )
        },
        || {
            session
                .node()
                .service_builder(&service)
                .request_response::<R, RequestReport>()
                .max_servers(service::MAX_SERVERS)
                .max_clients(service::MAX_CLIENTS)
                .max_nodes(service::MAX_NODES)
                .max_active_requests_per_client(service::MAX_OUTSTANDING)
                .max_loaned_requests(service::MAX_LOANED_REQUESTS)
                .max_response_buffer_size(service::RESPONSE_BUFFER)
                .max_borrowed_responses_per_pending_response(service::MAX_BORROWED_REPORTS)
                .enable_fire_and_forget_requests(service::FIRE_AND_FORGET)
                .enable_safe_overflow_for_requests(false)
                .enable_safe_overflow_for_responses(false)
                .open_or_create_with_attributes(&verifier)
        },
    )
}

fn judge_request(error: RequestResponseOpenOrCreateError) -> Verdict {
    use RequestResponseCreateError as Create;
    use RequestResponseOpenError as Open;
    match error {
        RequestResponseOpenOrCreateError::SystemInFlux => Verdict::Transient,
        RequestResponseOpenOrCreateError::RequestResponseCreateError(error) => match error {
            Create::InsufficientPermissions => Verdict::Fatal,
            _ => Verdict::Transient,
        },
        RequestResponseOpenOrCreateError::RequestResponseOpenError(error) => match error {
            Open::IncompatibleRequestOrResponseType | Open::IncompatibleAttributes => {
                Verdict::Layout
            }
            Open::Interrupt
            | Open::DoesNotExist
            | Open::InternalFailure
            | Open::ServiceInCorruptedState
            | Open::HangsInCreation
            | Open::IsMarkedForDestruction
            | Open::UnableToCreateServiceTag => Verdict::Transient,
            Open::InsufficientPermissions | Open::ExceedsMaxNumberOfNodes => Verdict::Fatal,
            _ => Verdict::Settings,
        },
    }
}

/// Makes a port; when the service is full, cleans up after the dead and tries once more.
pub(crate) fn port<P, E: Debug + Copy>(
    session: &Session,
    service: &str,
    (what, max): (&'static str, usize),
    is_full: impl Fn(E) -> bool,
    create: impl Fn() -> Result<P, E>,
) -> Result<P, OpenError> {
    let error = match session.make(&create) {
        Ok(port) => return Ok(port),
        Err(error) => error,
    };
    tracing::debug!(service, what, ?error, "making the port again");
    session.clean_dead();
    session.make(&create).map_err(|error| {
        if is_full(error) {
            OpenError::Full {
                service: service.to_owned(),
                what,
                max,
            }
        } else {
            failed(service, error)
        }
    })
}
