//! What becomes of a movement whose station says nothing any more.
//!
//! | the station's movement | `continue` | `hold` | `land` |
//! |---|---|---|---|
//! | a path | goes on | the helicopter holds | it lands |
//! | a mission | goes on | is paused, the helicopter holds | is paused, it lands |
//! | a take-off that waits for its start | goes on | is not begun | is not begun |
//! | a take-off, which nothing interrupts | goes on; it ends in a hover | goes on | it lands when the take-off is done |
//! | a return or a landing, which end on the ground | goes on | goes on | goes on |
//! | none, or that of another station or program | – | – | – |

use ipc_types::MonotonicNs;

use super::Gateway;
use super::pending::Pending;
use crate::commands::{CommandKey, Subject};
use crate::event::{Event, OrderKind};
use crate::number::{MavResult, MavSeverity};
use crate::settings::StationLost;
use crate::stations::StationAddress;
use crate::verdict::CommandAck;

impl Gateway {
    pub(super) fn look_for_lost_stations(&mut self, now: MonotonicNs) {
        for lost in self.stations.take_lost(now) {
            self.station_lost(lost, now);
        }
    }

    fn station_lost(&mut self, lost: StationAddress, now: MonotonicNs) {
        let kind = match self.settings.station_lost {
            StationLost::Continue => None,
            StationLost::Hold => Some(OrderKind::Hold),
            StationLost::Land => Some(OrderKind::Land),
        };
        if self.flies_mission_of(lost) {
            return self.mission_of_lost(lost, kind, now);
        }
        let waiting = |one: &&mut Pending| {
            one.key.sender == lost && one.kind == OrderKind::Start && one.then.is_some()
        };
        if let Some(start) = self.pending.iter_mut().find(waiting) {
            if kind.is_none() {
                return self.tell_lost(lost, "its take-off goes on", None, now);
            }
            start.then = None;
            let unanswered = (!start.is_answered).then_some(start.key);
            start.is_answered = true;
            if let Some(key) = unanswered {
                self.settle(&key, CommandAck::plain(MavResult::Cancelled), now);
            }
            return self.tell_lost(lost, "its take-off is not begun", None, now);
        }
        let moving = |one: &&mut Pending| one.key.sender == lost && one.is_movement();
        let movement = self.pending.iter_mut().find(moving);
        let (then, order) = match (movement, kind) {
            (None, _) => ("it had ordered no movement that is under way", None),
            (Some(_), None) => ("its movement goes on", None),
            (Some(one), Some(_)) if one.is_return => ("its return goes on", None),
            (Some(one), Some(kind)) => match (one.kind, kind) {
                (OrderKind::TakeOff(_), OrderKind::Land) => {
                    one.then = Some(OrderKind::Land);
                    ("the helicopter lands after its take-off", None)
                }
                (OrderKind::TakeOff(_), _) => ("its take-off goes on", None),
                // The path of a mission that was stopped, for want of an answer of the bridge, as any other.
                (_, kind) => {
                    let then = match kind {
                        OrderKind::Land => "the helicopter lands",
                        _ => "the helicopter holds",
                    };
                    (then, Some((kind, one.key, one.request_id)))
                }
            },
        };
        self.tell_lost(lost, then, order, now);
    }

    fn flies_mission_of(&self, sender: StationAddress) -> bool {
        let run = self.missions.run.as_ref();
        run.is_some_and(|run| run.key.sender == sender && run.executor.is_running())
    }

    fn mission_of_lost(&mut self, lost: StationAddress, kind: Option<OrderKind>, now: MonotonicNs) {
        let (Some(kind), Some(run)) = (kind, &mut self.missions.run) else {
            return self.tell_lost(lost, "its mission goes on", None, now);
        };
        let (key, before) = (run.key, run.before);
        let step = self
            .pending
            .iter_mut()
            .find(|one| Some(one.number) == run.order);
        // A hover between two steps follows the one before.
        let after = step.as_ref().map_or(before, |step| step.request_id);
        let (then, order) = match (step.as_ref().map(|step| step.kind), step) {
            (Some(OrderKind::Land), _) => ("its landing goes on", None),
            (Some(OrderKind::TakeOff(_)), Some(step)) if kind == OrderKind::Land => {
                // It is no step of a mission any more that would go on.
                (step.then, step.is_mission, run.order) = (Some(kind), false, None);
                ("the helicopter lands after its take-off", None)
            }
            (Some(OrderKind::TakeOff(_)), _) => ("its mission is paused after the take-off", None),
            _ if kind == OrderKind::Land => ("the helicopter lands", Some((kind, key, after))),
            _ => ("its mission is paused", Some((kind, key, after))),
        };
        self.pause_mission(now);
        self.tell_lost(lost, then, order, now);
    }

    fn tell_lost(
        &mut self,
        lost: StationAddress,
        then: &str,
        order: Option<(OrderKind, CommandKey, u64)>,
        now: MonotonicNs,
    ) {
        let text = format!("{lost} is lost: {then}");
        let mut others = self.stations.addresses();
        others.retain(|address| *address != lost.address);
        match order {
            None => {
                self.note(Event::Note(text.clone()));
                self.say(&others, MavSeverity::Notice, &text, now);
            }
            Some((kind, key, after)) => {
                self.note(Event::Warning(text.clone()));
                self.say(&others, MavSeverity::Critical, &text, now);
                self.order_by_itself(kind, key, after, now);
            }
        }
    }

    /// An order that no station waits for. It ends what the request `after` has begun, and nothing newer.
    fn order_by_itself(&mut self, kind: OrderKind, key: CommandKey, after: u64, now: MonotonicNs) {
        self.cancel_what_follows(now);
        self.commands.order(None, Subject::Motion, true, self.frame);
        self.send_order(Pending {
            number: 0,
            request_id: 0,
            kind,
            key,
            then: None,
            is_return: false,
            is_mission: false,
            path: Vec::new(),
            issued: now,
            answer_by: now,
            is_answered: true,
            is_accepted: false,
            after,
        });
    }
}
