//! The table of the robot's own services: keys, slot numbers and payloads, one row each.
//!
//! `docs/ipc.md` shows the same table for consumers in other languages.

use super::contract::{Contract, Request, Topic};
use crate::payload::{
    BridgeOutline, DspTelemetry, HeroTelemetry, MavlinkStations, ModuleControl, ModuleState,
    MovementData, ParameterRequest, RelayLink, RelayStations,
};
use crate::robot::RobotId;
use crate::{request, topic};

/// A service of the robot's own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ServiceId {
    /// Raw telemetry of the DSP, bridge → all (`UAV_SLOT_DSP_SENSORS_STATE`).
    DspTelemetry,
    /// Telemetry in SI units, status → all (`UAV_SLOT_SENSORS_STATE`).
    HeroTelemetry,
    /// State of the bridge, bridge → all (`UAV_BRIDGE_MODULE_STATUS_SLOT`).
    ModuleState,
    /// Start and stop, operator → bridge (`UAV_SLOT_MODULE_CONTROL`).
    ModuleControl,
    /// Movements, operator → bridge (`UAV_BRIDGE_DATA_SLOT`).
    Movement,
    /// The DSP's virtual ports at run time, operator → bridge. Not of the source.
    Parameters,
}

/// One row of the table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ServiceSpec {
    /// Which service.
    pub id: ServiceId,
    /// The slot's identifier in the source, `-` when the source has none.
    pub original: &'static str,
    /// Key, provider, pattern and payload.
    pub contract: Contract,
}

impl ServiceSpec {
    const fn topic<T: Topic>(id: ServiceId, original: &'static str) -> ServiceSpec {
        ServiceSpec {
            id,
            original,
            contract: Contract::of_topic::<T>(),
        }
    }

    const fn request<R: Request>(id: ServiceId, original: &'static str) -> ServiceSpec {
        ServiceSpec {
            id,
            original,
            contract: Contract::of_request::<R>(),
        }
    }
}

/// All services, in the order of their ids and slot numbers.
pub const SERVICES: [ServiceSpec; 6] = [
    ServiceSpec::topic::<DspTelemetry>(ServiceId::DspTelemetry, "UAV_SLOT_DSP_SENSORS_STATE"),
    ServiceSpec::topic::<HeroTelemetry>(ServiceId::HeroTelemetry, "UAV_SLOT_SENSORS_STATE"),
    ServiceSpec::topic::<ModuleState>(ServiceId::ModuleState, "UAV_BRIDGE_MODULE_STATUS_SLOT"),
    ServiceSpec::request::<ModuleControl>(ServiceId::ModuleControl, "UAV_SLOT_MODULE_CONTROL"),
    ServiceSpec::request::<MovementData>(ServiceId::Movement, "UAV_BRIDGE_DATA_SLOT"),
    ServiceSpec::request::<ParameterRequest>(ServiceId::Parameters, "-"),
];

impl ServiceId {
    /// The service's row of the table.
    pub const fn spec(self) -> &'static ServiceSpec {
        &SERVICES[self as usize]
    }

    /// What all processes that open the service must agree on.
    pub const fn contract(self) -> &'static Contract {
        &self.spec().contract
    }

    /// Last part of the service's name, such as `dsp_telemetry`.
    pub const fn key(self) -> &'static str {
        self.contract().key
    }

    /// The module whose process provides it, such as `bridge`.
    pub const fn provider(self) -> &'static str {
        self.contract().provider
    }

    /// The service's name, such as `hero/1/dsp_telemetry`.
    pub fn name(self, robot: RobotId) -> String {
        self.contract().name(robot)
    }

    /// Offset of the slot's number within the robot's ten.
    pub const fn slot_offset(self) -> u32 {
        self as u32
    }

    /// The slot's number, 3000 … 3999: `3000 + 10 · ((robot − 1) mod 100) + offset`.
    ///
    /// The range has room for a hundred robots; the name, not the number, distinguishes services.
    pub const fn slot(self, robot: RobotId) -> u32 {
        3000 + 10 * ((robot.get() - 1) % 100) + self.slot_offset()
    }
}

/// The robot's own service with this key; `None` if it is a module's.
pub fn own(key: &str) -> Option<ServiceId> {
    let spec = SERVICES.iter().find(|spec| spec.contract.key == key);
    spec.map(|spec| spec.id)
}

/// The slot's number of the service with this key, of which only the robot's own services have one.
pub(crate) fn slot(key: &str, robot: RobotId) -> Option<u32> {
    own(key).map(|id| id.slot(robot))
}

/// Screens, recorders and gateways; twice as many cost 2 MiB of shared memory more.
const MAX_OUTLINE_SUBSCRIBERS: usize = 16;

topic!(DspTelemetry, "dsp_telemetry", "bridge");
topic!(HeroTelemetry, "hero_telemetry", "status");
topic!(ModuleState, "module_state", "bridge");
topic!(
    BridgeOutline,
    "bridge/outline",
    "bridge",
    MAX_OUTLINE_SUBSCRIBERS
);
topic!(MavlinkStations, "mavlink/stations", "mavlink");
topic!(RelayLink, "relay/link", "relay");
topic!(RelayStations, "relay/stations", "relay");
request!(ModuleControl, "module_control", "bridge");
request!(MovementData, "movement", "bridge");
request!(ParameterRequest, "parameters", "bridge");

#[cfg(test)]
mod tests {
    use super::super::key::is_key;
    use super::*;

    fn robot(id: u32) -> RobotId {
        RobotId::new(id).expect("greater than zero")
    }

    #[test]
    fn the_table_is_in_the_order_of_the_ids_and_its_keys_are_unique() {
        for (index, spec) in SERVICES.iter().enumerate() {
            assert_eq!(spec.id as usize, index);
            assert!(is_key(spec.contract.key));
            assert_eq!(own(spec.contract.key), Some(spec.id));
        }
        assert_eq!(own("battery_watch/state"), None);
        // The relay's have no slot.
        let link = (RelayLink::KEY, RelayLink::PROVIDER);
        assert_eq!(link, ("relay/link", "relay"));
        let stations = (RelayStations::KEY, RelayStations::PROVIDER);
        assert_eq!(stations, ("relay/stations", "relay"));
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
}
