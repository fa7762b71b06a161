//! [`StationOrders`]: the station's orders. See the [states](super).
//!
//! **Rounds.** A new order goes out at once. What the robot side has not answered goes out again in rounds, all of it
//! in the order of the numbers: after an outage the robot side gets the older order first. There is one timer for all;
//! its pauses double while nothing is answered.
//!
//! **Orders move.** A movement is open for minutes while short requests come and go, and would hold the floor down
//! until no number below `floor + WINDOW` is left. So an open order whose number lies [`MOVE_AFTER`] behind moves to a
//! new number. The robot side recognizes it by session and request id. The floor passes the former number when the
//! robot side has answered the new one.

#[cfg(test)]
mod tests;

use std::collections::VecDeque;
use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::Stage;
use ipc_types::payload::RequestReport;

use super::message::{Answer, NO_PLACE, Order, RelayVerdict, WINDOW, request_id};

/// Orders that a station has open at the same time: eight requests of one client to each of four services. One more is
/// refused: too-many-requests.
pub const OPEN_ORDERS: usize = 32;

/// An open order so many numbers behind the newest moves to a new number.
pub const MOVE_AFTER: u64 = WINDOW / 2;

/// Former sessions that are known as such: a clock message of the robot side's former instance may be late. One that is
/// older is taken for a new session, which the robot side denies; the next clock message repairs that.
const FORMER_SESSIONS: usize = 8;

/// The shortest time after which an unanswered order is repeated.
const LEAST_TIMEOUT: Duration = Duration::from_millis(100);

/// In which clock `reported_ns` of a report is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// The robot's.
    Robot,
    /// The station's.
    Station,
}

/// What the station has to do.
#[derive(Clone, Debug, PartialEq)]
pub enum Output {
    /// Send this to the robot.
    Send(Order),
    /// Hand a report on to the client. After a final one, the handle is free.
    Report {
        /// Of the request.
        handle: u64,
        /// The report, with the request's id and path.
        report: RequestReport,
        /// Whose clock it has.
        origin: Origin,
    },
}

/// One instance of a station: its orders to one robot.
#[derive(Clone, Debug)]
pub struct StationOrders {
    give_up: Duration,
    session: Option<u64>,
    /// The robot side has no place for this station.
    is_left_out: bool,
    former_sessions: VecDeque<u64>,
    /// In the order of their numbers.
    entries: Vec<OpenOrder>,
    next_number: u64,
    timeout: Duration,
    /// When the next round is, if an order is to be asked for.
    next_round: MonotonicNs,
    /// Rounds since something was answered.
    unanswered_rounds: u32,
}

impl StationOrders {
    /// A station to which its robot has said nothing yet. After `give_up` without an answer of the robot, the client
    /// gets the report that the outcome is unknown. An outage shorter than this ends with the true report.
    pub fn new(give_up: Duration) -> StationOrders {
        StationOrders {
            give_up,
            session: None,
            is_left_out: false,
            former_sessions: VecDeque::with_capacity(FORMER_SESSIONS),
            entries: Vec::with_capacity(OPEN_ORDERS),
            next_number: 1,
            timeout: 2 * LEAST_TIMEOUT,
            next_round: MonotonicNs(0),
            unanswered_rounds: 0,
        }
    }

    /// The round trip to the robot was measured. An order is repeated after twice that, at least 100 ms and at most 1
    /// s.
    pub fn round_trip(&mut self, round_trip: Duration) {
        self.timeout = (2 * round_trip.min(ASK_PERIOD)).clamp(LEAST_TIMEOUT, ASK_PERIOD);
    }

