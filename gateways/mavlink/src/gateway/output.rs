//! What is sent: streams, messages on request, texts; and what the gateway says of itself.

use std::net::SocketAddr;
use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::payload::{MAX_MAVLINK_STATIONS, MavlinkStation, MavlinkStations, ascii_bytes};
use plans::mavlink::parameters::account;
use plans::mavlink::{MissionItem, command_name};

use super::Gateway;
use crate::event::{Datagram, Event, OrderKind};
use crate::message::{self, AUTOPILOT_VERSION, MESSAGE_INTERVAL};
use crate::mode::Mode;
use crate::number::{COMPONENT, MavResult, MavSeverity, command};
use crate::stations::{MAX_STATIONS, Station, StationAddress};
use crate::streams::StreamId;
use crate::telemetry::Scene;
use crate::wire::MessageWriter;

/// Most datagrams that wait to be sent. Of more the oldest go: stations repeat what they get no answer for.
const MAX_DATAGRAMS: usize = 256;

/// Most events that wait for the log.
const MAX_EVENTS: usize = 64;

const _: () = assert!(MAX_STATIONS == MAX_MAVLINK_STATIONS);

impl Gateway {
    pub(super) fn message_request(
        &mut self,
        sender: StationAddress,
        asked: &MissionItem,
        now: MonotonicNs,
    ) -> MavResult {
        let [first, second, ..] = asked.params;
        let account = account(asked);
        if let Some((_, what)) = account.refused {
            let text = format!("{} asks for {what}", command_name(asked.command));
            self.tell(sender, MavSeverity::Error, &text, now);
            return MavResult::Denied;
        }
        for (what, _) in account.named {
            let text = format!("{}: {what} is not done", command_name(asked.command));
            self.tell(sender, MavSeverity::Notice, &text, now);
        }
        let is_number = (0.0..16_777_216.0).contains(&first) && first.fract() == 0.0;
        let id = if is_number { first as u32 } else { u32::MAX };
        let stream = StreamId::of(id);
        // What is no message of ours, such as none at all, has the highest number here.
        let told = u16::try_from(id).unwrap_or(u16::MAX);
        match (asked.command, stream) {
            (command::REQUEST_CAPABILITIES, _) => {
                self.send_message(sender, AUTOPILOT_VERSION.id, 0)
            }
            (command::GET_HOME_POSITION, _) => {
                self.send_message(sender, message::HOME_POSITION.id, 0)
            }
            (command::REQUEST_MESSAGE, _) => {
                let is_one_of_some = id == message::AVAILABLE_MODES.id;
                if !is_one_of_some && second.abs() > 0.0 {
                    let text = format!("REQUEST_MESSAGE: parameter 2 = {second} is not done");
                    self.tell(sender, MavSeverity::Notice, &text, now);
                }
                match is_one_of_some && (second < 0.0 || second.fract() != 0.0) {
                    true => MavResult::Denied,
                    false => self.send_message(sender, id, second as usize),
                }
            }
            (command::SET_MESSAGE_INTERVAL, Some(stream)) => match stream.period(second) {
                Ok(period) => {
                    if let Some(route) = self.stations.route(sender.address) {
                        route.streams.set_period(stream, period, now);
                    }
                    MavResult::Accepted
                }
                Err(result) => result,
            },
            (command::GET_MESSAGE_INTERVAL, Some(stream)) => {
                let route = self.stations.route(sender.address);
                let period = route.and_then(|route| route.streams.period(stream));
                let us = |period: Duration| i32::try_from(period.as_micros()).unwrap_or(i32::MAX);
                self.send(
                    sender.address,
                    &MessageWriter::new(MESSAGE_INTERVAL)
                        .i32(period.map_or(-1, us))
                        .u16(told),
                );
                MavResult::Accepted
            }
            (command::GET_MESSAGE_INTERVAL, None) => {
                self.send(
                    sender.address,
                    &MessageWriter::new(MESSAGE_INTERVAL).i32(0).u16(told),
                );
                MavResult::Accepted
            }
            _ => MavResult::Unsupported,
        }
    }

