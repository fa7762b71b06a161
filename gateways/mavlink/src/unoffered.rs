//! Messages that ask the vehicle for what is not offered: each is answered by a text, and by a message where the
//! protocol has one for that.

use crate::message::{self, MessageKind};
use crate::number::MavResult;
use crate::wire::{MessageWriter, Payload};

/// A message that asks for what is not offered.
#[derive(Debug, PartialEq)]
pub struct Unoffered {
    /// Which one.
    pub kind: MessageKind,
    /// Where its payload names the system.
    system: usize,
    /// Where it names the component; `None` if it does not.
    component: Option<usize>,
    /// Whether many come in a second, so that one text has to do for a minute.
    pub is_stream: bool,
    /// What is there instead, as a clause.
    pub instead: &'static str,
}

const fn with(
    kind: MessageKind,
    system: usize,
    component: Option<usize>,
    is_stream: bool,
    instead: &'static str,
) -> Unoffered {
    Unoffered {
        kind,
        system,
        component,
        is_stream,
        instead,
    }
}

/// One that names a component behind its system.
const fn once(kind: MessageKind, system: usize, instead: &'static str) -> Unoffered {
    with(kind, system, Some(system + 1), false, instead)
}

/// One that comes many times in a second.
const fn stream(kind: MessageKind, system: usize, instead: &'static str) -> Unoffered {
    with(kind, system, Some(system + 1), true, instead)
}

const SET_POINTS: &str = "set points are not flown; DO_REPOSITION and missions are";
const NO_GIMBAL: &str = "there is no gimbal";
const NO_CAMERA: &str = "there are no parameters but those of PARAM_REQUEST_LIST";
const NO_LOGS: &str = "there are no logs over MAVLink: `ril record` writes them";
const NO_BUS: &str = "there is no CAN bus";
const NO_PAYLOAD: &str = "bytes for others go nowhere";
const NO_TUNE: &str = "there is no buzzer";

/// All of them.
#[rustfmt::skip]
pub const UNOFFERED: &[Unoffered] = &[
    with(message::CHANGE_OPERATOR_CONTROL, 0, None, false, "`[commands] systems` names those that may command"),
    with(message::SET_GPS_GLOBAL_ORIGIN, 12, None, false, "places are those of the globe"),
    once(message::PARAM_MAP_RC, 18, "PARAM_SET sets a parameter"),
    once(message::SAFETY_SET_ALLOWED_AREA, 24, "send a geofence"),
    stream(message::REQUEST_DATA_STREAM, 2, "SET_MESSAGE_INTERVAL sets a rate"),
    with(message::MANUAL_CONTROL, 10, None, true, "a joystick moves nothing"),
    stream(message::RC_CHANNELS_OVERRIDE, 16, "a joystick moves nothing"),
    once(message::COMMAND_CANCEL, 2, "no command is taken back; Pause ends what moves the helicopter"),
    stream(message::SET_ATTITUDE_TARGET, 36, SET_POINTS),
    stream(message::SET_POSITION_TARGET_LOCAL_NED, 50, SET_POINTS),
    stream(message::SET_POSITION_TARGET_GLOBAL_INT, 50, SET_POINTS),
    once(message::LOG_REQUEST_LIST, 4, NO_LOGS),
    once(message::LOG_REQUEST_DATA, 10, NO_LOGS),
    once(message::LOG_ERASE, 0, NO_LOGS),
    once(message::LOG_REQUEST_END, 0, NO_LOGS),
    stream(message::GPS_INJECT_DATA, 0, "the receiver takes no corrections"),
    stream(message::V2_EXTENSION, 3, NO_PAYLOAD),
    stream(message::TUNNEL, 2, NO_PAYLOAD),
    stream(message::SERIAL_CONTROL, 79, "there is no shell"),
    stream(message::SET_ACTUATOR_CONTROL_TARGET, 41, SET_POINTS),
    with(message::SET_HOME_POSITION, 52, None, false, "DO_SET_HOME sets home"),
    once(message::SETUP_SIGNING, 8, "the key never comes over MAVLink"),
    once(message::PLAY_TUNE, 0, NO_TUNE),
    stream(message::GIMBAL_MANAGER_SET_ATTITUDE, 32, NO_GIMBAL),
    stream(message::GIMBAL_DEVICE_SET_ATTITUDE, 30, NO_GIMBAL),
    stream(message::GIMBAL_MANAGER_SET_PITCHYAW, 20, NO_GIMBAL),
    stream(message::GIMBAL_MANAGER_SET_MANUAL_CONTROL, 20, NO_GIMBAL),
    once(message::PARAM_EXT_REQUEST_READ, 2, NO_CAMERA),
    once(message::PARAM_EXT_REQUEST_LIST, 0, NO_CAMERA),
    once(message::PARAM_EXT_SET, 0, NO_CAMERA),
    stream(message::CAN_FRAME, 4, NO_BUS),
    stream(message::CANFD_FRAME, 4, NO_BUS),
    once(message::CAN_FILTER_MODIFY, 32, NO_BUS),
    once(message::PLAY_TUNE_V2, 4, NO_TUNE),
    once(message::REQUEST_EVENT, 4, "there are no events; texts say what happens"),
];

