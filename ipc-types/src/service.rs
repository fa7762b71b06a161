//! The one table of services: names, slot numbers, patterns, payloads and every quality-of-service value.
//!
//! iceoryx2's defaults lose data without an error (subscriber buffer 2, history 0, overflow of requests), therefore
//! nothing is left to a default here. `docs/ipc.md` shows the same table for consumers in other languages.

use crate::iox::Wire;
use crate::payload::{
    DspTelemetry, HeroTelemetry, ModuleControl, ModuleState, MovementData, ParameterRequest,
    RequestReport, SharedStruct, layout_hash,
};
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

/// How a service carries its data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pattern {
    /// Publish/subscribe, the latest value wins; the source's non-secure slot.
    Latest,
    /// Request/response with a stream of reports, nothing is lost; the source's secure slot.
    Secure,
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
        pattern: Pattern::Latest,
        layout: DspTelemetry::TYPE_NAME,
        layout_hash: layout_hash(&[DspTelemetry::FIELDS]),
    },
    ServiceSpec {
        id: ServiceId::HeroTelemetry,
        key: "hero_telemetry",
        original: "UAV_SLOT_SENSORS_STATE",
        slot_offset: 1,
        pattern: Pattern::Latest,
        layout: HeroTelemetry::TYPE_NAME,
        layout_hash: layout_hash(&[HeroTelemetry::FIELDS]),
    },
    ServiceSpec {
        id: ServiceId::ModuleState,
        key: "module_state",
        original: "UAV_BRIDGE_MODULE_STATUS_SLOT",
        slot_offset: 2,
        pattern: Pattern::Latest,
        layout: ModuleState::TYPE_NAME,
        layout_hash: layout_hash(&[ModuleState::FIELDS]),
    },
    ServiceSpec {
        id: ServiceId::ModuleControl,
        key: "module_control",
        original: "UAV_SLOT_MODULE_CONTROL",
        slot_offset: 3,
        pattern: Pattern::Secure,
        layout: request_layout!("hero.ModuleControl.v1"),
        layout_hash: layout_hash(&[ModuleControl::FIELDS, RequestReport::FIELDS]),
    },
    ServiceSpec {
        id: ServiceId::Movement,
        key: "movement",
        original: "UAV_BRIDGE_DATA_SLOT",
        slot_offset: 4,
        pattern: Pattern::Secure,
        layout: request_layout!("hero.MovementData.v2"),
        layout_hash: layout_hash(&[MovementData::FIELDS, RequestReport::FIELDS]),
    },
    ServiceSpec {
        id: ServiceId::Parameters,
        key: "parameters",
        original: "-",
        slot_offset: 5,
        pattern: Pattern::Secure,
        layout: request_layout!("hero.ParameterRequest.v1"),
        layout_hash: layout_hash(&[ParameterRequest::FIELDS, RequestReport::FIELDS]),
    },
];

impl ServiceId {
    /// The service's row of the table.
    pub const fn spec(self) -> &'static ServiceSpec {
        &SERVICES[self as usize]
    }

    /// The service's name, such as `hero/1/dsp_telemetry`.
    pub fn name(self, robot: RobotId) -> String {
        format!("hero/{robot}/{}", self.spec().key)
    }

    /// The slot's number, 3000 … 3999: `3000 + 10 · ((robot − 1) mod 100) + offset`.
    ///
    /// The range has room for a hundred robots; the name, not the number, tells services apart.
    pub const fn slot(self, robot: RobotId) -> u32 {
        3000 + 10 * ((robot.get() - 1) % 100) + self.spec().slot_offset
    }
}

/// A payload that is published: the latest sample wins.
pub trait Topic: SharedStruct + Wire {
    /// The service that carries it.
    const SERVICE: ServiceId;

    /// Writes the publisher's count and identity into the sample.
    fn stamp(&mut self, sequence: u64, epoch_ns: u64);

