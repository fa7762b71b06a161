//! [`Service`]: what a station is told of a service, in [`Part`]s of which each fits into one batch of the network.
//!
//! A schema may have 256 KiB, and a slow link has no room for so much at once. So a station asks for one part after the other, and a
//! part that is lost is asked for again. [`Service::part`] cuts, [`Assembly`] puts together. Pure values.

use ipc_types::schema::MAX_TEXT_LEN;
use serde::{Deserialize, Serialize};

/// Bytes of a schema in one part. With the rest of its message (at most 90 bytes), its key expression (at most 55) and Zenoh's
/// headers it fits into a batch of 4,352 bytes, so that the loss of one datagram loses one part.
pub const PART_BYTES: usize = 4096;

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
    /// The part of the description that begins at the byte `from` of the schema; nothing when the schema has no such byte. An empty
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

/// The parts of one description that have come.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Assembly {
    /// The first part, without its bytes.
    head: Part,
    bytes: Vec<u8>,
}

impl Assembly {
    /// Nothing has come yet of the description that `part` belongs to. Nothing when that is longer than a schema may be.
    pub fn begin(part: &Part) -> Option<Assembly> {
        let is_possible = usize::try_from(part.schema_bytes).is_ok_and(|len| len <= MAX_TEXT_LEN);
        is_possible.then(|| Assembly {
            head: Part {
                bytes: Vec::new(),
                ..part.clone()
            },
            bytes: Vec::new(),
        })
    }

    /// Whether a part belongs to this description.
    pub fn has(&self, part: &Part) -> bool {
        let (head, life) = (&self.head, part.robot_life);
        (head.robot_life, head.index, head.schema_bytes) == (life, part.index, part.schema_bytes)
            && (&head.key, head.takes_requests) == (&part.key, part.takes_requests)
    }

    /// Which service it is of.
    pub fn index(&self) -> u16 {
        self.head.index
    }

    /// Where the part begins that is missing next, bytes.
    pub fn missing_from(&self) -> u32 {
        // It is never longer than the whole, which is a u32.
        self.bytes.len() as u32
    }

    /// Takes the part that is missing next, and says whether it was that one. Others change nothing: they were repeated, or belong to
    /// another description.
    pub fn take(&mut self, part: &Part) -> bool {
        let is_next = self.has(part) && part.from == self.missing_from();
        let fits = self.bytes.len() + part.bytes.len() <= self.head.schema_bytes as usize;
        if is_next && fits {
            self.bytes.extend_from_slice(&part.bytes);
        }
        is_next && fits
    }

    /// The service, when all parts have come.
    pub fn service(&self) -> Option<Service> {
        (self.bytes.len() == self.head.schema_bytes as usize).then(|| Service {
            key: self.head.key.clone(),
            takes_requests: self.head.takes_requests,
            // What is no text is no schema either, and is refused with one.
            schema: String::from_utf8_lossy(&self.bytes).into_owned(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn service(len: usize) -> Service {
        Service {
            key: "a/b".to_owned(),
            takes_requests: false,
            // Two bytes each, so that parts end within a letter.
            schema: "xä".repeat(len / 3) + &"x".repeat(len % 3),
        }
    }

    fn assembled(service: &Service) -> (Option<Service>, usize) {
        let mut parts = 0;
        let mut assembly = Assembly::begin(&service.part(1, 2, 0).unwrap()).unwrap();
        while let Some(part) = service.part(1, 2, assembly.missing_from()) {
            assert!(part.bytes.len() <= PART_BYTES);
            assert!(assembly.take(&part));
            parts += 1;
            if assembly.service().is_some() {
                break;
            }
        }
        (assembly.service(), parts)
    }

    #[test]
    fn a_schema_of_any_length_is_put_together_of_its_parts() {
        for (len, parts) in [
            (0, 1),
            (1, 1),
            (PART_BYTES, 1),
            (PART_BYTES + 1, 2),
            (MAX_TEXT_LEN, 64),
        ] {
            let service = service(len);
            assert_eq!(service.schema.len(), len);
            assert_eq!(assembled(&service), (Some(service), parts), "{len}");
        }
    }

    #[test]
    fn there_is_no_part_behind_the_end() {
        let service = service(PART_BYTES);
        for from in [PART_BYTES as u32, PART_BYTES as u32 + 1, u32::MAX] {
            assert_eq!(service.part(1, 2, from), None, "{from}");
        }
    }

    #[test]
    fn parts_that_are_repeated_or_of_another_description_change_nothing() {
        let service = service(3 * PART_BYTES);
        let part = |from: usize| service.part(1, 2, from as u32).unwrap();
        let mut assembly = Assembly::begin(&part(0)).unwrap();
        assert!(
            !assembly.take(&part(PART_BYTES)),
            "the first one is missing"
        );
        assert!(assembly.take(&part(0)) && !assembly.take(&part(0)));
        let next = part(PART_BYTES);
        let others = [
            Part {
                robot_life: 9,
                ..next.clone()
            },
            Part {
                index: 9,
                ..next.clone()
            },
            Part {
                schema_bytes: 9,
                ..next.clone()
            },
            Part {
                key: "a/c".to_owned(),
                ..next.clone()
            },
            Part {
                takes_requests: true,
                ..next.clone()
            },
            Part {
                bytes: vec![0; 2 * PART_BYTES + 1],
                ..next.clone()
            },
        ];
        for other in others {
            assert!(!assembly.take(&other), "{other:?}");
        }
        assert!(assembly.take(&next));
        assert_eq!(assembly.service(), None);
        assert!(assembly.take(&part(2 * PART_BYTES)));
        assert_eq!(assembly.service(), Some(service));
    }

    #[test]
    fn a_description_that_is_longer_than_a_schema_may_be_is_not_begun() {
        let part = Part {
            schema_bytes: MAX_TEXT_LEN as u32 + 1,
            ..service(1).part(1, 2, 0).unwrap()
        };
        assert_eq!(Assembly::begin(&part), None);
    }
}
