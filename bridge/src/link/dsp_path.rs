//! [`DspPath`]: what the DSP's path buffer may hold (requirement H1).
//!
//! Waypoints can only be sent while this is not `Unknown`, and only the acknowledgement of *invalidate path* makes it
//! `Empty`. Whatever ends a movement, or makes its state uncertain, sets it to `Unknown`; the link then repeats *invalidate
//! path* until the DSP has acknowledged it.
//!
//! | state | forget | waypoint | emptied, for certain | emptied, perhaps |
//! |---|---|---|---|---|
//! | Empty | → Unknown | → Ours | – | – |
//! | Ours | → Unknown | – | – | – |
//! | Unknown | – | not sent | → Empty | – |

use ipc_types::code::DspPathState;
use serde::{Deserialize, Serialize};

/// See the module's documentation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum DspPath {
    /// It may hold anything.
    #[default]
    Unknown,
    /// It holds nothing.
    Empty,
    /// It holds waypoints of the path under way.
    Ours,
}

impl DspPath {
    /// A waypoint is about to be sent; false when that is not allowed.
    pub fn add_waypoint(&mut self) -> bool {
        match self {
            DspPath::Unknown => false,
            DspPath::Empty | DspPath::Ours => {
                *self = DspPath::Ours;
                true
            }
        }
    }

    /// How it is published.
    pub fn published(self) -> DspPathState {
        match self {
            DspPath::Unknown => DspPathState::Unknown,
            DspPath::Empty => DspPathState::Empty,
            DspPath::Ours => DspPathState::Ours,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_added_to_what_is_not_known() {
        let mut path = DspPath::Unknown;
        assert!(!path.add_waypoint());
        assert_eq!(path, DspPath::Unknown);
        path = DspPath::Empty;
        assert!(path.add_waypoint() && path.add_waypoint());
        assert_eq!(path, DspPath::Ours);
    }
}
