//! What a frame asks for, and whether it asks this vehicle: each message goes to who answers it.

use std::net::SocketAddr;

use ipc_types::MonotonicNs;

use super::{Gateway, Origin};
use crate::event::Event;
use crate::message::{COMMAND_ACK, FILE_TRANSFER_PROTOCOL, MISSION_ACK, PING, TIMESYNC};
use crate::number::{COMPONENT, MISSION_PLANNER, MavResult, MavSeverity, MissionResult};
use crate::parameters::{ParameterError, error_about};
use crate::received::{MissionRequest, ParameterQuery, StationMessage};
use crate::stations::{HeartbeatOutcome, StationAddress};
use crate::wire::{MavFrame, MessageWriter};

/// The first opcode of a file's messages that is an answer.
const FILE_ANSWERS: u8 = 128;

impl Gateway {
    pub(super) fn frame(&mut self, from: SocketAddr, frame: &MavFrame<'_>, now: MonotonicNs) {
        let sender = StationAddress {
            address: from,
            system: frame.system,
            component: frame.component,
        };
        let Some(received) = StationMessage::of(frame) else {
            return;
        };
        if frame.system == self.settings.system || frame.system == 0 {
            // Our own frame came back, or a stranger has our number; or none has sent it: an answer would be one to
            // all.
            return;
        }
        let is_station = self.stations.touch(sender, self.frame.came);
        let is_heartbeat = matches!(received, StationMessage::Heartbeat { .. });
        if frame.is_version_1 && !is_heartbeat {
            return self.refuse_version_1(sender, &received, now);
        }
        let (ours, target) = (self.settings.system, received.target());
        let is_named = target.is_none_or(|(system, _)| system == ours);
        let is_for_another = target.is_some_and(|(system, component)| {
            let is_mission = matches!(received, StationMessage::Mission { .. });
            let is_component =
                matches!(component, 0 | COMPONENT) || is_mission && component == MISSION_PLANNER;
            !matches!(system, 0) && system != ours || !is_component
        });
        if is_for_another {
            return;
        }
        match received {
            StationMessage::Heartbeat { is_station: true } => self.heartbeat(sender, now),
            StationMessage::Heartbeat { .. } => {}
            StationMessage::Command(command) => self.command(sender, is_station, &command, now),
            StationMessage::SetMode { custom, .. } if is_named => {
                self.set_mode(sender, is_station, custom, now);
            }
            StationMessage::SetMode { .. } => {
                self.stations.count_refusal(sender);
                self.name_the_system(sender, "SET_MODE", now);
            }
            StationMessage::Unoffered { message, .. } => {
                self.stations.count_refusal(sender);
                let to = (sender.system, sender.component);
                if let Some(answer) = message.answer(frame.payload, to) {
                    self.send(sender.address, &answer);
                }
                let text = format!("{} is not done: {}", message.kind.name(), message.instead);
                match message.is_stream {
                    true => self.tell_rarely(sender, &text, now),
                    false => self.tell(sender, MavSeverity::Error, &text, now),
                }
            }
            StationMessage::Ping { time_us, sequence } => {
                let answer = MessageWriter::new(PING).u64(time_us).u32(sequence);
                self.send(
                    sender.address,
                    &answer.u8(sender.system).u8(sender.component),
                );
            }
            StationMessage::TimeSync { theirs_ns } => {
                let answer = MessageWriter::new(TIMESYNC)
                    .i64(now.0 as i64)
                    .i64(theirs_ns);
                self.send(sender.address, &answer);
            }
            StationMessage::Mission {
                request,
                mission_type,
                ..
            } => {
                let origin = Origin {
                    sender,
                    is_station,
                    mission_type,
                    now,
                };
                match is_named || request.is_reading() {
                    true => self.mission(origin, &request),
                    false => {
                        self.stations.count_refusal(sender);
                        self.acknowledge_mission(sender, MissionResult::Denied, mission_type);
                        self.name_the_system(sender, frame.kind.name(), now);
                    }
                }
            }
            StationMessage::Parameter { asked, .. } => match asked {
                ParameterQuery::Set { name, .. } if !is_named => {
                    self.stations.count_refusal(sender);
                    let error = error_about(-1, &name, ParameterError::PermissionDenied);
                    self.send(sender.address, &error);
                    self.name_the_system(sender, "PARAM_SET", now);
                }
                asked => self.parameter(sender, is_station, &asked, now),
            },
            // There are no files: with this answer a station that asks goes on at once.
            StationMessage::File {
                sequence,
                session,
                opcode,
                ..
            } if opcode < FILE_ANSWERS => {
                let answer = no_file(sender, sequence.wrapping_add(1), session, opcode);
                self.send(sender.address, &answer);
            }
            StationMessage::File { .. } => {}
        }
    }

