//! What a script of faults does inside the DSP ([`crate::faults`]). Nothing here happens by itself.

use std::time::Duration;

use dsp_protocol::{DspErrorCode, StatusMask, port};

use super::Dsp;

impl Dsp {
    /// Queues an error, as if something in the DSP had failed.
    pub fn raise(&mut self, error: DspErrorCode) {
        self.errors.push(error);
    }

    /// Stops the status transmission, which no command of the PC can do. One that waits is still sent.
    pub fn stop_status(&mut self) {
        self.status_due = None;
    }

    /// Lets the clock jump, as a status carries it. It never reads less than zero; a reboot sets it right.
    pub fn shift_clock(&mut self, milliseconds: i64) {
        self.clock_shift_ms = self.clock_shift_ms.saturating_add(milliseconds);
    }

    /// Changes the status mask, as a write to port 10000 does that the PC did not send.
    pub fn change_mask(&mut self, mask: StatusMask) {
        // Port 10000 takes every value.
        let _ = self.ports.write_16(port::STATUS_MASK, mask.0);
    }

    /// Puts off everything that is due before `until`.
    pub fn hold(&mut self, until: Duration) {
        for due in [
            &mut self.status_due,
            &mut self.flow_control_due,
            &mut self.pc_timeout_due,
            &mut self.take_off.begins_at,
        ] {
            *due = due.map(|due| due.max(until));
        }
    }

    /// What the clock reads after running for `elapsed`, ms. It has 32 bits, and wraps after 49.7 days.
    pub(super) fn clock_ms(&self, elapsed: Duration) -> u32 {
        let elapsed_ms = i64::try_from(elapsed.as_millis()).unwrap_or(i64::MAX);
        elapsed_ms
            .saturating_add(self.firmware.clock_start_ms.into())
            .saturating_add(self.clock_shift_ms)
            .max(0) as u32
    }
}
