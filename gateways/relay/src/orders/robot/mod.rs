//! [`RobotOrders`]: the robot side's memory of orders. See the [states](super).

mod records;
mod sessions;

#[cfg(test)]
mod tests;

use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::{Reason, Stage};
use ipc_types::payload::RequestReport;

use super::message::{Order, RelayVerdict, request_id};
pub use records::{NotSent, ORPHANS, Output, Traits};
use records::{OrderMatch, OrderRecord, OrderState, Records};
use sessions::Sessions;
pub use sessions::{INSTANCE_KEPT, OrderCounts, SESSIONS};

/// How long the robot side waits before it passes a request on again that could not be sent.
const SEND_AGAIN: Duration = Duration::from_millis(100);

/// How long the robot side tries to send a request: a bridge that is restarted is back within this time. A request is
/// not sent after its deadline, which may be earlier.
const SEND_TOTAL: Duration = Duration::from_secs(2);

/// How long the robot side waits before it asks again for a request that is open at the server without a client.
const ASK_AGAIN: Duration = Duration::from_millis(500);

/// Settings of the robot side.
#[derive(Clone, Copy, Debug)]
pub struct Config {
    /// A station with an open order that was silent for so long is reported as lost; never if `None`.
    pub link_loss: Option<Duration>,
    /// How long the robot side asks for the end of a request that a former instance of the robot side had passed on.
    /// Longer than any movement takes.
    pub still_open: Duration,
}

impl Default for Config {
    fn default() -> Config {
        Config {
            link_loss: None,
            still_open: Duration::from_secs(3600),
        }
    }
}

/// The robot side of all stations' orders.
///
/// Its memory is bounded: [`SESSIONS`] · [`WINDOW`](super::message::WINDOW) + [`ORPHANS`] orders.
#[derive(Clone, Debug)]
pub struct RobotOrders {
    config: Config,
    sessions: Sessions,
    records: Records,
}

impl RobotOrders {
    /// A robot side without memory. `seed` is random: tokens of sessions must differ from those of former instances.
    pub fn new(config: Config, seed: u64) -> RobotOrders {
        RobotOrders {
            config,
            sessions: Sessions::new(seed),
            records: Records::default(),
        }
    }

    /// The session of this instance of the station `name`; call it for every clock message of a station that may
    /// command, and send the session back with the answer. It is [`NO_PLACE`](super::message::NO_PLACE) if all
    /// [`SESSIONS`] are those of stations that are active: the session of a station whose last clock message came
    /// within [`INSTANCE_KEPT`] is never forgotten for another one. It is
    /// [`NOT_PERMITTED`](super::message::NOT_PERMITTED) if another station has shown this instance. A station that is
    /// forgotten with open orders cannot be watched any more: it counts as lost.
    pub fn session_for(
        &mut self,
        station: u64,
        name: &str,
        now: MonotonicNs,
        out: &mut Vec<Output>,
    ) -> u64 {
        let (token, forgotten) = self.sessions.note_ping(station, name, now);
        if let Some(session) = forgotten {
            let limit = self.config.link_loss;
            let is_changed = limit.and_then(|limit| session.lost_at(limit)).is_some();
            if is_changed && self.records.has_open(session.token) {
                out.push(Output::LinkLost {
                    station: session.station,
                });
            }
            self.records.forget(session.token, u64::MAX, out);
        }
        token
    }

