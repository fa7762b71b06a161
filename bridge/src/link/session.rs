//! [`Session`]: what is known of a DSP that was started up, above all what its path buffer may hold.

use std::time::Duration;

use dsp_protocol::StatusMask;
use ipc_types::MonotonicNs;
use serde::{Deserialize, Serialize};

use super::dsp_path::DspPath;
use super::start_up::StartUp;

/// Sensors that come and go make a few masks; the oldest is asked for anew.
const ACCEPTED_MASKS: usize = 4;

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
