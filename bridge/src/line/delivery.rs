//! Delivery of commands: one outstanding at a time, matched by its acknowledgement, three attempts (requirement D2).
//!
//! | state | `push` | `poll` | matching ack | other ack | timeout |
//! |---|---|---|---|---|---|
//! | idle, queue empty | queued | nothing | unmatched | unmatched | – |
//! | idle, queue not empty | queued, or full | sends the oldest → waiting | unmatched | unmatched | – |
//! | waiting, attempts left | queued, or full | nothing | delivered → idle | unmatched | sends again |
//! | waiting, none left | queued, or full | nothing | delivered → idle | unmatched | failed → idle |
//!
//! The classic profile's acknowledgement names only its command's code. One that comes after its command was repeated
//! may therefore be taken for the next command of the same code; `docs/protocol.md` section 10. In the extended profile
//! each command has a number, which all its attempts share and its acknowledgement repeats.

use std::collections::VecDeque;
use std::time::Duration;

use dsp_protocol::{Command, Sequence};
use ipc_types::MonotonicNs;

/// Attempts in all before a command is given up.
pub const ATTEMPTS: u32 = 3;

/// Commands that may wait: the start-up sequence with a write for every port of the protocol (5 + 19), a stop (2), a
/// movement (2) and a probe, rounded up. A command that finds the queue full is refused.
pub const QUEUE_LEN: usize = 32;

/// An acknowledgement as the decoder gives it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ack {
    /// Code of the command.
    pub command: u8,
    /// What came with it.
    pub data: AckData,
    /// Number of the command; extended profile only.
    pub acknowledges: Option<Sequence>,
}

/// A command to send, and its number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sending {
    /// The command.
    pub command: Command,
    /// Its number, the same in every attempt.
    pub number: Sequence,
}

/// The data of an acknowledgement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AckData {
    /// No data.
    None,
    /// Value of a 16-bit port.
    Bits16(u16),
    /// Value of a 32-bit port.
    Bits32(f32),
}

impl Ack {
    /// Whether this acknowledgement answers the command: same code, the data that it asks for, and its number if there
    /// are numbers.
    fn answers(&self, sending: &Sending) -> bool {
        self.command == sending.command.code()
            && self
                .acknowledges
                .is_none_or(|number| number == sending.number)
            && match sending.command {
                Command::Read16 { .. } => matches!(self.data, AckData::Bits16(_)),
                Command::Read32 { .. } => matches!(self.data, AckData::Bits32(_)),
                _ => self.data == AckData::None,
            }
    }
}

/// The queue is full; the command was not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{QUEUE_LEN} commands are waiting for the DSP already")]
pub struct QueueFull;

/// What became of the outstanding command when its time was up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Overdue<P> {
    /// To be sent once more.
    SendAgain(Sending),
    /// Given up after [`ATTEMPTS`]: an ack error.
    Failed(P),
}

#[derive(Clone, Copy, Debug)]
struct Outstanding<P> {
    sending: Sending,
    purpose: P,
    attempts: u32,
    deadline: MonotonicNs,
}

/// Commands on their way to the DSP; `P` says what each is for.
#[derive(Clone, Debug)]
pub struct Delivery<P> {
    timeout: Duration,
    waiting: VecDeque<(Command, P)>,
    outstanding: Option<Outstanding<P>>,
    next_number: Sequence,
}

impl<P: Copy> Delivery<P> {
    /// Nothing to deliver; each attempt waits `timeout` for its acknowledgement.
    pub fn new(timeout: Duration) -> Self {
        Delivery {
            timeout,
            waiting: VecDeque::with_capacity(QUEUE_LEN),
            outstanding: None,
            next_number: Sequence::FIRST,
        }
    }

    /// Queues a command.
    pub fn push(&mut self, command: Command, purpose: P) -> Result<(), QueueFull> {
        if self.waiting.len() == QUEUE_LEN {
            return Err(QueueFull);
        }
        self.waiting.push_back((command, purpose));
        Ok(())
    }

