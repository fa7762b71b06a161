//! What happens to whole messages of one direction.
//!
//! Bytes are held until they make a message or cannot make one: a decoder of `dsp-protocol` decides which. So a
//! message is dropped, repeated or moved as a whole, and never put into the middle of another. Bytes that are no
//! message pass untouched, for the receiver to reject. Holding them changes nothing for a receiver, which acts on the
//! last byte of a message.

use std::collections::VecDeque;
use std::time::Duration;

use dsp_protocol::{Decoder, Framed, Profile, header};

use crate::random::Random;

use super::counters::MessageCounters;
use super::script::{Act, MessageKind, Window};

/// Messages that may be late at a time. One that would be late beyond it is in time instead.
pub(super) const MAX_LATE: usize = 64;

/// Where bytes go that come out at a time.
pub(super) type Sink<'a> = &'a mut dyn FnMut(Duration, &[u8]);

/// Messages of one direction, some of which faults drop, repeat or move.
#[derive(Clone, Debug)]
pub(super) struct MessageStage<M> {
    faults: Vec<MessageFault>,
    decoder: Decoder<M>,
    /// The message that has begun, from its header on: no longer than the decoder holds.
    open: Vec<u8>,
    /// Messages that are late, and when they come; ascending, those of one time in the order in which they were sent.
    late: VecDeque<(Duration, Vec<u8>)>,
    counters: MessageCounters,
}

/// One fault at work.
#[derive(Clone, Debug)]
pub(super) struct MessageFault {
    message: MessageKind,
    window: Window,
    rate: f64,
    act: Act,
    random: Random,
    /// The message that waits for the next of its kind.
    held: Option<Vec<u8>>,
}

impl MessageFault {
    /// Lets `act` happen to a share of the messages of this kind, chosen by `random`.
    pub(super) fn new(
        message: MessageKind,
        window: Window,
        rate: f64,
        act: Act,
        random: Random,
    ) -> MessageFault {
        MessageFault {
            message,
            window,
            rate,
            act,
            random,
            held: None,
        }
    }
}

/// What the faults make of one message.
struct Effects {
    copies: usize,
    late_by: Duration,
    /// Index of the fault that holds it back.
    held_by: Option<usize>,
}

impl<M: dsp_protocol::Direction> MessageStage<M> {
    /// Messages of `profile` that all arrive.
    pub(super) fn new(profile: Profile) -> MessageStage<M> {
        MessageStage {
            faults: Vec::new(),
            decoder: Decoder::with_profile(profile),
            open: Vec::new(),
            late: VecDeque::new(),
            counters: MessageCounters::default(),
        }
    }

    /// Appends a fault.
    pub(super) fn add(&mut self, fault: MessageFault) {
        self.faults.push(fault);
    }

    /// Takes a byte at `at`, which is no earlier than that of the byte before; `sink` gets what comes out, in the order
    /// of its times.
    pub(super) fn enter(&mut self, at: Duration, byte: u8, sink: Sink<'_>) {
        if self.faults.is_empty() {
            return sink(at, &[byte]);
        }
        self.release(at, sink);
        let mut input = &[byte][..];
        while !input.is_empty() {
            let (taken, framed) = self.decoder.next_frame(input);
            let is_message = matches!(framed, Framed::Frame(_));
            let is_incomplete = matches!(framed, Framed::Incomplete);
            let (used, rest) = input.split_at_checked(taken).unwrap_or((input, &[]));
            input = rest;
            // What comes without a message open and opens none is a stray.
            let opens = used.first().is_some_and(|byte| header::is_header(*byte));
            if is_incomplete && self.open.is_empty() && !opens {
                sink(at, used);
                continue;
            }
            self.open.extend_from_slice(used);
            if is_incomplete {
                continue;
            }
            let whole = std::mem::take(&mut self.open);
            if is_message {
                self.decide(at, whole, sink);
            } else {
                sink(at, &whole);
            }
        }
    }

    /// Gives `sink` the late messages that come by `now`.
    pub(super) fn release(&mut self, now: Duration, sink: Sink<'_>) {
        while self.next_deadline().is_some_and(|due| due <= now) {
            if let Some((due, message)) = self.late.pop_front() {
                sink(due, &message);
            }
        }
    }

