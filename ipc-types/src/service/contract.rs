//! [`Contract`]: what all processes that open a service must agree on. The traits [`Topic`] and [`Request`] give it for
//! a payload, and the macros [`topic!`](crate::topic) and [`request!`](crate::request) implement them, in any crate.

use super::key::{is_key, service_name};
use crate::iox::Wire;
use crate::payload::{Layout, RequestReport, SharedStruct};
use crate::robot::RobotId;
use crate::schema::{self, Schema};
use crate::sequence::{EPOCH_OFFSET, SEQUENCE_OFFSET, stamp, word};

/// How a service carries its data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pattern {
    /// Publish/subscribe, the latest value wins; the source's non-secure slot.
    PublishSubscribe,
    /// Request/response with a stream of reports, nothing is lost; the source's secure slot.
    RequestResponse,
}

impl Pattern {
    /// The attribute `layout` of a service that carries `schema` in this way: its type name; of requests both, joined
    /// by `/`.
    pub fn layout(self, schema: &Schema) -> String {
        match self {
            Pattern::PublishSubscribe => schema.type_name().to_owned(),
            Pattern::RequestResponse => {
                format!("{}/{}", schema.type_name(), RequestReport::TYPE_NAME)
            }
        }
    }

    /// The attribute `layout_hash` of such a service, as a number.
    pub fn layout_hash(self, schema: &Schema) -> u64 {
        match self {
            Pattern::PublishSubscribe => schema.layout_hash(),
            Pattern::RequestResponse => schema.request_layout_hash(),
        }
    }
}

/// What all processes that open a service must agree on: a service of the robot's own, or a module's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contract {
    /// Last part of the service's name.
    pub key: &'static str,
    /// The module whose process publishes or serves it.
    pub provider: &'static str,
    /// How it carries data.
    pub pattern: Pattern,
    /// The payload: the sample, or the request.
    pub payload: &'static Layout,
    /// The report that answers the request; `None` for a topic.
    pub report: Option<&'static Layout>,
}

impl Contract {
    /// The service of a topic.
    pub const fn of_topic<T: Topic>() -> Contract {
        Contract {
            key: T::KEY,
            provider: T::PROVIDER,
            pattern: Pattern::PublishSubscribe,
            payload: T::LAYOUT,
            report: None,
        }
    }

    /// The service of a request.
    pub const fn of_request<R: Request>() -> Contract {
        Contract {
            key: R::KEY,
            provider: R::PROVIDER,
            pattern: Pattern::RequestResponse,
            payload: R::LAYOUT,
            report: Some(RequestReport::LAYOUT),
        }
    }

    /// The service's name, such as `hero/1/battery_watch/cell_voltages`.
    pub fn name(&self, robot: RobotId) -> String {
        service_name(robot, self.key)
    }

    /// See [`Pattern::layout`].
    pub fn layout(&self) -> String {
        self.pattern.layout(&Schema::from_layout(self.payload))
    }

    /// See [`Pattern::layout_hash`].
    pub fn layout_hash(&self) -> u64 {
        self.pattern.layout_hash(&Schema::from_layout(self.payload))
    }

    /// The schema of the payload; of a request service that of the request.
    pub fn schema(&self) -> String {
        schema::text(self.payload)
    }
}

/// A payload that is published: the latest sample wins. [`topic!`](crate::topic) implements it, in any crate.
pub trait Topic: SharedStruct + Wire {
    /// Last part of the service's name, which is `hero/<robot>/<key>`; see [`is_key`](crate::service::is_key).
    const KEY: &'static str;

    /// The module whose process publishes it, such as `bridge`.
    const PROVIDER: &'static str;

    /// Subscribers that the topic can have, in all processes.
    const MAX_SUBSCRIBERS: usize = super::bounds::MAX_SUBSCRIBERS;

    /// The sample's count, from 1.
    fn sequence(&self) -> u64 {
        word(self.bytes(), SEQUENCE_OFFSET)
    }

    /// When its publisher began, host monotonic ns.
    fn epoch_ns(&self) -> u64 {
        word(self.bytes(), EPOCH_OFFSET)
    }

    /// Writes a publisher's count and identity into the sample, as a publisher does.
    fn stamp(&mut self, sequence: u64, epoch_ns: u64) {
        let mut bytes = self.bytes().to_vec();
        stamp(&mut bytes, sequence, epoch_ns);
        if let Some(stamped) = Self::from_bytes(&bytes) {
            *self = stamped;
        }
    }
}

/// A payload that is sent as a request and answered with a stream of [`RequestReport`]s. [`request!`](crate::request)
/// implements it, in any crate.
pub trait Request: SharedStruct + Wire {
    /// Last part of the service's name, which is `hero/<robot>/<key>`; see [`is_key`](crate::service::is_key).
    const KEY: &'static str;

    /// The module whose process serves it, such as `bridge`.
    const PROVIDER: &'static str;

    /// The id that its sender chose; every report repeats it.
    fn request_id(&self) -> u64 {
        word(self.bytes(), REQUEST_ID_OFFSET)
    }

    /// The path that it belongs to, 0 for none: its field `path_id`.
    fn path_id(&self) -> u64 {
        let offset = Self::LAYOUT.offset_of("path_id");
        offset.map_or(0, |offset| word(self.bytes(), offset))
    }
}

/// Stops the compiler when a topic's struct, key or provider breaks a rule of the contract.
#[doc(hidden)]
pub const fn check_topic<T: Topic>() {
    assert!(
        has_number(T::LAYOUT, "sequence", SEQUENCE_OFFSET)
            && has_number(T::LAYOUT, "epoch_ns", EPOCH_OFFSET),
        "a topic's struct begins with `sequence: u64` and `epoch_ns: u64`"
    );
    assert!(
        is_key(T::KEY) && !T::PROVIDER.is_empty(),
        "a module's key is `<module>/<topic>` in lower snake case"
    );
}

