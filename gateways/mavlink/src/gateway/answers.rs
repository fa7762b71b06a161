//! How what a station has asked for is answered, and what the other stations are told of it.

use ipc_types::MonotonicNs;

use super::Gateway;
use super::pending::Pending;
use super::uploads::MISSION;
use crate::commands::{CommandKey, Form};
use crate::message::COMMAND_ACK;
use crate::number::{MavResult, MavSeverity, MissionResult};
use crate::stations::StationAddress;
use crate::verdict::CommandAck;
use crate::wire::MessageWriter;

impl Gateway {
    /// Something that changes the vehicle was sent to all systems.
    pub(super) fn name_the_system(&mut self, sender: StationAddress, what: &str, now: MonotonicNs) {
        let text = format!(
            "{what} was refused: it was sent to all systems; name this one, {}",
            self.settings.system
        );
        self.tell(sender, MavSeverity::Error, &text, now);
    }

    pub(super) fn tell_others(&mut self, pending: &Pending, now: MonotonicNs) {
        let text = format!("{} by {}", pending.name(), pending.key.sender);
        self.tell_the_others(pending.key.sender, &text, now);
    }

    pub(super) fn tell_the_others(&mut self, own: StationAddress, text: &str, now: MonotonicNs) {
        let mut others = self.stations.addresses();
        others.retain(|address| *address != own.address);
        self.say(&others, MavSeverity::Notice, text, now);
    }

    /// The answer to a command, which its copies get too.
    pub(super) fn settle(&mut self, key: &CommandKey, answer: CommandAck, now: MonotonicNs) {
        self.commands.answer(key, answer, now);
        self.answer(key, answer);
    }

    /// Answers in the form that what was asked has.
    pub(super) fn answer(&mut self, key: &CommandKey, answer: CommandAck) {
        let is_refused = answer.result != MavResult::Accepted;
        if is_refused {
            self.stations.count_refusal(key.sender);
        }
        match key.form {
            Form::Command(command) => self.acknowledge(key.sender, command, answer),
            Form::GuidedItem => {
                let result = match answer.result {
                    MavResult::Accepted => MissionResult::Accepted,
                    MavResult::Denied => MissionResult::Denied,
                    MavResult::Unsupported => MissionResult::Unsupported,
                    MavResult::Cancelled => MissionResult::Cancelled,
                    MavResult::TemporarilyRejected | MavResult::Failed => MissionResult::Error,
                };
                self.acknowledge_mission(key.sender, result, MISSION);
            }
            Form::CurrentItem if is_refused => {
                self.acknowledge_mission(key.sender, MissionResult::InvalidSequence, MISSION);
            }
            Form::CurrentItem | Form::Mode => {}
        }
    }

    /// Never "in progress": MAVSDK takes the first answer to a command for the last one, and reports an error.
    pub(super) fn acknowledge(&mut self, sender: StationAddress, command: u16, answer: CommandAck) {
        let message = MessageWriter::new(COMMAND_ACK)
            .u16(command)
            .u8(answer.result as u8)
            .u8(0)
            .i32(answer.reason.code() as i32)
            .u8(sender.system)
            .u8(sender.component);
        self.send(sender.address, &message);
    }
}
