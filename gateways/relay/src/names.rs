//! Where messages go: key expressions of Zenoh.
//!
//! | key | from → to | message |
//! |---|---|---|
//! | `hero/<robot>/topic/<key>` | robot → all | samples, with a `SampleHeader` as attachment |
//! | `hero/<robot>/ask/<station>` | station → robot | `Ask` |
//! | `hero/<robot>/order/<station>` | station → robot | `Order` |
//! | `hero/<robot>/tell/<station>` | robot → station | `Reply` |
//!
//! The four are apart so that the [access rules](crate::access) can allow or forbid each. A robot is a number, or `*`
//! for all robots; a station is a name, or `*` for all stations.

use std::fmt::Display;

use ipc_types::payload::{MavlinkStations, RelayStations};
use ipc_types::{Module, RelayModule, Schema, Topic};

/// Everything.
pub const ALL: &str = "hero/**";

/// The samples of one topic.
pub fn topic<R: Display>(robot: R, key: &str) -> String {
    format!("hero/{robot}/topic/{key}")
}

/// The samples of all topics.
pub fn topics<R: Display>(robot: R) -> String {
    topic(robot, "**")
}

/// What a station asks.
pub fn ask<R: Display>(robot: R, station: &str) -> String {
    format!("hero/{robot}/ask/{station}")
}

/// What a station orders.
pub fn order<R: Display>(robot: R, station: &str) -> String {
    format!("hero/{robot}/order/{station}")
}

/// What a robot answers to a station.
pub fn tell<R: Display>(robot: R, station: &str) -> String {
    format!("hero/{robot}/tell/{station}")
}

/// Whether a service is one that relays carry. Of the gateways' own, which each machine has itself, only the robot's
/// stations are: so every station shows who commands.
pub fn is_carried(key: &str) -> bool {
    let gateways = [RelayModule::NAME, MavlinkStations::PROVIDER];
    let provider = key.split('/').next();
    key == RelayStations::KEY || !gateways.iter().any(|name| provider == Some(name))
}

/// The `origin` of the requests of an instance of a station: never 0, which stands for the robot's own clock.
pub fn origin(station_instance: u64) -> u32 {
    (station_instance as u32).max(1)
}

/// What a request service is called in orders, whatever its index in an instance of the robot's relay: a hash of its
/// key and of the layout of its requests. So an order never reaches another service, nor one whose requests have
/// another layout.
pub fn service_id(key: &str, schema: &Schema) -> u64 {
    let bytes = key
        .bytes()
        .chain(schema.request_layout_hash().to_le_bytes());
    // FNV-1a, 64 bits.
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// The topic's key, or the station, that a key expression names after its third `/`.
pub fn last(key: &str) -> &str {
    key.splitn(4, '/').nth(3).unwrap_or_default()
}

/// How logs name an instance of a relay.
pub fn instance_name(instance: u64) -> String {
    format!("{instance:016x}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_names_its_topic_and_its_station() {
        let robot = 7;
        assert_eq!(
            last(&topic(robot, "battery_watch/state")),
            "battery_watch/state"
        );
        assert_eq!(last(&tell(robot, "gcs-1")), "gcs-1");
        assert_eq!(last("hero/7"), "");
    }

    #[test]
    fn what_each_machine_has_itself_is_not_carried() {
        for (key, expected) in [
            ("module_state", true),
            ("relay/stations", true),
            ("relay/link", false),
            ("mavlink/stations", false),
            ("mavlink_watch/state", true),
        ] {
            assert_eq!(is_carried(key), expected, "{key}");
        }
    }
}