    /// Sends a message once.
    pub(super) fn send_message(
        &mut self,
        sender: StationAddress,
        id: u32,
        which: usize,
    ) -> MavResult {
        let modes: Vec<MessageWriter> = match which {
            0 => (0..Mode::ALL.len()).filter_map(Mode::message).collect(),
            one => Mode::message(one - 1).into_iter().collect(),
        };
        let messages = match id {
            id if id == AUTOPILOT_VERSION.id => vec![autopilot_version(self.robot)],
            id if id == message::AVAILABLE_MODES.id => modes,
            id => match StreamId::of(id) {
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

    pub(super) fn scene(&self) -> Option<Scene<'_>> {
        let known = self.vehicle.now()?;
        let is_returning = self
            .pending
            .iter()
            .any(|one| one.is_return && matches!(one.kind, OrderKind::GoTo(_)));
        Some(Scene {
            known,
            home: &self.home,
            mode: Mode::of(&known, is_returning, self.missions.view().is_mode),
            mission: self.missions.view(),
            zero_above_sea_m: self.settings.zero_above_sea_m.unwrap_or(0.0),
        })
    }

    pub(super) fn send_streams(&mut self, now: MonotonicNs) {
        let Some(scene) = self.scene() else {
            return;
        };
        let (signature, sample) = (scene.signature(), scene.sample());
        let has_changed = self.shown.replace(signature) != Some(signature);
        let mut messages: [Option<Option<MessageWriter>>; StreamId::ALL.len()] = Default::default();
        let mut due = Vec::new();
        for route in self.stations.routes() {
            if has_changed {
                let at_once = [
                    StreamId::Heartbeat,
                    StreamId::CurrentMode,
                    StreamId::ExtendedSysState,
                    StreamId::Home,
                    StreamId::Mission,
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

    pub(super) fn say_to_all(&mut self, severity: MavSeverity, text: &str, now: MonotonicNs) {
        let addresses = self.stations.addresses();
        self.say(&addresses, severity, text, now);
    }

    /// A text for all who are at these addresses.
    pub(super) fn say(
        &mut self,
        to: &[SocketAddr],
        severity: MavSeverity,
        text: &str,
        now: MonotonicNs,
    ) {
        let all = to.iter().map(|address| StationAddress::all_at(*address));
        self.say_to(all, severity, text, now);
    }

    /// A text for one station. Others behind the same router see it, too, and get theirs nevertheless.
    pub(super) fn tell(
        &mut self,
        to: StationAddress,
        severity: MavSeverity,
        text: &str,
        now: MonotonicNs,
    ) {
        self.say_to([to], severity, text, now);
    }

    /// A text for one station, of something that comes many times in a second.
    pub(super) fn tell_rarely(&mut self, to: StationAddress, text: &str, now: MonotonicNs) {
        for message in self.texts.say_rarely(to, MavSeverity::Warning, text, now) {
            self.push(to.address, &message, false);
        }
    }

    fn say_to(
        &mut self,
        to: impl IntoIterator<Item = StationAddress>,
        severity: MavSeverity,
        text: &str,
        now: MonotonicNs,
    ) {
        let mut is_said = false;
        for station in to {
            for message in self.texts.say(station, severity, text, now) {
                self.push(station.address, &message, false);
                is_said = true;
            }
        }
        let is_bad = matches!(
            severity,
            MavSeverity::Error | MavSeverity::Critical | MavSeverity::Emergency
        );
        if is_said && is_bad && self.texts.is_news(text, now) {
            self.note(Event::Warning(text.to_owned()));
        }
    }

    /// Sends a message in MAVLink 1, which has no signatures.
    pub(super) fn send_in_version_1(&mut self, to: SocketAddr, message: &MessageWriter) {
        let sequence = self.next_sequence(to);
        let bytes = message.frame_of_version_1(sequence, self.settings.system, COMPONENT);
        self.queue(to, bytes, false);
    }

    pub(super) fn send(&mut self, to: SocketAddr, message: &MessageWriter) {
        self.push(to, message, false);
    }

    pub(super) fn push(&mut self, to: SocketAddr, message: &MessageWriter, is_telemetry: bool) {
        let (sequence, system) = (self.next_sequence(to), self.settings.system);
        let bytes = match &mut self.signing {
            None => message.frame(sequence, system, COMPONENT),
            Some(signing) => {
                let mut frame = message.frame_to_sign(sequence, system, COMPONENT);
                signing.sign(&mut frame, self.moment);
                frame
            }
        };
        self.queue(to, bytes, is_telemetry);
    }

    fn next_sequence(&mut self, to: SocketAddr) -> u8 {
        let route = self.stations.route(to);
        route.map_or(0, |route| route.next_sequence())
    }

    fn queue(&mut self, to: SocketAddr, bytes: Vec<u8>, is_telemetry: bool) {
        if self.datagrams.len() == MAX_DATAGRAMS {
            self.datagrams.pop_front();
        }
        self.counts.datagrams_sent += 1;
        self.datagrams.push_back(Datagram {
            to,
            bytes,
            is_telemetry,
        });
    }

    pub(super) fn note(&mut self, event: Event) {
        if self.events.len() < MAX_EVENTS {
            self.events.push_back(event);
        }
    }

    /// Writes everything but what each publisher writes itself.
    pub fn describe(&self, sample: &mut MavlinkStations, now: MonotonicNs) {
        let (vehicle, since) = self.told_vehicle;
        *sample = MavlinkStations {
            sequence: sample.sequence,
            epoch_ns: sample.epoch_ns,
            published_ns: now.0,
            since_ns: since.0,
            vehicle: vehicle.code(),
            system: self.settings.system.into(),
            is_signed: self.signing.is_some().into(),
            ..self.counts
        };
        let stations = self.stations.all();
        sample.count = stations.len() as u32;
        for (place, station) in sample.stations.iter_mut().zip(stations) {
            *place = self.describe_station(station);
        }
    }

    fn describe_station(&self, station: &Station) -> MavlinkStation {
        let sender = station.sender;
        let mut movements = self.pending.iter().filter(|one| one.is_movement());
        let has_movement = movements.any(|one| one.key.sender == sender);
        MavlinkStation {
            address: ascii_bytes(&sender.address.to_string()),
            last_heard_ns: station.heard.0,
            since_ns: station.since.0,
            last_command_ns: station.last_command.map_or(0, |last| last.0),
            commands: station.commands,
            refused: station.refused,
            system: sender.system.into(),
            component: sender.component.into(),
            may_command: self.not_permitted(sender, true).is_none().into(),
            is_lost: station.is_lost.into(),
            has_movement: has_movement.into(),
            ..MavlinkStation::default()
        }
    }
}

/// MAV_PROTOCOL_CAPABILITY: parameters, of which integers are not converted; missions and commands with integer
/// coordinates; MAVLink 2; fences.
const CAPABILITIES: u64 = 2 | 4 | 8 | 16 | 8192 | 16_384;

/// AUTOPILOT_VERSION. The version is that of the PX4 of which the dialect of modes and commands is, of the type
/// "development".
fn autopilot_version(robot: u32) -> MessageWriter {
    let own = env!("CARGO_PKG_VERSION");
    MessageWriter::new(AUTOPILOT_VERSION)
        .u64(CAPABILITIES)
        .u64(u64::from(robot))
        .u32(0x010f_0000)
        .u32(0)
        .u32(0)
        .u32(0)
        .u16(0)
        .u16(0)
        .text(own, 8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn robots_are_told_apart_by_their_serial_numbers() {
        assert_eq!(autopilot_version(3).payload().u64(8), 3);
    }
}
