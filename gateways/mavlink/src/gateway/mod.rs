//! [`Gateway`]: all of it as one value.
//!
//! A command becomes an order, of which at most one request is made. Its asker gets one answer:
//!
//! | | answer |
//! |---|---|
//! | first report of the bridge | that of [`answer_of`](crate::answer_of); a refusal is said in a text as well |
//! | no report for 250 ms, and each second from then on | in progress |
//! | no report for `answer_within` | failed: the outcome is unknown |
//! | a hold, a landing or a stop, while its start is awaited | cancelled: what was to follow the start is not sent |
//!
//! What becomes of it later is a text to all stations.
//!
//! `missions`: how a mission comes, and its steps; `orders`: commands become orders, and reports become answers; `output`: what is sent; `pending`: an order on its way.

mod missions;
mod orders;
mod output;
mod pending;

use std::collections::VecDeque;
use std::net::SocketAddr;
use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::{ModuleStatus, SafetyAction};
use ipc_types::payload::{HeroTelemetry, ModuleState};

use self::pending::Pending;
use crate::commands::Commands;
use crate::event::{Datagram, Event, Order, Task};
use crate::home::Home;
use crate::message::{PING, TIMESYNC};
use crate::mission::Missions;
use crate::number::{COMPONENT, MISSION_PLANNER, Severity};
use crate::received::Received;
use crate::settings::Settings;
use crate::stations::{Entry, Sender, Stations};
use crate::telemetry::Signature;
use crate::texts::Texts;
use crate::vehicle::{Heard, Vehicle};
use crate::wire::{Frame, Message, frames};

/// Frames that were rejected are logged at most so often.
const REJECTED_PERIOD: Duration = Duration::from_secs(10);

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
    missions: Missions,
    pending: Vec<Pending>,
    last_number: u64,
    last_hold: Option<MonotonicNs>,
    shown: Option<Signature>,
    rejected: u64,
    rejected_logged: MonotonicNs,
    datagrams: VecDeque<Datagram>,
    orders: VecDeque<Order>,
    tasks: VecDeque<Task>,
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
            missions: Missions::new(),
            pending: Vec::new(),
            last_number: 0,
            last_hold: None,
            shown: None,
            rejected: 0,
            rejected_logged: MonotonicNs(0),
            datagrams: VecDeque::new(),
            orders: VecDeque::new(),
            tasks: VecDeque::new(),
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
        self.look_at_mission(now);
    }

    /// A datagram has come.
    pub fn datagram(&mut self, from: SocketAddr, bytes: &[u8], now: MonotonicNs) {
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

    fn frame(&mut self, from: SocketAddr, frame: &Frame<'_>, now: MonotonicNs) {
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
                component,
                request,
                mission_type,
            } if system == self.settings.system
                && matches!(component, 0 | COMPONENT | MISSION_PLANNER) =>
            {
                self.mission(sender, is_station, &request, mission_type, now);
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
            self.missions.forget(gone);
            self.note(Event::Note(format!("{gone} at {} is gone", gone.address)));
        }
        self.remind(now);
        self.advance_missions(now);
        self.send_streams(now);
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
            self.missions.deadline(),
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
