//! The test bench: one end of the serial link as a check sees it. A check is linear code that sends and waits; it is
//! suspended until the [`Wire`] has what it waits for. Nothing here waits for real.

use std::cell::RefCell;
use std::future::poll_fn;
use std::rc::Rc;
use std::task::Poll;
use std::time::Duration;

use dsp_protocol::{Command, Downlink, Profile, Sequence, Status, StatusMask, Uplink, port};

use crate::arrival::{Arrival, describe_command, describe_uplink};
use crate::outcome::{Judged, Stop, broken, ensure, not_judged};
use crate::permitted::{Harmless, Permitted, QuietPort16, Raw};
use crate::report::Rejected;
use crate::wire::{Reset, Sent, Wire, encode};

/// How often a command, or a single expectation, is tried on a line that damages bytes. At 1 % a command with its
/// acknowledgement is undisturbed eight times in ten, an expectation with four statuses three times.
const LOSSY_ATTEMPTS: usize = 40;
/// How many attempts of an expectation without a sign of damage from the DSP decide on such a line: as many that fulfil
/// it, or as many that do not. Damage on the way to the DSP shows no sign, and can look like a fault or hide one.
const LOSSY_VOTES: usize = 3;
/// How many times as long the time-out for statuses is on such a line.
const LOSSY_TIMEOUT_FACTOR: u32 = 8;

/// Within which time an acknowledgement begins (section 8.2).
pub const ACK_TIME: Duration = Duration::from_millis(50);

/// The bench in the hands of a check.
#[derive(Clone, Debug)]
pub struct Bench(Rc<RefCell<Wire>>);

impl Bench {
    /// A bench at this line.
    pub fn new(wire: Rc<RefCell<Wire>>) -> Bench {
        Bench(wire)
    }

    /// The time.
    pub fn now(&self) -> Duration {
        self.0.borrow().now
    }

    /// What both ends speak.
    pub fn profile(&self) -> Profile {
        self.0.borrow().setup.profile
    }

    /// How late this computer may see a byte.
    pub fn slack(&self) -> Duration {
        self.0.borrow().setup.slack
    }

    /// Whether the line damages bytes.
    pub fn is_lossy(&self) -> bool {
        self.0.borrow().setup.is_lossy
    }

    /// How often something is tried.
    fn attempts(&self) -> usize {
        match self.is_lossy() {
            true => LOSSY_ATTEMPTS,
            false => 1,
        }
    }

    /// Whether a message of the DSP is missing or was rejected since `mark`.
    pub fn is_disturbed(&self, mark: usize) -> bool {
        let seen = self.since(mark);
        let numbers = seen.iter().filter_map(|seen| seen.sequence);
        let next = numbers.clone().skip(1);
        seen.iter().any(|seen| seen.event.is_err())
            || numbers
                .zip(next)
                .any(|(before, this)| this != before.next())
    }

    /// How long `bytes` take on the line.
    pub fn line_time(&self, bytes: usize) -> Duration {
        self.0.borrow().line_time(bytes)
    }

    /// How long the status and the error take that may be on the line when a message waits.
    pub fn frame_time(&self) -> Duration {
        let wire = self.0.borrow();
        wire.line_time(wire.status_and_error_len())
    }

    /// How many arrivals there are: for [`Bench::since`].
    pub fn mark(&self) -> usize {
        self.0.borrow().arrivals.len()
    }

    /// What came since `mark`.
    pub fn since(&self, mark: usize) -> Vec<Arrival> {
        let wire = self.0.borrow();
        wire.arrivals.get(mark..).unwrap_or_default().to_vec()
    }

    /// The rejected frame that says most; `None` if none was rejected.
    pub fn rejected(&self) -> Option<Rejected> {
        self.0.borrow().rejected.clone()
    }

    /// Lets everything that has come count as taken: what is waited for next must be new.
    pub fn forget(&self) {
        let mut wire = self.0.borrow_mut();
        wire.taken = wire.arrivals.len();
    }

    /// The next thing that comes, until `until`; `None` if nothing does.
    pub async fn next(&self, until: Duration) -> Option<Arrival> {
        poll_fn(|_| {
            let mut wire = self.0.borrow_mut();
            let next = wire.arrivals.get(wire.taken).copied();
            if next.is_some() {
                wire.taken += 1;
                return Poll::Ready(next);
            }
            if wire.now >= until {
                return Poll::Ready(None);
            }
            wire.wake_at = Some(until);
            Poll::Pending
        })
        .await
    }

    /// Waits until `until`; what comes meanwhile stays to be taken.
    pub async fn sleep_until(&self, until: Duration) {
        poll_fn(|_| {
            let mut wire = self.0.borrow_mut();
            if wire.now >= until {
                return Poll::Ready(());
            }
            wire.wake_at = Some(until);
            Poll::Pending
        })
        .await;
    }

