//! What the vehicle says that it is: its version and its modes.

use crate::message::{AUTOPILOT_VERSION, AVAILABLE_MODES};
use crate::mode::Mode;
use crate::wire::MessageWriter;

/// MAV_PROTOCOL_CAPABILITY: parameters, of which integers are not converted; missions and commands with integer coordinates; MAVLink 2;
/// fences.
const CAPABILITIES: u64 = 2 | 4 | 8 | 16 | 8192 | 16_384;

/// AUTOPILOT_VERSION. The version is that of the PX4 of which the dialect of modes and commands is, of the type "development".
pub fn autopilot_version(robot: u32) -> MessageWriter {
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

/// AVAILABLE_MODES: one mode, by its place in the list.
pub fn available_mode(index: usize) -> Option<MessageWriter> {
    let mode = Mode::ALL.get(index)?;
    let not_selectable = if mode.is_selectable() { 0 } else { 2 };
    Some(
        MessageWriter::new(AVAILABLE_MODES)
            .u32(mode.custom())
            .u32(not_selectable)
            .u8(Mode::ALL.len() as u8)
            .u8(index as u8 + 1)
            .u8(mode.standard())
            .text(mode.name(), 35),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modes_are_listed_from_one() {
        assert_eq!(available_mode(0).unwrap().payload().0.len(), 46);
        assert!(available_mode(Mode::ALL.len()).is_none());
        assert_eq!(autopilot_version(1).payload().u64(8), 1);
    }
}
