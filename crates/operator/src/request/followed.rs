//! [`FollowedOrders`]: the orders of a screen or a page that were sent to one robot, and what becomes of them.
//! Without a port and without a clock.

use std::collections::VecDeque;

use ipc_types::MonotonicNs;
use ipc_types::code::{Reason, Stage};
use ipc_types::payload::RequestReport;
use runtime::exit::ExitCode;

use crate::config::RequestConfig;
use crate::render::messages::{self, FinalReport, Verb};
use crate::request::{Exchange, Next, Outcome, Until};
use crate::robot::changes::Weight;
use crate::robot::model::WatchedRobot;

/// Most orders of a robot that are followed at a time. A further one is refused: the operator sees why nothing goes
/// on. What ends a movement has as many places more: it is pressed when nothing goes on.
const MAX_ORDERS: usize = 4;

/// Most news of orders that are kept until they are taken: more than all open orders make at a time. The oldest goes;
/// the terminal, which shows the journal, takes none.
const MAX_NEWS: usize = 64;

/// What became of an order.
#[derive(Clone, Debug, PartialEq)]
pub struct OrderNews {
    /// The number that [`FollowedOrders::begin`] has given it.
    pub number: u64,
    /// The request's id for the bridge.
    pub request_id: u64,
    /// How far it is, and why; `None` if that cannot be known, because the bridge did not answer.
    pub stage: Option<(Stage, Reason)>,
    /// Stage and reason in words.
    pub text: String,
    /// Whether nothing more follows.
    pub is_final: bool,
}

/// An order that has no final report yet.
#[derive(Debug)]
struct OpenOrder {
    number: u64,
    request_id: u64,
    verb: Verb,
    exchange: Exchange,
}

/// The orders of one robot that have no final report yet, by what came of them and when it is: what sends them is
/// around it.
#[derive(Debug, Default)]
pub struct FollowedOrders {
    open: Vec<OpenOrder>,
    /// Orders that were sent so far.
    sent: u64,
    news: VecDeque<OrderNews>,
}

impl FollowedOrders {
    /// Whether a further order of this kind may be sent.
    ///
    /// # Errors
    ///
    /// Why not.
    pub fn room(&self, verb: Verb) -> Result<(), String> {
        let most = match verb {
            Verb::Hold | Verb::Land | Verb::Stop => 2 * MAX_ORDERS,
            _ => MAX_ORDERS,
        };
        match self.open.len() >= most {
            true => Err(format!(
                "{} orders have no final report yet",
                self.open.len()
            )),
            false => Ok(()),
        }
    }

    /// An order was sent as this request. Gives its number.
    pub fn begin(
        &mut self,
        request_id: u64,
        verb: Verb,
        config: &RequestConfig,
        now: MonotonicNs,
    ) -> u64 {
        let mut exchange = Exchange::new([request_id], Until::Final, config.timeout());
        exchange.sent(now);
        self.sent += 1;
        self.open.push(OpenOrder {
            number: self.sent,
            request_id,
            verb,
            exchange,
        });
        self.sent
    }

    /// When an order is to be looked at although no report comes.
    pub fn next(&self) -> Option<MonotonicNs> {
        let due = self.open.iter().filter_map(|order| order.exchange.due());
        due.min()
    }

    /// What became of orders since the last call.
    pub fn take_news(&mut self) -> impl Iterator<Item = OrderNews> + use<> {
        std::mem::take(&mut self.news).into_iter()
    }

    /// Takes reports, and ends the orders that are over, which the journal of `robot` says; says whether anything
    /// changed.
    pub fn take(
        &mut self,
        reports: &[RequestReport],
        robot: &mut WatchedRobot,
        now: MonotonicNs,
    ) -> bool {
        for report in reports {
            for order in &mut self.open {
                let is_end =
                    FinalReport::of(report).is_some_and(|end| end.exit_code() != ExitCode::Ok);
                // How it ends is written when it is over, with the explanation.
                if order.exchange.take(report, now).is_some()
                    && !is_end
                    && let Some(line) = messages::line(order.verb, 0, 1, report)
                {
                    note(
                        &mut self.news,
                        OrderNews {
                            number: order.number,
                            request_id: order.request_id,
                            stage: report.stage().zip(report.reason()),
                            text: line.clone(),
                            is_final: FinalReport::of(report).is_some(),
                        },
                    );
                    robot.journal.add(now, Weight::Order, line);
                }
            }
        }
        let before = self.open.len();
        self.open.retain(|order| match order.exchange.next(now) {
            Next::Over(outcome) => {
                if let Some((stage, text)) = end_of(order.verb, &outcome) {
                    robot.journal.add(now, Weight::Alarm, text.clone());
                    note(
                        &mut self.news,
                        OrderNews {
                            number: order.number,
                            request_id: order.request_id,
                            stage,
                            text,
                            is_final: true,
                        },
                    );
                }
                false
            }
            _ => true,
        });
        !reports.is_empty() || self.open.len() < before
    }
}

/// How an order ended, unless its last report has said it.
fn end_of(verb: Verb, outcome: &Outcome) -> Option<(Option<(Stage, Reason)>, String)> {
    match outcome {
        Outcome::Accepted => None,
        Outcome::Final(end) if end.exit_code() == ExitCode::Ok => None,
        Outcome::Final(end) => Some((Some((end.stage, end.reason)), messages::ending(verb, end))),
        Outcome::NoAnswer(_) => {
            let text = format!(
                "{}: no answer in time, the bridge may hang; look whether it took effect all the same",
                verb.name()
            );
            Some((None, text))
        }
    }
}

fn note(news: &mut VecDeque<OrderNews>, one: OrderNews) {
    if news.len() == MAX_NEWS {
        news.pop_front();
    }
    news.push_back(one);
}