    /// Waits for this long.
    pub async fn sleep(&self, pause: Duration) {
        self.sleep_until(self.now() + pause).await;
    }

    /// Waits for a reset of the DSP; gives when it was.
    pub async fn reset(&self) -> Judged<Duration> {
        self.0.borrow_mut().reset = Reset::Wanted;
        let done = poll_fn(|_| {
            let mut wire = self.0.borrow_mut();
            match wire.reset {
                Reset::Done(at) => Poll::Ready(Some(at)),
                Reset::Declined => Poll::Ready(None),
                Reset::None | Reset::Wanted => {
                    wire.wake_at = None;
                    Poll::Pending
                }
            }
        })
        .await;
        let mut wire = self.0.borrow_mut();
        wire.reset = Reset::None;
        wire.monitor.forget_order();
        match done {
            Some(at) => Ok(at),
            None => not_judged("the DSP was not reset"),
        }
    }

    /// The frame of a message, under the next number.
    pub fn frame(&self, message: impl Into<Permitted>) -> Raw {
        let mut wire = self.0.borrow_mut();
        let (frame, _) = encode(&mut wire, *message.into().message());
        Raw::of_frame(&frame)
    }

    /// The frame of a message under a number of the caller's choice.
    pub fn frame_numbered(&self, message: impl Into<Permitted>, number: Sequence) -> Raw {
        let profile = self.profile();
        let message = message.into();
        Raw::of_frame(message.message().encode_in(profile, number).as_bytes())
    }

    /// Sends a message.
    pub fn send(&self, message: impl Into<Permitted>) -> Judged<Sent> {
        let message = message.into();
        let mut wire = self.0.borrow_mut();
        let (frame, sequence) = encode(&mut wire, *message.message());
        let through_at = wire.put(&frame, describe_uplink(message.message()))?;
        wire.follow(message.message());
        Ok(Sent {
            through_at,
            sequence,
        })
    }

    /// Sends bytes that are no right frame, or are one that was made by [`Bench::frame`].
    pub fn send_raw(&self, raw: &Raw, what: &str) -> Judged<Duration> {
        let mut wire = self.0.borrow_mut();
        wire.monitor.sent_raw(raw.as_bytes());
        wire.put(raw.as_bytes(), what.to_owned())
    }

    /// Until when the acknowledgement of a command must be there whole (section 8.2).
    pub fn ack_limit(&self, sent: &Sent) -> Duration {
        let wire = self.0.borrow();
        // The longest acknowledgement has 8 bytes, 15 in the extended profile; flow control may be on its way, too.
        let len = wire.status_and_error_len() + 15 + 9;
        sent.through_at + ACK_TIME + wire.line_time(len) + wire.setup.slack
    }

    /// Sends a command and waits for its acknowledgement, which must be the next one that comes.
    pub async fn ask(&self, command: impl Into<Permitted>) -> Judged<Arrival> {
        self.forget();
        self.ask_behind(command.into(), false).await
    }

    /// Sends a command and waits for its acknowledgement; `passes_others`: acknowledgements of other commands may come
    /// before it.
    async fn ask_behind(&self, command: Permitted, passes_others: bool) -> Judged<Arrival> {
        let Uplink::Command(asked) = *command.message() else {
            return not_judged("a waypoint is not acknowledged");
        };
        let mut sent = self.send(command)?;
        let mut rejected = None;
        for attempt in 0..self.attempts() {
            if attempt > 0 {
                let again = self.frame_numbered(command, sent.sequence);
                sent.through_at = self.send_raw(&again, "the same again")?;
            }
            let limit = self.ack_limit(&sent);
            while let Some(arrival) = self.next(limit).await {
                if let Err(error) = arrival.event {
                    rejected = Some(error);
                }
                if arrival.ack().is_some() {
                    match judge_ack(asked, sent, &arrival) {
                        Ok(()) => return Ok(arrival),
                        Err(_) if passes_others || self.is_lossy() => {}
                        Err(stop) => return Err(stop),
                    }
                }
            }
        }
        self.be_sure();
        let what = describe_command(&asked);
        broken(match rejected {
            Some(error) => format!(
                "{what} is not acknowledged; a frame came that the PC rejects: {}",
                error.name()
            ),
            None => format!("{what} is not acknowledged in time"),
        })
    }

    /// Reads a 16-bit port.
    pub async fn read_16(&self, port: u16) -> Judged<u16> {
        match self.ask(Harmless::read_16(port)).await?.event {
            Ok(Downlink::Ack16 { value, .. }) => Ok(value),
            _ => broken(format!(
                "the read of port {port} is not answered with 16 bits"
            )),
        }
    }

