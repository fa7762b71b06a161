//! [`Catalog`]: which pages describe the services of a robot, and what a station still has to ask about them. A pure
//! value.
//!
//! One part of one page is asked for at a time, so that descriptions take no more of a link than one message, and no
//! more memory than one page.

use std::time::Duration;

use ipc_types::MonotonicNs;

use crate::message::{MAX_SERVICES, Part, Service, ServicesPage};

/// How long a part may take at first, before it is asked for again.
const PART_TIMEOUT: Duration = Duration::from_millis(500);

/// How long a part may take at most: each part that was asked for twice and comes twice doubles the time, and each new
/// one takes an eighth off. Over 64 kbit/s a part takes half a second and waits behind others; over a link that loses
/// parts none comes twice.
const LONGEST_PART_TIMEOUT: Duration = Duration::from_secs(4);

/// The pages that a robot says it has.
#[derive(Debug)]
pub struct Catalog {
    /// How many there are.
    pages: u16,
    /// The first one that has not come.
    next: u16,
    /// What has come of it.
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
            pages: 0,
            next: 0,
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
    /// Index of the page.
    pub index: u16,
    /// Where the part begins in the page, bytes.
    pub from: u32,
}

impl Catalog {
    /// The robot says that it has so many. More than [`MAX_SERVICES`] are left out.
    pub fn expect(&mut self, pages: u16) {
        self.pages = pages.min(MAX_SERVICES);
    }

    /// The part to ask for now.
    pub fn question(&mut self, now: MonotonicNs) -> Option<Question> {
        let index = self.missing().filter(|_| now >= self.next_question)?;
        let question = Question {
            index,
            from: self.assembly.as_ref().map_or(0, Assembly::missing_from),
        };
        if self.asked.replace(question) == Some(question) {
            self.repeated = Some(question);
        }
        self.next_question = now + self.timeout;
        Some(question)
    }

    /// A part has come. Says which services are described by now that were not before.
    pub fn take(&mut self, part: &Part) -> Vec<Service> {
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
            return Vec::new();
        }
        if !ServicesPage::may_have(part.page_bytes) {
            let (page, bytes) = (part.index, part.page_bytes);
            tracing::warn!(page, bytes, "descriptions of another length than any has");
            self.turn();
            return Vec::new();
        }
        let begun = self.assembly.take().filter(|assembly| assembly.has(part));
        let mut assembly = begun.unwrap_or_else(|| Assembly::begin(part));
        if assembly.take(part) {
            // The next one at once.
            self.next_question = MonotonicNs(0);
            self.asked = None;
            self.timeout = (self.timeout - self.timeout / 8).max(PART_TIMEOUT);
        }
        if !assembly.is_whole() {
            self.assembly = Some(assembly);
            return Vec::new();
        }
        self.turn();
        let services = ServicesPage::unpack(&assembly.bytes);
        if services.is_none() {
            tracing::warn!(page = part.index, "descriptions cannot be read");
        }
        services.unwrap_or_default()
    }

    /// Nothing more is asked about this page.
    fn turn(&mut self) {
        self.next += 1;
        self.next_question = MonotonicNs(0);
    }

    /// The first page that has not come.
    fn missing(&self) -> Option<u16> {
        (self.next < self.pages).then_some(self.next)
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

/// The parts of one page that have come.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Assembly {
    /// Of the first part: instance of the robot's relay, page, its length.
    page: (u64, u16, u32),
    bytes: Vec<u8>,
}

impl Assembly {
    /// Nothing has come yet of the page that `part` belongs to.
    fn begin(part: &Part) -> Assembly {
        Assembly {
            page: (part.robot_instance, part.index, part.page_bytes),
            bytes: Vec::new(),
        }
    }

    /// Whether a part belongs to this page.
    fn has(&self, part: &Part) -> bool {
        self.page == (part.robot_instance, part.index, part.page_bytes)
    }