    /// A client has sent a request. It is refused at once when the link is down.
    pub fn request(
        &mut self,
        request: ClientRequest,
        is_link_up: bool,
        now: MonotonicNs,
        out: &mut Vec<Output>,
    ) {
        let id = request_id(&request.bytes);
        self.catch_up(now, out);
        let refusal = if id == 0 {
            Some(RelayVerdict::InvalidRequest)
        } else if self.entries.iter().any(|entry| entry.request_id == id) {
            Some(RelayVerdict::Busy)
        } else if !is_link_up {
            Some(RelayVerdict::LinkDown)
        } else if self.is_left_out {
            Some(RelayVerdict::TooManyStations)
        } else if self.session.is_none() {
            Some(RelayVerdict::LinkDown)
        } else if !self.has_room() {
            Some(RelayVerdict::TooManyRequests)
        } else {
            None
        };
        let entry = OpenOrder::new(request, id, self.next_number, now);
        if let Some(verdict) = refusal {
            out.push(report(&entry, &verdict.report(id, now), Origin::Station));
            return;
        }
        let number = self.next_number;
        self.next_number += 1;
        let is_waited_for = self.asked_from().is_some_and(|from| from <= now);
        self.entries.push(entry);
        self.ask(|entry| entry.number == number, out);
        let round = now + self.timeout;
        self.next_round = match is_waited_for {
            true => self.next_round.min(round),
            false => round,
        };
        self.unanswered_rounds = 1;
    }

    /// The client of this request has gone: it gets no more reports, and the robot side gives the request up.
    pub fn give_up(&mut self, handle: u64, out: &mut Vec<Output>) {
        let mut entries = self.entries.iter_mut();
        let entry = entries
            .find(|entry| entry.client == Requester::Waits && entry.request.handle == handle);
        if let Some(entry) = entry {
            entry.client = Requester::Gone;
            let number = entry.number;
            self.ask(|entry| entry.number == number, out);
        }
    }

    /// The robot has answered a clock message, with the session of this station, or [`NO_PLACE`]: requests are refused
    /// until there is a session. What is open stays open, because the answer may be late, and because a place may
    /// become free.
    pub fn session(&mut self, session: u64, now: MonotonicNs, out: &mut Vec<Output>) {
        self.is_left_out = session == NO_PLACE;
        if self.is_left_out {
            return;
        }
        if self.session == Some(session) || self.former_sessions.contains(&session) {
            return;
        }
        self.end_session();
        self.session = Some(session);
        let next_number = &mut self.next_number;
        self.entries.retain_mut(|entry| {
            let held = entry.move_to_session(*next_number);
            if held.is_none() {
                *next_number += 1;
            }
            if let (Some(held), Requester::Waits) = (&held, entry.client) {
                out.push(report(entry, held, Origin::Robot));
            }
            held.is_none()
        });
        self.next_round = now;
        self.unanswered_rounds = 0;
        self.ask_due(now, out);
    }

    /// The robot side does not know a session. Requests are refused until there is another one.
    pub fn unknown_session(&mut self, session: u64) {
        if self.session == Some(session) {
            self.end_session();
        }
    }

    /// The robot side has answered an order. One of a former session or number, or that is settled, is ignored.
    pub fn answer(&mut self, answer: &Answer, now: MonotonicNs, out: &mut Vec<Output>) {
        if self.session != Some(answer.session) {
            return;
        }
        let mut entries = self.entries.iter();
        let Some(index) = entries.position(|entry| entry.number == answer.number) else {
            return;
        };
        let entry = &mut self.entries[index];
        if entry.client == Requester::Gone && answer.report.is_final() {
            self.entries.remove(index);
            return;
        }
        let ready = entry.take(answer.serial, &answer.report, now);
        self.unanswered_rounds = 0;
        self.next_round = self.next_round.min(now + self.timeout);
        if entry.client == Requester::Gone {
            return;
        }
        for ready in ready.into_iter().flatten() {
            out.push(report(&self.entries[index], &ready, Origin::Robot));
            if ready.is_final() {
                self.entries.remove(index);
                return;
            }
        }
    }

    /// Does what is due. Call it at [`StationOrders::deadline`].
    pub fn tick(&mut self, now: MonotonicNs, out: &mut Vec<Output>) {
        let limit = self.give_up;
        self.entries.retain_mut(|entry| {
            if entry.lost_at(limit).is_none_or(|at| at > now) {
                return true;
            }
            entry.client = Requester::Gone;
            if let Some(held) = entry.held_final() {
                out.push(report(entry, &held, Origin::Robot));
                return false;
            }
            let lost = RelayVerdict::LinkLost.report(entry.request_id, now);
            out.push(report(entry, &lost, Origin::Station));
            true
        });
        self.ask_due(now, out);
    }

