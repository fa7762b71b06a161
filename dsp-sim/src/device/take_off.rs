//! [`TakeOff`]: a take-off that was ordered.

use std::time::Duration;

/// What the DSP knows of a take-off beyond what the helicopter does.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TakeOff {
    /// When a take-off begins that was acknowledged; only a firmware that begins late has one.
    pub(super) begins_at: Option<Duration>,
    /// Whether flow control has not said 1 since the take-off began.
    pub(super) awaits_flow_control: bool,
}
