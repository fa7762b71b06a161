//! Commands become orders, and reports become answers.

use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::{Functionality, Reason, Stage};
use ipc_types::payload::{RequestReport, WaypointPosition};
use plans::mavlink::command_name;

use super::pending::Pending;
use super::{Gateway, Origin};
use crate::commands::{CommandKey, Copy, Form, Since};
use crate::decide::{
    Decision, JudgedCommand, OrderPair, VehicleFacts, decide, decide_guided, decide_mode,
};
use crate::event::{Event, Order, OrderKind};
use crate::home::Home;
use crate::mission::store::Item;
use crate::number::{MavResult, MavSeverity, command};
use crate::received::VehicleCommand;
use crate::stations::StationAddress;
use crate::verdict::{CommandAck, answer_of};

/// Most orders without a final report: the bridge has eight for a client. One is kept for hold and land.
pub(super) const MAX_ORDERS: usize = 8;

/// A hold is not sent again so soon after the last one while the helicopter holds: a flood of them is one.
const HOLD_PERIOD: Duration = Duration::from_millis(100);

/// The answer to a command for which there is no room.
const TOO_MANY: CommandAck = CommandAck {
    result: MavResult::TemporarilyRejected,
    reason: Reason::TooManyRequests,
};

impl Gateway {
    pub(super) fn command(
        &mut self,
        sender: StationAddress,
        is_station: bool,
        asked: &VehicleCommand,
        now: MonotonicNs,
    ) {
        let is_request = matches!(
            asked.command,
            command::GET_HOME_POSITION
                | command::GET_MESSAGE_INTERVAL
                | command::SET_MESSAGE_INTERVAL
                | command::REQUEST_MESSAGE
                | command::REQUEST_CAPABILITIES
        );
        let item = asked.item();
        if is_request {
            let result = match is_station {
                true => self.message_request(sender, &item, now),
                false => MavResult::TemporarilyRejected,
            };
            self.acknowledge(sender, asked.command, CommandAck::plain(result));
            return;
        }
        let key = CommandKey::new(sender, Form::Command(asked.command), asked.bits());
        if asked.system != self.settings.system {
            // A command to all systems is one to none in particular.
            self.answer(&key, CommandAck::plain(MavResult::Denied));
            return self.name_the_system(sender, &command_name(asked.command), now);
        }
        let judged = decide(&item, &self.facts());
        self.carry_out(key, is_station, judged, now);
    }

    /// An item has come that is to be flown to at once.
    pub(super) fn guided_item(&mut self, origin: Origin, item: &Item) {
        let key = CommandKey::new(origin.sender, Form::GuidedItem, item.bits());
        let judged = decide_guided(&item.read(), item.current(), &self.facts());
        self.carry_out(key, origin.is_station, judged, origin.now);
    }

    pub(super) fn set_mode(
        &mut self,
        sender: StationAddress,
        is_station: bool,
        custom: u32,
        now: MonotonicNs,
    ) {
        let mut bits = [0; 8];
        bits[0] = custom;
        let key = CommandKey::new(sender, Form::Mode, bits);
        let decision = decide_mode(custom, &self.facts());
        self.carry_out(key, is_station, decision.into(), now);
    }

