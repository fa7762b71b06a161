//! Commands on their way to the DSP: one outstanding at a time, matched by its acknowledgement, three attempts
//! (requirement D2).
//!
//! | state | `push` | `poll` | matching ack | other ack | time-out |
//! |---|---|---|---|---|---|
//! | idle, queue empty | queued | nothing | unmatched | unmatched | – |
//! | idle, queue not empty | queued, or full | sends the oldest → waiting | unmatched | unmatched | – |
//! | waiting, attempts left | queued, or full | nothing | delivered → idle | unmatched | sends again; after its moment failed → idle |
//! | waiting, none left | queued, or full | nothing | delivered → idle | unmatched | failed → idle |
//!
//! The classic profile's acknowledgement names only its command's code (`docs/protocol.md` section 10). After a command
//! was sent more often than it was acknowledged, a late acknowledgement may still arrive and be taken for that of the
//! next command of the same code. [`Acknowledged::is_certain`] says whether that can be excluded. In the extended
//! profile each command has a number, which all its attempts share and its acknowledgement repeats, so every
//! acknowledgement is certain.

use std::collections::VecDeque;
use std::time::Duration;

use dsp_protocol::{Command, Sequence};
use ipc_types::MonotonicNs;
use serde::{Deserialize, Serialize};

pub use crate::config::ATTEMPTS;

/// Commands that may wait: a stop (2), a movement (2), a probe, a keep-alive, an emptying of the path buffer, and the
/// parameter requests (8), rounded up. The start-up sequence queues one command at a time. A command that finds the
/// queue full is refused.
pub const QUEUE_LEN: usize = 32;

/// How long after it was sent a command may still be acknowledged. The DSP answers within 50 ms (`docs/protocol.md`
/// section 8.2); the rest is for a line that stalls.
pub const LATE_ACK: Duration = Duration::from_secs(2);

/// The moment of a command that may be sent for as long as it is not acknowledged.
pub const ALWAYS: MonotonicNs = MonotonicNs(u64::MAX);

/// Codes of commands.
const CODES: usize = 8;

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

/// The data of an acknowledgement.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum AckData {
    /// No data.
    None,
    /// Value of a 16-bit port.
    Bits16(u16),
    /// Value of a 32-bit port.
    Bits32(f32),
}

/// A command to send, and its number.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sending {
    /// The command.
    pub command: Command,
    /// Its number, the same in every attempt.
    pub number: Sequence,
}

/// A command that has been acknowledged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Acknowledged<P> {
    /// What it was for; `None` if that was forgotten meanwhile.
    pub purpose: Option<P>,
    /// The acknowledgement can only be that of this command.
    pub is_certain: bool,
    /// When its first attempt was sent: the DSP has got one of the attempts since.
    pub sent: MonotonicNs,
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
pub enum Timeout<P> {
    /// To be sent once more.
    SendAgain(Sending),
    /// Given up after [`ATTEMPTS`]: an ack error.
    Failed(P),
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct OutstandingCommand<P> {
    sending: Sending,
    /// `None` if it was forgotten.
    purpose: Option<P>,
    /// No attempt is sent later.
    until: MonotonicNs,
    attempts: u32,
    /// No late acknowledgement of an earlier command of the same code can arrive any more.
    is_certain: bool,
    /// When the first and the last attempt were sent.
    first_sent: MonotonicNs,
    sent: MonotonicNs,
    deadline: MonotonicNs,
}

/// A command that has not been sent.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Waiting<P> {
    command: Command,
    purpose: P,
    /// No attempt after the first is sent later.
    until: MonotonicNs,
    /// How long an attempt waits; `None` if as long as those of every command.
    timeout: Option<Duration>,
}

/// Commands on their way to the DSP; `P` says what each is for.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct CommandQueue<P> {
    #[serde(skip)]
    timeout: Duration,
    waiting: VecDeque<Waiting<P>>,
    outstanding: Option<OutstandingCommand<P>>,
    next_number: Sequence,
    /// By code, until when a late acknowledgement may arrive.
    late_until: [MonotonicNs; CODES],
}

impl<P: Copy> CommandQueue<P> {
    /// Nothing to deliver; each attempt waits `timeout` for its acknowledgement.
    pub fn new(timeout: Duration) -> Self {
        CommandQueue {
            timeout,
            waiting: VecDeque::with_capacity(QUEUE_LEN),
            outstanding: None,
            next_number: Sequence::FIRST,
            late_until: [MonotonicNs(0); CODES],
        }
    }

    /// Takes over how long an attempt waits, after a snapshot.
    pub fn configure(&mut self, timeout: Duration) {
        self.timeout = timeout;
    }

    /// Queues a command.
    ///
    /// # Errors
    /// [`QueueFull`]; nothing has changed.
    pub fn push(&mut self, command: Command, purpose: P) -> Result<(), QueueFull> {
        self.push_until(command, purpose, ALWAYS)
    }

