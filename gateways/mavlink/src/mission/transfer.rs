//! [`Transfer`]: a mission or a fence comes from a station, item by item, whole or not at all; and stations read the
//! one in force, each the one that was in force when it began.
//!
//! | state | MISSION_COUNT | the awaited item | another item | no item for a while | the limit | the verdict of the check |
//! |---|---|---|---|---|---|---|
//! | idle | → receiving | – | the last one of the transfer before, of the same station: the same answer again; of a station that had none: refused | – | – | – |
//! | receiving | of the same station: anew; of another: refused | the next one is asked for; after the last one → checking | – | it is asked for again | → idle, cancelled | – |
//! | checking | of the same station: → receiving; of another: refused | – | – | – | → idle, failed | → idle, answered |
//!
//! Stations only answer: who sends the items waits for each to be asked for. QGroundControl gives up when 1.5 s have
//! passed without a question, so an item is asked for again in a time that depends on how quickly the station has
//! answered so far, and for 1.5 s at most.

use std::sync::Arc;
use std::time::Duration;

use ipc_types::MonotonicNs;

use super::store::Item;
use crate::number::MissionResult;
use crate::stations::{MAX_STATIONS, StationAddress};

/// When an item is asked for again: four times what the station has needed for an answer so far, within these limits.
/// The longer one is what QGroundControl itself waits, and holds until an answer has come; the shorter one keeps a
/// station from being flooded.
const MIN_RETRY: Duration = Duration::from_millis(20);
const MAX_RETRY: Duration = Duration::from_millis(250);

/// How long one item is awaited: QGroundControl waits no longer for the next question.
const ITEM_LIMIT: Duration = Duration::from_millis(1_500);

/// How long a whole transfer may take, and how much longer for each item. It is looked at before anything is asked for
/// again.
const LIMIT: Duration = Duration::from_secs(5);
const LIMIT_OF_ITEM: Duration = Duration::from_millis(250);

/// How long the check may take: the bridge's rules are asked for, and the mission is written to disk; or the bridge
/// reads the fence.
const CHECK_LIMIT: Duration = Duration::from_secs(5);

/// What is to be done.
#[derive(Clone, Debug, PartialEq)]
pub enum Output {
    /// Ask for an item.
    Request(StationAddress, u16),
    /// Say how the transfer ended.
    Ack(StationAddress, MissionResult),
    /// Say that it comes to nothing, and why, as a clause.
    Refused(StationAddress, MissionResult, &'static str),
    /// Say that it ended because this item did not come.
    Late(StationAddress, u16),
    /// All items are there: check them, then say [`Transfer::checked`].
    Check(StationAddress, Vec<Item>),
}

#[derive(Clone, Debug)]
enum TransferState {
    Idle,
    Receiving(Receiving),
    Checking {
        from: StationAddress,
        count: u16,
        limit: MonotonicNs,
    },
}

#[derive(Clone, Debug)]
struct Receiving {
    from: StationAddress,
    count: u16,
    items: Vec<Item>,
    /// When the awaited item was asked for first.
    asked: MonotonicNs,
    is_asked_again: bool,
    retry_at: MonotonicNs,
    /// How long the station needs for an answer, as far as it is known.
    answers_within: Option<Duration>,
    limit: MonotonicNs,
}

/// The transfer of a mission or a fence from a station, item by item, and to stations.
#[derive(Clone, Debug)]
pub struct Transfer {
    max_items: usize,
    state: TransferState,
    /// The end of the last transfer: its station, the number of its last item, the answer.
    last: Option<(StationAddress, u16, MissionResult)>,
    /// What stations read.
    read: Vec<(StationAddress, Arc<[Item]>)>,
}

impl Transfer {
    /// None is under way, and none has more items.
    pub fn new(max_items: usize) -> Transfer {
        Transfer {
            max_items,
            state: TransferState::Idle,
            last: None,
            read: Vec::new(),
        }
    }