    /// When [`StationOrders::tick`] is due.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        let from = self.asked_from().filter(|_| self.session.is_some());
        let round = from.map(|from| from.max(self.next_round));
        let entries = self.entries.iter();
        let losses = entries.filter_map(|entry| entry.lost_at(self.give_up));
        losses.chain(round).min()
    }

    /// Orders that are not settled, those that were given up included.
    pub fn open(&self) -> usize {
        self.entries.len()
    }

    fn end_session(&mut self) {
        if let Some(former) = self.session.take() {
            if self.former_sessions.len() == FORMER_SESSIONS {
                self.former_sessions.pop_front();
            }
            self.former_sessions.push_back(former);
        }
    }

    /// From when on an order is to be asked for.
    fn asked_from(&self) -> Option<MonotonicNs> {
        self.entries.iter().map(OpenOrder::asked_from).min()
    }

    fn floor(&self) -> u64 {
        let lowest = self.entries.iter().map(|entry| entry.lowest).min();
        lowest.unwrap_or(self.next_number)
    }

    fn has_room(&self) -> bool {
        self.entries.len() < OPEN_ORDERS && self.next_number - self.floor() < WINDOW
    }

    /// Moves orders that are far behind to new numbers, unless the robot side may not know them yet.
    fn catch_up(&mut self, now: MonotonicNs, out: &mut Vec<Output>) {
        if self.session.is_none() {
            return;
        }
        let newest = self.next_number;
        for entry in &mut self.entries {
            if entry.is_answered && newest - entry.number >= MOVE_AFTER {
                entry.move_to(self.next_number);
                self.next_number += 1;
                self.next_round = now;
            }
        }
        self.entries.sort_by_key(|entry| entry.number);
        self.ask_due(now, out);
    }

    /// A round, when it is due.
    fn ask_due(&mut self, now: MonotonicNs, out: &mut Vec<Output>) {
        let is_due = self.asked_from().is_some_and(|from| from <= now);
        if !is_due || now < self.next_round || self.session.is_none() {
            return;
        }
        self.ask(|entry| entry.asked_from() <= now, out);
        let doublings = self.unanswered_rounds.min(8);
        self.next_round = now + ASK_PERIOD.min(self.timeout * (1 << doublings));
        self.unanswered_rounds = self.unanswered_rounds.saturating_add(1);
    }

    /// # Panics
    /// When the open orders contradict each other, which is a defect.
    fn assert_sound(&self) {
        let entries = &self.entries;
        debug_assert!(entries.len() <= OPEN_ORDERS);
        debug_assert!(entries.is_sorted_by(|one, next| one.number < next.number));
        for (index, entry) in entries.iter().enumerate() {
            debug_assert!(entry.lowest <= entry.number && entry.number < self.next_number);
            let id = entry.request_id;
            debug_assert!(
                entries[index + 1..]
                    .iter()
                    .all(|other| other.request_id != id)
            );
        }
        let is_former = |session| self.former_sessions.contains(&session);
        debug_assert!(!self.session.is_some_and(is_former));
    }

    /// Sends one more copy of each of these orders.
    fn ask(&self, is_meant: impl Fn(&OpenOrder) -> bool, out: &mut Vec<Output>) {
        self.assert_sound();
        let Some(session) = self.session else {
            return;
        };
        let floor = self.floor();
        let entries = self.entries.iter().filter(|entry| is_meant(entry));
        out.extend(entries.map(|entry| Output::Send(entry.ask(session, floor))));
    }
}

/// What hands a report on to the client of an order.
fn report(entry: &OpenOrder, report: &RequestReport, origin: Origin) -> Output {
    Output::Report {
        handle: entry.request.handle,
        report: RequestReport {
            request_id: entry.request_id,
            path_id: entry.request.path_id,
            ..*report
        },
        origin,
    }
}

/// How often an order is asked for that the robot has answered, and the longest pause between two rounds.
const ASK_PERIOD: Duration = Duration::from_secs(1);

/// A request of a client.
#[derive(Clone, Debug, PartialEq)]
pub struct ClientRequest {
    /// By what the caller knows the request; different from all that are open.
    pub handle: u64,
    /// Path of the request, which every report repeats; 0 if it has none.
    pub path_id: u64,
    /// Which request service of the robot.
    pub service: u64,
    /// The robot side must not pass the request on later than this. Monotonic clock of the *robot*; the caller takes
    /// the earliest time that the deadline can be in that clock.
    pub expires: MonotonicNs,
    /// The request as its service has it.
    pub bytes: Vec<u8>,
}

