//! What a client asks for, and the order that a station makes of it.

use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::Stage;
use ipc_types::payload::RequestReport;

use crate::orders::message::Order;

/// How often an order is asked for that the robot has answered, and the longest pause between two rounds.
pub(super) const ASK_PERIOD: Duration = Duration::from_secs(1);

/// A request of a client.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// By what the caller knows the request; different from all that are open.
    pub handle: u64,
    /// Path of the request, which every report repeats; 0 if it has none.
    pub path_id: u64,
    /// Which request service of the robot.
    pub service: u64,
    /// The robot side must not pass the request on later than this. Monotonic clock of the *robot*; the caller takes the earliest
    /// time that the deadline can be in that clock.
    pub expires: MonotonicNs,
    /// The request as its service has it.
    pub bytes: Vec<u8>,
}

/// Who waits for the reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Client {
    Waits,
    /// It went away, or has the report that the outcome is unknown.
    Gone,
}

/// An order that is not settled.
#[derive(Clone, Debug)]
pub(super) struct Entry {
    pub(super) request: Request,
    pub(super) request_id: u64,
    pub(super) client: Client,
    pub(super) number: u64,
    /// The lowest number under which the robot side may remember this order: until it has answered the present number, the
    /// former one.
    pub(super) lowest: u64,
    /// Another session, or another number, was used before.
    is_repeat: bool,
    /// The robot side has answered under the present number.
    pub(super) is_answered: bool,
    last_answer: MonotonicNs,
    /// Serial number of the newest report that was handed on, in this session; 0 for none.
    handed_on: u32,
    /// A report that is not final was handed on, in whatever session.
    has_begun: bool,
    /// The newest report, while the first one is missing.
    held: Option<(u32, RequestReport)>,
}

impl Entry {
    pub(super) fn new(request: Request, request_id: u64, number: u64, now: MonotonicNs) -> Entry {
        Entry {
            request,
            request_id,
            client: Client::Waits,
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

    /// From when on the order is asked for: at once while the robot side has not answered it, or its first report is missing.
    pub(super) fn asked_from(&self) -> MonotonicNs {
        match self.is_answered && self.held.is_none() {
            true => self.last_answer + ASK_PERIOD,
            false => MonotonicNs(0),
        }
    }

    /// When the robot has been silent about this order for `give_up`. `None` if no client waits.
    pub(super) fn lost_at(&self, give_up: Duration) -> Option<MonotonicNs> {
        (self.client == Client::Waits).then(|| self.last_answer + give_up)
    }

    /// One more copy.
    pub(super) fn ask(&self, session: u64, floor: u64) -> Order {
        Order {
            session,
            number: self.number,
            floor,
            service: self.request.service,
            expires: self.request.expires,
            is_repeat: self.is_repeat,
            is_given_up: self.client == Client::Gone,
            request: self.request.bytes.clone(),
        }
    }

    /// The order is asked for under another number of the same session, which the robot side knows it by.
    pub(super) fn move_to(&mut self, number: u64) {
        self.lowest = self.number;
        self.renumber(number);
    }

    /// The order is asked for in another session, under another number. A final report that was held is returned: it is the true
    /// one, and the robot side may not remember it.
    pub(super) fn move_to_session(&mut self, number: u64) -> Option<RequestReport> {
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
    pub(super) fn take(
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
    pub(super) fn held_final(&mut self) -> Option<RequestReport> {
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