    /// Reads a 32-bit port.
    pub async fn read_32(&self, port: u16) -> Judged<f32> {
        match self.ask(Harmless::read_32(port)).await?.event {
            Ok(Downlink::Ack32 { value, .. }) => Ok(value),
            _ => broken(format!(
                "the read of port {port} is not answered with 32 bits"
            )),
        }
    }

    /// Writes the status mask.
    pub async fn set_mask(&self, mask: StatusMask) -> Judged {
        let write = Harmless::write_16(QuietPort16::StatusMask, mask.0);
        self.ask(write).await.map(|_| ())
    }

    /// Writes the status period, ms.
    pub async fn set_period(&self, period_ms: u16) -> Judged {
        let write = Harmless::write_16(QuietPort16::StatusPeriod, period_ms);
        self.ask(write).await.map(|_| ())
    }

    /// No status of an earlier mask is on the line.
    pub fn forget_mask(&self) {
        let mut wire = self.0.borrow_mut();
        wire.mask_before = wire.mask;
    }

    /// The status period that the kit has set.
    pub fn period(&self) -> Duration {
        self.0.borrow().period
    }

    /// Until when `count` statuses must have come.
    fn statuses_limit(&self, count: usize) -> Duration {
        let wire = self.0.borrow();
        let each = wire.period + wire.line_time(wire.status_and_error_len());
        let factor = match wire.setup.is_lossy {
            true => LOSSY_TIMEOUT_FACTOR,
            false => 1,
        };
        wire.now + each * (count as u32 + 2) * factor + wire.setup.slack
    }

    /// Waits for `count` statuses that are new.
    pub async fn statuses(&self, count: usize) -> Judged<Vec<(Duration, Status)>> {
        let limit = self.statuses_limit(count);
        let mut seen = Vec::new();
        while seen.len() < count {
            let Some(arrival) = self.next(limit).await else {
                return broken(format!(
                    "{} statuses came where {count} should have",
                    seen.len()
                ));
            };
            if let Some(status) = arrival.status() {
                seen.push((arrival.at, status));
            }
        }
        Ok(seen)
    }

    /// The errors of the link that come with the next `count` statuses: each stands right behind one, so one more is
    /// waited for.
    pub async fn errors(&self, count: usize) -> Judged<Vec<u16>> {
        let mark = self.0.borrow().taken;
        self.statuses(count + 1).await?;
        let seen = self.since(mark);
        Ok(seen.iter().filter_map(Arrival::link_error).collect())
    }

    /// As [`Bench::provoke_pieces`], all at once.
    pub async fn provoke(&self, raw: &Raw, what: &str) -> Judged<Reaction> {
        self.provoke_pieces(std::slice::from_ref(raw), Duration::ZERO, what)
            .await
    }

    /// Sends `pieces` with a pause before each but the first, then a command with a known answer, and gives what came
    /// because of them.
    pub async fn provoke_pieces(
        &self,
        pieces: &[Raw],
        pause: Duration,
        what: &str,
    ) -> Judged<Reaction> {
        self.forget();
        let mark = self.mark();
        for (index, piece) in pieces.iter().enumerate() {
            if index > 0 && !pause.is_zero() {
                self.sleep(pause).await;
            }
            self.send_raw(piece, what)?;
        }
        // In order: what answers the pieces comes before this answer.
        let read = Harmless::read_16(port::STATUS_PERIOD_MS).into();
        if let Err(Stop::Broken(found)) = self.ask_behind(read, true).await {
            return broken(format!("after {what}: {found}"));
        }
        let mut errors = self.errors(3).await?;
        // An error may have been sent before the answer.
        let all = self.since(mark);
        let whole: Vec<u16> = all.iter().filter_map(Arrival::link_error).collect();
        if whole.len() > errors.len() {
            errors = whole;
        }
        let acks = all.iter().filter(|arrival| arrival.ack().is_some()).count();
        Ok(Reaction {
            acks: acks.saturating_sub(1),
            errors,
        })
    }

    /// As [`Bench::provoke`], and judges: how many acknowledgements and which errors must come.
    pub async fn expect(&self, raw: &Raw, what: &str, acks: usize, errors: &[u16]) -> Judged {
        let attempt = async || self.provoke(raw, what).await?.judge(what, acks, errors);
        self.vote(attempt).await
    }

