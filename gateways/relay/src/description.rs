//! [`Service`]: the description of a service for a station, in [`Part`]s of which each fits into one batch of the network.
//!
//! A schema may have 256 KiB, and a slow link has no room for so much at once. So a station asks for one part after the other, and a
//! part that is lost is asked for again. [`Service::part`] cuts, and the station's catalog puts together. Pure values.

use serde::{Deserialize, Serialize};

/// Bytes of a schema in one part. With the rest of its message (at most 90 bytes), its key expression (at most 55) and Zenoh's
/// headers it fits into a batch of 4,352 bytes, so that the loss of one datagram loses one part.
pub const PART_BYTES: usize = 4096;

/// Most services of a robot: three of its own, and some of each of some twenty modules.
pub const MAX_SERVICES: u16 = 128;

/// A service of the robot, as a station knows it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Service {
    /// Last part of its name, such as `hero_telemetry`.
    pub key: String,
    /// Whether it takes requests; else it is a topic.
    pub takes_requests: bool,
    /// Text of the schema of its samples, or of its requests.
    pub schema: String,
}

/// A part of the description of a service.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Part {
    /// Life of the robot's relay.
    pub robot_life: u64,
    /// Index of the service in that life.
    pub index: u16,
    /// See [`Service::key`].
    pub key: String,
    /// See [`Service::takes_requests`].
    pub takes_requests: bool,
    /// Length of the whole schema, bytes.
    pub schema_bytes: u32,
    /// Where in the schema this part begins, bytes.
    pub from: u32,
    /// The part, at most [`PART_BYTES`] bytes.
    pub bytes: Vec<u8>,
}

impl Service {
    /// The part of the description that begins at the byte `from` of the schema. `None` if the schema has no such byte. An empty
    /// schema has one part.
    pub fn part(&self, robot_life: u64, index: u16, from: u32) -> Option<Part> {
        let schema = self.schema.as_bytes();
        let rest = schema.get(usize::try_from(from).ok()?..)?;
        if rest.is_empty() && from > 0 {
            return None;
        }
        Some(Part {
            robot_life,
            index,
            key: self.key.clone(),
            takes_requests: self.takes_requests,
            schema_bytes: u32::try_from(schema.len()).ok()?,
            from,
            bytes: rest[..rest.len().min(PART_BYTES)].to_vec(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_is_no_part_behind_the_end() {
        let service = Service {
            key: "a/b".to_owned(),
            takes_requests: false,
            schema: "x".repeat(PART_BYTES),
        };
        for from in [PART_BYTES as u32, PART_BYTES as u32 + 1, u32::MAX] {
            assert_eq!(service.part(1, 2, from), None, "{from}");
        }
    }
}
