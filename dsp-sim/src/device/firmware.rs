//! What distinguishes one DSP firmware from another, so that a PC can be tested against old and odd ones.

use std::time::Duration;

use dsp_protocol::StatusMask;

/// What a firmware can do and how it does it. The default is the DSP of `docs/protocol.md`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Firmware {
    /// Whether it has port 10004, hence empties its path buffer when the PC falls silent.
    pub has_pc_timeout: bool,
    /// Whether it has port 10003, which counts the waypoints.
    pub has_waypoint_count: bool,
    /// Whether a status carries the DSP's time when the mask asks for it.
    pub has_time: bool,
    /// Whether it refuses a take-off until the PC has switched waypoint following on.
    pub refuses_take_off_before_start_up: bool,
    /// How long after the acknowledgement a take-off begins. Until then port 10121 reads 0.
    pub take_off_delay: Duration,
    /// Groups that a status carries although the mask does not ask for them.
    pub extra_groups: StatusMask,
    /// What the DSP's clock reads when the simulator starts, ms, as if the DSP had booted that long before. Every later
    /// boot begins at 0.
    pub clock_start_ms: u32,
}

impl Default for Firmware {
    fn default() -> Firmware {
        Firmware {
            has_pc_timeout: true,
            has_waypoint_count: true,
            has_time: true,
            refuses_take_off_before_start_up: true,
            take_off_delay: Duration::ZERO,
            extra_groups: StatusMask::NONE,
            clock_start_ms: 0,
        }
    }
}