    /// The next command to send now, if none is outstanding.
    pub fn poll(&mut self, now: MonotonicNs) -> Option<Sending> {
        if self.outstanding.is_some() {
            return None;
        }
        let (command, purpose) = self.waiting.pop_front()?;
        let number = self.next_number;
        self.next_number = number.next();
        let sending = Sending { command, number };
        self.outstanding = Some(Outstanding {
            sending,
            purpose,
            attempts: 1,
            deadline: now + self.timeout,
        });
        Some(sending)
    }

    /// Takes an acknowledgement; returns the purpose of the command that it completes, or nothing if it matches none.
    pub fn acknowledge(&mut self, ack: &Ack) -> Option<P> {
        self.outstanding
            .take_if(|outstanding| ack.answers(&outstanding.sending))
            .map(|outstanding| outstanding.purpose)
    }

    /// Handles the outstanding command if its time is up.
    pub fn overdue(&mut self, now: MonotonicNs) -> Option<Overdue<P>> {
        let outstanding = self.outstanding.as_mut()?;
        if now < outstanding.deadline {
            return None;
        }
        if outstanding.attempts == ATTEMPTS {
            let purpose = outstanding.purpose;
            self.outstanding = None;
            return Some(Overdue::Failed(purpose));
        }
        outstanding.attempts += 1;
        outstanding.deadline = now + self.timeout;
        Some(Overdue::SendAgain(outstanding.sending))
    }

