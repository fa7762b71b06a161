//! The one table of services: names, slot numbers, patterns, payloads and every quality-of-service value.
//!
//! iceoryx2's defaults lose data without an error (subscriber buffer 2, history 0, overflow of requests), therefore
//! nothing is left to a default here. `docs/ipc.md` shows the same table for consumers in other languages.

use crate::iox::Wire;
use crate::payload::layout::is_snake;
use crate::payload::{
    DspTelemetry, HeroTelemetry, Layout, ModuleControl, ModuleState, MovementData,
    ParameterRequest, RequestReport, SharedStruct, layout_hash,
};
use crate::random;
use crate::robot::RobotId;

/// A service of the contract.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ServiceId {
    /// Raw telemetry of the DSP, bridge → everybody (`UAV_SLOT_DSP_SENSORS_STATE`).
    DspTelemetry,
    /// Telemetry in SI units, status → everybody (`UAV_SLOT_SENSORS_STATE`).
    HeroTelemetry,
    /// State of the bridge, bridge → everybody (`UAV_BRIDGE_MODULE_STATUS_SLOT`).
    ModuleState,
    /// Start and stop, operator → bridge (`UAV_SLOT_MODULE_CONTROL`).
    ModuleControl,
    /// Movements, operator → bridge (`UAV_BRIDGE_DATA_SLOT`).
    Movement,
    /// The DSP's virtual ports at run time, operator → bridge. Not of the source.
    Parameters,
}

/// Longest key of a service, bytes.
pub const MAX_KEY_LEN: usize = 64;

/// Last parts of names that the event services of every service have.
const EVENT_PARTS: [&str; 3] = ["subscribers", "requests", "responses"];

/// Whether `key` can be the last part of a service's name: parts in lower snake case, divided by `/`, at most
/// [`MAX_KEY_LEN`] bytes.
///
/// A module's own keys begin with the module's name, as `battery_watch/cell_voltages` does, so that no two modules have the
/// same one. The last part is none of those that the event services have.
pub const fn is_key(key: &str) -> bool {
    let key = key.as_bytes();
    if key.is_empty() || key.len() > MAX_KEY_LEN {
        return false;
    }
    let mut from = 0;
    let mut index = 0;
    while index <= key.len() {
        if index == key.len() || key[index] == b'/' {
            if !is_snake(key, from, index) {
                return false;
            }
            if index < key.len() {
                from = index + 1;
            }
        }
        index += 1;
    }
    let mut part = 0;
    while part < EVENT_PARTS.len() {
        if ends_with(key, from, EVENT_PARTS[part].as_bytes()) {
            return false;
        }
        part += 1;
    }
    true
}

/// Whether `text[from..]` is `end`.
const fn ends_with(text: &[u8], from: usize, end: &[u8]) -> bool {
    if text.len() - from != end.len() {
        return false;
    }
    let mut index = 0;
    while index < end.len() {
        if text[from + index] != end[index] {
            return false;
        }
        index += 1;
    }
    true
}

/// How a service carries its data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pattern {
    /// Publish/subscribe, the latest value wins; the source's non-secure slot.
    PublishSubscribe,
    /// Request/response with a stream of reports, nothing is lost; the source's secure slot.
    RequestResponse,
}

/// One row of the table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ServiceSpec {
    /// Which service.
    pub id: ServiceId,
    /// Last part of the service's name.
    pub key: &'static str,
    /// The slot's identifier in the source.
    pub original: &'static str,
    /// Offset of the slot's number within the robot's ten.
    pub slot_offset: u32,
    /// How it carries data.
    pub pattern: Pattern,
    /// Type names of what lies in shared memory, joined by `/`: the payload, or request and response.
    pub layout: &'static str,
    /// Hash of every field's name, offset, size and type: see [`layout_hash`].
    pub layout_hash: u64,
}

/// Joins a request's type name and the report's, as the attribute `layout` has them.
macro_rules! request_layout {
    ($request:literal) => {
        concat!($request, "/", "hero.RequestReport.v2")
    };
}