/// Checks at compile time that the struct of a request begins as the contract says.
#[doc(hidden)]
pub const fn check_request<R: Request>() {
    assert!(
        has_number(R::LAYOUT, "request_id", REQUEST_ID_OFFSET),
        "a request's struct begins with `request_id: u64`"
    );
    assert!(
        is_key(R::KEY) && !R::PROVIDER.is_empty(),
        "a module's key is `<module>/<request>` in lower snake case"
    );
}

/// Whether there is a `u64` of this name at this offset.
const fn has_number(layout: &Layout, name: &str, offset: usize) -> bool {
    matches!(layout.offset_of(name), Some(found) if found == offset)
}

/// Makes a [`shared_struct!`](crate::shared_struct) a topic of a module:
/// `topic!(Battery, "battery_watch/cell_voltages")`.
///
/// The struct begins with `sequence: u64` and `epoch_ns: u64`, which the publisher fills in, and which are how a
/// subscriber notices losses and restarts. The key begins with the module's name; see
/// [`is_key`](crate::service::is_key).
///
/// ```
/// ipc_types::shared_struct! {
///     /// Voltages of the flight battery.
///     pub struct Voltages("battery_watch.Voltages.v1") = 64 {
///         /// Counts the samples of this publisher from 1.
///         pub sequence: u64,
///         /// When the publisher began, host monotonic ns.
///         pub epoch_ns: u64,
///         /// Of the cells, from the negative pole, under load [V].
///         pub cells: [f32; 12],
///     }
/// }
/// ipc_types::topic!(Voltages, "battery_watch/cell_voltages");
///
/// use ipc_types::Topic;
/// use ipc_types::service::Contract;
/// assert_eq!(Voltages::PROVIDER, "battery_watch");
/// const CONTRACT: Contract = Contract::of_topic::<Voltages>();
/// assert_eq!(CONTRACT.layout(), "battery_watch.Voltages.v1");
/// ```
///
/// A struct that does not begin so does not compile, and neither does a key without a module:
///
/// ```compile_fail
/// ipc_types::shared_struct! {
///     pub struct Voltages("battery_watch.Voltages.v1") = 24 {
///         pub epoch_ns: u64,
///         pub sequence: u64,
///         pub voltage_v: f64,
///     }
/// }
/// ipc_types::topic!(Voltages, "battery_watch/voltages");
/// ```
///
/// ```compile_fail
/// ipc_types::shared_struct! {
///     pub struct Voltages("battery_watch.Voltages.v1") = 24 {
///         pub sequence: u64,
///         pub epoch_ns: u64,
///         pub voltage_v: f64,
///     }
/// }
/// ipc_types::topic!(Voltages, "voltages");
/// ```
///
/// A key of one of the RIL's own modules neither:
///
/// ```compile_fail
/// ipc_types::shared_struct! {
///     pub struct Voltages("battery_watch.Voltages.v1") = 24 {
///         pub sequence: u64,
///         pub epoch_ns: u64,
///         pub voltage_v: f64,
///     }
/// }
/// ipc_types::topic!(Voltages, "relay/voltages");
/// ```
#[macro_export]
macro_rules! topic {
    ($payload:ty, $key:literal) => {
        $crate::topic!($payload, $key, $crate::service::module_of($key));
        const _: () = $crate::service::check_outside($key);
    };
    ($payload:ty, $key:literal, $provider:expr) => {
        $crate::topic!($payload, $key, $provider, $crate::service::MAX_SUBSCRIBERS);
    };
    ($payload:ty, $key:literal, $provider:expr, $max_subscribers:expr) => {
        impl $crate::Topic for $payload {
            const KEY: &'static str = $key;
            const PROVIDER: &'static str = $provider;
            const MAX_SUBSCRIBERS: usize = $max_subscribers;
        }

        const _: () = $crate::service::check_topic::<$payload>();
    };
}

/// Makes a [`shared_struct!`](crate::shared_struct) a request to a module:
/// `request!(SetLimits, "battery_watch/limits")`.
///
/// The struct begins with `request_id: u64`, which the sender chooses and every report repeats. The key is as that of a
/// [`topic!`](crate::topic).
///
/// ```
/// ipc_types::shared_struct! {
///     /// Sets the voltage below which `battery_watch` warns.
///     pub struct SetLimit("battery_watch.SetLimit.v1") = 16 {
///         /// Chosen by the sender, not 0, never used before by any sender; every report repeats it.
///         pub request_id: u64,
///         /// Least voltage of a cell.
///         pub least_v: f64,
///     }
/// }
/// ipc_types::request!(SetLimit, "battery_watch/limits");
///
/// use ipc_types::service::Contract;
/// const CONTRACT: Contract = Contract::of_request::<SetLimit>();
/// assert_eq!(CONTRACT.layout(), "battery_watch.SetLimit.v1/hero.RequestReport.v3");
/// ```
#[macro_export]
macro_rules! request {
    ($payload:ty, $key:literal) => {
        $crate::request!($payload, $key, $crate::service::module_of($key));
        const _: () = $crate::service::check_outside($key);
    };
    ($payload:ty, $key:literal, $provider:expr) => {
        impl $crate::Request for $payload {
            const KEY: &'static str = $key;
            const PROVIDER: &'static str = $provider;
        }

        const _: () = $crate::service::check_request::<$payload>();
    };
}

/// Where `request_id` lies in every request, bytes.
pub const REQUEST_ID_OFFSET: usize = 0;