    /// A station begins to read these items.
    pub fn read_by(&mut self, sender: StationAddress, items: Arc<[Item]>) {
        self.forget(sender);
        if self.read.len() == MAX_STATIONS {
            // Of more stations the oldest has to begin anew.
            self.read.remove(0);
        }
        self.read.push((sender, items));
    }

    /// What a station reads; `None` if it has not begun.
    pub fn read(&self, sender: StationAddress) -> Option<&[Item]> {
        let mut reads = self.read.iter();
        let (_, items) = reads.find(|(one, _)| *one == sender)?;
        Some(items)
    }

    /// A station has read it, or is gone.
    pub fn forget(&mut self, sender: StationAddress) {
        self.read.retain(|(one, _)| *one != sender);
    }

    /// How a station ended: what it has read, or, if it failed, what it was sending too.
    pub fn ended_by(&mut self, sender: StationAddress, result: u8) {
        self.forget(sender);
        if result != MissionResult::Accepted as u8 {
            self.cancel(sender);
        }
    }

    /// A station has `count` items.
    pub fn begin(&mut self, from: StationAddress, count: u16, now: MonotonicNs) -> Output {
        if self.station().is_some_and(|station| station != from) {
            let why = "another station is just sending one";
            return Output::Refused(from, MissionResult::Error, why);
        }
        self.last = None;
        if usize::from(count) > self.max_items {
            self.state = TransferState::Idle;
            return Output::Refused(from, MissionResult::NoSpace, "it has too many items");
        }
        if count == 0 {
            return self.check(from, Vec::new(), now);
        }
        self.state = TransferState::Receiving(Receiving {
            from,
            count,
            items: Vec::with_capacity(count.into()),
            asked: now,
            is_asked_again: false,
            retry_at: now + MAX_RETRY,
            answers_within: None,
            limit: now + LIMIT + LIMIT_OF_ITEM * u32::from(count),
        });
        Output::Request(from, 0)
    }

    fn check(&mut self, from: StationAddress, items: Vec<Item>, now: MonotonicNs) -> Output {
        self.state = TransferState::Checking {
            from,
            count: items.len() as u16,
            limit: now + CHECK_LIMIT,
        };
        Output::Check(from, items)
    }

    /// An item has come.
    pub fn item(
        &mut self,
        from: StationAddress,
        sequence: u16,
        item: Item,
        now: MonotonicNs,
    ) -> Option<Output> {
        let receiving = match &mut self.state {
            TransferState::Receiving(receiving) if receiving.from == from => receiving,
            TransferState::Idle => {
                return match self.last.filter(|last| last.0 == from) {
                    // Our answer was lost, or it is a late copy.
                    Some((_, last, result)) => {
                        (last == sequence).then_some(Output::Ack(from, result))
                    }
                    None => {
                        let why = "no item was asked for: begin with MISSION_COUNT";
                        Some(Output::Refused(from, MissionResult::InvalidSequence, why))
                    }
                };
            }
            _ => return None,
        };
        if usize::from(sequence) != receiving.items.len() {
            // One that came twice, or too late. The awaited one is asked for when its time has come.
            return None;
        }
        receiving.items.push(item);
        if !receiving.is_asked_again {
            let needed = now.since(receiving.asked);
            let before = receiving.answers_within.unwrap_or(needed);
            receiving.answers_within = Some((before * 7 + needed) / 8);
        }
        if receiving.items.len() == usize::from(receiving.count) {
            let items = std::mem::take(&mut receiving.items);
            return Some(self.check(from, items, now));
        }
        (receiving.asked, receiving.is_asked_again) = (now, false);
        receiving.retry_at = now + receiving.retry();
        Some(Output::Request(from, sequence + 1))
    }

    /// The station does not go on.
    pub fn cancel(&mut self, from: StationAddress) {
        if self.station() == Some(from) {
            self.state = TransferState::Idle;
        }
    }

    /// Whether the check that was asked for is still awaited.
    pub fn is_checking(&self) -> bool {
        matches!(self.state, TransferState::Checking { .. })
    }

