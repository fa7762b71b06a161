//! Whether the line carries what the DSP is asked to send (`docs/protocol.md` section 1).

use dsp_protocol::{Downlink, FlowControl, Profile, Sequence, port};
use runtime::config::Fault;

use super::BridgeConfig;

/// Bits of a byte on the line: 8N1.
const BITS_PER_BYTE: u32 = 10;

impl BridgeConfig {
    /// Whether status with all groups of the mask, and flow control, fit the line at their periods: those of `[parameters]`, or of
    /// the DSP's boot.
    ///
    /// # Errors
    /// By how much they do not, and what to do about it.
    pub fn check_line(&self) -> Result<(), Fault> {
        let flow = Downlink::FlowControl(FlowControl::Send);
        let frame_len = |profile| {
            flow.encode_in(profile, Sequence::FIRST, Sequence::FIRST)
                .as_bytes()
                .len()
        };
        let flow_len = frame_len(self.link.profile);
        let longer = flow_len - frame_len(Profile::Classic);
        let status_len = self.status.mask().status_frame_len() + longer;
        let [status_ms, flow_ms] = [port::STATUS_PERIOD_MS, port::FLOW_CONTROL_PERIOD_MS]
            .map(|port| u32::from(self.parameters.value_16(port)));
        let a_second = |len: usize, period_ms: u32| (len as u32 * 1000).div_ceil(period_ms);
        let (status, flow) = (a_second(status_len, status_ms), a_second(flow_len, flow_ms));
        let carried = self.serial.baud_rate / BITS_PER_BYTE;
        if status + flow <= carried {
            return Ok(());
        }
        let slower = match carried.checked_sub(flow).filter(|left| *left > 0) {
            Some(left) => format!(
                ", take `status_period_ms` = {} or more in `[parameters]`",
                a_second(status_len, left)
            ),
            None => String::new(),
        };
        Err(Fault::at(
            &["serial", "baud_rate"],
            format!(
                "{} baud carry {carried} bytes a second, and the DSP is asked for {}: a status of {status_len} bytes each {status_ms} ms and \
                 flow control of {flow_len} bytes each {flow_ms} ms; name fewer groups in `status.groups`{slower}, or make the line faster",
                self.serial.baud_rate,
                status + flow,
            ),
        ))
    }
}
