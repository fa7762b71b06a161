//! [`Home`]: where the flight began, or what an operator has set as home.
//!
//! | home | on the ground | in the air | an operator sets it |
//! |---|---|---|---|
//! | unknown, first heard | → ground | → first heard, once | → operator |
//! | ground | follows | → take-off | → operator |
//! | take-off | → ground | stays | → operator |
//! | operator | stays | stays | → operator |

use ipc_types::payload::WaypointPosition;

/// See the module's documentation. Altitudes have telemetry's zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Home {
    /// No position has come yet.
    #[default]
    Unknown,
    /// Where the helicopter was when it was first heard, in the air: for display only.
    FirstHeard(WaypointPosition),
    /// Where it stands.
    Ground(WaypointPosition),
    /// Where it took off.
    TakeOff(WaypointPosition),
    /// What an operator has set.
    Operator(WaypointPosition),
}

impl Home {
    /// A position has come.
    pub fn follow(&mut self, position: WaypointPosition, is_flying: bool) {
        *self = match (*self, is_flying) {
            (Home::Operator(set), _) => Home::Operator(set),
            (_, false) => Home::Ground(position),
            (Home::Unknown, true) => Home::FirstHeard(position),
            (Home::Ground(ground), true) => Home::TakeOff(ground),
            (known, true) => known,
        };
    }

    /// What is shown.
    pub fn shown(&self) -> Option<WaypointPosition> {
        match *self {
            Home::Unknown => None,
            Home::FirstHeard(position) => Some(position),
            _ => self.known(),
        }
    }

    /// What a helicopter may return to, and what heights are relative to.
    pub fn known(&self) -> Option<WaypointPosition> {
        match *self {
            Home::Unknown | Home::FirstHeard(_) => None,
            Home::Ground(position) | Home::TakeOff(position) | Home::Operator(position) => {
                Some(position)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_state_and_each_event() {
        let at = |latitude_deg| WaypointPosition {
            latitude_deg,
            longitude_deg: 0.0,
            altitude_m: 0.0,
        };
        let (old, new) = (at(1.0), at(2.0));
        // Before, after a position on the ground, after one in the air.
        let table = [
            (Home::Unknown, Home::Ground(new), Home::FirstHeard(new)),
            (
                Home::FirstHeard(old),
                Home::Ground(new),
                Home::FirstHeard(old),
            ),
            (Home::Ground(old), Home::Ground(new), Home::TakeOff(old)),
            (Home::TakeOff(old), Home::Ground(new), Home::TakeOff(old)),
            (
                Home::Operator(old),
                Home::Operator(old),
                Home::Operator(old),
            ),
        ];
        for (before, on_ground, in_air) in table {
            for (is_flying, expected) in [(false, on_ground), (true, in_air)] {
                let mut home = before;
                home.follow(new, is_flying);
                assert_eq!(home, expected, "{before:?}, flying: {is_flying}");
            }
        }
        assert_eq!(Home::FirstHeard(old).known(), None);
        assert_eq!(Home::FirstHeard(old).shown(), Some(old));
    }
}
