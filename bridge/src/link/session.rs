//! [`Session`]: what is known of a DSP that was started up, above all what its path buffer may hold ([`DspPath`], requirement H1).
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

use std::time::Duration;

use dsp_protocol::StatusMask;
use ipc_types::MonotonicNs;
use ipc_types::code::DspPathState;
use serde::{Deserialize, Serialize};

use super::start_up::StartUp;

/// Sensors that come and go make a few masks; the oldest is asked for anew.
const ACCEPTED_MASKS: usize = 4;

/// What the DSP's path buffer may hold.
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

/// What is known of a DSP that was started up.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct Session {
    /// What its path buffer may hold.
    pub path: DspPath,
    /// It empties its path buffer by itself when the PC is gone.
    pub has_pc_timeout: bool,
    /// When the last message was sent that the DSP is known to have got.
    pub heard: MonotonicNs,
    /// Probes in a row that were answered without any other message.
    pub probe_only_replies: u32,
    /// A mask that is not ours, in the last status and how often in a row, and when that came.
    pub odd_mask: Option<(StatusMask, u32)>,
    pub odd_mask_at: MonotonicNs,
    /// Masks that are not ours but are taken, because the DSP says that it has ours; the newest first.
    pub accepted_masks: [Option<StatusMask>; ACCEPTED_MASKS],
}

impl Session {
    /// A DSP that has just been started up.
    pub fn begin(now: MonotonicNs, start_up: StartUp) -> Session {
        Session {
            heard: now,
            path: if start_up.is_path_empty {
                DspPath::Empty
            } else {
                DspPath::Unknown
            },
            has_pc_timeout: start_up.has_pc_timeout,
            ..Session::default()
        }
    }

    /// Whether the DSP may have taken the PC for gone by `now`, because nothing is known to have arrived there for so long.
    pub fn may_have_dropped_path(&self, now: MonotonicNs, pc_timeout: Duration) -> bool {
        self.has_pc_timeout && now.since(self.heard) >= pc_timeout
    }

    /// Takes status with these groups from now on.
    pub fn accept(&mut self, groups: StatusMask) {
        self.accepted_masks.rotate_right(1);
        self.accepted_masks[0] = Some(groups);
        self.odd_mask = None;
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