/// Who waits for the reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Requester {
    Waits,
    /// It went away, or has the report that the outcome is unknown.
    Gone,
}

/// An order that is not settled.
#[derive(Clone, Debug)]
struct OpenOrder {
    request: ClientRequest,
    request_id: u64,
    client: Requester,
    number: u64,
    /// The lowest number under which the robot side may remember this order: until it has answered the present number,
    /// the former one.
    lowest: u64,
    /// Another session, or another number, was used before.
    is_repeat: bool,
    /// The robot side has answered under the present number.
    is_answered: bool,
    last_answer: MonotonicNs,
    /// Serial number of the newest report that was handed on, in this session; 0 for none.
    handed_on: u32,
    /// A report that is not final was handed on, in whatever session.
    has_begun: bool,
    /// The newest report, while the first one is missing.
    held: Option<(u32, RequestReport)>,
}

impl OpenOrder {
    fn new(request: ClientRequest, request_id: u64, number: u64, now: MonotonicNs) -> OpenOrder {
        OpenOrder {
            request,
            request_id,
            client: Requester::Waits,
            number,
            lowest: number,
            is_repeat: false,
            is_answered: false,
            last_answer: now,
            handed_on: 0,
            has_begun: false,
            held: None,
        }
    }

    /// From when on the order is asked for: at once while the robot side has not answered it, or its first report is
    /// missing.
    fn asked_from(&self) -> MonotonicNs {
        match self.is_answered && self.held.is_none() {
            true => self.last_answer + ASK_PERIOD,
            false => MonotonicNs(0),
        }
    }

    /// When the robot has been silent about this order for `give_up`. `None` if no client waits.
    fn lost_at(&self, give_up: Duration) -> Option<MonotonicNs> {
        (self.client == Requester::Waits).then(|| self.last_answer + give_up)
    }

    /// One more copy.
    fn ask(&self, session: u64, floor: u64) -> Order {
        Order {
            session,
            number: self.number,
            floor,
            service: self.request.service,
            expires: self.request.expires,
            is_repeat: self.is_repeat,
            is_given_up: self.client == Requester::Gone,
            request: self.request.bytes.clone(),
        }
    }

    /// The order is asked for under another number of the same session, which the robot side knows it by.
    fn move_to(&mut self, number: u64) {
        self.lowest = self.number;
        self.renumber(number);
    }

    /// The order is asked for in another session, under another number. A final report that was held is returned: it is
    /// the true one, and the robot side may not remember it.
    fn move_to_session(&mut self, number: u64) -> Option<RequestReport> {
        self.lowest = number;
        self.renumber(number);
        self.handed_on = 0;
        let (_, report) = self.held.take()?;
        report.is_final().then_some(report)
    }

    fn renumber(&mut self, number: u64) {
        self.number = number;
        self.is_repeat = true;
        self.is_answered = false;
    }

    /// An answer has come. The reports that can now be handed on, in their order.
    fn take(
        &mut self,
        serial: u32,
        report: &RequestReport,
        now: MonotonicNs,
    ) -> [Option<RequestReport>; 2] {
        self.is_answered = true;
        self.lowest = self.number;
        self.last_answer = now;
        if serial <= self.handed_on {
            return [None, None];
        }
        if serial > 1 && self.handed_on == 0 && !self.has_begun {
            if self.held.is_none_or(|(held, _)| held < serial) {
                self.held = Some((serial, *report));
            }
            return [None, None];
        }
        let first = self.hand_on(serial, report);
        let held = self.held.take();
        [
            first,
            held.and_then(|(serial, report)| self.hand_on(serial, &report)),
        ]
    }

    /// The final report that was held, when there will be no other.
    fn held_final(&mut self) -> Option<RequestReport> {
        let (_, report) = self.held.take()?;
        report.is_final().then_some(report)
    }

    fn hand_on(&mut self, serial: u32, report: &RequestReport) -> Option<RequestReport> {
        self.handed_on = self.handed_on.max(serial);
        // A server that was asked again may accept again.
        let is_again = self.has_begun && report.stage() == Some(Stage::Accepted);
        self.has_begun |= !report.is_final();
        (!is_again).then_some(*report)
    }
}