    /// One attempt; on a line that damages bytes as many as agree.
    async fn vote<T>(&self, attempt: impl AsyncFn() -> Judged<T>) -> Judged<T> {
        let (mut kept, mut broken) = (0, 0);
        for _ in 0..self.attempts() {
            let mark = self.mark();
            let outcome = attempt().await;
            if !self.is_lossy() {
                return outcome;
            }
            if !self.is_disturbed(mark) {
                match outcome {
                    Ok(_) => kept += 1,
                    Err(_) => broken += 1,
                }
                if kept == LOSSY_VOTES {
                    return outcome;
                }
                if broken == LOSSY_VOTES {
                    self.be_sure();
                    return outcome;
                }
            }
            self.clear().await;
        }
        self::broken("too few attempts were undisturbed")
    }

    /// The attempts that failed agree.
    fn be_sure(&self) {
        self.0.borrow_mut().is_sure = true;
    }

    /// Whether repeated attempts of the check agree that the DSP is wrong.
    pub fn is_sure(&self) -> bool {
        self.0.borrow().is_sure
    }

    /// Empties the queue of errors before the next attempt.
    async fn clear(&self) {
        // What does not succeed here shows in the attempt.
        let _ = self.ask(Harmless::CLEAR_ERRORS).await;
        let _ = self.statuses(2).await;
    }

    /// Sends a command, and judges that it is acknowledged and which errors it brings.
    pub async fn expect_command(
        &self,
        command: impl Into<Permitted>,
        errors: &[u16],
    ) -> Judged<Arrival> {
        let command = command.into();
        let attempt = async || self.command_and_errors(command, errors).await;
        self.vote(attempt).await
    }

    async fn command_and_errors(&self, command: Permitted, errors: &[u16]) -> Judged<Arrival> {
        let mark = self.mark();
        let answer = self.ask(command).await?;
        self.errors(2).await?;
        let came: Vec<u16> = self
            .since(mark)
            .iter()
            .filter_map(Arrival::link_error)
            .collect();
        ensure(came == errors, || {
            format!(
                "{}: errors {came:?} came where {errors:?} should have",
                describe_uplink(command.message())
            )
        })?;
        Ok(answer)
    }
}

/// What the DSP did because of some bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reaction {
    /// Acknowledgements.
    pub acks: usize,
    /// Errors of the link, in the order of their arrival.
    pub errors: Vec<u16>,
}

impl Reaction {
    /// Judges how many acknowledgements and which errors came because of `what`.
    pub fn judge(&self, what: &str, acks: usize, errors: &[u16]) -> Judged {
        ensure(self.acks == acks, || {
            format!(
                "{what}: {} acknowledgements came where {acks} should have",
                self.acks
            )
        })?;
        ensure(self.errors == errors, || {
            format!(
                "{what}: errors {:?} came where {errors:?} should have",
                self.errors
            )
        })
    }
}

/// What several checks judge: the first of them that runs observes it, for all. On a lossy line each observes by
/// itself, since a check is tried again there.
#[derive(Clone, Debug)]
pub struct Observed<T>(Rc<RefCell<Option<Judged<T>>>>);

impl<T> Default for Observed<T> {
    /// Not observed yet.
    fn default() -> Observed<T> {
        Observed(Rc::default())
    }
}

impl<T: Clone> Observed<T> {
    /// What was observed; by `observe` if no check has done it.
    ///
    /// # Errors
    ///
    /// Why it could not be observed, for each check that asks.
    pub async fn or(&self, bench: &Bench, observe: impl Future<Output = Judged<T>>) -> Judged<T> {
        let known = self.0.borrow().clone();
        if let Some(observed) = known {
            return observed;
        }
        let observed = observe.await;
        if !bench.is_lossy() {
            self.0.replace(Some(observed.clone()));
        }
        observed
    }
}

/// Whether an acknowledgement is that of the command.
fn judge_ack(asked: Command, sent: Sent, arrival: &Arrival) -> Judged {
    let what = describe_command(&asked);
    let (code, kind) = match arrival.event {
        Ok(Downlink::Ack { command }) => (command, "without data"),
        Ok(Downlink::Ack16 { command, .. }) => (command, "with 16 bits"),
        Ok(Downlink::Ack32 { command, .. }) => (command, "with 32 bits"),
        _ => return Ok(()),
    };
    ensure(code == asked.code(), || {
        format!("{what}: the acknowledgement names command {code}")
    })?;
    let expected = match asked {
        Command::Read16 { .. } => "with 16 bits",
        Command::Read32 { .. } => "with 32 bits",
        _ => "without data",
    };
    ensure(kind == expected, || {
        format!("{what}: acknowledged {kind} in place of {expected}")
    })?;
    match arrival.acknowledges {
        Some(number) if number != sent.sequence => broken(format!(
            "{what}: sent under number {}, acknowledged as number {}",
            sent.sequence.number(),
            number.number()
        )),
        _ => Ok(()),
    }
}