    /// When the next late message comes.
    pub(super) fn next_deadline(&self) -> Option<Duration> {
        self.late.front().map(|(due, _)| *due)
    }

    /// What was done so far.
    pub(super) fn counters(&self) -> MessageCounters {
        self.counters
    }

    /// Bytes that are held.
    pub(super) fn waiting(&self) -> usize {
        let late = self.late.iter().map(|(_, message)| message.len());
        let held = self.faults.iter().flat_map(|fault| &fault.held);
        self.open.len() + late.sum::<usize>() + held.map(Vec::len).sum::<usize>()
    }

    /// Decides what becomes of one whole message.
    fn decide(&mut self, at: Duration, message: Vec<u8>, sink: Sink<'_>) {
        let kind = kind_of(&message);
        let waited: Vec<Vec<u8>> = self
            .faults
            .iter_mut()
            .filter(|fault| Some(fault.message) == kind)
            .filter_map(|fault| fault.held.take())
            .collect();
        let has_waited = !waited.is_empty();
        let effects = self.effects(at, kind, has_waited);
        if effects.copies == 0 {
            self.counters.dropped += 1;
            self.counters.dropped_bytes += message.len() as u64;
        } else if let Some(fault) = effects.held_by.and_then(|index| self.faults.get_mut(index)) {
            self.counters.reordered += 1;
            fault.held = Some(message);
        } else {
            for copy in 0..effects.copies {
                if copy > 0 {
                    self.counters.repeated += 1;
                    self.counters.repeated_bytes += message.len() as u64;
                }
                self.send(at, effects.late_by, &message, sink);
            }
        }
        for message in waited {
            sink(at, &message);
        }
    }

    /// Draws the random numbers of every fault that a message of this kind meets at `at`.
    fn effects(&mut self, at: Duration, kind: Option<MessageKind>, has_waited: bool) -> Effects {
        let mut effects = Effects {
            copies: 1,
            late_by: Duration::ZERO,
            held_by: None,
        };
        for (index, fault) in self.faults.iter_mut().enumerate() {
            let is_meant = Some(fault.message) == kind && fault.window.contains(at);
            if !(is_meant && fault.random.uniform() < fault.rate) {
                continue;
            }
            match fault.act {
                Act::Drop => effects.copies = 0,
                Act::Repeat if effects.copies > 0 => effects.copies = 2,
                Act::Repeat => {}
                Act::Late(delay) => effects.late_by = effects.late_by.saturating_add(delay),
                // Two that change places: the second one goes on, or neither would ever arrive.
                Act::Reorder if !has_waited => effects.held_by = Some(index),
                Act::Reorder => {}
            }
        }
        effects
    }

    /// Sends a message on now, or keeps it until it is late enough.
    fn send(&mut self, at: Duration, late_by: Duration, message: &[u8], sink: Sink<'_>) {
        if late_by == Duration::ZERO || self.late.len() >= MAX_LATE {
            return sink(at, message);
        }
        self.counters.late += 1;
        let due = at.saturating_add(late_by);
        let place = self.late.partition_point(|(other, _)| *other <= due);
        self.late.insert(place, (due, message.to_vec()));
    }
}

/// What kind of message a frame of either profile holds.
fn kind_of(frame: &[u8]) -> Option<MessageKind> {
    let header = match *frame {
        [
            header::EXTENDED_DOWNLINK | header::EXTENDED_UPLINK,
            _,
            kind,
            ..,
        ] => header::of_kind(kind),
        [header, ..] => header,
        [] => return None,
    };
    match header {
        header::STATUS => Some(MessageKind::Status),
        header::FLOW_CONTROL => Some(MessageKind::FlowControl),
        header::ACK | header::ACK_16 | header::ACK_32 => Some(MessageKind::Ack),
        header::ERROR => Some(MessageKind::Error),
        header::COMMAND => Some(MessageKind::Command),
        header::WAYPOINT => Some(MessageKind::Waypoint),
        _ => None,
    }
}

#[cfg(test)]
mod tests;