    /// The sample's count, from 1.
    fn sequence(&self) -> u64;

    /// When its publisher began, host monotonic ns.
    fn epoch_ns(&self) -> u64;
}

macro_rules! topics {
    ($($payload:ident => $service:ident),+ $(,)?) => {
        $(
            impl Topic for $payload {
                const SERVICE: ServiceId = ServiceId::$service;

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
        )+
    };
}

topics! {
    DspTelemetry => DspTelemetry,
    HeroTelemetry => HeroTelemetry,
    ModuleState => ModuleState,
}

/// A payload that is sent as a request and answered with a stream of [`RequestReport`]s.
pub trait Request: SharedStruct + Wire {
    /// The service that carries it.
    const SERVICE: ServiceId;

    /// The id that its sender chose; every report repeats it.
    fn request_id(&self) -> u64;

    /// The path that it belongs to, 0 for none.
    fn path_id(&self) -> u64;
}

impl Request for ModuleControl {
    const SERVICE: ServiceId = ServiceId::ModuleControl;

    fn request_id(&self) -> u64 {
        self.request_id
    }

    fn path_id(&self) -> u64 {
        0
    }
}

impl Request for MovementData {
    const SERVICE: ServiceId = ServiceId::Movement;

    fn request_id(&self) -> u64 {
        self.request_id
    }

    fn path_id(&self) -> u64 {
        self.path_id
    }
}

impl Request for ParameterRequest {
    const SERVICE: ServiceId = ServiceId::Parameters;

    fn request_id(&self) -> u64 {
        self.request_id
    }

    fn path_id(&self) -> u64 {
        0
    }
}

/// Providers that may be registered at a service: publishers, and whoever waits for or signals events in their place.
///
/// One lives at a time, by the lock of its owner file. The rest is room for registrations that a `kill -9` during
/// start-up left behind and that nobody could clean: they would otherwise keep the robot from starting again for as
/// long as any other process of the domain lives.
pub const MAX_PROVIDERS: usize = 4;

/// Servers that may be registered at a request service: the one that lives, and one that was left behind as above, or takes
/// the other's place. Fewer than publishers, because iceoryx2 makes channels for each of them: see [`MAX_OUTSTANDING`].
pub const MAX_SERVERS: usize = 2;

/// Subscribers of a published service, in all processes. One more is refused at its creation.
pub const MAX_SUBSCRIBERS: usize = 32;

/// Samples that wait for a subscriber that does not read; the oldest is dropped for the newest.
///
/// At 5 kHz a buffer of 16 lost samples to scheduling alone; 128 are 2.5 s of telemetry at its default 50 Hz.
pub const SUBSCRIBER_BUFFER: usize = 128;

/// Samples that a subscriber may hold at once: one that is being read, one of reserve.
pub const MAX_BORROWED_SAMPLES: usize = 2;

/// Samples that a late joiner gets at once: a blackboard slot holds one value.
pub const HISTORY: usize = 1;

/// Clients of a request service, in all processes. One more is refused at its creation.
pub const MAX_CLIENTS: usize = 16;

/// Requests that a client may have open: a path keeps two open at a time, the rest is reserve.
///
/// The server's memory, the cost of each report and the time that it takes to let a dead client go all grow with this
/// number: iceoryx2 makes `MAX_SERVERS * 2 * MAX_OUTSTANDING + 1` channels for every client, 33, and looks at each of
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
    fn the_layout_of_a_request_names_both_directions() {
        for (service, request) in [
            (ServiceId::ModuleControl, ModuleControl::TYPE_NAME),
            (ServiceId::Movement, MovementData::TYPE_NAME),
            (ServiceId::Parameters, ParameterRequest::TYPE_NAME),
        ] {
            let wanted = format!("{request}/{}", RequestReport::TYPE_NAME);
            assert_eq!(service.spec().layout, wanted);
        }
    }
}
