//! [`SentOrders`]: the orders that went to the bridge and have no final report yet. Without a port and without a clock.
//! Of a path each waypoint is sent when the one before it was accepted, and the reports of the last one stand for it.

use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::{Reason, Stage};
use ipc_types::payload::{MovementData, RequestReport};
use operator::render::messages::{self, FinalReport, Verb};
use operator::request::{Exchange, Next, Outcome, Until};

use crate::{Gateway, Order, OrderKind};

/// How long the bridge may need to take one waypoint of a path.
const WAYPOINT_LIMIT: Duration = Duration::from_secs(5);

/// Of another order the gateway itself knows when it gives up; this bounds what is remembered.
const ORDER_LIMIT: Duration = Duration::from_secs(86_400);

/// The orders that went to the bridge and have no final report yet.
#[derive(Default)]
pub struct SentOrders {
    open: Vec<SentOrder>,
}

/// An order without a final report.
struct SentOrder {
    number: u64,
    verb: Verb,
    exchange: Exchange,
    /// The waypoints of a path.
    path: Vec<MovementData>,
}

impl SentOrders {
    /// An order was sent: as this request, or as a path, whose first waypoint that is.
    pub fn begin(
        &mut self,
        order: &Order,
        verb: Verb,
        request_id: u64,
        path: Vec<MovementData>,
        now: MonotonicNs,
    ) {
        let further = path.iter().skip(1).map(|request| request.request_id);
        let limit = match order.kind {
            OrderKind::Path => WAYPOINT_LIMIT,
            _ => ORDER_LIMIT,
        };
        let ids = std::iter::once(request_id).chain(further);
        let mut exchange = Exchange::new(ids, Until::Final, limit);
        exchange.sent(now);
        self.open.push(SentOrder {
            number: order.number,
            verb,
            exchange,
            path,
        });
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.open.len()
    }

    /// When [`SentOrders::advance`] is to be called though nothing has come.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        let due = self.open.iter().filter_map(|one| one.exchange.due());
        due.min()
    }

    /// A report has come. `send` sends a waypoint, and says whether it was sent.
    pub fn report(
        &mut self,
        report: &RequestReport,
        gateway: &mut Gateway,
        send: &mut dyn FnMut(&MovementData) -> bool,
        now: MonotonicNs,
    ) {
        let taken = self
            .open
            .iter_mut()
            .find_map(|one| one.exchange.take(report, now).map(|index| (one, index)));
        let Some((one, index)) = taken else {
            return;
        };
        let number = one.number;
        let is_last = index + 1 >= one.path.len();
        if is_last && matches!(report.stage(), Some(Stage::Accepted | Stage::Progress)) {
            gateway.report(number, report, "", now);
        }
        self.go_on(number, gateway, send, now);
    }

    /// Ends what the bridge does not answer.
    pub fn advance(
        &mut self,
        gateway: &mut Gateway,
        send: &mut dyn FnMut(&MovementData) -> bool,
        now: MonotonicNs,
    ) {
        let open: Vec<u64> = self.open.iter().map(|one| one.number).collect();
        for number in open {
            self.go_on(number, gateway, send, now);
        }
    }

    /// Sends the next waypoints, or says how the order ended.
    fn go_on(
        &mut self,
        number: u64,
        gateway: &mut Gateway,
        send: &mut dyn FnMut(&MovementData) -> bool,
        now: MonotonicNs,
    ) {
        let Some(place) = self.open.iter().position(|one| one.number == number) else {
            return;
        };
        let one = &mut self.open[place];
        let report = loop {
            match one.exchange.next(now) {
                Next::Wait(_) => return,
                Next::Send(index) => match send(&one.path[index]) {
                    true => one.exchange.sent(now),
                    false => break RequestReport::new(Stage::Refused, Reason::LinkDown),
                },
                Next::Over(Outcome::Final(end)) => break end.report,
                Next::Over(_) => break RequestReport::new(Stage::Unknown, Reason::BridgeGone),
            }
        };
        let verb = self.open.swap_remove(place).verb;
        let end = FinalReport::of(&report);
        let words = end.map_or_else(String::new, |end| messages::ending(verb, &end));
        gateway.report(number, &report, &words, now);
    }
}
