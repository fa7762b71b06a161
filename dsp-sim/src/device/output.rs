//! What waits to be sent to the PC: whole messages, never a part of one; and the queue of errors (`docs/protocol.md`
//! section 8.6), which are sent one after each status.
//!
//! A message becomes a frame when it is its turn, so that the numbers of the extended profile run in the order of
//! sending. Acknowledgements overtake a status that waits, so that they are in time even on a slow serial link;
//! nothing overtakes a frame that has begun, nor the error that belongs to a status.

use std::collections::VecDeque;

use dsp_protocol::{Downlink, DspErrorCode, FlowControl, Frame, Profile, Sequence, Status};

/// Acknowledgements that may wait. The PC has at most one command outstanding, so that more than one means a faulty
/// PC; 32 is what it can have acknowledged while the longest status is on the serial link: 128 bytes at the commands'
/// 4. One that does not fit is dropped whole, as if the serial link had lost it.
const MAX_ACKS: usize = 32;

/// Messages that wait, and the frame that is being sent.
#[derive(Clone, Debug, Default)]
pub struct Output {
    profile: Profile,
    /// The number of the next frame.
    sequence: Sequence,
    sending: Option<Sending>,
    /// Acknowledgements and the numbers of the commands that they answer.
    acks: VecDeque<(Downlink, Sequence)>,
    alarm: Option<DspErrorCode>,
    flow_control: Option<FlowControl>,
    status: Option<Status>,
    error: Option<DspErrorCode>,
    status_pending: bool,
}

#[derive(Clone, Debug)]
struct Sending {
    frame: Frame,
    sent: usize,
    is_status: bool,
}

impl Output {
    /// Nothing to send yet, and then in this profile.
    pub fn with_profile(profile: Profile) -> Output {
        Output {
            profile,
            ..Output::default()
        }
    }

    /// Appends an acknowledgement of the command with the number `acknowledges`; false when there is no room and it is
    /// dropped.
    pub fn push_ack(&mut self, ack: Downlink, acknowledges: Sequence) -> bool {
        if self.acks.len() == MAX_ACKS {
            return false;
        }
        self.acks.push_back((ack, acknowledges));
        self.next();
        true
    }

    /// Sends an error without waiting for a status, in place of one that still waits.
    pub fn push_alarm(&mut self, error: DspErrorCode) {
        self.alarm = Some(error);
        self.next();
    }

    /// Puts a flow control in place of one that still waits: the newest is the true one.
    pub fn push_flow_control(&mut self, request: FlowControl) {
        self.flow_control = Some(request);
        self.next();
    }

    /// Whether a status waits or is being sent: then there is no room for another.
    pub fn status_pending(&self) -> bool {
        self.status_pending
    }

    /// Appends a status and the error that goes with it.
    pub fn push_status(&mut self, status: Status, error: Option<DspErrorCode>) {
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
            self.sending = None;
            match error {
                Some(error) => self.send(Downlink::Error(error), Sequence::FIRST),
                None => self.next(),
            }
        }
    }

    /// Begins the next frame when none is being sent.
    fn next(&mut self) {
        if self.sending.is_some() {
            return;
        }
        // Only an acknowledgement has a number of the PC to repeat; the others leave it out.
        let unasked = |message| (message, Sequence::FIRST);
        let first = self
            .acks
            .pop_front()
            .or_else(|| self.alarm.take().map(Downlink::Error).map(unasked))
            .or_else(|| {
                let request = self.flow_control.take();
                request.map(Downlink::FlowControl).map(unasked)
            })
            .or_else(|| self.status.take().map(Downlink::Status).map(unasked));
        if let Some((message, acknowledges)) = first {
            self.send(message, acknowledges);
        }
    }

    /// Begins to send `message`, under the next number.
    fn send(&mut self, message: Downlink, acknowledges: Sequence) {
        self.sending = Some(Sending {
            frame: message.encode_in(self.profile, self.sequence, acknowledges),
            sent: 0,
            is_status: matches!(message, Downlink::Status(_)),
        });
        self.sequence = self.sequence.next();
    }
}

/// Places of the queue, see section 8.6. An error that finds it full is dropped: the first ones show the cause.
const MAX_ERRORS: usize = 16;

/// Errors that wait to be sent, oldest first.
#[derive(Clone, Debug, Default)]
pub struct ErrorQueue {
    errors: VecDeque<DspErrorCode>,
    dropped: u64,
}

