//! [`Orders`]: orders from pages, and what becomes of them. Each is logged. What sends them, and knows the robot, is
//! around it: [`OrderPort`].
//!
//! `PageLost`: robots that a page has set in motion and that no page commands any more, and when they are to hold. A
//! page that is loaded again, or whose network comes back, takes command again, and no hold is ordered. A page that
//! is closed, hidden or silent loses command by the rules of its lease: until then it is not missing.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::{Reason, Stage};
use ipc_types::payload::{ModuleState, WaypointPosition};
use operator::config::RequestConfig;
use operator::request::followed::OrderNews;
use operator::request::ports::RobotOrder;
use operator::robot::model::WatchedRobot;

use crate::page::{self, OrderKind};

/// Most orders that are followed: those that all robots may have open at a time. The oldest goes; its outcome stays
/// in the journal.
const MAX_FOLLOWED: usize = 128;

/// A hold or a landing of a page may be so late; what other orders may be, the bridge says. The page shows by then
/// that there is no contact.
const CALM_WITHIN_MS: u32 = 5_000;

/// How often the hold of a robot that no page commands is tried at most, and how long after a try that failed: the
/// bridge may hang, or be restarted.
const TRIES: u32 = 10;
const RETRY: Duration = Duration::from_secs(1);

/// An order that comes so late has waited on its way: it was given before what the bridge has taken since.
const LATE: Duration = Duration::from_secs(2);

/// An order as a page gave it.
pub struct GivenOrder<'a> {
    /// What is ordered.
    pub order: &'a page::OrderRequest,
    /// Not later than it truly was given.
    pub issued: MonotonicNs,
    /// The page, for the log.
    pub from: &'a str,
}

/// A robot that is shown, as orders need it.
pub trait OrderPort {
    /// What is known of it.
    fn robot(&self) -> &WatchedRobot;

    /// Takes what is there of it.
    fn drain(&mut self, now: MonotonicNs);

    /// Why it is not to fly there; `None` if nothing known stands against it.
    fn refusal(&self, target: WaypointPosition, now: MonotonicNs) -> Option<String>;

    /// Sends an order that was given at `issued` or later, and gives its number.
    ///
    /// # Errors
    ///
    /// Why it was not sent.
    fn send(
        &mut self,
        order: RobotOrder,
        issued: MonotonicNs,
        config: &RequestConfig,
        now: MonotonicNs,
    ) -> Result<u64, String>;
}

/// An order that has no final report yet.
struct Followed {
    robot: u32,
    /// The number that the robot's ports gave it.
    number: u64,
    order: String,
    kind: OrderKind,
    /// The page that gave it, for the log.
    from: String,
}

/// Orders from pages that have no final report yet, and what follows when no page is there any more.
pub struct Orders {
    followed: VecDeque<Followed>,
    /// Robot and request of movements whose outcome is unknown. They may have begun all the same.
    unknown: VecDeque<(u32, u64)>,
    page_lost: PageLost,
}

impl Orders {
    /// None was given. A robot may go on without a page for `page_lost`; `None` for ever.
    pub fn new(page_lost: Option<Duration>) -> Orders {
        Orders {
            followed: VecDeque::new(),
            unknown: VecDeque::new(),
            page_lost: PageLost::new(page_lost),
        }
    }

    /// Sends an order, which the rules about pages allow, to `shown`. Gives the first report.
    pub fn take(
        &mut self,
        given: &GivenOrder<'_>,
        shown: &mut dyn OrderPort,
        config: &RequestConfig,
        now: MonotonicNs,
    ) -> page::OrderReport {
        let GivenOrder {
            order,
            issued,
            from,
        } = *given;
        let robot = order.robot;
        let mut config = config.clone();
        if order.kind.is_everyones() && config.deadline_ms == 0 {
            config.deadline_ms = CALM_WITHIN_MS;
        }
        let sent = wanted(order, shown, now).and_then(|wanted| {
            let late = now.since(issued);
            if late > LATE {
                // This process may have stood still, too.
                shown.drain(now);
            }
            if is_outdated(issued, shown.robot().last_movement, now) {
                let late_s = late.as_secs_f64();
                return Err(format!(
                    "it came {late_s:.1} s late, and another order was taken meanwhile"
                ));
            }
            shown.send(wanted, issued, &config, now)
        });
        let (stage, text) = match sent {
            Ok(number) => {
                if self.followed.len() == MAX_FOLLOWED {
                    self.followed.pop_front();
                }
                self.followed.push_back(Followed {
                    robot,
                    number,
                    order: order.order.clone(),
                    kind: order.kind,
                    from: from.to_owned(),
                });
                (page::OrderStage::Sent, "sent to the bridge".to_owned())
            }
            Err(why) => (page::OrderStage::NotSent, why),
        };
        log(robot, order.kind, &order.order, from, stage, &text);
        page::OrderReport {
            order: order.order.clone(),
            robot,
            kind: order.kind,
            stage,
            is_final: stage == page::OrderStage::NotSent,
            text,
        }
    }

