//! [`Mode`]: the flight mode in PX4's numbers. It is derived from what the bridge does, never echoed from a command:
//! the heartbeat is a station's only proof that a change of mode worked.

use ipc_types::code::Functionality;

use crate::message::AVAILABLE_MODES;
use crate::vehicle::Known;
use crate::wire::MessageWriter;

/// The flight mode that the heartbeat shows, derived from what the bridge does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// The pilot flies.
    Manual,
    /// A take-off is under way.
    TakeOff,
    /// At rest, hovering or stopping.
    Hold,
    /// A station's mission is flown, whatever its step, or waits for the arming that starts it.
    Mission,
    /// A return that a station has commanded.
    Return,
    /// A landing is under way.
    Land,
    /// A path, a station's or another program's. It is not Hold, in which ground stations hide the pause.
    Offboard,
}

impl Mode {
    /// All, in the order in which they are listed.
    pub const ALL: [Mode; 7] = [
        Mode::Hold,
        Mode::Mission,
        Mode::Return,
        Mode::Land,
        Mode::Manual,
        Mode::TakeOff,
        Mode::Offboard,
    ];

    /// What the helicopter does; `is_returning` says whether its path is that of a return, `has_mission` whether it is
    /// a mission's.
    pub fn of(known: &Known<'_>, is_returning: bool, has_mission: bool) -> Mode {
        if known.is_manual() {
            return Mode::Manual;
        }
        if has_mission {
            return Mode::Mission;
        }
        match known.state.functionality() {
            Some(Functionality::TakingOff) => Mode::TakeOff,
            Some(Functionality::Landing) => Mode::Land,
            Some(Functionality::FollowingPath) if is_returning => Mode::Return,
            Some(Functionality::FollowingPath) => Mode::Offboard,
            _ => Mode::Hold,
        }
    }

    /// Main mode and sub mode of PX4, MAV_STANDARD_MODE, whether a station can choose it, and what it is called.
    fn row(self) -> ((u8, u8), u8, bool, &'static str) {
        match self {
            Mode::Manual => ((1, 0), 0, false, "Manual"),
            Mode::TakeOff => ((4, 2), 8, false, "Takeoff"),
            Mode::Hold => ((4, 3), 0, true, "Hold"),
            Mode::Mission => ((4, 4), 6, true, "Mission"),
            Mode::Return => ((4, 5), 5, true, "Return"),
            Mode::Land => ((4, 6), 7, true, "Land"),
            Mode::Offboard => ((6, 0), 0, false, "Offboard"),
        }
    }

    /// `custom_mode`.
    pub fn custom(self) -> u32 {
        let (main, sub) = self.row().0;
        u32::from(sub) << 24 | u32::from(main) << 16
    }

    /// The mode with this number, and else what stations call it, if it is one that other vehicles have.
    pub fn of_custom(custom: u32) -> Result<Mode, &'static str> {
        let mode = Mode::ALL.into_iter().find(|mode| mode.custom() == custom);
        mode.ok_or(match (custom >> 16 & 0xff, custom >> 24) {
            (2, _) => "altitude control by stick",
            (3, _) => "position control by stick",
            _ => "this mode",
        })
    }

    /// MAV_STANDARD_MODE; 0 for one that is not standard.
    pub fn standard(self) -> u8 {
        self.row().1
    }

    /// Whether a station can choose it.
    pub fn is_selectable(self) -> bool {
        self.row().2
    }

    /// What it is called.
    pub fn name(self) -> &'static str {
        self.row().3
    }

    /// AVAILABLE_MODES: one mode, by its place in the list.
    pub fn message(index: usize) -> Option<MessageWriter> {
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

    /// `base_mode`, without "armed" and "simulated": custom mode, and how it is stabilized.
    pub fn base(self) -> u8 {
        match self {
            Mode::Manual => 1 | 64,
            _ => 1 | 16 | 8 | 4,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ipc_types::code::PilotSwitch;
    use ipc_types::payload::{HeroTelemetry, ModuleState};

    #[test]
    fn the_mode_is_what_the_bridge_does() {
        let telemetry = HeroTelemetry::default();
        for (functionality, plain, returning) in [
            (Functionality::AtRest, Mode::Hold, Mode::Hold),
            (Functionality::ReceivingPath, Mode::Hold, Mode::Hold),
            (Functionality::TakingOff, Mode::TakeOff, Mode::TakeOff),
            (Functionality::FollowingPath, Mode::Offboard, Mode::Return),
            (Functionality::Landing, Mode::Land, Mode::Land),
            (Functionality::Stopping, Mode::Hold, Mode::Hold),
            (Functionality::Holding, Mode::Hold, Mode::Hold),
        ] {
            for (switch, is_returning, expected) in [
                (PilotSwitch::Auto, false, plain),
                (PilotSwitch::Unknown, true, returning),
                (PilotSwitch::Manual, true, Mode::Manual),
            ] {
                let mut state = ModuleState {
                    functionality: functionality.code(),
                    ..ModuleState::default()
                };
                state.safety.pilot_switch = switch.code();
                let known = Known {
                    telemetry: &telemetry,
                    state: &state,
                };
                assert_eq!(
                    Mode::of(&known, is_returning, false),
                    expected,
                    "{functionality}, {switch}"
                );
                let in_mission = match switch {
                    PilotSwitch::Manual => Mode::Manual,
                    _ => Mode::Mission,
                };
                assert_eq!(Mode::of(&known, is_returning, true), in_mission);
            }
        }
    }

    #[test]
    fn numbers_are_those_of_px4_and_come_back() {
        let numbers = Mode::ALL.map(Mode::custom);
        let expected =
            [0x0304, 0x0404, 0x0504, 0x0604, 0x0001, 0x0204, 0x0006].map(|mode: u32| mode << 16);
        assert_eq!(numbers, expected);
        for mode in Mode::ALL {
            assert_eq!(Mode::of_custom(mode.custom()), Ok(mode));
        }
        assert_eq!(Mode::of_custom(7), Err("this mode"));
    }

    #[test]
    fn modes_are_listed_from_one() {
        assert_eq!(Mode::message(0).unwrap().payload().0.len(), 46);
        assert!(Mode::message(Mode::ALL.len()).is_none());
    }
}