/// All services, in the order of their slot numbers.
pub const SERVICES: [ServiceSpec; 6] = [
    ServiceSpec {
        id: ServiceId::DspTelemetry,
        key: "dsp_telemetry",
        original: "UAV_SLOT_DSP_SENSORS_STATE",
        slot_offset: 0,
        pattern: Pattern::PublishSubscribe,
        layout: DspTelemetry::TYPE_NAME,
        layout_hash: layout_hash(&[DspTelemetry::FIELDS]),
    },
    ServiceSpec {
        id: ServiceId::HeroTelemetry,
        key: "hero_telemetry",
        original: "UAV_SLOT_SENSORS_STATE",
        slot_offset: 1,
        pattern: Pattern::PublishSubscribe,
        layout: HeroTelemetry::TYPE_NAME,
        layout_hash: layout_hash(&[HeroTelemetry::FIELDS]),
    },
    ServiceSpec {
        id: ServiceId::ModuleState,
        key: "module_state",
        original: "UAV_BRIDGE_MODULE_STATUS_SLOT",
        slot_offset: 2,
        pattern: Pattern::PublishSubscribe,
        layout: ModuleState::TYPE_NAME,
        layout_hash: layout_hash(&[ModuleState::FIELDS]),
    },
    ServiceSpec {
        id: ServiceId::ModuleControl,
        key: "module_control",
        original: "UAV_SLOT_MODULE_CONTROL",
        slot_offset: 3,
        pattern: Pattern::RequestResponse,
        layout: request_layout!("hero.ModuleControl.v1"),
        layout_hash: layout_hash(&[ModuleControl::FIELDS, RequestReport::FIELDS]),
    },
    ServiceSpec {
        id: ServiceId::Movement,
        key: "movement",
        original: "UAV_BRIDGE_DATA_SLOT",
        slot_offset: 4,
        pattern: Pattern::RequestResponse,
        layout: request_layout!("hero.MovementData.v2"),
        layout_hash: layout_hash(&[MovementData::FIELDS, RequestReport::FIELDS]),
    },
    ServiceSpec {
        id: ServiceId::Parameters,
        key: "parameters",
        original: "-",
        slot_offset: 5,
        pattern: Pattern::RequestResponse,
        layout: request_layout!("hero.ParameterRequest.v1"),
        layout_hash: layout_hash(&[ParameterRequest::FIELDS, RequestReport::FIELDS]),
    },
];

impl ServiceId {
    /// The service's row of the table.
    pub const fn spec(self) -> &'static ServiceSpec {
        &SERVICES[self as usize]
    }

    /// The module whose process provides it, such as `bridge`.
    pub const fn provider(self) -> &'static str {
        CONTRACTS[self as usize].provider
    }

    /// The service's name, such as `hero/1/dsp_telemetry`.
    pub fn name(self, robot: RobotId) -> String {
        service_name(robot, self.spec().key)
    }

    /// The slot's number, 3000 … 3999: `3000 + 10 · ((robot − 1) mod 100) + offset`.
    ///
    /// The range has room for a hundred robots; the name, not the number, tells services apart.
    pub const fn slot(self, robot: RobotId) -> u32 {
        3000 + 10 * ((robot.get() - 1) % 100) + self.spec().slot_offset
    }
}

/// The robot's own service with this key; nothing when it is a module's.
pub fn own(key: &str) -> Option<ServiceId> {
    let spec = SERVICES.iter().find(|spec| spec.key == key);
    spec.map(|spec| spec.id)
}

/// Longest name of a service's folder, bytes: the longest key of the robot's own.
pub(crate) const MAX_FOLDER_LEN: usize = 14;

/// The name of a service's folder: the key, or if that is longer or has parts its first letters and a hash of it. Sockets lie
/// below, whose names are limited.
pub(crate) fn folder_name(key: &str) -> String {
    const HASH_LEN: usize = 6;
    if key.len() <= MAX_FOLDER_LEN && !key.contains('/') {
        return key.to_owned();
    }
    let begin: String = key
        .chars()
        .take_while(|letter| *letter != '/')
        .take(MAX_FOLDER_LEN - HASH_LEN - 1)
        .collect();
    let hash = random::letters(random::hash(key.as_bytes()), HASH_LEN);
    format!("{begin}-{hash}")
}

/// A payload that is published: the latest sample wins. [`topic!`](crate::topic) implements it, in any crate.
pub trait Topic: SharedStruct + Wire {
    /// Last part of the service's name, which is `hero/<robot>/<key>`; see [`is_key`].
    const KEY: &'static str;

    /// The module whose process publishes it, such as `bridge`.
    const PROVIDER: &'static str;