    pub(super) fn facts(&self) -> VehicleFacts<'_> {
        VehicleFacts {
            known: self.vehicle.now(),
            last_state: self.vehicle.last_state(),
            home: &self.home,
            settings: &self.settings,
        }
    }

    /// Why a sender may not command; `None` if it may.
    pub(super) fn not_permitted(
        &self,
        sender: StationAddress,
        is_station: bool,
    ) -> Option<(MavResult, &'static str)> {
        if !is_station && self.stations.is_full() {
            Some((
                MavResult::TemporarilyRejected,
                "eight stations are connected already",
            ))
        } else if !is_station {
            Some((
                MavResult::Denied,
                "send a HEARTBEAT before the first command",
            ))
        } else {
            let why = self.settings.bars(sender, self.signing.is_some());
            why.map(|why| (MavResult::Denied, why))
        }
    }

    pub(super) fn carry_out(
        &mut self,
        mut key: CommandKey,
        is_station: bool,
        judged: JudgedCommand,
        now: MonotonicNs,
    ) {
        let JudgedCommand { decision, notices } = judged;
        if let Some((result, why)) = self.not_permitted(key.sender, is_station) {
            self.answer(&key, CommandAck::plain(result));
            self.tell(key.sender, MavSeverity::Error, why, now);
            return;
        }
        let copy = match self.commands.look(&key, self.frame, now) {
            Copy::Past(Since::Own | Since::Others) if self.goes_on(&key) => {
                Copy::Answered(CommandAck::plain(MavResult::Accepted))
            }
            copy => copy,
        };
        let outdated = "it was sent before a newer order";
        let refused = match (copy, &decision) {
            (Copy::Open | Copy::Doubled, _) => return,
            // How the helicopter is now decides whether it may be disarmed, not how it was when that was asked before.
            (Copy::Answered(answer), Decision::Answer(fresh, _))
                if fresh.is_accepted() || !answer.is_accepted() || key.is_disarming() =>
            {
                None
            }
            (Copy::Answered(answer), _) => {
                self.answer(&key, answer);
                if !answer.is_accepted() {
                    let what = decision.name();
                    let text = format!(
                        "{what} came again, and was refused just before: {}",
                        answer.reason
                    );
                    self.tell(key.sender, MavSeverity::Error, &text, now);
                }
                return;
            }
            (Copy::Outdated, Decision::Answer(fresh, _)) if fresh.is_accepted() => Some(outdated),
            (_, Decision::Answer(..)) => None,
            (Copy::Outdated, decision) if !decision.is_stop() => Some(outdated),
            (Copy::Past(Since::Others), decision) if !decision.ends_something() => {
                Some("another order came in between; repeat it when you still want it")
            }
            (Copy::Past(Since::Stop), decision) if decision.moves() => {
                Some("a stop came in between; repeat it when you still want it")
            }
            _ => None,
        };
        let refused = refused.map(|why| (Reason::Superseded, why.to_owned()));
        let refused = refused.or_else(|| Some((Reason::TooLate, self.too_late(&decision, now)?)));
        if let Some((reason, why)) = refused {
            let result = MavResult::TemporarilyRejected;
            let answer = CommandAck { result, reason };
            if reason == Reason::TooLate {
                self.commands.refuse_late(&key, answer, now);
            }
            self.answer(&key, answer);
            let text = format!("{} was refused: {why}", decision.name());
            return self.tell(key.sender, MavSeverity::Error, &text, now);
        }
        let decision = self.with_start(&key, decision, now);
        let is_answer = matches!(decision, Decision::Answer(..));
        if !is_answer && !self.commands.take(&mut key, decision.is_stop(), self.frame) {
            let text = "the command was refused: too many of this station wait for an answer or have just got one";
            self.answer(&key, TOO_MANY);
            return self.tell(key.sender, MavSeverity::Error, text, now);
        }
        let is_refusal = matches!(&decision, Decision::Answer(answer, _) if !answer.is_accepted());
        for notice in notices.iter().filter(|_| !is_refusal) {
            self.tell(key.sender, MavSeverity::Notice, notice, now);
        }
        match decision {
            Decision::Answer(answer, text) => {
                self.answer(&key, answer);
                if let Some((severity, text)) = text {
                    self.tell(key.sender, severity, &text, now);
                }
            }
            Decision::SetHome(position) => {
                self.home = Home::Operator(position);
                self.settle(&key, CommandAck::plain(MavResult::Accepted), now);
                let WaypointPosition {
                    latitude_deg,
                    longitude_deg,
                    altitude_m,
                } = position;
                let above_sea_m = altitude_m + self.settings.zero_above_sea_m.unwrap_or(0.0);
                let text = format!(
                    "home was set by {}: {latitude_deg:.6}, {longitude_deg:.6}, {above_sea_m:.1} m above sea",
                    key.sender
                );
                self.tell_the_others(key.sender, &text, now);
                self.note(Event::Commanded(text));
            }
            Decision::Orders(orders) => self.order(key, orders, now),
            Decision::Mission(asked) => self.mission_asked(key, asked, now),
        }
    }

    /// Whether the movement of an equal command is the newest order, was accepted and has no end: what was ordered
    /// since was refused.
    fn goes_on(&self, key: &CommandKey) -> bool {
        self.pending.last().is_some_and(|newest| {
            newest.is_movement() && newest.is_accepted && newest.key.looks_like(key)
        })
    }

    /// Why a command is too old to be carried out: it has waited to be read. What stops something is worth waiting for.
    fn too_late(&self, decision: &Decision, now: MonotonicNs) -> Option<String> {
        let is_needless = matches!(decision, Decision::Answer(..)) || decision.ends_something();
        let age = self.age_of_frame(now)?;
        (!is_needless).then(|| format!("it came {:.1} s ago; repeat it", age.as_secs_f64()))
    }

    /// How long ago the frame came that is read, if that is too long for what it orders.
    pub(super) fn age_of_frame(&self, now: MonotonicNs) -> Option<Duration> {
        let age = now.since(self.frame.came);
        (age >= self.settings.answer_within).then_some(age)
    }

    pub(super) fn order(&mut self, key: CommandKey, orders: OrderPair, now: MonotonicNs) {
        let kind = orders.first;
        let name = match orders.is_return {
            true => "return",
            false => kind.name(),
        };
        let is_repeated = kind == OrderKind::Hold
            && self
                .last_hold
                .is_some_and(|last| now.since(last) < HOLD_PERIOD)
            && self.vehicle.now().is_some_and(|known| known.is_holding())
            && self.pending.iter().all(|one| one.kind == OrderKind::Hold)
            && !self.missions.is_running();
        if is_repeated {
            self.stations.count_command(key.sender, now);
            return self.settle(&key, CommandAck::plain(MavResult::Accepted), now);
        }
        if self.pending.len() + usize::from(!kind.is_stop()) >= MAX_ORDERS {
            let text = format!("{name} was refused: too many orders have no end yet");
            self.tell(key.sender, MavSeverity::Error, &text, now);
            return self.settle(&key, TOO_MANY, now);
        }
        if self.is_mission_of_another(key.sender, kind) {
            let answer = CommandAck {
                result: MavResult::TemporarilyRejected,
                reason: Reason::Busy,
            };
            let text =
                format!("{name} was refused: another station flies a mission; press Pause first");
            self.tell(key.sender, MavSeverity::Error, &text, now);
            return self.settle(&key, answer, now);
        }
        self.last_hold = (kind == OrderKind::Hold).then_some(now);
        if matches!(kind, OrderKind::Speed(_)) {
            self.replace_speed_writes();
        }
        if kind.is_stop() || kind == OrderKind::Stop {
            self.cancel_what_follows(now);
            self.cancel_start_of_mission(now);
        }
        let log = format!("{name} by {} at {}", key.sender, key.sender.address);
        self.note(Event::Commanded(log));
        self.stations.count_command(key.sender, now);
        self.send_order(Pending {
            number: 0,
            request_id: 0,
            kind,
            key,
            then: orders.then,
            is_return: orders.is_return,
            is_mission: false,
            path: Vec::new(),
            issued: self.frame.came,
            answer_by: now,
            is_answered: false,
            is_accepted: false,
            after: 0,
        });
    }

    pub(super) fn send_order(&mut self, pending: Pending) {
        let sender = pending.key.sender;
        let is_own = |one: &Pending| {
            one.key.sender == sender && matches!(one.kind, OrderKind::GoTo(_) | OrderKind::Path)
        };
        let state = self.vehicle.last_state();
        let functionality = state.and_then(|state| state.functionality());
        let preempts = match pending.kind {
            OrderKind::Hold | OrderKind::Land => true,
            // A station replaces only its own path. A hold may be replaced by each.
            _ => functionality == Some(Functionality::Holding) || self.pending.iter().any(is_own),
        };
        self.last_number += 1;
        let limit = self.settings.answer_within;
        let deadline = pending.issued + limit;
        let (begin_by, answer_by) = match pending.kind {
            // What makes the flight safer is worth waiting for.
            OrderKind::Hold | OrderKind::Land | OrderKind::Stop => (None, self.moment + limit),
            _ => (Some(deadline), deadline),
        };
        let run = self.missions.run.as_ref().filter(|_| pending.is_mission);
        self.orders.push_back(Order {
            number: self.last_number,
            kind: pending.kind,
            // The first step that needs an order was issued with the mission, however long a hover came before it.
            issued: match run {
                Some(run) if pending.after == 0 => run.issued,
                _ => pending.issued,
            },
            begin_by,
            preempts,
            after: pending.after,
        });
        if matches!(pending.kind, OrderKind::Start | OrderKind::Stop) {
            self.switched = Some(self.moment);
        }
        self.pending.push(Pending {
            number: self.last_number,
            answer_by,
            ..pending
        });
    }

    /// A take-off or path behind a start that is not done yet is not sent, and no return lands at its end.
    pub(super) fn cancel_what_follows(&mut self, now: MonotonicNs) {
        let mut cancelled = Vec::new();
        for one in &mut self.pending {
            one.is_return = false;
            if one.then.take().is_some() && !one.is_answered {
                one.is_answered = true;
                cancelled.push(one.key);
            }
        }
        for key in cancelled {
            self.settle(&key, CommandAck::plain(MavResult::Cancelled), now);
        }
    }

    /// The bridge has reported on an order; `words` say the same to people.
    pub fn report(&mut self, number: u64, report: &RequestReport, words: &str, now: MonotonicNs) {
        self.moment = now;
        let Some(stage) = report.stage() else {
            return;
        };
        let reason = report.reason().unwrap_or(Reason::None);
        let (stage, reason) = self.as_seen_from_the_ground(number, stage, reason);
        if self.fence_report(number, (stage, reason), words, now) {
            return;
        }
        if self.parameter_report(number, (stage, reason), report.value(), words, now) {
            return;
        }
        let answer = answer_of(stage, reason);
        let Some(index) = self.pending.iter().position(|one| one.number == number) else {
            return;
        };
        if matches!(self.pending[index].kind, OrderKind::Start | OrderKind::Stop) {
            self.switched = Some(now);
        }
        self.pending[index].request_id = report.request_id;
        let mut pending = match stage.is_final() {
            true => self.pending.remove(index),
            false => self.pending[index].clone(),
        };
        if pending.then.is_some() && answer.is_accepted() {
            // Not the start is answered, but what follows it.
            if stage.is_final()
                && let Some(kind) = pending.then.take()
            {
                // What follows by itself, long after the command, is an order of now.
                let issued = match pending.is_answered {
                    true => now,
                    false => pending.issued,
                };
                self.send_order(Pending {
                    kind,
                    issued,
                    after: step_before(report),
                    ..pending
                });
            }
            return;
        }
        let is_first = !pending.is_answered;
        if let Some(kept) = self.pending.iter_mut().find(|one| one.number == number) {
            kept.is_answered = true;
            kept.is_accepted |= answer.is_accepted();
        }
        if is_first {
            self.settle(&pending.key, answer, now);
            if answer.is_accepted() {
                self.tell_others(&pending, now);
                if !pending.is_mission && takes_over(pending.kind) {
                    self.pause_mission(now);
                }
            } else if !pending.is_mission {
                self.tell(pending.key.sender, MavSeverity::Error, words, now);
            }
        } else if !answer.is_accepted() {
            self.commands.answer(&pending.key, answer, now);
        }
        if pending.is_mission {
            return self.mission_report(&pending, report, (stage, reason), words, now);
        }
        if stage.is_final() && (answer.is_accepted() || !is_first) {
            self.end(&pending, report, (stage, reason), words, now);
        }
    }

    /// A helicopter that stands on the ground is held already: that its module is not started is no refusal of a hold.
    fn as_seen_from_the_ground(
        &self,
        number: u64,
        stage: Stage,
        reason: Reason,
    ) -> (Stage, Reason) {
        let is_hold = |one: &Pending| (one.number, one.kind) == (number, OrderKind::Hold);
        let is_on_ground = self.vehicle.now().is_some_and(|known| !known.is_flying());
        match (stage, reason) {
            (Stage::Refused, Reason::NotStarted | Reason::NotFlying)
                if is_on_ground && self.pending.iter().any(is_hold) =>
            {
                (stage, Reason::AlreadyRunning)
            }
            _ => (stage, reason),
        }
    }

    /// An order that had been accepted is over.
    pub(super) fn end(
        &mut self,
        pending: &Pending,
        report: &RequestReport,
        (stage, reason): (Stage, Reason),
        words: &str,
        now: MonotonicNs,
    ) {
        match (stage, reason) {
            (Stage::Done, _) => {
                let text = format!("{} done", pending.name());
                self.say_to_all(MavSeverity::Info, &text, now);
            }
            (Stage::Refused, Reason::AlreadyRunning) => {}
            (Stage::Aborted, Reason::Replaced) => self.say_to_all(MavSeverity::Info, words, now),
            _ => self.say_to_all(MavSeverity::Error, words, now),
        }
        if stage == Stage::Done && pending.is_return && matches!(pending.kind, OrderKind::GoTo(_)) {
            self.send_order(Pending {
                kind: OrderKind::Land,
                is_return: false,
                is_answered: true,
                issued: now,
                after: step_before(report),
                ..pending.clone()
            });
        }
    }

    /// An order was not sent, which `words` explain.
    pub fn not_sent(&mut self, number: u64, words: &str, now: MonotonicNs) {
        let report = RequestReport::new(Stage::Refused, Reason::LinkDown);
        self.report(number, &report, words, now);
    }

    /// Gives up what the bridge does not answer in time.
    pub(super) fn give_up(&mut self, now: MonotonicNs) {
        let mut given_up = Vec::new();
        let mut is_mission_stuck = false;
        for one in self.pending.iter_mut().filter(|one| !one.is_answered) {
            if now >= one.answer_by {
                // What was to follow would come too late.
                (one.is_answered, one.then) = (true, None);
                is_mission_stuck |= one.is_mission;
                given_up.push((one.key, one.name()));
            }
        }
        for (key, name) in given_up {
            self.settle(&key, CommandAck::plain(MavResult::Failed), now);
            let text = format!(
                "{name}: no answer of the bridge; it may have been done, look before you repeat it"
            );
            self.tell(key.sender, MavSeverity::Error, &text, now);
        }
        if is_mission_stuck {
            self.mission_unanswered(now);
        }
    }
}

/// What the step after the one that has ended so names; 0 if the bridge did not do it.
pub(super) fn step_before(report: &RequestReport) -> u64 {
    match report.stage() {
        Some(Stage::Done) => report.request_id,
        _ => 0,
    }
}

/// Whether an order, when it is accepted, moves the helicopter otherwise than a mission does, or makes it hover.
fn takes_over(kind: OrderKind) -> bool {
    !matches!(
        kind,
        OrderKind::Start | OrderKind::Speed(_) | OrderKind::ReadPort(_) | OrderKind::WritePort(..)
    )
}
