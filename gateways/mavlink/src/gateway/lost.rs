//! What becomes of a movement whose station says nothing any more.
//!
//! | the station's movement | `continue` | `hold` | `land` |
//! |---|---|---|---|
//! | a path | goes on | the helicopter holds | it lands |
//! | a take-off, which nothing interrupts | goes on; it ends in a hover | goes on | it lands when the take-off is done |
//! | a return or a landing, which end on the ground | goes on | goes on | goes on |
//! | a mission | goes on | it is paused, in what the row of its step says | the same, and it lands |
//! | none, or that of another station or program | – | – | – |

use ipc_types::MonotonicNs;
use plans::flight::Step;

use super::Gateway;
use super::pending::Pending;
use crate::commands::Key;
use crate::event::{Event, OrderKind};
use crate::number::Severity;
use crate::settings::StationLost;
use crate::stations::Sender;

impl Gateway {
    pub(super) fn look_for_lost_stations(&mut self, now: MonotonicNs) {
        for lost in self.stations.take_lost(now) {
            self.station_lost(lost, now);
        }
    }

    fn station_lost(&mut self, lost: Sender, now: MonotonicNs) {
        let kind = match self.settings.station_lost {
            StationLost::Continue => None,
            StationLost::Hold => Some(OrderKind::Hold),
            StationLost::Land => Some(OrderKind::Land),
        };
        let mission = self.missions.run.as_ref();
        let mission = mission.filter(|run| run.executor.is_running() && run.key.sender == lost);
        let is_landing =
            mission.is_some_and(|run| matches!(run.executor.step(), Some(Step::Land { .. })));
        let mission = mission.map(|run| run.key);
        let moving = |one: &&mut Pending| one.key.sender == lost && one.is_movement();
        let movement = self.pending.iter_mut().find(moving);
        let (then, order) = match (movement, kind) {
            (None, _) if is_landing => ("its landing goes on", None),
            (None, Some(OrderKind::Land)) if mission.is_some() => (
                "the helicopter lands",
                mission.map(|key| (OrderKind::Land, key)),
            ),
            (None, Some(_)) if mission.is_some() => ("its mission is paused", None),
            (None, None) if mission.is_some() => ("its mission goes on", None),
            (None, _) => ("it had ordered no movement that is under way", None),
            (Some(_), None) => ("its movement goes on", None),
            (Some(one), Some(_)) if one.is_return => ("its return goes on", None),
            (Some(one), Some(kind)) => match (one.kind, kind) {
                (OrderKind::GoTo(_) | OrderKind::Path, kind) => match kind {
                    OrderKind::Land => ("the helicopter lands", Some((kind, one.key))),
                    _ => ("the helicopter holds", Some((kind, one.key))),
                },
                (_, OrderKind::Land) => {
                    (one.then, one.is_mission) = (Some(OrderKind::Land), false);
                    ("the helicopter lands after its take-off", None)
                }
                _ => ("its take-off goes on", None),
            },
        };
        if mission.is_some() && kind.is_some() && !is_landing {
            self.pause_mission(now);
        }
        let text = format!("{lost} is lost: {then}");
        let mut others = self.stations.addresses();
        others.retain(|address| *address != lost.address);
        match order {
            None => {
                self.note(Event::Note(text.clone()));
                self.say(&others, Severity::Notice, &text, now);
            }
            Some((kind, key)) => {
                self.note(Event::Warning(text.clone()));
                self.say(&others, Severity::Critical, &text, now);
                self.order_by_itself(kind, key, now);
            }
        }
    }

    /// An order that no station waits for.
    fn order_by_itself(&mut self, kind: OrderKind, key: Key, now: MonotonicNs) {
        self.cancel_what_follows(now);
        self.send_order(Pending {
            number: 0,
            kind,
            key,
            then: None,
            is_return: false,
            is_mission: false,
            path: Vec::new(),
            issued: now,
            is_answered: true,
            progress_at: now,
        });
    }
}