    /// Where the part begins that is missing next, bytes.
    fn missing_from(&self) -> u32 {
        // It is never longer than the whole, which is a u32.
        self.bytes.len() as u32
    }

    /// Takes the part that is missing next, and says whether it was that one. Others change nothing: they were
    /// repeated, or belong to another page.
    fn take(&mut self, part: &Part) -> bool {
        let is_next = self.has(part) && part.from == self.missing_from() && !part.bytes.is_empty();
        let fits = self.bytes.len() + part.bytes.len() <= self.page.2 as usize;
        if is_next && fits {
            self.bytes.extend_from_slice(&part.bytes);
        }
        is_next && fits
    }

    /// Whether all parts have come.
    fn is_whole(&self) -> bool {
        self.bytes.len() == self.page.2 as usize
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use fastrand::Rng;
    use ipc_types::schema::MAX_TEXT_LEN;

    use super::*;
    use crate::message::PART_BYTES;
    use crate::message::{Ask, MAX_ASK_BYTES, MAX_REPLY_BYTES, Reply, decode, encode};
    const INSTANCE: u64 = u64::MAX;

    const fn at(ms: u64) -> MonotonicNs {
        MonotonicNs(ms * 1_000_000)
    }

    /// A service whose schema is a text of chance, which no packing makes shorter than three quarters.
    fn service(key: &str, len: usize) -> Service {
        let mut random = Rng::with_seed(len as u64);
        Service {
            key: key.to_owned(),
            takes_requests: key.len() % 2 == 1,
            schema: (0..len).map(|_| random.alphanumeric()).collect(),
        }
    }

    fn page(service: &Service) -> ServicesPage {
        ServicesPage::of(std::slice::from_ref(service)).remove(0)
    }

    fn part(page: &ServicesPage, index: u16, from: usize) -> Part {
        let part = page.part(INSTANCE, index, from as u32);
        part.expect("it is there")
    }

    /// A station learns pages over a link that loses and repeats messages, and takes none that is longer than one may
    /// be. Returns what it learned, how many parts that were, and how long it took, ms.
    fn learned(pages: &[ServicesPage], lost_percent: u64) -> (Vec<Service>, u64, u64) {
        let mut catalog = Catalog::default();
        catalog.expect(pages.len() as u16);
        let (mut learned, mut random, mut ms, mut parts) = (Vec::new(), Rng::with_seed(1), 0, 0);
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
            let tell = part(&pages[usize::from(index)], index, from as usize);
            let tell = encode(&Reply::Part(tell));
            assert!(tell.len() <= MAX_REPLY_BYTES, "{}", tell.len());
            let Ok(Reply::Part(part)) = decode(&tell) else {
                panic!("it is a part");
            };
            // A round trip.
            ms += 20;
            if arrives(lost_percent) && arrives(lost_percent) {
                parts += 1;
                learned.extend(catalog.take(&part));
                if !arrives(lost_percent) {
                    assert_eq!(catalog.take(&part), [], "it is a repetition");
                }
            }
        }
        (learned, parts, ms)
    }