    /// The robots of these that are to hold now, because a movement of a page goes on and no page commands any more.
    /// Each robot comes with the request whose movement it [carries out](operator::robot::pilot::request_under_way);
    /// each is named again, a few times, until its hold [was sent](Orders::note_held).
    pub fn deserted(
        &mut self,
        robots: impl Iterator<Item = (u32, Option<u64>)>,
        is_commanded: impl Fn(u32) -> bool,
        now: MonotonicNs,
    ) -> Vec<u32> {
        let is_deserted = |(robot, under_way): (u32, Option<u64>)| {
            let moves = self.is_followed(robot)
                || under_way.is_some_and(|id| self.unknown.contains(&(robot, id)));
            (robot, moves && !is_commanded(robot))
        };
        let robots: Vec<_> = robots.map(is_deserted).collect();
        self.page_lost.due(robots.into_iter(), now)
    }

    /// The hold of a robot that [was deserted](Orders::deserted) was sent.
    pub fn note_held(&mut self, robot: u32) {
        self.page_lost.note_held(robot);
    }

    /// Whether a movement that a page has ordered has no final report yet.
    fn is_followed(&self, robot: u32) -> bool {
        self.followed
            .iter()
            .any(|one| one.robot == robot && is_movement(one.kind))
    }

    /// What `news` of `robot` says of an order of a page; `None` if it is of another one.
    pub fn report(&mut self, robot: u32, news: &OrderNews) -> Option<page::OrderReport> {
        let is_it = |one: &Followed| (one.robot, one.number) == (robot, news.number);
        let index = self.followed.iter().position(is_it)?;
        let stage = stage(news.stage);
        let one = &self.followed[index];
        log(robot, one.kind, &one.order, &one.from, stage, &news.text);
        let report = page::OrderReport {
            order: one.order.clone(),
            robot,
            kind: one.kind,
            stage,
            text: news.text.clone(),
            is_final: news.is_final,
        };
        if news.is_final {
            if stage == page::OrderStage::Unknown && is_movement(one.kind) {
                if self.unknown.len() == MAX_FOLLOWED {
                    self.unknown.pop_front();
                }
                self.unknown.push_back((robot, news.request_id));
            }
            self.followed.remove(index);
        }
        Some(report)
    }
}

fn is_movement(kind: OrderKind) -> bool {
    matches!(kind, OrderKind::Goto | OrderKind::Takeoff)
}

/// Whether an order has waited on its way while the bridge took another one. The bridge itself judges so of all but
/// hold, land and stop, which are never too old for it.
fn is_outdated(issued: MonotonicNs, taken: Option<MonotonicNs>, now: MonotonicNs) -> bool {
    now.since(issued) > LATE && taken.is_some_and(|taken| taken > issued)
}