    /// When [`Delivery::overdue`] has something to say.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        self.outstanding
            .as_ref()
            .map(|outstanding| outstanding.deadline)
    }

    /// Forgets the waiting and outstanding commands whose purpose `unwanted` picks. An outstanding one that has gone out
    /// cannot be called back; its acknowledgement will be unmatched.
    pub fn forget(&mut self, unwanted: impl Fn(&P) -> bool) {
        self.waiting.retain(|(_, purpose)| !unwanted(purpose));
        self.outstanding
            .take_if(|outstanding| unwanted(&outstanding.purpose));
    }

    /// Whether a command with such a purpose waits or is outstanding.
    pub fn has(&self, wanted: impl Fn(&P) -> bool) -> bool {
        self.waiting.iter().any(|(_, purpose)| wanted(purpose))
            || self
                .outstanding
                .iter()
                .any(|outstanding| wanted(&outstanding.purpose))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIMEOUT: Duration = Duration::from_millis(100);
    const READ: Command = Command::Read16 { port: 10_000 };
    const PLAIN: Ack = ack(4, AckData::None);

    const fn ack(command: u8, data: AckData) -> Ack {
        Ack {
            command,
            data,
            acknowledges: None,
        }
    }

    const fn sending(command: Command, number: u8) -> Sending {
        Sending {
            command,
            number: Sequence::new(number),
        }
    }

    const CLEAR: Sending = sending(Command::ClearErrors, 0);

    fn at(ms: u64) -> MonotonicNs {
        MonotonicNs(ms * 1_000_000)
    }

    /// A delivery in each state of the table: idle empty, idle queued, waiting with attempts left, waiting with none.
    fn in_state(state: usize) -> Delivery<&'static str> {
        let mut delivery = Delivery::new(TIMEOUT);
        if state >= 1 {
            delivery.push(Command::ClearErrors, "clear").unwrap();
        }
        if state >= 2 {
            assert_eq!(delivery.poll(at(0)), Some(CLEAR));
        }
        if state >= 3 {
            for attempt in 1..u64::from(ATTEMPTS) {
                let again = delivery.overdue(at(100 * attempt));
                assert_eq!(again, Some(Overdue::SendAgain(CLEAR)));
            }
        }
        delivery
    }

    #[test]
    fn every_state_and_event() {
        let late = at(10_000);
        let sends = [None, Some(CLEAR), None, None];
        let acknowledged = [None, None, Some("clear"), Some("clear")];
        let overdue = [
            None,
            None,
            Some(Overdue::SendAgain(CLEAR)),
            Some(Overdue::Failed("clear")),
        ];
        for state in 0..4 {
            assert_eq!(in_state(state).poll(late), sends[state], "poll in {state}");
            assert_eq!(
                in_state(state).acknowledge(&PLAIN),
                acknowledged[state],
                "ack in {state}"
            );
            assert_eq!(
                in_state(state).overdue(late),
                overdue[state],
                "timeout in {state}"
            );
            assert_eq!(
                in_state(state).push(READ, "read"),
                Ok(()),
                "push in {state}"
            );
            let other = ack(5, AckData::None);
            let mut delivery = in_state(state);
            assert_eq!(delivery.acknowledge(&other), None, "other ack in {state}");
            assert_eq!(
                delivery.acknowledge(&PLAIN),
                acknowledged[state],
                "ack after it in {state}"
            );
        }
    }

    #[test]
    fn an_ack_must_carry_the_data_that_its_command_asks_for() {
        let mut delivery = Delivery::new(TIMEOUT);
        delivery.push(READ, ()).unwrap();
        delivery.poll(at(0));
        assert_eq!(delivery.acknowledge(&ack(0, AckData::None)), None);
        assert_eq!(delivery.acknowledge(&ack(0, AckData::Bits32(1.0))), None);
        assert_eq!(delivery.acknowledge(&ack(0, AckData::Bits16(1))), Some(()));
    }

    #[test]
    fn one_command_is_outstanding_at_a_time_and_they_keep_their_order() {
        let mut delivery = Delivery::new(TIMEOUT);
        delivery.push(Command::ClearErrors, 1).unwrap();
        delivery.push(Command::ActivateStatus, 2).unwrap();
        assert_eq!(delivery.poll(at(0)), Some(CLEAR));
        assert_eq!(delivery.poll(at(0)), None);
        assert_eq!(delivery.acknowledge(&PLAIN), Some(1));
        assert_eq!(
            delivery.poll(at(0)),
            Some(sending(Command::ActivateStatus, 1))
        );
    }

    #[test]
    fn a_full_queue_refuses_and_keeps_what_it_has() {
        let mut delivery = Delivery::new(TIMEOUT);
        for _ in 0..QUEUE_LEN {
            delivery.push(Command::ClearErrors, ()).unwrap();
        }
        assert_eq!(delivery.push(READ, ()), Err(QueueFull));
        assert_eq!(delivery.poll(at(0)), Some(CLEAR));
        assert_eq!(delivery.push(READ, ()), Ok(()));
    }

    #[test]
    fn nothing_is_overdue_before_its_time() {
        let mut delivery = in_state(2);
        assert_eq!(delivery.deadline(), Some(at(100)));
        assert_eq!(delivery.overdue(MonotonicNs(at(100).0 - 1)), None);
        assert!(delivery.overdue(at(100)).is_some());
        assert_eq!(delivery.deadline(), Some(at(200)));
    }

    #[test]
    fn what_is_forgotten_is_neither_sent_nor_matched() {
        let mut delivery = in_state(2);
        delivery.push(READ, "read").unwrap();
        delivery.forget(|purpose| *purpose == "clear");
        assert_eq!(delivery.acknowledge(&PLAIN), None);
        assert_eq!(delivery.poll(at(0)), Some(sending(READ, 1)));
        assert!(delivery.has(|purpose| *purpose == "read"));
        assert!(!delivery.has(|purpose| *purpose == "clear"));
    }

    #[test]
    fn a_late_ack_is_never_taken_for_the_next_command_when_there_are_numbers() {
        let mut delivery = in_state(3);
        let late = Ack {
            acknowledges: Some(Sequence::FIRST),
            ..PLAIN
        };
        assert_eq!(delivery.acknowledge(&late), Some("clear"));
        delivery.push(Command::ClearErrors, "again").unwrap();
        let again = delivery.poll(at(1000)).unwrap();
        assert_eq!(delivery.acknowledge(&late), None, "a second copy of it");
        let own = Ack {
            acknowledges: Some(again.number),
            ..PLAIN
        };
        assert_eq!(delivery.acknowledge(&own), Some("again"));
    }
}