    /// An order has come.
    ///
    /// It is passed on when all orders of its session before it were here, unless it [ends a
    /// movement](Traits::ends_movement). A repetition, which nothing is begun for, waits for none either.
    ///
    /// False if its session is not known, which the sender of this order is to be told, and no other station.
    pub fn order(
        &mut self,
        order: &Order,
        traits: Traits,
        now: MonotonicNs,
        out: &mut Vec<Output>,
    ) -> bool {
        let Some(session) = self.sessions.of(order.session) else {
            return false;
        };
        session.note_message(now);
        let (station, former_floor) = (session.station, session.floor);
        let is_sent = session.see(order.number, order.floor);
        let floor = session.floor;
        if floor > former_floor {
            self.records.forget(order.session, floor, out);
        }
        if !is_sent {
            return true;
        }
        let index = match self.records.known(order, station) {
            OrderMatch::Yes(index) => index,
            OrderMatch::Moved(index) => {
                let record = &mut self.records.list[index];
                (record.session, record.number) = (Some(order.session), order.number);
                index
            }
            new => {
                let verdict = match new {
                    OrderMatch::No => judge(order, traits, now),
                    _ if order.is_repeat => Some(RelayVerdict::NotRemembered),
                    _ => Some(RelayVerdict::Busy),
                };
                if let Some(session) = self.sessions.of(order.session) {
                    session.counts.note(verdict, now);
                }
                let index = self.records.remember(order, station, verdict, now);
                if order.is_repeat || traits.ends_movement {
                    self.go_on(index, now, out);
                }
                index
            }
        };
        // A late copy of another order must not give up one that its client sent after it, with the same request id.
        if order.is_given_up && self.records.list[index].number == order.number {
            self.give_up(index, now, out);
        }
        self.answer(index, out);
        self.pass_on_in_turn(now, out);
        true
    }

    /// A report about a request has come from its server, or from the client's port.
    pub fn report(
        &mut self,
        service: u64,
        report: &RequestReport,
        now: MonotonicNs,
        out: &mut Vec<Output>,
    ) {
        let Some(index) = self.records.passed_on(service, report.request_id) else {
            return;
        };
        let still_open = self.config.still_open;
        let record = &mut self.records.list[index];
        match &mut record.state {
            OrderState::PassedOn(passage) if passage.is_repeat && is_still_open(report) => {
                if now.since(passage.since) < still_open {
                    passage.unsent_since = None;
                    record.wait(now + ASK_AGAIN);
                    return;
                }
                record.note(&RelayVerdict::StillOpen.report(report.request_id, now));
            }
            _ => record.note(report),
        }
        self.noted(index, out);
    }

    /// A request that [`Output::Send`] is about was not sent.
    pub fn not_sent(
        &mut self,
        service: u64,
        request_id: u64,
        why: NotSent,
        now: MonotonicNs,
        out: &mut Vec<Output>,
    ) {
        let Some(index) = self.records.passed_on(service, request_id) else {
            return;
        };
        let record = &mut self.records.list[index];
        let OrderState::PassedOn(passage) = &mut record.state else {
            return;
        };
        let unsent_for = passage.unsent_for(now);
        let (verdict, total) = match (why, passage.is_repeat) {
            (NotSent::NoServer, false) => (RelayVerdict::NoServer, SEND_TOTAL),
            (NotSent::NoServer, true) => (RelayVerdict::ServerGone, SEND_TOTAL),
            (NotSent::Full, false) => (RelayVerdict::TooManyRequests, SEND_TOTAL),
            (NotSent::Full, true) => (RelayVerdict::StillOpen, self.config.still_open),
        };
        if unsent_for < total {
            record.wait(now + SEND_AGAIN);
            return;
        }
        record.note(&verdict.report(request_id, now));
        self.noted(index, out);
        self.pass_on_in_turn(now, out);
    }

    /// Does what is due. Call it at [`RobotOrders::deadline`].
    pub fn tick(&mut self, now: MonotonicNs, out: &mut Vec<Output>) {
        while let Some(index) = self.records.due(now) {
            self.go_on(index, now, out);
            if !self.records.list[index].is_open() {
                self.noted(index, out);
            }
        }
        self.pass_on_in_turn(now, out);
        let Some(link_loss) = self.config.link_loss else {
            return;
        };
        for session in self.sessions.iter_mut() {
            let is_due = session.lost_at(link_loss).is_some_and(|at| at <= now);
            if is_due && self.records.has_open(session.token) {
                session.report_loss();
                out.push(Output::LinkLost {
                    station: session.station,
                });
            }
        }
    }