/// The order that is wanted, or why nothing may be sent.
fn wanted(
    order: &page::OrderRequest,
    shown: &dyn OrderPort,
    now: MonotonicNs,
) -> Result<RobotOrder, String> {
    let state = shown.robot().state.as_ref();
    if state.is_some_and(ModuleState::is_replayed) {
        return Err("this robot is a recorded flight that is played".to_owned());
    }
    match order.kind {
        OrderKind::Hold => Ok(RobotOrder::Hold),
        OrderKind::Land => Ok(RobotOrder::Land),
        OrderKind::Start => Ok(RobotOrder::Start),
        OrderKind::Stop if order.confirm.as_deref() == Some("stop") => Ok(RobotOrder::Stop),
        OrderKind::Stop => Err("a stop is confirmed by the word stop".to_owned()),
        OrderKind::Takeoff => match order.altitude_m {
            Some(height_m) if height_m.is_finite() && height_m > 0.0 => {
                Ok(RobotOrder::TakeOff(height_m))
            }
            _ => Err("a take-off needs a height".to_owned()),
        },
        OrderKind::Goto => {
            let target = target(order.position, order.altitude_m)?;
            match shown.refusal(target, now) {
                Some(why) => Err(why),
                None => Ok(RobotOrder::GoTo(target)),
            }
        }
    }
}

/// Where to fly.
pub(crate) fn target(
    position: Option<[f64; 2]>,
    altitude_m: Option<f64>,
) -> Result<WaypointPosition, String> {
    let missing = "a flight needs a place and an altitude";
    let [latitude_deg, longitude_deg] = position.ok_or(missing)?;
    Ok(WaypointPosition {
        latitude_deg,
        longitude_deg,
        altitude_m: altitude_m.ok_or(missing)?,
    })
}

fn stage(stage: Option<(Stage, Reason)>) -> page::OrderStage {
    match stage {
        None | Some((Stage::Unknown, _)) => page::OrderStage::Unknown,
        Some((Stage::Accepted, _)) => page::OrderStage::Accepted,
        Some((Stage::Progress, _)) => page::OrderStage::InProgress,
        Some((Stage::Done, _)) => page::OrderStage::Done,
        Some((Stage::Refused, _)) => page::OrderStage::Refused,
        Some((Stage::Aborted, Reason::Replaced | Reason::PathReplaced)) => {
            page::OrderStage::Replaced
        }
        Some((Stage::Aborted, _)) => page::OrderStage::Aborted,
    }
}

/// The audit trail: each order with its sender and its outcome.
fn log(robot: u32, kind: OrderKind, order: &str, from: &str, stage: page::OrderStage, text: &str) {
    tracing::info!(robot, ?kind, order, from, ?stage, "order: {text}");
}

/// When a robot that a page has set in motion, and that no page commands any more, is to hold.
#[derive(Debug)]
struct PageLost {
    /// How long a robot may go on without a page; `None` for ever.
    after: Option<Duration>,
    /// Robots whose movement goes on and that no page commands.
    deserted: BTreeMap<u32, Desertion>,
}

/// Of a robot that no page commands.
#[derive(Debug)]
struct Desertion {
    /// When it is to hold; `None` once its hold was sent, or was tried often enough.
    due: Option<MonotonicNs>,
    tries: u32,
}

impl PageLost {
    fn new(after: Option<Duration>) -> PageLost {
        PageLost {
            after,
            deserted: BTreeMap::new(),
        }
    }

    /// The robots that are to hold now, of all robots and whether each is deserted. Each is named up to [`TRIES`] times
    /// until its hold was sent, a page commands it again or its movement has ended.
    fn due(&mut self, robots: impl Iterator<Item = (u32, bool)>, now: MonotonicNs) -> Vec<u32> {
        let Some(after) = self.after else {
            return Vec::new();
        };
        let mut due = Vec::new();
        for (robot, is_deserted) in robots {
            if !is_deserted {
                self.deserted.remove(&robot);
                continue;
            }
            let desertion = self.deserted.entry(robot).or_insert(Desertion {
                due: Some(now + after),
                tries: 0,
            });
            if desertion.due.is_some_and(|due| now >= due) {
                desertion.tries += 1;
                desertion.due = (desertion.tries < TRIES).then_some(now + RETRY);
                due.push(robot);
            }
        }
        due
    }