    /// Queues a command that is sent once and waits `timeout` for its acknowledgement.
    ///
    /// # Errors
    /// [`QueueFull`]; nothing has changed.
    pub fn push_once(
        &mut self,
        command: Command,
        purpose: P,
        timeout: Duration,
    ) -> Result<(), QueueFull> {
        self.queue(Waiting {
            command,
            purpose,
            until: MonotonicNs(0),
            timeout: Some(timeout),
        })
    }

    /// Queues a command that is not sent again after `until`. The caller takes it back when it has not been sent by
    /// then.
    ///
    /// # Errors
    /// [`QueueFull`]; nothing has changed.
    pub fn push_until(
        &mut self,
        command: Command,
        purpose: P,
        until: MonotonicNs,
    ) -> Result<(), QueueFull> {
        self.queue(Waiting {
            command,
            purpose,
            until,
            timeout: None,
        })
    }

    fn queue(&mut self, waiting: Waiting<P>) -> Result<(), QueueFull> {
        if self.waiting.len() == QUEUE_LEN {
            return Err(QueueFull);
        }
        self.waiting.push_back(waiting);
        Ok(())
    }

    /// The next command to send now, if none is outstanding.
    pub fn poll(&mut self, now: MonotonicNs) -> Option<Sending> {
        if self.outstanding.is_some() {
            return None;
        }
        let Waiting {
            command,
            purpose,
            until,
            timeout,
        } = self.waiting.pop_front()?;
        let number = self.next_number;
        self.next_number = number.next();
        let sending = Sending { command, number };
        self.outstanding = Some(OutstandingCommand {
            sending,
            purpose: Some(purpose),
            until,
            attempts: 1,
            is_certain: now >= self.late_until(command),
            first_sent: now,
            sent: now,
            deadline: now + timeout.unwrap_or(self.timeout),
        });
        Some(sending)
    }

    /// Takes an acknowledgement; returns what it completes, or `None` if it matches no command.
    pub fn acknowledge(&mut self, ack: &Ack) -> Option<Acknowledged<P>> {
        let outstanding = self
            .outstanding
            .take_if(|outstanding| ack.answers(&outstanding.sending))?;
        if outstanding.attempts > 1 {
            self.expect_late_ack(&outstanding);
        }
        Some(Acknowledged {
            purpose: outstanding.purpose,
            is_certain: outstanding.is_certain || ack.acknowledges.is_some(),
            sent: outstanding.first_sent,
        })
    }

    /// Handles the outstanding command if its time is up.
    pub fn time_out(&mut self, now: MonotonicNs) -> Option<Timeout<P>> {
        let outstanding = self.outstanding.as_mut()?;
        if now < outstanding.deadline {
            return None;
        }
        let purpose = outstanding.purpose;
        if outstanding.attempts == ATTEMPTS || purpose.is_none() || now > outstanding.until {
            self.abandon_outstanding();
            return purpose.map(Timeout::Failed);
        }
        outstanding.attempts += 1;
        outstanding.sent = now;
        outstanding.deadline = now + self.timeout;
        Some(Timeout::SendAgain(outstanding.sending))
    }

