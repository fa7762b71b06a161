//! Which robot: every process takes its id, and robots with different ids never touch one another.

use std::fmt;
use std::num::NonZeroU32;
use std::str::FromStr;

/// A robot's id, an integer greater than zero (`robot_id`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct RobotId(NonZeroU32);

/// The text is not a robot id.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not a robot id: it must be an integer from 1 to 4294967295")]
pub struct InvalidRobotId(String);

impl RobotId {
    /// The id that every command takes when none is given.
    pub const DEFAULT: RobotId = RobotId(NonZeroU32::MIN);

    /// The id `id`, or `None` for 0.
    pub const fn new(id: u32) -> Option<RobotId> {
        match NonZeroU32::new(id) {
            Some(id) => Some(RobotId(id)),
            None => None,
        }
    }

    /// The id as a number.
    pub const fn get(self) -> u32 {
        self.0.get()
    }
}

impl From<NonZeroU32> for RobotId {
    fn from(id: NonZeroU32) -> RobotId {
        RobotId(id)
    }
}

impl FromStr for RobotId {
    type Err = InvalidRobotId;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        text.parse()
            .map(RobotId)
            .map_err(|_| InvalidRobotId(text.to_owned()))
    }
}

impl fmt::Display for RobotId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_id_is_an_integer_greater_than_zero() {
        assert_eq!("7".parse(), Ok(RobotId::new(7).unwrap()));
        for text in ["0", "-1", "", "one", "1.0", "4294967296"] {
            let error = text.parse::<RobotId>().unwrap_err();
            assert!(error.to_string().contains("integer from 1"), "{text}");
        }
    }
}
