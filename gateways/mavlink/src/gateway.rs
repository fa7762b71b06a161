//! [`Gateway`]: all of it as one value.
//!
//! A command becomes an order, of which at most one request is made. Its asker gets one answer:
//!
//! | | answer |
//! |---|---|
//! | first report of the bridge | that of [`answer_of`]; a refusal is said in a text as well |
//! | no report for 250 ms, and each second from then on | in progress |
//! | no report for `answer_within` | failed: the outcome is unknown |
//! | a hold, a landing or a stop, while its start is awaited | cancelled: what was to follow the start is not sent |
//!
//! What becomes of it later is a text to all stations.

use std::collections::VecDeque;
use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::{Functionality, ModuleStatus, Reason, SafetyAction, Stage};
use ipc_types::payload::{HeroTelemetry, ModuleState, RequestReport};

use crate::commands::{Commands, Copy, Key};
use crate::decide::{Decision, Facts, Orders, decide, decide_mode};
use crate::event::{Datagram, Event, Order, OrderKind};
use crate::home::Home;
use crate::message::{
    self, COMMAND_ACK, Command, MESSAGE_INTERVAL, MISSION_ACK, MISSION_COUNT, MissionRequest, PING,
    Received, TIMESYNC,
};
use crate::mode::Mode;
use crate::number::{COMPONENT, MavResult, Severity, command};
use crate::settings::Settings;
use crate::stations::{Entry, Sender, Stations};
use crate::streams::Stream;
use crate::telemetry::{Scene, Signature, autopilot_version, available_mode};
use crate::texts::Texts;
use crate::vehicle::{Heard, Vehicle};
use crate::verdict::{Answer, answer_of};
use crate::wire::{Frame, Message, frames};

/// When "in progress" is said first, and how often from then on.
const FIRST_PROGRESS: Duration = Duration::from_millis(250);
const NEXT_PROGRESS: Duration = Duration::from_secs(1);

/// Most orders without a final report: the bridge has eight for a client. One is kept for hold and land.
const MAX_ORDERS: usize = 8;

/// A hold is not sent again so soon after the last one while the helicopter holds: a flood of them is one.
const HOLD_PERIOD: Duration = Duration::from_millis(100);

/// Most datagrams that wait to be sent. Of more the oldest go: stations repeat what they get no answer for.
const MAX_DATAGRAMS: usize = 256;

/// Most events that wait for the log.
const MAX_EVENTS: usize = 64;

/// In place of a command's number in the key of SET_MODE, which is none.
const SET_MODE: u16 = u16::MAX;

/// Frames that were rejected are logged at most so often.
const REJECTED_PERIOD: Duration = Duration::from_secs(10);

/// An order that has no final report.
#[derive(Clone, Debug)]
struct Pending {
    number: u64,
    kind: OrderKind,
    key: Key,
    /// What follows when it is done.
    then: Option<OrderKind>,
    is_return: bool,
    issued: MonotonicNs,
    is_answered: bool,
    progress_at: MonotonicNs,
}

/// See the module's documentation.
#[derive(Clone, Debug)]
pub struct Gateway {
    settings: Settings,
    robot: u32,
    vehicle: Vehicle,
    home: Home,
    stations: Stations,
    commands: Commands,
    texts: Texts,
    pending: Vec<Pending>,
    last_number: u64,
    last_hold: Option<MonotonicNs>,
    shown: Option<Signature>,
    rejected: u64,
    rejected_logged: MonotonicNs,
    datagrams: VecDeque<Datagram>,
    orders: VecDeque<Order>,
    events: VecDeque<Event>,
}

impl Gateway {
    /// A gateway of a robot that was not heard yet.
    pub fn new(settings: Settings, robot: u32) -> Gateway {
        Gateway {
            vehicle: Vehicle::new(settings.lost_after),
            stations: Stations::new(&settings.stations),
            settings,
            robot,
            home: Home::default(),
            commands: Commands::default(),
            texts: Texts::default(),
            pending: Vec::new(),
            last_number: 0,
            last_hold: None,
            shown: None,
            rejected: 0,
            rejected_logged: MonotonicNs(0),
            datagrams: VecDeque::new(),
            orders: VecDeque::new(),
            events: VecDeque::new(),
        }
    }