    #[test]
    fn over_a_narrow_link_most_parts_are_asked_for_once_or_twice() {
        let page = page(&service("a/b", MAX_TEXT_LEN));
        let mut catalog = Catalog::default();
        catalog.expect(1);
        // Each part comes 1.2 s after its question.
        let (mut now, mut under_way, mut questions, mut parts) = (at(0), VecDeque::new(), 0, 0);
        while let Some(due) = catalog.deadline() {
            let due = due.max(now);
            let arrived = under_way.front().copied().filter(|(at, _)| *at <= due);
            if let Some((arrives, from)) = arrived {
                under_way.pop_front();
                now = arrives;
                parts = parts.max(from as usize / PART_BYTES + 1);
                catalog.take(&part(&page, 0, from as usize));
            } else {
                now = due;
                questions += 1;
                let question = catalog.question(now).expect("it is due");
                under_way.push_back((now + Duration::from_millis(1200), question.from));
            }
        }
        assert!(catalog.is_complete() && parts > 40);
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
        ];
        let pages: Vec<_> = services.iter().map(page).collect();
        let (all, parts, ms) = learned(&pages, 20);
        assert!(all == services && parts > 80);
        // Of the parts a third is asked for again.
        assert!(ms < parts * 520, "{ms} ms for {parts}");
        let (all, parts, ms) = learned(&pages, 0);
        assert!(all == services && ms == parts * 20);
        let together = ServicesPage::of(&services[..3]);
        assert_eq!(together.len(), 1);
        assert!(learned(&together, 20).0 == services[..3]);
    }

    #[test]
    fn pages_are_asked_for_one_after_the_other_until_all_have_come() {
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
        let service = service("a", 8000);
        let page = page(&service);
        let part = |index, from| part(&page, index, from);
        assert_eq!(catalog.take(&part(0, 0)), []);
        assert_eq!(catalog.question(at(601)), question(0, 4096), "at once");
        assert_eq!(catalog.take(&part(0, 0)), [], "it came twice");
        assert_eq!(catalog.question(at(602)), None);
        assert_eq!(catalog.take(&part(1, 0)), [], "it was not asked for");
        assert_eq!(catalog.take(&part(0, 4096)), std::slice::from_ref(&service));
        assert_eq!(catalog.take(&part(0, 4096)), []);
        assert_eq!(catalog.question(at(603)), question(1, 0));
        let _ = catalog.take(&part(1, 0));
        assert_eq!(catalog.take(&part(1, 4096)), [service]);
        assert!(catalog.is_complete() && catalog.question(at(9000)).is_none());
        catalog.expect(3);
        assert_eq!(catalog.question(at(9000)), question(2, 0));
    }

    #[test]
    fn a_page_that_is_too_long_or_cannot_be_read_is_left_out_and_the_next_one_is_asked_for() {
        let mut catalog = Catalog::default();
        catalog.expect(u16::MAX);
        let whole = part(&page(&service("a", 1)), 0, 0);
        let too_long = Part {
            page_bytes: u32::MAX,
            ..whole.clone()
        };
        assert_eq!(catalog.take(&too_long), []);
        assert_eq!(catalog.question(at(0)).unwrap().index, 1);
        let unreadable = Part {
            index: 1,
            bytes: vec![0; whole.bytes.len()],
            ..whole
        };
        assert_eq!(catalog.take(&unreadable), []);
        assert_eq!(catalog.question(at(0)).unwrap().index, 2);
        assert_eq!(catalog.pages, MAX_SERVICES);
    }

    #[test]
    fn a_robot_that_describes_something_else_meanwhile_is_asked_from_the_beginning() {
        let mut catalog = Catalog::default();
        catalog.expect(1);
        let (one, other) = (service("a", 7000), service("b", 8000));
        let _ = catalog.take(&part(&page(&one), 0, 0));
        assert_eq!(catalog.take(&part(&page(&other), 0, 4096)), []);
        assert_eq!(catalog.question(at(0)).unwrap().from, 0);
        let _ = catalog.take(&part(&page(&other), 0, 0));
        assert_eq!(catalog.take(&part(&page(&other), 0, 4096)), [other]);
    }

    #[test]
    fn parts_that_are_repeated_or_of_another_page_change_nothing() {
        let page = page(&service("a/b", 12_000));
        let part = |from| part(&page, 2, from);
        let mut assembly = Assembly::begin(&part(0));
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
                page_bytes: 9,
                ..next.clone()
            },
            Part {
                bytes: vec![0; 2 * PART_BYTES + 1],
                ..next.clone()
            },
            Part {
                bytes: Vec::new(),
                ..next.clone()
            },
        ];
        for other in others {
            assert!(!assembly.take(&other), "{other:?}");
        }
        assert!(assembly.take(&next) && !assembly.is_whole());
        assert!(assembly.take(&part(2 * PART_BYTES)) && assembly.is_whole());
    }
}
