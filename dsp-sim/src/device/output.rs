//! What waits to be sent to the PC: whole frames, never a part of one.
//!
//! Acknowledgements overtake a status that waits, so that they are in time even on a slow line; nothing overtakes a
//! frame that has begun, nor the error that belongs to a status.

use std::collections::VecDeque;

use dsp_protocol::Frame;

/// Acknowledgements that may wait. The PC has at most one command outstanding, so that more than one is a babbling PC;
/// 32 is what it can have acknowledged while the longest status is on the line: 128 bytes at the commands' 4. One that
/// does not fit is dropped whole, as if the line had lost it.
const MAX_ACKS: usize = 32;

/// Frames that wait, and the one that is being sent.
#[derive(Clone, Debug, Default)]
pub struct Output {
    sending: Option<Sending>,
    acks: VecDeque<Frame>,
    flow_control: Option<Frame>,
    status: Option<Frame>,
    error: Option<Frame>,
    status_pending: bool,
}

#[derive(Clone, Debug)]
struct Sending {
    frame: Frame,
    sent: usize,
    is_status: bool,
}

impl Output {
    /// Appends an acknowledgement; false when there is no room and it is dropped.
    pub fn push_ack(&mut self, frame: Frame) -> bool {
        if self.acks.len() == MAX_ACKS {
            return false;
        }
        self.acks.push_back(frame);
        self.next();
        true
    }

    /// Puts a flow control in place of one that still waits: the newest is the true one.
    pub fn push_flow_control(&mut self, frame: Frame) {
        self.flow_control = Some(frame);
        self.next();
    }

    /// Whether a status waits or is being sent: then there is no room for another.
    pub fn status_pending(&self) -> bool {
        self.status_pending
    }

    /// Appends a status and the error that goes with it.
    pub fn push_status(&mut self, status: Frame, error: Option<Frame>) {
        self.status = Some(status);
        self.error = error;
        self.status_pending = true;
        self.next();
    }

    /// Takes back the error that waits for the end of its status.
    pub fn forget_error(&mut self) {
        self.error = None;
    }

    /// What is left of the frame that is being sent; empty when nothing waits.
    pub fn front(&self) -> &[u8] {
        match &self.sending {
            Some(sending) => &sending.frame.as_bytes()[sending.sent..],
            None => &[],
        }
    }

    /// Counts `count` bytes of [`front`](Self::front) as sent.
    pub fn consume(&mut self, count: usize) {
        let left = self.front().len();
        let Some(sending) = &mut self.sending else {
            return;
        };
        sending.sent += count.min(left);
        if count >= left {
            self.status_pending &= !sending.is_status;
            let error = self.error.take_if(|_| sending.is_status);
            self.sending = error.map(|frame| Sending::new(frame, false));
            self.next();
        }
    }

    /// Begins the next frame when none is being sent.
    fn next(&mut self) {
        if self.sending.is_some() {
            return;
        }
        let urgent = self.acks.pop_front().or_else(|| self.flow_control.take());
        self.sending = match urgent {
            Some(frame) => Some(Sending::new(frame, false)),
            None => self.status.take().map(|frame| Sending::new(frame, true)),
        };
    }
}

impl Sending {
    fn new(frame: Frame, is_status: bool) -> Sending {
        Sending {
            frame,
            sent: 0,
            is_status,
        }
    }
}

#[cfg(test)]
mod tests {
    use dsp_protocol::{Downlink, DspErrorCode, FlowControl, Status};

    use super::*;

    fn ack(command: u8) -> Frame {
        Downlink::Ack { command }.encode()
    }

    fn drain(output: &mut Output) -> Vec<u8> {
        let mut headers = Vec::new();
        while let Some(header) = output.front().first() {
            headers.push(*header);
            output.consume(output.front().len());
        }
        headers
    }

    #[test]
    fn acks_overtake_a_waiting_status_but_not_what_has_begun() {
        let status = Downlink::Status(Status::default()).encode();
        let error = Downlink::Error(DspErrorCode(30)).encode();
        let flow = Downlink::FlowControl(FlowControl::Send).encode();
        let mut output = Output::default();
        output.push_status(status, Some(error));
        output.consume(1);
        output.push_flow_control(flow);
        assert!(output.push_ack(ack(4)));
        assert_eq!(output.front().len(), status.as_bytes().len() - 1);
        let first = output.front().to_vec();
        assert_eq!(drain(&mut output)[1..], [0xE6, 0xC3, 0xAA]);
        assert_eq!(first, status.as_bytes()[1..]);

        assert!(output.push_ack(ack(4)));
        output.push_status(status, None);
        output.push_flow_control(flow);
        assert!(output.push_ack(ack(5)));
        assert!(output.status_pending());
        assert_eq!(drain(&mut output), [0xC3, 0xC3, 0xAA, 0xE9]);
        assert!(!output.status_pending());
    }

    #[test]
    fn acks_beyond_the_bound_are_dropped_whole() {
        let mut output = Output::default();
        let taken = (0..100).filter(|_| output.push_ack(ack(4))).count();
        assert_eq!(taken, MAX_ACKS + 1, "one is being sent already");
        assert_eq!(drain(&mut output).len(), taken);
        assert!(output.push_ack(ack(4)));
    }

    #[test]
    fn consuming_more_than_there_is_does_no_harm() {
        let mut output = Output::default();
        output.consume(7);
        output.push_ack(ack(4));
        output.consume(1_000);
        assert_eq!(output.front(), [0_u8; 0]);
    }
}