    /// Writes the publisher's count and identity into the sample.
    fn stamp(&mut self, sequence: u64, epoch_ns: u64);

    /// The sample's count, from 1.
    fn sequence(&self) -> u64;

    /// When its publisher began, host monotonic ns.
    fn epoch_ns(&self) -> u64;
}

/// A payload that is sent as a request and answered with a stream of [`RequestReport`]s. [`request!`](crate::request)
/// implements it, in any crate.
pub trait Request: SharedStruct + Wire {
    /// Last part of the service's name, which is `hero/<robot>/<key>`; see [`is_key`].
    const KEY: &'static str;

    /// The module whose process serves it, such as `bridge`.
    const PROVIDER: &'static str;

    /// The id that its sender chose; every report repeats it.
    fn request_id(&self) -> u64;

    /// The path that it belongs to, 0 for none.
    fn path_id(&self) -> u64 {
        0
    }
}

/// Makes a [`shared_struct!`](crate::shared_struct) a topic of a module: `topic!(Battery, "battery_watch/cell_voltages")`.
///
/// The struct begins with `sequence: u64` and `epoch_ns: u64`, which the publisher fills in, and which are how a
/// subscriber notices losses and restarts. The key begins with the module's name; see [`is_key`](crate::service::is_key).
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
#[macro_export]
macro_rules! topic {
    ($payload:ty, $key:literal) => {
        $crate::topic!($payload, $key, $crate::service::module_of($key));
    };
    ($payload:ty, $key:literal, $provider:expr) => {
        impl $crate::Topic for $payload {
            const KEY: &'static str = $key;
            const PROVIDER: &'static str = $provider;

            fn stamp(&mut self, sequence: u64, epoch_ns: u64) {
                self.sequence = sequence;
                self.epoch_ns = epoch_ns;
            }

            fn sequence(&self) -> u64 {
                self.sequence
            }

            fn epoch_ns(&self) -> u64 {
                self.epoch_ns
            }
        }

        const _: () = {
            ::core::assert!(
                ::core::mem::offset_of!($payload, sequence) == $crate::service::SEQUENCE_OFFSET
                    && ::core::mem::offset_of!($payload, epoch_ns) == $crate::service::EPOCH_OFFSET,
                "a topic's struct begins with `sequence: u64` and `epoch_ns: u64`"
            );
            ::core::assert!(
                $crate::service::is_key($key) && !<$payload as $crate::Topic>::PROVIDER.is_empty(),
                "a module's key is `<module>/<topic>` in lower snake case"
            );
        };
    };
}

/// Makes a [`shared_struct!`](crate::shared_struct) a request to a module: `request!(SetLimits, "battery_watch/limits")`.
///
/// The struct begins with `request_id: u64`, which the sender chooses and every report repeats. The key is as that of a
/// [`topic!`](crate::topic).
///
/// ```
/// ipc_types::shared_struct! {
///     /// Sets the voltage below which `battery_watch` warns.
///     pub struct SetLimit("battery_watch.SetLimit.v1") = 16 {
///         /// Chosen by the sender, not 0, never used before by anybody; every report repeats it.
///         pub request_id: u64,
///         /// Least voltage of a cell.
///         pub least_v: f64,
///     }
/// }
/// ipc_types::request!(SetLimit, "battery_watch/limits");
///
/// use ipc_types::service::Contract;
/// const CONTRACT: Contract = Contract::of_request::<SetLimit>();
/// assert_eq!(CONTRACT.layout(), "battery_watch.SetLimit.v1/hero.RequestReport.v2");
/// ```
#[macro_export]
macro_rules! request {
    ($payload:ty, $key:literal) => {
        $crate::request!($payload, $key, $crate::service::module_of($key));
    };
    ($payload:ty, $key:literal, $provider:expr) => {
        impl $crate::Request for $payload {
            const KEY: &'static str = $key;
            const PROVIDER: &'static str = $provider;

            fn request_id(&self) -> u64 {
                self.request_id
            }
        }

        const _: () = {
            ::core::assert!(
                ::core::mem::offset_of!($payload, request_id) == 0,
                "a request's struct begins with `request_id: u64`"
            );
            ::core::assert!(
                $crate::service::is_key($key)
                    && !<$payload as $crate::Request>::PROVIDER.is_empty(),
                "a module's key is `<module>/<request>` in lower snake case"
            );
        };
    };
}

