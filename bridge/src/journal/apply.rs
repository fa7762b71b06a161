//! An input of the journal as a call of the core.

use ipc_types::MonotonicNs;

use super::record::Input;
use crate::core::Bridge;
use crate::outputs::Outputs;

impl Bridge {
    /// Calls the function that `input` names.
    pub fn apply<O: Outputs>(&mut self, now: MonotonicNs, input: Input<'_>, out: &mut O) {
        match input {
            Input::PortOpened => self.port_opened(now, out),
            Input::PortClosed => self.port_closed(now, out),
            Input::Received(bytes) => self.receive(now, bytes, out),
            Input::Control { key, request, .. } => self.control(now, key, &request, out),
            Input::NewFence {
                key,
                request,
                fence,
                ..
            } => self.new_fence(now, key, &request, fence, out),
            Input::Movement { key, request, .. } => self.movement(now, key, &request, out),
            Input::Parameter { key, request, .. } => self.parameter(now, key, &request, out),
            Input::SenderGone(key) => self.sender_gone(now, key, out),
            Input::Advance => self.advance(now, out),
            Input::WindDown => self.wind_down(now, out),
            Input::Close => self.close(now, out),
            Input::Transmit => {
                self.transmit(now);
            }
            Input::Transmitted(count) => self.transmitted(count),
            Input::DiscardUnsent => {
                self.take_discard_unsent();
            }
        }
    }
}