    /// All items were checked, and what they are is in force if the result says so.
    pub fn checked(&mut self, result: MissionResult) -> Option<Output> {
        let TransferState::Checking { from, count, .. } = self.state else {
            return None;
        };
        self.state = TransferState::Idle;
        self.last = Some((from, count.saturating_sub(1), result));
        Some(Output::Ack(from, result))
    }

    /// Time has passed.
    pub fn advance(&mut self, now: MonotonicNs) -> Option<Output> {
        let ended = match &mut self.state {
            TransferState::Receiving(receiving) => {
                let is_over = now >= receiving.limit || now >= receiving.asked + ITEM_LIMIT;
                let awaited = receiving.items.len() as u16;
                if !is_over {
                    if now < receiving.retry_at {
                        return None;
                    }
                    receiving.is_asked_again = true;
                    receiving.retry_at = now + receiving.retry();
                    return Some(Output::Request(receiving.from, awaited));
                }
                Output::Late(receiving.from, awaited)
            }
            TransferState::Checking { from, limit, .. } if now >= *limit => {
                let why = "its check has taken too long";
                Output::Refused(*from, MissionResult::Error, why)
            }
            _ => return None,
        };
        self.state = TransferState::Idle;
        Some(ended)
    }

    /// # Panics
    /// When what was received contradicts what was announced, which is a defect.
    fn assert_sound(&self) {
        let is_idle = matches!(self.state, TransferState::Idle);
        debug_assert!(is_idle || self.last.is_none(), "{self:?}");
        match &self.state {
            TransferState::Idle => {}
            TransferState::Receiving(receiving) => {
                debug_assert!(receiving.items.len() < usize::from(receiving.count));
                debug_assert!(usize::from(receiving.count) <= self.max_items);
                debug_assert!(receiving.asked <= receiving.retry_at);
            }
            TransferState::Checking { count, .. } => {
                debug_assert!(usize::from(*count) <= self.max_items);
            }
        }
        debug_assert!(self.read.len() <= MAX_STATIONS);
    }

    /// When [`Transfer::advance`] is to be called.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        self.assert_sound();
        match &self.state {
            TransferState::Idle => None,
            TransferState::Receiving(receiving) => {
                let item = receiving.asked + ITEM_LIMIT;
                Some(receiving.retry_at.min(item).min(receiving.limit))
            }
            TransferState::Checking { limit, .. } => Some(*limit),
        }
    }

    fn station(&self) -> Option<StationAddress> {
        match &self.state {
            TransferState::Idle => None,
            TransferState::Receiving(Receiving { from, .. })
            | TransferState::Checking { from, .. } => Some(*from),
        }
    }
}

impl Receiving {
    fn retry(&self) -> Duration {
        let retry = self.answers_within.map(|within| within * 4);
        retry.unwrap_or(MAX_RETRY).clamp(MIN_RETRY, MAX_RETRY)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::MISSION_ITEM_INT;
    use crate::wire::MessageWriter;

    fn sender(port: u16) -> StationAddress {
        StationAddress {
            address: ([127, 0, 0, 1], port).into(),
            system: 255,
            component: 190,
        }
    }

    fn item(number: u16) -> Item {
        let message = MessageWriter::new(MISSION_ITEM_INT).f32(f32::from(number));
        Item::of(message.payload())
    }

    fn at(ms: u64) -> MonotonicNs {
        MonotonicNs(ms * 1_000_000)
    }

    /// Two items of station 1: idle, after one of them, after both.
    fn states() -> [Transfer; 3] {
        let idle = Transfer::new(2048);
        let mut receiving = idle.clone();
        receiving.begin(sender(1), 2, at(0));
        receiving.item(sender(1), 0, item(0), at(0));
        let mut checking = receiving.clone();
        checking.item(sender(1), 1, item(1), at(0));
        [idle, receiving, checking]
    }

    fn name(transfer: &Transfer) -> &'static str {
        match transfer.state {
            TransferState::Idle => "idle",
            TransferState::Receiving(_) => "receiving",
            TransferState::Checking { .. } => "checking",
        }
    }