    /// When [`CommandQueue::time_out`] has something to say.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        self.outstanding
            .as_ref()
            .map(|outstanding| outstanding.deadline)
    }

    /// Until when a late acknowledgement of such a command may arrive.
    pub fn late_until(&self, command: Command) -> MonotonicNs {
        self.late_until[usize::from(command.code()) % CODES]
    }

    /// Forgets the waiting and outstanding commands whose purpose `unwanted` picks. An outstanding one that has gone
    /// out cannot be called back: the next command waits for its acknowledgement, or until the time of its present
    /// attempt is up, so that the one is not taken for that of the other. It is not sent again.
    pub fn forget(&mut self, unwanted: impl Fn(&P) -> bool) {
        self.waiting.retain(|waiting| !unwanted(&waiting.purpose));
        if let Some(outstanding) = &mut self.outstanding {
            outstanding.purpose.take_if(|purpose| unwanted(purpose));
        }
    }

    /// Whether no further command is taken.
    pub fn is_full(&self) -> bool {
        self.waiting.len() == QUEUE_LEN
    }

    /// # Panics
    /// When the moments of the outstanding command contradict each other, which is a defect.
    pub(super) fn assert_sound(&self) {
        debug_assert!(self.waiting.len() <= QUEUE_LEN);
        if let Some(outstanding) = &self.outstanding {
            debug_assert!((1..=ATTEMPTS).contains(&outstanding.attempts));
            debug_assert!(outstanding.first_sent <= outstanding.sent);
            debug_assert!(outstanding.sent <= outstanding.deadline);
        }
    }

    /// Gives up every command, at once: the DSP is another one now, or the line.
    pub fn abandon(&mut self) {
        self.waiting.clear();
        self.abandon_outstanding();
    }

    /// Takes back a command that has not been sent; false when it was sent, or is not here.
    pub fn withdraw(&mut self, unwanted: impl Fn(&P) -> bool) -> bool {
        let before = self.waiting.len();
        self.waiting.retain(|waiting| !unwanted(&waiting.purpose));
        self.waiting.len() < before
    }

    /// Whether a command with such a purpose waits or is outstanding.
    pub fn has(&self, wanted: impl Fn(&P) -> bool) -> bool {
        self.waiting.iter().any(|waiting| wanted(&waiting.purpose))
            || self
                .outstanding
                .iter()
                .filter_map(|outstanding| outstanding.purpose.as_ref())
                .any(wanted)
    }

    fn abandon_outstanding(&mut self) {
        if let Some(outstanding) = self.outstanding.take() {
            self.expect_late_ack(&outstanding);
        }
    }

    fn expect_late_ack(&mut self, outstanding: &OutstandingCommand<P>) {
        let code = usize::from(outstanding.sending.command.code()) % CODES;
        self.late_until[code] = self.late_until[code].max(outstanding.sent + LATE_ACK);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIMEOUT: Duration = Duration::from_millis(100);
    const READ: Command = Command::Read16 { port: 10_000 };
    const PLAIN: Ack = ack(4, AckData::None);

    fn purpose_of<P: Copy>(queue: &mut CommandQueue<P>, ack: &Ack) -> Option<P> {
        queue
            .acknowledge(ack)
            .and_then(|acknowledged| acknowledged.purpose)
    }

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

    /// A queue in each state of the table: idle empty, idle queued, waiting with attempts left, waiting with none.
    fn in_state(state: usize) -> CommandQueue<&'static str> {
        let mut queue = CommandQueue::new(TIMEOUT);
        if state >= 1 {
            queue.push(Command::ClearErrors, "clear").unwrap();
        }
        if state >= 2 {
            assert_eq!(queue.poll(at(0)), Some(CLEAR));
        }
        if state >= 3 {
            for attempt in 1..u64::from(ATTEMPTS) {
                let again = queue.time_out(at(100 * attempt));
                assert_eq!(again, Some(Timeout::SendAgain(CLEAR)));
            }
        }
        queue
    }

    #[test]
    fn every_state_and_event() {
        let late = at(10_000);
        let sends = [None, Some(CLEAR), None, None];
        let acknowledged = [None, None, Some("clear"), Some("clear")];
        let overdue = [
            None,
            None,
            Some(Timeout::SendAgain(CLEAR)),
            Some(Timeout::Failed("clear")),
        ];
        for state in 0..4 {
            assert_eq!(in_state(state).poll(late), sends[state], "poll in {state}");
            assert_eq!(
                purpose_of(&mut in_state(state), &PLAIN),
                acknowledged[state],
                "ack in {state}"
            );
            assert_eq!(
                in_state(state).time_out(late),
                overdue[state],
                "timeout in {state}"
            );
            assert_eq!(
                in_state(state).push(READ, "read"),
                Ok(()),
                "push in {state}"
            );
            let other = ack(5, AckData::None);
            let mut queue = in_state(state);
            assert_eq!(purpose_of(&mut queue, &other), None, "other ack in {state}");
            assert_eq!(
                purpose_of(&mut queue, &PLAIN),
                acknowledged[state],
                "ack after it in {state}"
            );
        }
    }

    #[test]
    fn an_ack_must_carry_the_data_that_its_command_asks_for() {
        let mut queue = CommandQueue::new(TIMEOUT);
        queue.push(READ, ()).unwrap();
        queue.poll(at(0));
        assert_eq!(purpose_of(&mut queue, &ack(0, AckData::None)), None);
        assert_eq!(purpose_of(&mut queue, &ack(0, AckData::Bits32(1.0))), None);
        assert_eq!(
            purpose_of(&mut queue, &ack(0, AckData::Bits16(1))),
            Some(())
        );
    }

    #[test]
    fn one_command_is_outstanding_at_a_time_and_they_keep_their_order() {
        let mut queue = CommandQueue::new(TIMEOUT);
        queue.push(Command::ClearErrors, 1).unwrap();
        queue.push(Command::ActivateStatus, 2).unwrap();
        assert_eq!(queue.poll(at(0)), Some(CLEAR));
        assert_eq!(queue.poll(at(0)), None);
        assert_eq!(purpose_of(&mut queue, &PLAIN), Some(1));
        assert_eq!(queue.poll(at(0)), Some(sending(Command::ActivateStatus, 1)));
    }

    #[test]
    fn a_full_queue_refuses_and_keeps_what_it_has() {
        let mut queue = CommandQueue::new(TIMEOUT);
        for _ in 0..QUEUE_LEN {
            queue.push(Command::ClearErrors, ()).unwrap();
        }
        assert_eq!(queue.push(READ, ()), Err(QueueFull));
        assert_eq!(queue.poll(at(0)), Some(CLEAR));
        assert_eq!(queue.push(READ, ()), Ok(()));
    }

    #[test]
    fn nothing_is_overdue_before_its_time() {
        let mut queue = in_state(2);
        assert_eq!(queue.deadline(), Some(at(100)));
        assert_eq!(queue.time_out(MonotonicNs(at(100).0 - 1)), None);
        assert!(queue.time_out(at(100)).is_some());
        assert_eq!(queue.deadline(), Some(at(200)));
    }

    #[test]
    fn the_last_attempt_goes_out_at_its_moment() {
        for (until, is_repeated) in [(99, false), (100, true)] {
            let mut queue = CommandQueue::new(TIMEOUT);
            queue.push_until(READ, (), at(until)).unwrap();
            queue.poll(at(0)).unwrap();
            let timeout = queue.time_out(at(100)).unwrap();
            assert_eq!(matches!(timeout, Timeout::SendAgain(_)), is_repeated);
        }
    }

    #[test]
    fn what_is_forgotten_serves_nothing_and_the_next_command_waits_for_its_ack() {
        let mut queue = in_state(2);
        queue.push(READ, "read").unwrap();
        queue.push(Command::ActivateStatus, "activate").unwrap();
        queue.forget(|purpose| *purpose == "clear" || *purpose == "activate");
        assert!(queue.has(|purpose| *purpose == "read"));
        assert!(!queue.has(|purpose| *purpose != "read"));
        assert_eq!(queue.poll(at(0)), None, "the acknowledgement may come");
        assert_eq!(purpose_of(&mut queue, &PLAIN), None);
        assert_eq!(queue.poll(at(0)), Some(sending(READ, 1)));
        assert!(queue.acknowledge(&ack(0, AckData::Bits16(1))).is_some());
        assert_eq!(queue.poll(at(0)), None);
    }

    #[test]
    fn what_is_forgotten_is_not_sent_again() {
        let mut queue = in_state(2);
        queue.push(READ, "read").unwrap();
        queue.forget(|purpose| *purpose == "clear");
        assert_eq!(queue.time_out(at(100)), None, "nothing waits for it");
        assert_eq!(queue.poll(at(100)), Some(sending(READ, 1)));
    }

    #[test]
    fn a_late_ack_is_never_taken_for_the_next_command_when_there_are_numbers() {
        let mut queue = in_state(3);
        let late = Ack {
            acknowledges: Some(Sequence::FIRST),
            ..PLAIN
        };
        assert_eq!(purpose_of(&mut queue, &late), Some("clear"));
        queue.push(Command::ClearErrors, "again").unwrap();
        let again = queue.poll(at(1000)).unwrap();
        assert_eq!(purpose_of(&mut queue, &late), None, "a second copy of it");
        let own = Ack {
            acknowledges: Some(again.number),
            ..PLAIN
        };
        assert_eq!(purpose_of(&mut queue, &own), Some("again"));
    }

    #[test]
    fn an_ack_is_certain_unless_an_earlier_attempt_may_still_be_answered() {
        let mut queue = in_state(2);
        assert!(matches!(
            queue.time_out(at(100)),
            Some(Timeout::SendAgain(_))
        ));
        // Two attempts, one acknowledgement: another one may come.
        assert!(queue.acknowledge(&PLAIN).is_some_and(|ack| ack.is_certain));
        let second = |queue: &mut CommandQueue<&'static str>, ms| {
            queue.push(Command::ClearErrors, "second").unwrap();
            queue.poll(at(ms)).unwrap();
            queue.acknowledge(&PLAIN).unwrap().is_certain
        };
        assert!(!second(&mut queue, 150));
        assert!(!second(&mut queue, 2099));
        assert!(second(&mut queue, 2100));
        // A command that was abandoned may be answered as well.
        queue.push(Command::ClearErrors, "abandoned").unwrap();
        queue.poll(at(3000)).unwrap();
        queue.abandon();
        assert!(!second(&mut queue, 3100));
        let numbered = Ack {
            acknowledges: Some(Sequence::new(6)),
            ..PLAIN
        };
        queue.push(Command::ClearErrors, "numbered").unwrap();
        let number = queue.poll(at(3200)).unwrap().number;
        let numbered = Ack {
            acknowledges: Some(number),
            ..numbered
        };
        assert!(queue.acknowledge(&numbered).unwrap().is_certain);
    }

    #[test]
    fn only_what_has_not_been_sent_is_withdrawn() {
        let mut queue = in_state(1);
        assert!(queue.withdraw(|_| true));
        assert!(!in_state(2).withdraw(|_| true));
    }
}
