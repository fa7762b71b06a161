//! [`Catalog`]: which services a robot has, and what a station still has to ask about them. A pure value.
//!
//! One part of one description is asked for at a time, so that descriptions take no more of a link than one message, and no more
//! memory than one schema.

use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::schema::MAX_TEXT_LEN;

use crate::message::{MAX_SERVICES, Part, Service};

/// How long a part of a description may take at first, before it is asked for again.
const PART_TIMEOUT: Duration = Duration::from_millis(500);

/// The same at most: each part that was asked for twice and comes twice doubles the time, and each new one takes an eighth off. Over
/// 64 kbit/s a part takes half a second and waits behind others; over a link that loses parts none comes twice.
const LONGEST_PART_TIMEOUT: Duration = Duration::from_secs(4);

/// The services that a robot says it has.
#[derive(Debug)]
pub struct Catalog {
    /// Whether each is described.
    described: Vec<bool>,
    /// What has come of the first one that is not.
    assembly: Option<Assembly>,
    next_question: MonotonicNs,
    /// What was asked last, unless it has come.
    asked: Option<Question>,
    /// What was asked twice last.
    repeated: Option<Question>,
    timeout: Duration,
}

impl Default for Catalog {
    fn default() -> Catalog {
        Catalog {
            described: Vec::new(),
            assembly: None,
            next_question: MonotonicNs(0),
            asked: None,
            repeated: None,
            timeout: PART_TIMEOUT,
        }
    }
}

/// A part that a station needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Question {
    /// Index of the service.
    pub index: u16,
    /// Where the part begins in the schema, bytes.
    pub from: u32,
}

impl Catalog {
    /// The robot says that it has so many. More than [`MAX_SERVICES`] are left out.
    pub fn expect(&mut self, services: u16) {
        self.described
            .resize(services.min(MAX_SERVICES).into(), false);
    }

    /// The part to ask for now.
    pub fn question(&mut self, now: MonotonicNs) -> Option<Question> {
        let index = self.missing().filter(|_| now >= self.next_question)?;
        let begun = self.assembly.as_ref();
        let begun = begun.filter(|assembly| assembly.head.index == index);
        let question = Question {
            index,
            from: begun.map_or(0, Assembly::missing_from),
        };
        if self.asked.replace(question) == Some(question) {
            self.repeated = Some(question);
        }
        self.next_question = now + self.timeout;
        Some(question)
    }

    /// A part has come. Says which service is described by now that was not before.
    pub fn take(&mut self, part: &Part) -> Option<Service> {
        let answered = Some(Question {
            index: part.index,
            from: part.from,
        });
        if answered == self.repeated && answered != self.asked {
            // It was under way when it was asked for again.
            self.timeout = (self.timeout * 2).min(LONGEST_PART_TIMEOUT);
            self.repeated = None;
        }
        if self.missing() != Some(part.index) {
            return None;
        }
        let begun = self.assembly.take();
        let mut assembly = match begun.filter(|assembly| assembly.has(part)) {
            Some(assembly) => assembly,
            None => match Assembly::begin(part) {
                Some(assembly) => assembly,
                None => {
                    tracing::warn!(
                        index = part.index,
                        bytes = part.schema_bytes,
                        "a service is left out: its schema is too long"
                    );
                    self.close(part.index);
                    return None;
                }
            },
        };
        if assembly.take(part) {
            // The next one at once.
            self.next_question = MonotonicNs(0);
            self.asked = None;
            self.timeout = (self.timeout - self.timeout / 8).max(PART_TIMEOUT);
        }
        let service = assembly.service();
        match service {
            Some(_) => self.close(part.index),
            None => self.assembly = Some(assembly),
        }
        service
    }

    /// Nothing more is asked about this service.
    fn close(&mut self, index: u16) {
        if let Some(described) = self.described.get_mut(usize::from(index)) {
            *described = true;
        }
        self.next_question = MonotonicNs(0);
    }

    /// The first service that is not described.
    fn missing(&self) -> Option<u16> {
        let mut described = self.described.iter();
        let missing = described.position(|is_described| !is_described)?;
        u16::try_from(missing).ok()
    }

    /// Whether all are described.
    pub fn is_complete(&self) -> bool {
        self.missing().is_none()
    }

