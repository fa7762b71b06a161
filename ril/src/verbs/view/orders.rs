//! [`Orders`]: orders and checks from pages, by the code that sends those of `ril watch`, and what becomes of them. Each is logged.

use std::collections::VecDeque;

use ipc_types::MonotonicNs;
use ipc_types::code::{Reason, Stage};
use ipc_types::payload::{ModuleState, WaypointPosition};
use view::page::{self, OrderKind};

use super::check::{self, Checked};
use super::fleet::ShownRobot;
use crate::config::RequestConfig;
use crate::request::order::RobotOrder;
use crate::request::ports::OrderNews;

/// Most orders that are followed: those that all robots may have open at a time. The oldest goes; its outcome stays in the journal.
const MAX_FOLLOWED: usize = 128;

/// An order that has no final report yet.
struct Followed {
    robot: u32,
    /// As the robot's ports call it.
    number: u64,
    order: String,
    kind: OrderKind,
    /// The page or client that gave it, for the log.
    from: String,
}

/// See the module's documentation.
#[derive(Default)]
pub(super) struct Orders {
    followed: VecDeque<Followed>,
}

impl Orders {
    /// Sends `order`, which the rules about pages allow, to `shown`. Gives the first report.
    pub fn take(
        &mut self,
        order: &page::OrderRequest,
        from: &str,
        shown: &mut ShownRobot,
        config: &RequestConfig,
        now: MonotonicNs,
    ) -> page::OrderReport {
        let robot = order.robot;
        let sent = wanted(order, shown, now).and_then(|wanted| {
            let sent = shown.ports.send(wanted, config, &mut shown.robot, now);
            sent.map_err(|failure| failure.chain().join(": "))?
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

    /// Whether a movement that a page has ordered goes on.
    pub fn moves(&self, robot: u32) -> bool {
        let is_movement = |kind| matches!(kind, OrderKind::Goto | OrderKind::Takeoff);
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
            self.followed.remove(index);
        }
        Some(report)
    }
}

/// The order that is wanted, or why nothing may be sent.
fn wanted(
    order: &page::OrderRequest,
    shown: &ShownRobot,
    now: MonotonicNs,
) -> Result<RobotOrder, String> {
    let state = shown.robot.state.as_ref();
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
            match check_go_to(shown, target, now).refusal() {
                Some(finding) => Err(finding.text.clone()),
                None => Ok(RobotOrder::GoTo(target)),
            }
        }
    }
}

/// Where to fly.
pub(super) fn target(
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

/// Whether the flight would be taken.
pub(super) fn check_go_to(
    shown: &ShownRobot,
    target: WaypointPosition,
    now: MonotonicNs,
) -> Checked {
    check::go_to(&shown.robot, shown.fence(), target, now)
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