    /// MAVLink 1 has no room for what stations are told, and no signatures: what asks for something in it is refused in
    /// it.
    fn refuse_version_1(
        &mut self,
        sender: StationAddress,
        received: &StationMessage,
        now: MonotonicNs,
    ) {
        let ours = self.settings.system;
        let is_for_us = |(system, component)| {
            matches!(component, 0 | COMPONENT | MISSION_PLANNER) && (system == ours || system == 0)
        };
        let is_answer = matches!(
            received,
            StationMessage::Mission {
                request: MissionRequest::Ack(_),
                ..
            }
        );
        if is_answer || !received.target().is_some_and(is_for_us) {
            return;
        }
        self.counts.refused_unknown += 1;
        self.stations.count_refusal(sender);
        let answer = match received {
            StationMessage::Command(command) => Some(
                MessageWriter::new(COMMAND_ACK)
                    .u16(command.command)
                    .u8(MavResult::Denied as u8),
            ),
            StationMessage::Mission { .. } => Some(
                MessageWriter::new(MISSION_ACK)
                    .u8(sender.system)
                    .u8(sender.component)
                    .u8(MissionResult::Denied as u8),
            ),
            _ => None,
        };
        let text = "MAVLink 1 is not taken: use MAVLink 2";
        let severity = MavSeverity::Error;
        let text = self.texts.say_in_version_1(sender, severity, text, now);
        for message in answer.iter().chain(&text) {
            self.send_in_version_1(sender.address, message);
        }
    }

    fn heartbeat(&mut self, sender: StationAddress, now: MonotonicNs) {
        let (settings, signs) = (&self.settings, self.signing.is_some());
        let may_command = |one| settings.bars(one, signs).is_none();
        let outcome = self
            .stations
            .heartbeat(sender, may_command, self.frame.came);
        let mut text = format!("{sender} at {} has come", sender.address);
        match outcome {
            HeartbeatOutcome::Known => return,
            HeartbeatOutcome::New => {}
            HeartbeatOutcome::Instead(other) => {
                self.forget(other);
                text += &format!(", in the place of {other} at {}", other.address);
            }
            HeartbeatOutcome::Full => {
                self.counts.refused_full += 1;
                return;
            }
        }
        self.note(Event::Note(text));
        if let Some(text) = self.missions.interrupted() {
            self.tell(sender, MavSeverity::Notice, &text, now);
        }
        if self.settings.zero_above_sea_m.is_none() {
            let text = "altitudes count from telemetry's zero: `zero_above_sea_m` is not set";
            self.tell(sender, MavSeverity::Warning, text, now);
        }
    }
}

/// The refusal of a request for a file.
fn no_file(sender: StationAddress, sequence: u16, session: u8, opcode: u8) -> MessageWriter {
    const NAK: u8 = 129;
    const UNKNOWN_COMMAND: u8 = 7;
    let to = MessageWriter::new(FILE_TRANSFER_PROTOCOL)
        .u8(0)
        .u8(sender.system)
        .u8(sender.component);
    let header = to.u16(sequence).u8(session).u8(NAK).u8(1).u8(opcode);
    header.u8(0).u8(0).u32(0).u8(UNKNOWN_COMMAND)
}