    #[test]
    fn each_state_and_each_event() {
        use MissionResult::{Accepted, Error, NoSpace};
        let (one, two) = (sender(1), sender(2));
        type Event = Box<dyn Fn(&mut Transfer) -> Option<Output>>;
        let begin = |from, count| -> Event {
            Box::new(move |transfer| Some(transfer.begin(from, count, at(10))))
        };
        let comes = |from, sequence| -> Event {
            Box::new(move |transfer| transfer.item(from, sequence, item(sequence), at(10)))
        };
        let passes = |ms| -> Event { Box::new(move |transfer| transfer.advance(at(ms))) };
        let request = |sequence| Some(Output::Request(one, sequence));
        let ack = |to, result| Some(Output::Ack(to, result));
        let busy = || {
            let why = "another station is just sending one";
            Some(Output::Refused(two, Error, why))
        };
        let many = || Some(Output::Refused(one, NoSpace, "it has too many items"));
        let slow = || {
            let why = "its check has taken too long";
            Some(Output::Refused(one, Error, why))
        };
        let unasked = |to| {
            let why = "no item was asked for: begin with MISSION_COUNT";
            Some(Output::Refused(to, MissionResult::InvalidSequence, why))
        };
        let late = || Some(Output::Late(one, 1));
        let all = || Some(Output::Check(one, vec![item(0), item(1)]));
        let none = || Some(Output::Check(one, Vec::new()));
        // For each state: what is done, and the state afterwards.
        type Column = (Option<Output>, &'static str);
        let table: Vec<(&str, Event, [Column; 3])> = vec![
            (
                "count of the same station",
                begin(one, 2),
                [
                    (request(0), "receiving"),
                    (request(0), "receiving"),
                    (request(0), "receiving"),
                ],
            ),
            (
                "count of another station",
                begin(two, 2),
                [
                    (Some(Output::Request(two, 0)), "receiving"),
                    (busy(), "receiving"),
                    (busy(), "checking"),
                ],
            ),
            (
                "count 0",
                begin(one, 0),
                [
                    (none(), "checking"),
                    (none(), "checking"),
                    (none(), "checking"),
                ],
            ),
            (
                "as many as fit",
                begin(one, 2048),
                [
                    (request(0), "receiving"),
                    (request(0), "receiving"),
                    (request(0), "receiving"),
                ],
            ),
            (
                "too many",
                begin(one, 2049),
                [(many(), "idle"), (many(), "idle"), (many(), "idle")],
            ),
            (
                "the awaited item",
                comes(one, 1),
                [
                    (unasked(one), "idle"),
                    (all(), "checking"),
                    (None, "checking"),
                ],
            ),
            (
                "the item before",
                comes(one, 0),
                [
                    (unasked(one), "idle"),
                    (None, "receiving"),
                    (None, "checking"),
                ],
            ),
            (
                "an item of another station",
                comes(two, 1),
                [
                    (unasked(two), "idle"),
                    (None, "receiving"),
                    (None, "checking"),
                ],
            ),
            (
                "cancelled",
                Box::new(move |transfer| {
                    transfer.cancel(one);
                    None
                }),
                [(None, "idle"), (None, "idle"), (None, "idle")],
            ),
            (
                "cancelled by another station",
                Box::new(move |transfer| {
                    transfer.cancel(two);
                    None
                }),
                [(None, "idle"), (None, "receiving"), (None, "checking")],
            ),
            (
                "the station has read it, and says so",
                Box::new(move |transfer| {
                    transfer.ended_by(one, 0);
                    None
                }),
                [(None, "idle"), (None, "receiving"), (None, "checking")],
            ),
            (
                "the station says that it failed",
                Box::new(move |transfer| {
                    transfer.ended_by(one, 15);
                    None
                }),
                [(None, "idle"), (None, "idle"), (None, "idle")],
            ),
            (
                "checked",
                Box::new(|transfer| transfer.checked(Accepted)),
                [
                    (None, "idle"),
                    (None, "receiving"),
                    (ack(one, Accepted), "idle"),
                ],
            ),
            (
                "the time of an answer has passed",
                passes(21),
                [
                    (None, "idle"),
                    (request(1), "receiving"),
                    (None, "checking"),
                ],
            ),
            (
                "the time of an item has passed",
                passes(1_500),
                [(None, "idle"), (late(), "idle"), (None, "checking")],
            ),
            (
                "the time of the check has passed",
                passes(5_000),
                [(None, "idle"), (late(), "idle"), (slow(), "idle")],
            ),
        ];
        for (event, happens, expected) in table {
            for (mut transfer, (output, after)) in states().into_iter().zip(expected) {
                let before = name(&transfer);
                assert_eq!(happens(&mut transfer), output, "{before}: {event}");
                assert_eq!(name(&transfer), after, "{before}: {event}");
                assert_eq!(transfer.deadline().is_some(), after != "idle");
                assert_eq!(transfer.is_checking(), after == "checking");
            }
        }
    }

    #[test]
    fn the_last_item_again_gets_the_same_answer_again() {
        let [_, _, mut transfer] = states();
        transfer.checked(MissionResult::Unsupported);
        let again = Some(Output::Ack(sender(1), MissionResult::Unsupported));
        assert_eq!(transfer.item(sender(1), 1, item(1), at(20)), again);
        assert_eq!(transfer.item(sender(1), 0, item(0), at(20)), None);
        let is_refused = |output| matches!(output, Some(Output::Refused(..)));
        assert!(is_refused(transfer.item(sender(2), 1, item(1), at(20))));
        transfer.begin(sender(2), 3, at(30));
        transfer.cancel(sender(2));
        assert!(is_refused(transfer.item(sender(1), 1, item(1), at(40))));
    }

    #[test]
    fn an_item_is_asked_for_again_as_quickly_as_the_station_answers() {
        for (answer_ms, expected_ms) in [(0, 20), (30, 120), (200, 250)] {
            let mut transfer = Transfer::new(2048);
            transfer.begin(sender(1), 9, at(0));
            assert_eq!(transfer.deadline(), Some(at(250)), "nothing is known yet");
            transfer.item(sender(1), 0, item(0), at(answer_ms));
            let retry = at(answer_ms + expected_ms);
            assert_eq!(transfer.deadline(), Some(retry), "{answer_ms}");
            // What came after a second question says nothing of the time.
            assert!(transfer.advance(retry).is_some());
            let again = at(answer_ms + 2 * expected_ms);
            assert_eq!(transfer.deadline(), Some(again));
            transfer.item(sender(1), 1, item(1), at(1_000));
            assert_eq!(transfer.deadline(), Some(at(1_000 + expected_ms)));
        }
    }

    #[test]
    fn a_station_that_always_answers_late_is_cut_off_at_the_limit() {
        let mut transfer = Transfer::new(2048);
        transfer.begin(sender(1), 100, at(0));
        let mut now_ms = 0;
        let ended = (0..100).find_map(|number| {
            now_ms += 1_400;
            let ended = transfer.advance(at(now_ms));
            let is_over = matches!(ended, Some(Output::Late(..)));
            transfer.item(sender(1), number, item(number), at(now_ms));
            is_over.then_some(now_ms)
        });
        // 5 s and 250 ms for each item.
        assert_eq!(ended, Some(30_800));
        let mut transfer = Transfer::new(2048);
        transfer.begin(sender(1), 100, at(0));
        for number in 0..21 {
            transfer.item(
                sender(1),
                number,
                item(number),
                at(1_400 * u64::from(number + 1)),
            );
        }
        let last = Some(Output::Request(sender(1), 21));
        assert_eq!(transfer.advance(at(29_999)), last);
        assert_eq!(transfer.deadline(), Some(at(30_000)));
        assert_eq!(
            transfer.advance(at(30_000)),
            Some(Output::Late(sender(1), 21))
        );
    }
}