/// Where `sequence` lies in every sample of a topic, bytes.
pub const SEQUENCE_OFFSET: usize = 0;

/// Where `epoch_ns` lies in every sample of a topic, bytes.
pub const EPOCH_OFFSET: usize = 8;

/// The module whose key this is: the part before the first `/`; empty when there is none.
pub const fn module_of(key: &'static str) -> &'static str {
    let bytes = key.as_bytes();
    let mut len = 0;
    while len < bytes.len() {
        if bytes[len] == b'/' {
            return key.split_at(len).0;
        }
        len += 1;
    }
    ""
}

topic!(DspTelemetry, "dsp_telemetry", "bridge");
topic!(HeroTelemetry, "hero_telemetry", "status");
topic!(ModuleState, "module_state", "bridge");
request!(ModuleControl, "module_control", "bridge");
request!(ParameterRequest, "parameters", "bridge");

impl Request for MovementData {
    const KEY: &'static str = "movement";
    const PROVIDER: &'static str = "bridge";

    fn request_id(&self) -> u64 {
        self.request_id
    }

    fn path_id(&self) -> u64 {
        self.path_id
    }
}

/// What everybody must agree on who opens a service: the robot's own, or a module's.
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
    /// The report that answers the request; nothing for a topic.
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

    /// The attribute `layout`: the payload's type name; for requests both, joined by `/`.
    pub fn layout(&self) -> String {
        match self.report {
            None => self.payload.type_name.to_owned(),
            Some(report) => format!("{}/{}", self.payload.type_name, report.type_name),
        }
    }

    /// The attribute `layout_hash`, as a number: see [`layout_hash`].
    pub const fn layout_hash(&self) -> u64 {
        match self.report {
            None => layout_hash(&[self.payload.fields]),
            Some(report) => layout_hash(&[self.payload.fields, report.fields]),
        }
    }

    /// The schema of the payload; of a request service that of the request.
    pub fn schema(&self) -> String {
        crate::schema::text(self.payload)
    }
}

/// The slot's number of the service with this key, of which only the robot's own services have one.
pub(crate) fn slot(key: &str, robot: RobotId) -> Option<u32> {
    own(key).map(|id| id.slot(robot))
}

/// The name of the service with this key, such as `hero/1/dsp_telemetry`.
pub fn service_name(robot: RobotId, key: &str) -> String {
    format!("hero/{robot}/{key}")
}

/// The contracts of the robot's own services, in the order of [`SERVICES`].
pub const CONTRACTS: [Contract; SERVICES.len()] = [
    Contract::of_topic::<DspTelemetry>(),
    Contract::of_topic::<HeroTelemetry>(),
    Contract::of_topic::<ModuleState>(),
    Contract::of_request::<ModuleControl>(),
    Contract::of_request::<MovementData>(),
    Contract::of_request::<ParameterRequest>(),
];

/// Providers (publishers or servers) of one generation of a service: the process that began it.
pub const MAX_PROVIDERS: usize = 1;

/// Subscribers of a published service, in all processes. One more is refused at its creation.
pub const MAX_SUBSCRIBERS: usize = 32;

/// Samples that wait for a subscriber that does not read; the oldest is dropped for the newest.
///
/// At 5 kHz a buffer of 16 lost samples to scheduling alone; 128 are 2.5 s of telemetry at its default 50 Hz.
pub const SUBSCRIBER_BUFFER: usize = 128;

/// Samples that a subscriber may hold at once: one that is being read, one of reserve.
pub const MAX_BORROWED_SAMPLES: usize = 2;

/// Samples that a subscriber gets at once that comes to a service for the first time: a blackboard slot holds one value.
pub const LATEST: usize = 1;

/// Samples that a subscriber can get at once that was there before the publisher, or follows it to a new generation. It enters
/// some milliseconds after the publisher has begun: a tenth of a second at 500 Hz is enough for a machine that stalls.
pub const HISTORY: usize = 50;

/// Clients of a request service, in all processes. One more is refused at its creation.
pub const MAX_CLIENTS: usize = 16;

/// Requests that a client may have open: a path keeps two open at a time, the rest is reserve.
///
/// The server's memory, the cost of each report and the time that it takes to let a dead client go all grow with this
/// number: iceoryx2 makes `2 * MAX_OUTSTANDING + 1` channels for every client, 17, and looks at each of
/// them for each report.
pub const MAX_OUTSTANDING: usize = 8;