    /// A sample of telemetry has come.
    pub fn telemetry(&mut self, telemetry: &HeroTelemetry, now: MonotonicNs) {
        let before = self.vehicle.now().map(|known| known.is_flying());
        self.vehicle.set_telemetry(telemetry);
        self.look(now);
        let Some(known) = self.vehicle.now() else {
            return;
        };
        let is_flying = known.is_flying();
        if let Some(position) = known.position() {
            self.home.follow(position, is_flying);
        }
        if before.is_some_and(|before| before != is_flying) {
            let text = if is_flying {
                "in the air"
            } else {
                "on the ground"
            };
            self.say_to_all(Severity::Info, text, now);
        }
    }

    /// A state of the bridge has come.
    pub fn state(&mut self, state: &ModuleState, now: MonotonicNs) {
        let before = self.vehicle.last_state().copied();
        self.vehicle.set_state(state);
        self.look(now);
        for (severity, text) in before.iter().flat_map(|before| changes(before, state)) {
            self.say_to_all(severity, &text, now);
        }
    }

    /// A datagram has come.
    pub fn datagram(&mut self, from: std::net::SocketAddr, bytes: &[u8], now: MonotonicNs) {
        for frame in frames(bytes) {
            match frame {
                Ok(frame) => self.frame(from, &frame, now),
                Err(_) => self.rejected += 1,
            }
        }
        if self.rejected > 0 && now.since(self.rejected_logged) >= REJECTED_PERIOD {
            let text = format!(
                "{} frames were not read, the last from {from}",
                self.rejected
            );
            (self.rejected, self.rejected_logged) = (0, now);
            self.note(Event::Warning(text));
        }
    }

    fn frame(&mut self, from: std::net::SocketAddr, frame: &Frame<'_>, now: MonotonicNs) {
        let sender = Sender {
            address: from,
            system: frame.system,
            component: frame.component,
        };
        let Some(received) = Received::of(frame) else {
            return;
        };
        if frame.system == self.settings.system {
            // Our own frame came back, or a stranger has our number.
            return;
        }
        let is_station = self.stations.touch(sender, now);
        match received {
            Received::Heartbeat { is_station: true } => self.heartbeat(sender, now),
            Received::Heartbeat { .. } => {}
            Received::Command(command) => self.command(sender, is_station, &command, now),
            Received::SetMode { system, custom } if system == self.settings.system => {
                self.set_mode(sender, is_station, custom, now);
            }
            Received::Ping { time_us, sequence } => {
                let answer = Message::new(PING).u64(time_us).u32(sequence);
                self.send(
                    sender.address,
                    &answer.u8(sender.system).u8(sender.component),
                );
            }
            Received::TimeSync { theirs_ns } => {
                let answer = Message::new(TIMESYNC).i64(now.0 as i64).i64(theirs_ns);
                self.send(sender.address, &answer);
            }
            Received::Mission {
                system,
                request,
                mission_type,
            } if system == self.settings.system => {
                self.mission(sender, request, mission_type, now);
            }
            Received::SetMode { .. } | Received::Mission { .. } => {}
        }
    }

    fn heartbeat(&mut self, sender: Sender, now: MonotonicNs) {
        let text = match self.stations.heartbeat(sender, now) {
            Entry::Known => return,
            Entry::New => format!("{sender} at {} has come", sender.address),
            Entry::Full => {
                self.rejected += 1;
                return;
            }
        };
        self.note(Event::Note(text));
        if self.settings.zero_above_sea_m.is_none() {
            let text = "altitudes count from telemetry's zero: `zero_above_sea_m` is not set";
            self.say(&[sender.address], Severity::Warning, text, now);
        }
    }

