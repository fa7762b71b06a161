//! How a mission begins: what a command means while one waits for its arming or its start, and with which item it
//! begins.

use bridge::BridgeConfig;
use ipc_types::MonotonicNs;
use ipc_types::code::Reason;
use plans::flight::Step;
use plans::mavlink::command as item;

use super::Gateway;
use super::pending::Pending;
use crate::commands::CommandKey;
use crate::decide::{Decision, MissionAsk, OrderPair};
use crate::event::{Event, OrderKind, Task};
use crate::message::MISSION_CURRENT;
use crate::mission::check::check_mission;
use crate::mission::{PRIMED, Run, Starting};
use crate::number::{MavResult, MavSeverity};
use crate::stations::StationAddress;
use crate::verdict::CommandAck;

impl Gateway {
    /// What a command means while a start is under way, which a disarming stops, and while a mission waits for its
    /// arming, which that of the same station is. Any other order ends the waiting.
    pub(super) fn with_start(
        &mut self,
        key: &CommandKey,
        decision: Decision,
        now: MonotonicNs,
    ) -> Decision {
        if key.is_switch()
            && matches!(decision, Decision::Answer(answer, _) if answer.is_accepted())
        {
            let kind = match key.is_disarming() {
                true => OrderKind::Stop,
                false => OrderKind::Start,
            };
            if self.is_switching() {
                return OrderPair::one(kind);
            }
            if kind == OrderKind::Stop {
                self.cancel_start_of_mission(now);
            }
        }
        let primed_by = self.missions.primed.map(|(sender, _)| sender);
        match (primed_by, &decision) {
            (None, _) | (_, Decision::Answer(..) | Decision::Mission(_)) => decision,
            (Some(sender), Decision::Orders(orders))
                if sender == key.sender
                    && (orders.first, orders.then) == (OrderKind::Start, None) =>
            {
                Decision::Mission(MissionAsk::Start {
                    first: None,
                    arms: true,
                })
            }
            _ => {
                self.missions.primed = None;
                decision
            }
        }
    }

    /// Whether the module is being started or stopped, or was so recently that the bridge's state does not show it yet:
    /// then it is not known whether it is started.
    fn is_switching(&self) -> bool {
        let is_switch = |one: &Pending| matches!(one.kind, OrderKind::Start | OrderKind::Stop);
        let published = self.vehicle.last_state().map(|state| state.published());
        let is_unseen = |at| published.is_none_or(|published| published <= at);
        self.pending.iter().any(is_switch) || self.switched.is_some_and(is_unseen)
    }

    /// Whether an order would move the helicopter in the middle of the mission of another station.
    pub(super) fn is_mission_of_another(&self, sender: StationAddress, kind: OrderKind) -> bool {
        let run = self.missions.run.as_ref();
        let is_another =
            run.is_some_and(|run| run.executor.is_running() && run.key.sender != sender);
        is_another && matches!(kind, OrderKind::GoTo(_) | OrderKind::TakeOff(_))
    }

    /// A command about the mission.
    pub(super) fn mission_asked(&mut self, key: CommandKey, asked: MissionAsk, now: MonotonicNs) {
        match asked {
            MissionAsk::SetCurrent(sequence) => {
                self.set_current(key, sequence, now);
            }
            MissionAsk::Start { first, arms } => self.start_mission(key, first, arms, now),
        }
    }

    fn start_mission(&mut self, key: CommandKey, first: Option<u16>, arms: bool, now: MonotonicNs) {
        let total = self.missions.mission.count();
        let Some(known) = self.vehicle.now() else {
            let why = "the helicopter is not heard";
            return self.refuse_for_now(&key, Reason::LinkDown, why, now);
        };
        if self.missions.saving.is_some() {
            let why = "another mission is just coming into force";
            return self.refuse_for_now(&key, Reason::Busy, why, now);
        }
        if total == 0 || first.is_some_and(|first| first >= total) {
            let why = match total {
                0 => "there is none: send one first",
                _ => "there is no such item",
            };
            return self.refuse_mission(&key, MavResult::Denied, Reason::None, why, now);
        }
        if self.missions.is_running() && first.is_none() {
            return self.settle(&key, CommandAck::plain(MavResult::Accepted), now);
        }
        if self.missions.is_in_use() {
            let why = "it is flown: press Pause first";
            return self.refuse_for_now(&key, Reason::Busy, why, now);
        }
        if !known.is_started() {
            if let Some(why) = known.not_ready() {
                return self.refuse_for_now(&key, Reason::None, why, now);
            }
            if !arms && !known.is_flying() {
                self.missions.primed = Some((key.sender, now + PRIMED));
                return self.settle(&key, CommandAck::plain(MavResult::Accepted), now);
            }
        }
        let from = first.map_or(self.missions.next, |first| u32::from(first) + 1);
        self.ask_to_start(key, from);
    }