    /// When something is to be asked.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        self.missing().map(|_| self.next_question)
    }
}

/// The parts of one description that have come.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Assembly {
    /// The first part, without its bytes.
    head: Part,
    bytes: Vec<u8>,
}

impl Assembly {
    /// Nothing has come yet of the description that `part` belongs to. `None` if that is longer than a schema may be.
    fn begin(part: &Part) -> Option<Assembly> {
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
    fn has(&self, part: &Part) -> bool {
        let (head, instance) = (&self.head, part.robot_instance);
        (head.robot_instance, head.index, head.schema_bytes)
            == (instance, part.index, part.schema_bytes)
            && (&head.key, head.takes_requests) == (&part.key, part.takes_requests)
    }

    /// Where the part begins that is missing next, bytes.
    fn missing_from(&self) -> u32 {
        // It is never longer than the whole, which is a u32.
        self.bytes.len() as u32
    }

    /// Takes the part that is missing next, and says whether it was that one. Others change nothing: they were repeated, or belong to
    /// another description.
    fn take(&mut self, part: &Part) -> bool {
        let is_next = self.has(part) && part.from == self.missing_from();
        let fits = self.bytes.len() + part.bytes.len() <= self.head.schema_bytes as usize;
        if is_next && fits {
            self.bytes.extend_from_slice(&part.bytes);
        }
        is_next && fits
    }

    /// The service. `None` if a part is missing.
    fn service(&self) -> Option<Service> {
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
    use std::collections::VecDeque;

    use fastrand::Rng;

    use super::*;
    use crate::message::PART_BYTES;
    use crate::message::{Ask, MAX_ASK_BYTES, MAX_REPLY_BYTES, Reply, decode, encode};
    const INSTANCE: u64 = u64::MAX;

    const fn at(ms: u64) -> MonotonicNs {
        MonotonicNs(ms * 1_000_000)
    }

    fn service(key: &str, len: usize) -> Service {
        Service {
            key: key.to_owned(),
            takes_requests: key.len() % 2 == 1,
            // Two bytes each, so that parts end within a letter.
            schema: "xä".repeat(len / 3) + &"x".repeat(len % 3),
        }
    }

    /// A station learns the services over a link that loses and repeats messages, and takes none that is longer than one may
    /// be. Returns what it learned and how long that took, ms.
    fn learned(services: &[Service], lost_percent: u64) -> (Vec<Service>, u64) {
        let mut catalog = Catalog::default();
        catalog.expect(services.len() as u16);
        let (mut learned, mut random, mut ms) = (Vec::new(), Rng::with_seed(1), 0);
        let mut arrives = |lost_percent| random.u64(..100) >= lost_percent;
        while !catalog.is_complete() && ms < 10_000_000 {
            ms = ms.max(catalog.deadline().unwrap().0.div_ceil(1_000_000));
            let Question { index, from } = catalog.question(at(ms)).unwrap();
            let ask = encode(&Ask::Describe {
                robot_instance: INSTANCE,
                index,
                from,
            });
            assert!(ask.len() <= MAX_ASK_BYTES);
            let part = services[usize::from(index)].part(INSTANCE, index, from);
            let tell = encode(&Reply::Part(part.unwrap()));
            assert!(tell.len() <= MAX_REPLY_BYTES, "{}", tell.len());
            let Ok(Reply::Part(part)) = decode(&tell) else {
                panic!("it is a part");
            };
            // A round trip.
            ms += 20;
            if arrives(lost_percent) && arrives(lost_percent) {
                learned.extend(catalog.take(&part));
                if !arrives(lost_percent) {
                    assert_eq!(catalog.take(&part), None, "it is a repetition");
                }
            }
        }
        (learned, ms)
    }

    #[test]
    fn over_a_narrow_link_most_parts_are_asked_for_once_or_twice() {
        let parts = MAX_TEXT_LEN / PART_BYTES;
        let service = service("a/b", parts * PART_BYTES);
        let mut catalog = Catalog::default();
        catalog.expect(1);
        // Each part comes 1.2 s after its question.
        let (mut now, mut under_way, mut questions) = (at(0), VecDeque::new(), 0);
        while let Some(due) = catalog.deadline() {
            let due = due.max(now);
            let arrived = under_way.front().copied().filter(|(at, _)| *at <= due);
            if let Some((arrives, from)) = arrived {
                under_way.pop_front();
                now = arrives;
                let part = service.part(INSTANCE, 0, from);
                catalog.take(&part.expect("a part"));
            } else {
                now = due;
                questions += 1;
                let question = catalog.question(now).expect("it is due");
                under_way.push_back((now + Duration::from_millis(1200), question.from));
            }
        }
        assert!(catalog.is_complete());
        // With a fixed time-out it is three questions for each part.
        let most = parts * 2;
        assert!(questions < most, "{questions} for {parts}");
    }

    #[test]
    fn schemas_of_the_greatest_length_are_learned_over_a_link_that_loses_a_fifth() {
        let key = "k".repeat(64);
        let services = [
            service("a", 3000),
            service(&key, MAX_TEXT_LEN),
            service("b", 0),
            service("cc", MAX_TEXT_LEN - 1),
            service("d", PART_BYTES),
            service("e", PART_BYTES + 1),
        ];
        let (all, ms) = learned(&services, 20);
        assert!(all == services);
        // 133 parts, of which a third is asked for again.
        assert!(ms < 133 * 520, "{ms} ms");
        assert!(learned(&services, 0) == (services.to_vec(), 133 * 20));
    }

    #[test]
    fn services_are_asked_for_one_after_the_other_until_all_are_described() {
        let mut catalog = Catalog::default();
        assert!(catalog.is_complete() && catalog.deadline().is_none());
        catalog.expect(2);
        let question = |index, from| Some(Question { index, from });
        assert_eq!(catalog.question(at(10)), question(0, 0));
        assert_eq!(
            catalog.question(at(20)),
            None,
            "the answer may be under way"
        );
        assert_eq!(catalog.question(at(600)), question(0, 0), "it was lost");
        let service = service("a", 5000);
        let part = |index, from| service.part(INSTANCE, index, from).unwrap();
        assert_eq!(catalog.take(&part(0, 0)), None);
        assert_eq!(catalog.question(at(601)), question(0, 4096), "at once");
        assert_eq!(catalog.take(&part(0, 0)), None, "it came twice");
        assert_eq!(catalog.question(at(602)), None);
        assert_eq!(catalog.take(&part(1, 0)), None, "it was not asked for");
        assert_eq!(catalog.take(&part(0, 4096)), Some(service.clone()));
        assert_eq!(catalog.take(&part(0, 4096)), None);
        assert_eq!(catalog.question(at(603)), question(1, 0));
        let _ = catalog.take(&part(1, 0));
        assert_eq!(catalog.take(&part(1, 4096)), Some(service));
        assert!(catalog.is_complete() && catalog.question(at(9000)).is_none());
        catalog.expect(3);
        assert_eq!(catalog.question(at(9000)), question(2, 0));
    }

    #[test]
    fn a_description_that_is_too_long_is_left_out_and_the_next_one_is_asked_for() {
        let mut catalog = Catalog::default();
        catalog.expect(u16::MAX);
        let part = Part {
            schema_bytes: u32::MAX,
            ..service("a", 1).part(INSTANCE, 0, 0).unwrap()
        };
        assert_eq!(catalog.take(&part), None);
        assert_eq!(catalog.question(at(0)).unwrap().index, 1);
        assert_eq!(catalog.described.len(), usize::from(MAX_SERVICES));
    }

    #[test]
    fn a_robot_that_describes_something_else_meanwhile_is_asked_from_the_beginning() {
        let mut catalog = Catalog::default();
        catalog.expect(1);
        let (one, other) = (service("a", 5000), service("b", 6000));
        let _ = catalog.take(&one.part(INSTANCE, 0, 0).unwrap());
        assert_eq!(catalog.take(&other.part(INSTANCE, 0, 4096).unwrap()), None);
        assert_eq!(catalog.question(at(0)).unwrap().from, 0);
        let _ = catalog.take(&other.part(INSTANCE, 0, 0).unwrap());
        assert_eq!(
            catalog.take(&other.part(INSTANCE, 0, 4096).unwrap()),
            Some(other)
        );
    }

    #[test]
    fn parts_that_are_repeated_or_of_another_description_change_nothing() {
        let service = service("a/b", 3 * PART_BYTES);
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
                robot_instance: 9,
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
                takes_requests: !next.takes_requests,
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
}