    /// Missions are not offered yet: there are none, and none is taken.
    fn mission(
        &mut self,
        sender: Sender,
        request: MissionRequest,
        mission_type: u8,
        now: MonotonicNs,
    ) {
        let to = |message: Message| message.u8(sender.system).u8(sender.component);
        let answer = match request {
            MissionRequest::List => to(Message::new(MISSION_COUNT).u16(0)),
            MissionRequest::Clear => to(Message::new(MISSION_ACK)).u8(0),
            MissionRequest::Count => to(Message::new(MISSION_ACK)).u8(3),
        };
        self.send(sender.address, &answer.u8(mission_type));
        if request == MissionRequest::Count {
            let text = "missions and fences are not taken yet: fly plans with `ril plan fly`";
            self.say(&[sender.address], Severity::Error, text, now);
        }
    }

    fn command(&mut self, sender: Sender, is_station: bool, asked: &Command, now: MonotonicNs) {
        let is_ours = asked.system == self.settings.system;
        let is_for_autopilot = matches!(asked.component, 0 | COMPONENT);
        let is_request = matches!(
            asked.command,
            command::GET_MESSAGE_INTERVAL
                | command::SET_MESSAGE_INTERVAL
                | command::REQUEST_MESSAGE
                | command::REQUEST_CAPABILITIES
        );
        // A command to all systems is one to none in particular.
        if !is_for_autopilot || !(is_ours || is_request && asked.system == 0) {
            return;
        }
        if is_request {
            let result = match is_station {
                true => self.message_request(sender, asked, now),
                false => MavResult::TemporarilyRejected,
            };
            self.acknowledge(sender, asked.command, Answer::plain(result), 0);
            return;
        }
        let key = Key {
            sender,
            command: asked.command,
            bits: asked.bits(),
        };
        let decision = decide(asked, &self.facts());
        self.carry_out(key, is_station, decision, now);
    }

    fn set_mode(&mut self, sender: Sender, is_station: bool, custom: u32, now: MonotonicNs) {
        let mut bits = [0; 8];
        bits[0] = custom;
        let key = Key {
            sender,
            command: SET_MODE,
            bits,
        };
        let decision = decide_mode(custom, &self.facts());
        self.carry_out(key, is_station, decision, now);
    }