    fn ask_to_start(&mut self, key: CommandKey, from: u32) {
        self.missions.primed = None;
        self.missions.starting = Some(Starting {
            key,
            from,
            issued: self.frame.came,
            until: self.frame.came + self.settings.answer_within,
        });
        self.ask(Task::Rules);
    }

    /// What the helicopter is now stands against it; later it may be possible.
    pub(super) fn refuse_for_now(
        &mut self,
        key: &CommandKey,
        reason: Reason,
        why: &str,
        now: MonotonicNs,
    ) {
        self.refuse_mission(key, MavResult::TemporarilyRejected, reason, why, now);
    }

    fn refuse_mission(
        &mut self,
        key: &CommandKey,
        result: MavResult,
        reason: Reason,
        why: &str,
        now: MonotonicNs,
    ) {
        self.settle(key, CommandAck { result, reason }, now);
        let text = format!("the mission was refused: {why}");
        self.tell(key.sender, MavSeverity::Error, &text, now);
    }

    /// Goes on with another item: at once if the mission is flown, and else with the next start.
    pub(super) fn set_current(&mut self, key: CommandKey, sequence: u16, now: MonotonicNs) {
        let sender = key.sender;
        let run = self
            .missions
            .run
            .as_ref()
            .filter(|run| run.executor.is_running());
        let refused = if sequence >= self.missions.mission.count() {
            Some((MavResult::Denied, Reason::None, "there is no such item"))
        } else if self.missions.starting.is_some() || self.missions.saving.is_some() {
            Some((
                MavResult::TemporarilyRejected,
                Reason::Busy,
                "it is being started, or comes into force",
            ))
        } else if run.is_some_and(|run| run.key.sender != sender) {
            let why = "another station flies it: press Pause first";
            Some((MavResult::TemporarilyRejected, Reason::Busy, why))
        } else if run.is_some_and(|run| !can_leave(run.executor.step())) {
            let why = "the helicopter takes off or lands";
            Some((MavResult::TemporarilyRejected, Reason::UnableToAbort, why))
        } else {
            None
        };
        if let Some((result, reason, why)) = refused {
            self.refuse_mission(&key, result, reason, why, now);
        } else if run.is_some() {
            self.ask_to_start(key, u32::from(sequence) + 1);
        } else {
            self.missions.next = u32::from(sequence) + 1;
            self.settle(&key, CommandAck::plain(MavResult::Accepted), now);
            self.send_message(sender, MISSION_CURRENT.id, 0);
        }
    }

    /// Checks the mission as the helicopter is now, and begins it.
    pub(super) fn begin_mission(
        &mut self,
        starting: Starting,
        rules: Option<&BridgeConfig>,
        now: MonotonicNs,
    ) {
        let Starting {
            key, from, issued, ..
        } = starting;
        let Some(known) = self.vehicle.now() else {
            let why = "the helicopter is not heard";
            return self.refuse_for_now(&key, Reason::LinkDown, why, now);
        };
        let Some(here) = known.position() else {
            let why = "the position is not known";
            return self.refuse_for_now(&key, Reason::NoPosition, why, now);
        };
        let (is_flying, is_started) = (known.is_flying(), known.is_started());
        let mission = self.missions.mission.clone();
        let first = mission.items().get(from as usize - 1);
        let is_up = is_flying && first.is_some_and(|first| first.command() == item::TAKE_OFF);
        let from = match is_up && from < u32::from(mission.count()) {
            true => from + 1,
            false => from,
        };
        let checked = check_mission(
            &mission,
            from,
            &self.conditions(rules, Some((here, is_flying))),
        );
        let checked = match checked {
            Ok(checked) => checked,
            Err(refusal) => {
                return self.refuse_mission(
                    &key,
                    MavResult::Denied,
                    Reason::None,
                    &refusal.text,
                    now,
                );
            }
        };
        let follows = self
            .missions
            .run
            .as_ref()
            .is_some_and(|run| run.order.is_some() && run.executor.is_running());
        if follows && matches!(checked.flight.steps.first(), Some(Step::Wait { .. })) {
            let why = "that item hovers where the helicopter is: press Pause first";
            return self.refuse_for_now(&key, Reason::Busy, why, now);
        }
        let log = format!(
            "mission from item {from} by {} at {}",
            key.sender, key.sender.address
        );
        self.note(Event::Commanded(log));
        self.stations.count_command(key.sender, now);
        let starting = Starting { from, ..starting };
        self.missions.run = Some(Run::new(&mission, &checked.flight, &starting));
        if is_started {
            self.drive_mission(now);
        } else {
            self.send_step(OrderKind::Start, Vec::new(), issued);
        }
    }
}

/// Whether the bridge ends this step for another one.
fn can_leave(step: Option<&Step>) -> bool {
    !matches!(step, Some(Step::TakeOff { .. } | Step::Land { .. }))
}