/// The message of this kind, if it asks for what is not offered.
pub fn find(kind: MessageKind) -> Option<&'static Unoffered> {
    UNOFFERED.iter().find(|one| one.kind == kind)
}

impl Unoffered {
    /// For which system, and which component, 0 for all.
    pub fn target(&self, payload: Payload<'_>) -> (u8, u8) {
        let component = self.component.map_or(0, |at| payload.u8(at));
        (payload.u8(self.system), component)
    }

    /// The message that answers it, to a station; `None` if the protocol has none for that.
    pub fn answer(
        &self,
        payload: Payload<'_>,
        (system, component): (u8, u8),
    ) -> Option<MessageWriter> {
        Some(match self.kind {
            // Not this way.
            message::CHANGE_OPERATOR_CONTROL => {
                MessageWriter::new(message::CHANGE_OPERATOR_CONTROL_ACK)
                    .u8(system)
                    .u8(payload.u8(1))
                    .u8(2)
            }
            message::COMMAND_CANCEL => MessageWriter::new(message::COMMAND_ACK)
                .u16(payload.u16(0))
                .u8(MavResult::Denied as u8)
                .u8(0)
                .i32(0)
                .u8(system)
                .u8(component),
            // There is none: number 0 of 0.
            message::LOG_REQUEST_LIST => MessageWriter::new(message::LOG_ENTRY)
                .u32(0)
                .u32(0)
                .u16(0)
                .u16(0)
                .u16(0),
            message::LOG_REQUEST_DATA => MessageWriter::new(message::LOG_DATA)
                .u32(payload.u32(0))
                .u16(payload.u16(8))
                .u8(0),
            message::PARAM_EXT_SET => {
                let answer = MessageWriter::new(message::PARAM_EXT_ACK);
                let same = (2..147).fold(answer, |answer, at| answer.u8(payload.u8(at)));
                // Failed.
                same.u8(2)
            }
            message::REQUEST_EVENT => MessageWriter::new(message::RESPONSE_EVENT_ERROR)
                .u16(payload.u16(0))
                .u16(0)
                .u8(system)
                .u8(component)
                .u8(0),
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_names_its_target_where_the_protocol_has_it() {
        for one in UNOFFERED {
            assert_eq!(find(one.kind), Some(one), "twice: {:?}", one.kind.name());
            let mut bytes = [0; 255];
            bytes[one.system] = 1;
            if let Some(at) = one.component {
                bytes[at] = 190;
            }
            let component = if one.component.is_some() { 190 } else { 0 };
            assert_eq!(one.target(Payload(&bytes)), (1, component));
        }
    }

    #[test]
    fn the_document_has_this_table() {
        let document = include_str!("../../../docs/mavlink.md");
        let mut rows: Vec<(&str, Vec<&str>)> = Vec::new();
        for one in UNOFFERED {
            match rows.iter_mut().find(|row| row.0 == one.instead) {
                Some(row) => row.1.push(one.kind.name()),
                None => rows.push((one.instead, vec![one.kind.name()])),
            }
        }
        for (instead, names) in rows {
            let expected = format!("| {} | {instead} |", names.join(", "));
            assert!(
                document.contains(&expected),
                "docs/mavlink.md should have: {expected}"
            );
        }
    }
}