/// Reports that wait for a client that does not read: accepted, progress and final twice over.
///
/// At the bound progress is refused to the server, and the final word is kept by it until there is room.
pub const RESPONSE_BUFFER: usize = 8;

/// Whether a server is given the requests of clients that are gone. Our server drops these unseen.
///
/// Switched off, iceoryx2 drops them itself and forgets to give them back: it then keeps what it had mapped of each such
/// client, and ends the process at the 129th (`port/server.rs:714`, `port/details/receiver.rs:313`).
pub const FIRE_AND_FORGET: bool = true;

/// Reports about one request that a client may hold at once: the one being read, and the anchor of its round.
pub const MAX_BORROWED_REPORTS: usize = 2;

/// Requests that a client may fill in at once.
pub const MAX_LOANED_REQUESTS: usize = 1;

/// Nodes that may open one service: every port's process, and tools that only look.
pub const MAX_NODES: usize = 64;

/// What an event says. Every event is only a reason to wake up and drain; the data is in the data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
pub enum EventCode {
    /// There is something to receive: a sample, a request, a report, or a request that was given up.
    Data = 1,
    /// A port of the other side was created.
    Arrived = 2,
    /// A port of the other side was dropped.
    Left = 3,
    /// A port of the other side died; said by whoever cleans up after it.
    Died = 4,
}

/// The largest event id; four are used, the rest is room.
pub const EVENT_ID_MAX: usize = 15;

#[cfg(test)]
mod tests {
    use super::*;

    fn robot(id: u32) -> RobotId {
        RobotId::new(id).expect("greater than zero")
    }

    #[test]
    fn the_table_is_in_the_order_of_the_ids_and_slots() {
        for (index, spec) in SERVICES.iter().enumerate() {
            assert_eq!(spec.id as usize, index);
            assert_eq!(spec.slot_offset as usize, index);
            assert_eq!(spec.id.spec(), spec);
        }
    }

    #[test]
    fn slots_lie_in_the_source_s_interval_and_wrap_after_a_hundred_robots() {
        let cases = [
            (1, ServiceId::DspTelemetry, 3000),
            (1, ServiceId::Movement, 3004),
            (2, ServiceId::HeroTelemetry, 3011),
            (100, ServiceId::Movement, 3994),
            (101, ServiceId::DspTelemetry, 3000),
            (u32::MAX, ServiceId::Movement, 3944),
        ];
        for (id, service, slot) in cases {
            assert_eq!(service.slot(robot(id)), slot, "robot {id}, {service:?}");
        }
    }

    #[test]
    fn names_carry_the_robot() {
        assert_eq!(
            ServiceId::DspTelemetry.name(robot(7)),
            "hero/7/dsp_telemetry"
        );
    }

    #[test]
    fn the_table_says_what_the_structs_say() {
        for (spec, contract) in SERVICES.iter().zip(&CONTRACTS) {
            assert_eq!(spec.key, contract.key);
            assert_eq!(spec.pattern, contract.pattern);
            assert_eq!(spec.layout, contract.layout());
            assert_eq!(spec.layout_hash, contract.layout_hash());
            assert_eq!(spec.id.name(robot(7)), contract.name(robot(7)));
            assert!(is_key(spec.key));
        }
        let waypoint = MovementData {
            path_id: 9,
            ..MovementData::land(4)
        };
        assert_eq!((waypoint.request_id(), Request::path_id(&waypoint)), (4, 9));
    }

    #[test]
    fn keys_are_names_that_file_and_service_can_have() {
        let longest = "a".repeat(MAX_KEY_LEN);
        for key in [
            "dsp_telemetry",
            "battery_watch/cell_voltages",
            "a/b/c2",
            "requests/a",
            &longest,
        ] {
            assert!(is_key(key), "{key}");
        }
        let too_long = "a".repeat(MAX_KEY_LEN + 1);
        for key in [
            "",
            "/",
            "a/",
            "/a",
            "a//b",
            "A",
            "a.b",
            "a-b",
            "a__b",
            "a_",
            "2a",
            "a/requests",
            "responses",
            &too_long,
        ] {
            assert!(!is_key(key), "{key}");
        }
        assert_eq!(module_of("battery_watch/cell_voltages"), "battery_watch");
        assert_eq!(module_of("dsp_telemetry"), "");
    }
}