    fn note_held(&mut self, robot: u32) {
        if let Some(desertion) = self.deserted.get_mut(&robot) {
            desertion.due = None;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: u64 = 1_000_000_000;

    #[test]
    fn a_robot_holds_once_when_it_was_deserted_for_long_enough() {
        let mut lost = PageLost::new(Some(Duration::from_secs(5)));
        for (at_s, first, second, expected) in [
            (0, false, false, &[][..]),
            (1, true, false, &[]),
            (5, true, true, &[]),
            (6, true, true, &[1]),
            (7, true, true, &[]),
            (10, true, true, &[2]),
            (20, true, true, &[]),
            // A page commands again, and is lost again.
            (21, false, true, &[]),
            (22, true, true, &[]),
            (26, true, true, &[]),
            (27, true, true, &[1]),
        ] {
            let robots = [(1, first), (2, second)].into_iter();
            let due = lost.due(robots, MonotonicNs(at_s * SECOND));
            assert_eq!(due, expected, "{at_s} s");
            due.into_iter().for_each(|robot| lost.note_held(robot));
        }
    }

    #[test]
    fn a_hold_that_cannot_be_sent_is_tried_again_a_few_times() {
        let mut lost = PageLost::new(Some(Duration::from_secs(5)));
        let mut due = |tenth: u64, is_deserted: bool| {
            let now = MonotonicNs(tenth * SECOND / 10);
            !lost.due([(1, is_deserted)].into_iter(), now).is_empty()
        };
        let tries: Vec<u64> = (0..1000).filter(|tenth| due(*tenth, true)).collect();
        let expected: Vec<u64> = (0..u64::from(TRIES)).map(|one| 50 + 10 * one).collect();
        assert_eq!(tries, expected);
        // A page that commanded in between begins all of it anew.
        assert!(!due(1000, false));
        let again: Vec<u64> = (1000..1100).filter(|tenth| due(*tenth, true)).collect();
        assert_eq!(again.len(), 5);
    }

    #[test]
    fn a_movement_that_may_have_begun_though_its_outcome_is_unknown_is_held_as_well() {
        let begun = 77;
        let gone = Some((Stage::Unknown, Reason::BridgeGone));
        let refused = Some((Stage::Refused, Reason::TooLate));
        for (kind, stage, under_way, expected) in [
            (OrderKind::Goto, None, Some(begun), &[1][..]),
            (OrderKind::Goto, gone, Some(begun), &[1]),
            (OrderKind::Takeoff, None, Some(begun), &[1]),
            (OrderKind::Goto, refused, Some(begun), &[]),
            (OrderKind::Goto, None, Some(78), &[]),
            (OrderKind::Goto, None, None, &[]),
            (OrderKind::Land, None, Some(begun), &[]),
        ] {
            let mut orders = Orders::new(Some(Duration::from_secs(5)));
            orders.followed.push_back(Followed {
                robot: 1,
                number: 3,
                order: "a".to_owned(),
                kind,
                from: "a page".to_owned(),
            });
            let news = OrderNews {
                number: 3,
                request_id: begun,
                stage,
                text: "no answer in time".to_owned(),
                is_final: true,
            };
            assert!(orders.report(1, &news).is_some_and(|said| said.is_final));
            let mut due = |at_s: u64| {
                let robots = [(1, under_way), (2, Some(begun))].into_iter();
                orders.deserted(robots, |_| false, MonotonicNs(at_s * SECOND))
            };
            assert!(due(1).is_empty());
            assert_eq!(due(6), expected, "{kind:?} {under_way:?}");
        }
    }

    #[test]
    fn what_has_waited_while_another_order_was_taken_is_outdated() {
        let at = |ms: u64| MonotonicNs(ms * 1_000_000);
        for (issued_ms, taken_ms, is) in [
            (10_000, None, false),
            (10_000, Some(9_000), false),
            (10_000, Some(15_000), true),
            // It came as quickly as orders do: what the page showed was a little older than the press.
            (20_500, Some(21_000), false),
            (19_999, Some(21_000), true),
        ] {
            let outdated = is_outdated(at(issued_ms), taken_ms.map(at), at(22_000));
            assert_eq!(outdated, is, "{issued_ms} {taken_ms:?}");
        }
    }

    #[test]
    fn without_a_time_nothing_is_held() {
        let mut lost = PageLost::new(None);
        for at_s in [0, 3600, 86_400] {
            let due = lost.due([(1, true)].into_iter(), MonotonicNs(at_s * SECOND));
            assert!(due.is_empty());
        }
    }
}