    /// When [`RobotOrders::tick`] is due.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        let retries = self
            .records
            .list
            .iter()
            .filter_map(OrderRecord::waits_until);
        let losses = self.config.link_loss.into_iter().flat_map(|link_loss| {
            let open = |token| self.records.has_open(token);
            let watched = self
                .sessions
                .iter()
                .filter(move |session| open(session.token));
            watched.filter_map(move |session| session.lost_at(link_loss))
        });
        retries.chain(losses).min()
    }

    /// What the station of this instance is called. `None` if it has no session.
    pub fn name_of(&self, station: u64) -> Option<&str> {
        self.sessions.name_of(station)
    }

    /// What became of the orders of this instance of a station. `None` if it has no session.
    pub fn counts_of(&self, station: u64) -> Option<OrderCounts> {
        let session = self.sessions.of_station(station)?;
        Some(OrderCounts {
            open: self.records.open(session.token),
            ..session.counts
        })
    }

    /// Orders that are remembered.
    pub fn remembered(&self) -> usize {
        self.records.list.len()
    }

    /// Passes on what has waited for orders before it.
    fn pass_on_in_turn(&mut self, now: MonotonicNs, out: &mut Vec<Output>) {
        while let Some(index) = self.records.in_turn(&self.sessions) {
            self.go_on(index, now, out);
            if !self.records.list[index].is_open() {
                self.noted(index, out);
            }
        }
        self.records.assert_sound();
    }

    /// Passes an order on, unless it has ended, or is too late now.
    fn go_on(&mut self, index: usize, now: MonotonicNs, out: &mut Vec<Output>) {
        let record = &mut self.records.list[index];
        record.go_on(now);
        if let OrderState::PassedOn(passage) = &record.state {
            out.push(Output::Send {
                station: record.station,
                service: record.service,
                request_id: record.request_id,
                is_repeat: passage.is_repeat,
                request: passage.request.clone(),
            });
        }
    }

    fn give_up(&mut self, index: usize, now: MonotonicNs, out: &mut Vec<Output>) {
        let record = &mut self.records.list[index];
        if matches!(record.state, OrderState::PassedOn(_)) {
            out.push(record.give_up());
        }
        record.note(&RelayVerdict::GivenUp.report(record.request_id, now));
    }

    /// Answers a copy of an order: with the first report, which may have been lost, and the newest.
    fn answer(&self, index: usize, out: &mut Vec<Output>) {
        let record = &self.records.list[index];
        let answers = [record.first(), record.newest()];
        out.extend(answers.into_iter().flatten().map(|answer| Output::Answer {
            station: record.station,
            answer,
        }));
    }

    /// Sends the newest report on; an order that ended without a session is forgotten.
    fn noted(&mut self, index: usize, out: &mut Vec<Output>) {
        let record = &self.records.list[index];
        if let Some(answer) = record.newest() {
            out.push(Output::Answer {
                station: record.station,
                answer,
            });
        } else if !record.is_open() {
            self.records.list.swap_remove(index);
        }
    }
}

/// What the relay itself says about an order that it sees for the first time. `None` if the server is asked.
fn judge(order: &Order, traits: Traits, now: MonotonicNs) -> Option<RelayVerdict> {
    if request_id(&order.request) == 0 {
        Some(RelayVerdict::InvalidRequest)
    } else if order.is_given_up {
        Some(RelayVerdict::GivenUp)
    } else if order.is_repeat {
        // It may have been executed: that it is too late now says nothing.
        (!traits.is_repeatable).then_some(RelayVerdict::NotRemembered)
    } else {
        (order.expires < now).then(|| RelayVerdict::Expired(now.since(order.expires)))
    }
}

/// Whether the answer to a repetition says that the request is still open at the server: its client was the robot
/// side's former instance.
fn is_still_open(report: &RequestReport) -> bool {
    report.stage() == Some(Stage::Refused) && report.reason() == Some(Reason::StillOpen)
}