    fn facts(&self) -> Facts<'_> {
        Facts {
            known: self.vehicle.now(),
            last_state: self.vehicle.last_state(),
            home: &self.home,
            settings: &self.settings,
        }
    }

    /// Why a sender may not command; `None` if it may.
    fn not_permitted(&self, sender: Sender, is_station: bool) -> Option<(MavResult, &'static str)> {
        let named = &self.settings.commanders;
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
        } else if !named.is_empty() && !named.contains(&sender.system) {
            Some((
                MavResult::Denied,
                "this station may not command: `[commands] systems`",
            ))
        } else {
            None
        }
    }

    fn carry_out(&mut self, key: Key, is_station: bool, decision: Decision, now: MonotonicNs) {
        if let Some((result, why)) = self.not_permitted(key.sender, is_station) {
            self.answer(&key, Answer::plain(result));
            self.say(&[key.sender.address], Severity::Error, why, now);
            return;
        }
        match self.commands.take(key, decision.is_stop(), now) {
            Copy::New => {}
            Copy::Open => return self.answer(&key, Answer::plain(MavResult::InProgress)),
            Copy::Answered(answer) => return self.answer(&key, answer),
            Copy::Full => {
                let answer = Answer::plain(MavResult::TemporarilyRejected);
                return self.answer(&key, answer);
            }
        }
        match decision {
            Decision::Answer(answer, text) => {
                self.settle(&key, answer, now);
                if let Some((severity, text)) = text {
                    self.say(&[key.sender.address], severity, &text, now);
                }
            }
            Decision::SetHome(position) => {
                self.home = Home::Operator(position);
                self.settle(&key, Answer::plain(MavResult::Accepted), now);
                self.note(Event::Commanded(format!("home was set by {}", key.sender)));
            }
            Decision::Orders(orders) => self.order(key, orders, now),
        }
    }

    fn order(&mut self, key: Key, orders: Orders, now: MonotonicNs) {
        let kind = orders.first;
        let is_repeated = kind == OrderKind::Hold
            && self
                .last_hold
                .is_some_and(|last| now.since(last) < HOLD_PERIOD)
            && self.vehicle.now().is_some_and(|known| known.is_holding())
            && self.pending.iter().all(|one| one.kind == OrderKind::Hold);
        if is_repeated {
            return self.settle(&key, Answer::plain(MavResult::Accepted), now);
        }
        if self.pending.len() + usize::from(!kind.is_stop()) >= MAX_ORDERS {
            let answer = Answer {
                result: MavResult::TemporarilyRejected,
                reason: Reason::TooManyRequests,
            };
            return self.settle(&key, answer, now);
        }
        self.last_hold = (kind == OrderKind::Hold).then_some(now);
        if kind.is_stop() || kind == OrderKind::Stop {
            self.cancel_what_follows(now);
        }
        let log = format!(
            "{} by {} at {}",
            kind.name(),
            key.sender,
            key.sender.address
        );
        self.note(Event::Commanded(log));
        self.send_order(Pending {
            number: 0,
            kind,
            key,
            then: orders.then,
            is_return: orders.is_return,
            issued: now,
            is_answered: false,
            progress_at: now + FIRST_PROGRESS,
        });
        if let Some(notice) = orders.notice {
            self.say(&[key.sender.address], Severity::Notice, notice, now);
        }
    }

    fn send_order(&mut self, pending: Pending) {
        let sender = pending.key.sender;
        let is_own =
            |one: &Pending| one.key.sender == sender && matches!(one.kind, OrderKind::GoTo(_));
        let state = self.vehicle.last_state();
        let functionality = state.and_then(|state| state.functionality());
        let preempts = match pending.kind {
            OrderKind::Hold | OrderKind::Land => true,
            // A station replaces only its own path. A hold may be replaced by each.
            _ => functionality == Some(Functionality::Holding) || self.pending.iter().any(is_own),
        };
        self.last_number += 1;
        let deadline = pending.issued + self.settings.answer_within;
        self.orders.push_back(Order {
            number: self.last_number,
            kind: pending.kind,
            issued: pending.issued,
            begin_by: match pending.kind {
                // What makes the flight safer is worth waiting for.
                OrderKind::Hold | OrderKind::Land | OrderKind::Stop => None,
                _ => Some(deadline),
            },
            preempts,
        });
        self.pending.push(Pending {
            number: self.last_number,
            ..pending
        });
    }

    /// A take-off or path behind a start that is not done yet is not sent, and no return lands at its end.
    fn cancel_what_follows(&mut self, now: MonotonicNs) {
        let mut cancelled = Vec::new();
        for one in &mut self.pending {
            one.is_return = false;
            if one.then.take().is_some() && !one.is_answered {
                one.is_answered = true;
                cancelled.push(one.key);
            }
        }
        for key in cancelled {
            self.settle(&key, Answer::plain(MavResult::Cancelled), now);
        }
    }

    /// The bridge has reported on an order; `words` say the same to people.
    pub fn report(&mut self, number: u64, report: &RequestReport, words: &str, now: MonotonicNs) {
        let Some(stage) = report.stage() else {
            return;
        };
        let reason = report.reason().unwrap_or(Reason::None);
        let answer = answer_of(stage, reason);
        let Some(index) = self.pending.iter().position(|one| one.number == number) else {
            return;
        };
        let mut pending = match stage.is_final() {
            true => self.pending.remove(index),
            false => self.pending[index].clone(),
        };
        if pending.then.is_some() && answer.is_accepted() {
            // Not the start is answered, but what follows it.
            if stage.is_final()
                && let Some(kind) = pending.then.take()
            {
                self.send_order(Pending { kind, ..pending });
            }
            return;
        }
        let is_first = !pending.is_answered;
        if is_first {
            if let Some(kept) = self.pending.iter_mut().find(|one| one.number == number) {
                kept.is_answered = true;
            }
            self.settle(&pending.key, answer, now);
            if answer.is_accepted() {
                self.tell_others(&pending, now);
            } else {
                self.say(&[pending.key.sender.address], Severity::Error, words, now);
            }
        } else if !answer.is_accepted() {
            self.commands.answer(&pending.key, answer, now);
        }
        if stage.is_final() && (answer.is_accepted() || !is_first) {
            self.end(&pending, stage, reason, words, now);
        }
    }

    /// An order that had been accepted is over.
    fn end(
        &mut self,
        pending: &Pending,
        stage: Stage,
        reason: Reason,
        words: &str,
        now: MonotonicNs,
    ) {
        match (stage, reason) {
            (Stage::Done, _) => {
                let text = format!("{} done", pending.kind.name());
                self.say_to_all(Severity::Info, &text, now);
            }
            (Stage::Refused, Reason::AlreadyRunning) => {}
            (Stage::Aborted, Reason::Replaced) => self.say_to_all(Severity::Info, words, now),
            _ => self.say_to_all(Severity::Error, words, now),
        }
        if stage == Stage::Done && pending.is_return && matches!(pending.kind, OrderKind::GoTo(_)) {
            self.send_order(Pending {
                kind: OrderKind::Land,
                is_return: false,
                is_answered: true,
                issued: now,
                ..pending.clone()
            });
        }
    }

    /// An order was not sent, which `words` explain.
    pub fn not_sent(&mut self, number: u64, words: &str, now: MonotonicNs) {
        let report = RequestReport::new(Stage::Refused, Reason::LinkDown);
        self.report(number, &report, words, now);
    }

    fn tell_others(&mut self, pending: &Pending, now: MonotonicNs) {
        let own = pending.key.sender.address;
        let mut others = self.stations.addresses();
        others.retain(|address| *address != own);
        if !others.is_empty() {
            let text = format!("{} by {}", pending.kind.name(), pending.key.sender);
            self.say(&others, Severity::Notice, &text, now);
        }
    }

    /// The answer to a command, which its copies get too.
    fn settle(&mut self, key: &Key, answer: Answer, now: MonotonicNs) {
        self.commands.answer(key, answer, now);
        self.answer(key, answer);
    }

    /// SET_MODE has no answer but the heartbeat.
    fn answer(&mut self, key: &Key, answer: Answer) {
        if key.command != SET_MODE {
            let progress = match answer.result {
                MavResult::InProgress => u8::MAX,
                _ => 0,
            };
            self.acknowledge(key.sender, key.command, answer, progress);
        }
    }

    fn acknowledge(&mut self, sender: Sender, command: u16, answer: Answer, progress: u8) {
        let message = Message::new(COMMAND_ACK)
            .u16(command)
            .u8(answer.result as u8)
            .u8(progress)
            .i32(answer.reason.code() as i32)
            .u8(sender.system)
            .u8(sender.component);
        self.send(sender.address, &message);
    }

    fn message_request(&mut self, sender: Sender, asked: &Command, now: MonotonicNs) -> MavResult {
        let id = asked.param(1);
        let id = if (0.0..16_777_216.0).contains(&id) {
            id as u32
        } else {
            u32::MAX
        };
        let stream = Stream::of(id);
        match (asked.command, stream) {
            (command::REQUEST_CAPABILITIES, _) => {
                self.send_message(sender, message::AUTOPILOT_VERSION.id, 0)
            }
            (command::REQUEST_MESSAGE, _) => self.send_message(sender, id, asked.param(2) as usize),
            (command::SET_MESSAGE_INTERVAL, Some(stream)) => match stream.period(asked.param(2)) {
                Ok(period) => {
                    if let Some(route) = self.stations.route(sender.address) {
                        route.streams.set_period(stream, period, now);
                    }
                    MavResult::Accepted
                }
                Err(()) => MavResult::Denied,
            },
            (command::GET_MESSAGE_INTERVAL, Some(stream)) => {
                let route = self.stations.route(sender.address);
                let period = route.and_then(|route| route.streams.period(stream));
                let us = period.map_or(-1, |period| period.as_micros() as i32);
                self.send(
                    sender.address,
                    &Message::new(MESSAGE_INTERVAL).i32(us).u16(id as u16),
                );
                MavResult::Accepted
            }
            (command::GET_MESSAGE_INTERVAL, None) => {
                self.send(
                    sender.address,
                    &Message::new(MESSAGE_INTERVAL).i32(0).u16(id as u16),
                );
                MavResult::Accepted
            }
            _ => MavResult::Unsupported,
        }
    }

    /// Sends a message once.
    fn send_message(&mut self, sender: Sender, id: u32, which: usize) -> MavResult {
        let modes: Vec<Message> = match which {
            0 => (0..Mode::ALL.len()).filter_map(available_mode).collect(),
            one => available_mode(one - 1).into_iter().collect(),
        };
        let messages = match id {
            id if id == message::AUTOPILOT_VERSION.id => vec![autopilot_version(self.robot)],
            id if id == message::AVAILABLE_MODES.id => modes,
            id => match Stream::of(id) {
                None => return MavResult::Unsupported,
                Some(stream) => self
                    .scene()
                    .and_then(|scene| scene.message(stream))
                    .into_iter()
                    .collect(),
            },
        };
        for message in &messages {
            self.send(sender.address, message);
        }
        match messages.is_empty() {
            true => MavResult::TemporarilyRejected,
            false => MavResult::Accepted,
        }
    }

    fn scene(&self) -> Option<Scene<'_>> {
        let known = self.vehicle.now()?;
        let is_returning = self
            .pending
            .iter()
            .any(|one| one.is_return && matches!(one.kind, OrderKind::GoTo(_)));
        Some(Scene {
            known,
            home: &self.home,
            mode: Mode::of(&known, is_returning),
            zero_above_sea_m: self.settings.zero_above_sea_m.unwrap_or(0.0),
        })
    }

    fn look(&mut self, now: MonotonicNs) {
        match self.vehicle.look(now) {
            None => {}
            Some(Heard::Lost) => {
                let text = "the helicopter is not heard any more: nothing is sent until it is";
                self.say_to_all(Severity::Critical, text, now);
                self.shown = None;
            }
            Some(_) => self.say_to_all(Severity::Info, "the helicopter is heard", now),
        }
    }

    /// Does what is due. To be called after every input, and at the deadline.
    pub fn advance(&mut self, now: MonotonicNs) {
        self.look(now);
        for gone in self.stations.expire(now) {
            self.commands.forget(gone);
            self.note(Event::Note(format!("{gone} at {} is gone", gone.address)));
        }
        self.remind(now);
        self.send_streams(now);
    }

    /// Says "in progress", or gives up.
    fn remind(&mut self, now: MonotonicNs) {
        let limit = self.settings.answer_within;
        let mut said = Vec::new();
        for one in self.pending.iter_mut().filter(|one| !one.is_answered) {
            if now >= one.issued + limit {
                // What was to follow would come too late.
                (one.is_answered, one.then) = (true, None);
                said.push((one.key, one.kind, MavResult::Failed));
            } else if now >= one.progress_at {
                one.progress_at = now + NEXT_PROGRESS;
                said.push((one.key, one.kind, MavResult::InProgress));
            }
        }
        for (key, kind, result) in said {
            match result {
                MavResult::InProgress => self.answer(&key, Answer::plain(result)),
                _ => {
                    self.settle(&key, Answer::plain(result), now);
                    let text = format!(
                        "{}: no answer of the bridge; it may have been done, look before you repeat it",
                        kind.name()
                    );
                    self.say(&[key.sender.address], Severity::Error, &text, now);
                }
            }
        }
    }

    fn send_streams(&mut self, now: MonotonicNs) {
        let Some(scene) = self.scene() else {
            return;
        };
        let (signature, sample) = (scene.signature(), scene.sample());
        let has_changed = self.shown.replace(signature) != Some(signature);
        let mut messages: [Option<Option<Message>>; Stream::ALL.len()] = Default::default();
        let mut due = Vec::new();
        for route in self.stations.routes() {
            if has_changed {
                let at_once = [
                    Stream::Heartbeat,
                    Stream::CurrentMode,
                    Stream::ExtendedSysState,
                    Stream::Home,
                ];
                for stream in at_once {
                    route.streams.hurry(stream, now);
                }
            }
            for stream in route.streams.take_due(sample, now) {
                due.push((route.address, stream));
            }
        }
        for (address, stream) in due {
            let made = &mut messages[stream as usize];
            if made.is_none() {
                *made = Some(self.scene().and_then(|scene| scene.message(stream)));
            }
            if let Some(Some(message)) = made {
                let message = message.clone();
                self.push(address, &message, true);
            }
        }
    }

    fn say_to_all(&mut self, severity: Severity, text: &str, now: MonotonicNs) {
        let addresses = self.stations.addresses();
        self.say(&addresses, severity, text, now);
    }

    fn say(
        &mut self,
        to: &[std::net::SocketAddr],
        severity: Severity,
        text: &str,
        now: MonotonicNs,
    ) {
        if to.is_empty() {
            return;
        }
        for message in self.texts.say(severity, text, now) {
            for address in to {
                self.push(*address, &message, false);
            }
        }
        if matches!(
            severity,
            Severity::Error | Severity::Critical | Severity::Emergency
        ) {
            self.note(Event::Warning(text.to_owned()));
        }
    }

    fn send(&mut self, to: std::net::SocketAddr, message: &Message) {
        self.push(to, message, false);
    }

    fn push(&mut self, to: std::net::SocketAddr, message: &Message, is_telemetry: bool) {
        let sequence = self
            .stations
            .route(to)
            .map_or(0, |route| route.next_sequence());
        if self.datagrams.len() == MAX_DATAGRAMS {
            self.datagrams.pop_front();
        }
        self.datagrams.push_back(Datagram {
            to,
            bytes: message.frame(sequence, self.settings.system, COMPONENT),
            is_telemetry,
        });
    }

    fn note(&mut self, event: Event) {
        if self.events.len() < MAX_EVENTS {
            self.events.push_back(event);
        }
    }

    /// When [`Gateway::advance`] is to be called at the latest.
    pub fn deadline(&mut self) -> Option<MonotonicNs> {
        let limit = self.settings.answer_within;
        let open = self.pending.iter().filter(|one| !one.is_answered);
        let answers = open
            .map(|one| one.progress_at.min(one.issued + limit))
            .min();
        let streams = match self.vehicle.now() {
            Some(_) => {
                let routes = self.stations.routes();
                routes.filter_map(|route| route.streams.deadline()).min()
            }
            None => None,
        };
        [
            answers,
            streams,
            self.vehicle.deadline(),
            self.stations.deadline(),
        ]
        .into_iter()
        .flatten()
        .min()
    }

    /// Whether there is a station, so that every sample counts.
    pub fn has_stations(&self) -> bool {
        !self.stations.is_empty()
    }

    /// The next datagram to be sent.
    pub fn poll_datagram(&mut self) -> Option<Datagram> {
        self.datagrams.pop_front()
    }

    /// The next order for the bridge.
    pub fn poll_order(&mut self) -> Option<Order> {
        self.orders.pop_front()
    }

    /// The next line for the log.
    pub fn poll_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }
}

/// What stations are told of two states, one after the other.
fn changes(before: &ModuleState, after: &ModuleState) -> Vec<(Severity, String)> {
    let mut texts = Vec::new();
    let safety = |state: &ModuleState| state.safety.rule().zip(state.safety.action());
    match (safety(before), safety(after)) {
        (before, Some((rule, action))) if before != Some((rule, action)) => {
            let severity = match action {
                SafetyAction::Warn | SafetyAction::Refuse => Severity::Warning,
                SafetyAction::Hold => Severity::Critical,
                SafetyAction::Land => Severity::Emergency,
            };
            texts.push((severity, format!("safety rule {rule}: {action}")));
        }
        (Some((rule, _)), None) => {
            texts.push((Severity::Info, format!("safety rule {rule}: over")));
        }
        _ => {}
    }
    let aborted = |state: &ModuleState| state.status() == Some(ModuleStatus::Aborted);
    if aborted(after) && !aborted(before) && !after.imi_error().is_none() {
        let text = format!("the module was aborted: {}", after.imi_error());
        texts.push((Severity::Critical, text));
    }
    texts
}
