//! Where messages go: key expressions of Zenoh.
//!
//! | key | from → to | message |
//! |---|---|---|
//! | `hero/<robot>/topic/<key>` | robot → all | samples, with a `SampleHeader` as attachment |
//! | `hero/<robot>/ask/<station>` | station → robot | `Ask` |
//! | `hero/<robot>/order/<station>` | station → robot | `Command` |
//! | `hero/<robot>/tell/<station>` | robot → station | `Tell` |
//!
//! The four are apart so that the access rules of a router can allow or forbid each.

use std::num::NonZeroU32;

use ipc_types::Schema;

/// The samples of one topic.
pub fn topic(robot: NonZeroU32, key: &str) -> String {
    format!("hero/{robot}/topic/{key}")
}

/// The samples of all topics.
pub fn topics(robot: NonZeroU32) -> String {
    format!("hero/{robot}/topic/**")
}

/// What a station asks, or stations ask when it is `*`.
pub fn ask(robot: NonZeroU32, station: &str) -> String {
    format!("hero/{robot}/ask/{station}")
}

/// What a station orders, or stations order when it is `*`.
pub fn order(robot: NonZeroU32, station: &str) -> String {
    format!("hero/{robot}/order/{station}")
}

/// What a station is told.
pub fn tell(robot: NonZeroU32, station: &str) -> String {
    format!("hero/{robot}/tell/{station}")
}

/// What a request service is called in orders, whatever its index in a life of the robot's relay: a hash of its key and of the
/// layout of its requests. So an order never reaches another service, nor one whose requests have another layout.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_names_its_topic_and_its_station() {
        let robot = NonZeroU32::new(7).unwrap();
        assert_eq!(
            last(&topic(robot, "battery_watch/state")),
            "battery_watch/state"
        );
        assert_eq!(last(&tell(robot, "gcs-1")), "gcs-1");
        assert_eq!(last("hero/7"), "");
    }
}