impl ErrorQueue {
    /// Appends an error, or drops it when the queue is full.
    pub fn push(&mut self, error: DspErrorCode) {
        if self.errors.len() < MAX_ERRORS {
            self.errors.push_back(error);
        } else {
            self.dropped += 1;
        }
    }

    /// Takes out the oldest error.
    pub fn pop(&mut self) -> Option<DspErrorCode> {
        self.errors.pop_front()
    }

    /// Forgets all errors.
    pub fn clear(&mut self) {
        self.errors.clear();
    }

    /// Errors that wait.
    pub fn len(&self) -> usize {
        self.errors.len()
    }

    /// Whether none waits.
    pub fn is_empty(&self) -> bool {
        self.errors.is_empty()
    }

    /// Errors that found the queue full.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }
}

#[cfg(test)]
mod tests {
    use dsp_protocol::{Decoded, Decoder};

    use super::*;

    fn push_ack(output: &mut Output, command: u8) -> bool {
        output.push_ack(Downlink::Ack { command }, Sequence::FIRST)
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
        let status = Status::default();
        let status_frame = Downlink::Status(status).encode();
        let mut output = Output::default();
        output.push_status(status, Some(DspErrorCode(30)));
        output.consume(1);
        output.push_flow_control(FlowControl::Send);
        output.push_alarm(DspErrorCode(100));
        assert!(push_ack(&mut output, 4));
        assert_eq!(output.front().len(), status_frame.as_bytes().len() - 1);
        let first = output.front().to_vec();
        assert_eq!(drain(&mut output)[1..], [0xE6, 0xC3, 0xE6, 0xAA]);
        assert_eq!(first, status_frame.as_bytes()[1..]);

        assert!(push_ack(&mut output, 4));
        output.push_status(status, None);
        output.push_flow_control(FlowControl::Send);
        assert!(push_ack(&mut output, 5));
        assert!(output.status_pending());
        assert_eq!(drain(&mut output), [0xC3, 0xC3, 0xAA, 0xE9]);
        assert!(!output.status_pending());
    }

    #[test]
    fn acks_beyond_the_bound_are_dropped_whole() {
        let mut output = Output::default();
        let taken = (0..100).filter(|_| push_ack(&mut output, 4)).count();
        assert_eq!(taken, MAX_ACKS + 1, "one is being sent already");
        assert_eq!(drain(&mut output).len(), taken);
        assert!(push_ack(&mut output, 4));
    }

    #[test]
    fn numbers_run_in_the_order_of_the_line() {
        let mut output = Output::with_profile(Profile::Extended);
        let mut decoder = Decoder::<Downlink>::with_profile(Profile::Extended);
        let mut numbers = Vec::new();
        for _ in 0..130 {
            output.push_flow_control(FlowControl::Stop);
            output.push_status(Status::default(), Some(DspErrorCode(40)));
            output.push_ack(Downlink::Ack { command: 4 }, Sequence::new(99));
            while !output.front().is_empty() {
                let front = output.front().to_vec();
                let (_, Decoded::Message(received)) = decoder.receive(&front) else {
                    panic!("{front:02X?} is no frame");
                };
                let is_ack = matches!(received.message, Downlink::Ack { .. });
                assert_eq!(received.acknowledges, is_ack.then_some(Sequence::new(99)));
                numbers.extend(received.sequence);
                output.consume(front.len());
            }
        }
        assert_eq!(numbers.len(), 4 * 130);
        assert!(numbers.windows(2).all(|pair| pair[1] == pair[0].next()));
    }

    #[test]
    fn consuming_more_than_there_is_does_no_harm() {
        let mut output = Output::default();
        output.consume(7);
        push_ack(&mut output, 4);
        output.consume(1_000);
        assert_eq!(output.front(), [0_u8; 0]);
    }

    #[test]
    fn sixteen_fit_and_the_newest_are_dropped() {
        let mut queue = ErrorQueue::default();
        for code in 1..=20 {
            queue.push(DspErrorCode(code));
        }
        assert_eq!((queue.len(), queue.dropped()), (16, 4));
        assert_eq!(queue.pop(), Some(DspErrorCode(1)));
        queue.push(DspErrorCode(99));
        let rest: Vec<u16> = std::iter::from_fn(|| queue.pop())
            .map(|code| code.0)
            .collect();
        assert_eq!(
            rest,
            [2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 99]
        );
    }
}
