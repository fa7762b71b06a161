//! The test bench: one end of the serial link as a check sees it. A check is linear code that sends and waits; the bench
//! turns it into a value that is given time and bytes, and is drained of bytes.
//!
//! Nothing here waits: a check that does is suspended until [`Wire::advance`] or [`Wire::receive`] has what it waits for.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::future::poll_fn;
use std::num::NonZeroU32;
use std::rc::Rc;
use std::task::Poll;
use std::time::Duration;

use dsp_protocol::{
    Command, DecodeError, Decoded, Decoder, Downlink, DspErrorCode, FlowControl, Profile, Sequence,
    Status, StatusMask, Uplink, port,
};

use crate::monitor::Monitor;
use crate::permitted::{Harmless, MotionWatch, Permitted, QuietPort16, Raw};
use crate::report::{Line, Side};

/// Arrivals that one check may see: two minutes of a status each 4 ms. Further ones are counted, and the check is not judged.
const MAX_ARRIVALS: usize = 32_768;
/// Lines of a dialogue that are kept, the newest ones: what leads to a failure is in the last second or two.
const MAX_LINES: usize = 400;

/// How often a command, or a single expectation, is tried on a line that damages bytes. At 1 % a command with its acknowledgement
/// is undisturbed eight times in ten, an expectation with four statuses three times.
const LOSSY_ATTEMPTS: usize = 40;
/// How many attempts of an expectation without a sign of damage from the DSP decide on such a line: as many that fulfil it, or as
/// many that do not. Damage on the way to the DSP shows no sign, and can look like a fault or hide one.
const LOSSY_VOTES: usize = 3;
/// How many times as long a status may take to come on such a line.
const LOSSY_PATIENCE: u32 = 8;

/// Within which time an acknowledgement begins (section 8.2).
pub const ACK_TIME: Duration = Duration::from_millis(50);

/// How the kit and the line are set up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setup {
    /// What both ends speak.
    pub profile: Profile,
    /// Speed of the line, bits a second; `None`: bytes take no time.
    pub baud: Option<NonZeroU32>,
    /// How late this computer may see a byte, and how late it may send one. It is added to every limit of time.
    pub slack: Duration,
    /// The number of the kit's first command and waypoint in the extended profile.
    pub first_number: Sequence,
    /// Whether the line damages bytes. Then commands and single expectations are repeated, and a check that fails is tried again.
    pub is_lossy: bool,
}

/// Why a check ends before its end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The DSP breaks the sentence: what came, and what should have.
    Broken(String),
    /// The sentence cannot be judged: why.
    NotJudged(String),
}

/// What a check gives.
pub type Judged<T = ()> = Result<T, Stop>;

/// Ends a check: the DSP breaks the sentence.
pub fn broken<T>(found: impl Into<String>) -> Judged<T> {
    Err(Stop::Broken(found.into()))
}

/// Ends a check: it cannot be judged.
pub fn not_judged<T>(why: impl Into<String>) -> Judged<T> {
    Err(Stop::NotJudged(why.into()))
}

/// Breaks the sentence unless `holds`.
pub fn ensure(holds: bool, found: impl FnOnce() -> String) -> Judged {
    match holds {
        true => Ok(()),
        false => broken(found()),
    }
}

/// What came from the DSP.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrival {
    /// When its last byte was seen.
    pub at: Duration,
    /// A message, or bytes that were rejected.
    pub event: Result<Downlink, DecodeError>,
    /// Its number in the extended profile.
    pub sequence: Option<Sequence>,
    /// Of an acknowledgement in the extended profile: the number of the command.
    pub acknowledges: Option<Sequence>,
}

impl Arrival {
    /// The acknowledgement; `None` if it is none.
    pub fn ack(&self) -> Option<Downlink> {
        self.event.ok().filter(is_ack)
    }

    /// The status; `None` if it is none.
    pub fn status(&self) -> Option<Status> {
        match self.event {
            Ok(Downlink::Status(status)) => Some(status),
            _ => None,
        }
    }

    /// The flow control; `None` if it is none.
    pub fn flow(&self) -> Option<FlowControl> {
        match self.event {
            Ok(Downlink::FlowControl(flow)) => Some(flow),
            _ => None,
        }
    }

    /// The code of an error of the link; `None` if it is none, or an error of the DSP's own hardware.
    pub fn link_error(&self) -> Option<u16> {
        match self.event {
            Ok(Downlink::Error(DspErrorCode(code @ (15 | 30 | 100 | 102)))) => Some(code),
            _ => None,
        }
    }
}

fn is_ack(message: &Downlink) -> bool {
    matches!(
        message,
        Downlink::Ack { .. } | Downlink::Ack16 { .. } | Downlink::Ack32 { .. }
    )
}

/// A frame that the kit sent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sent {
    /// When its last byte is through the line.
    pub through_at: Duration,
    /// Its number in the extended profile.
    pub sequence: Sequence,
}

/// The line, the clock and everything that came since the check began.
#[derive(Debug)]
pub struct Wire {
    setup: Setup,
    now: Duration,
    /// When the check that is under way began.
    began: Duration,
    decoder: Decoder<Downlink>,
    /// Bytes of the frame that is arriving.
    arriving: Vec<u8>,
    arrivals: Vec<Arrival>,
    /// How many of them a check has taken.
    taken: usize,
    overflow: bool,
    outbox: Vec<u8>,
    line_free_at: Duration,
    wake_at: Option<Duration>,
    command_number: Sequence,
    waypoint_number: Sequence,
    watch: MotionWatch,
    may_move: bool,
    /// The mask that the kit wrote last, and the one before: a status of that may be on the line still.
    mask: StatusMask,
    mask_before: StatusMask,
    /// The status period that the kit wrote last.
    period: Duration,
    lines: VecDeque<Line>,
    monitor: Monitor,
    reset: Reset,
    /// Whether repeated attempts of the check agree that the DSP is wrong.
    is_sure: bool,
}

/// A reset of the DSP that a check waits for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reset {
    /// None.
    #[default]
    None,
    /// The DSP is to be reset.
    Wanted,
    /// It was, at this time.
    Done(Duration),
    /// It was not.
    Declined,
}

impl Wire {
    /// A line on which nothing was sent yet. With `may_move`, what moves a rotor may pass.
    pub fn new(setup: Setup, may_move: bool) -> Wire {
        Wire {
            setup,
            now: Duration::ZERO,
            began: Duration::ZERO,
            decoder: Decoder::with_profile(setup.profile),
            arriving: Vec::new(),
            arrivals: Vec::new(),
            taken: 0,
            overflow: false,
            outbox: Vec::new(),
            line_free_at: Duration::ZERO,
            wake_at: None,
            command_number: setup.first_number,
            waypoint_number: setup.first_number,
            watch: MotionWatch::default(),
            may_move,
            mask: StatusMask::ALL,
            mask_before: StatusMask::ALL,
            period: Duration::from_secs(10),
            lines: VecDeque::new(),
            monitor: Monitor::new(setup.profile),
            reset: Reset::None,
            is_sure: false,
        }
    }

    /// It is `now`. A time that is past changes nothing.
    pub fn advance(&mut self, now: Duration) {
        self.now = self.now.max(now);
    }

    /// Takes bytes that came until `now`.
    pub fn receive(&mut self, now: Duration, mut bytes: &[u8]) {
        self.advance(now);
        while !bytes.is_empty() {
            let (count, decoded) = self.decoder.receive(bytes);
            let (taken, rest) = bytes.split_at(count);
            self.arriving.extend_from_slice(taken);
            bytes = rest;
            let (event, sequence, acknowledges) = match decoded {
                Decoded::Incomplete => continue,
                Decoded::Message(got) => (Ok(got.message), got.sequence, got.acknowledges),
                Decoded::Rejected(error) => (Err(error), None, None),
            };
            let arrival = Arrival {
                at: self.now,
                event,
                sequence,
                acknowledges,
            };
            let text = match &event {
                Ok(message) => describe_downlink(message),
                Err(error) => format!("rejected: {}", error.name()),
            };
            let bytes = std::mem::take(&mut self.arriving);
            self.record(Side::Dsp, bytes, text);
            self.monitor.saw(&arrival, &self.lines);
            if self.arrivals.len() < MAX_ARRIVALS {
                self.arrivals.push(arrival);
            } else {
                self.overflow = true;
            }
        }
    }

    /// The bytes to send.
    pub fn take_outbox(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.outbox)
    }

    /// When a check wants to go on though nothing came; `None` while it waits for a reset.
    pub fn next_deadline(&self) -> Option<Duration> {
        self.wake_at
    }

    /// Whether the DSP is to be reset.
    pub fn wants_reset(&self) -> bool {
        self.reset == Reset::Wanted
    }

    /// The DSP was reset now, or will not be.
    pub fn end_reset(&mut self, reset: Reset) {
        self.reset = reset;
    }

    /// What the watch over all messages has seen.
    pub fn monitor(&self) -> &Monitor {
        &self.monitor
    }

    /// The newest lines of the check.
    pub fn lines(&self) -> Vec<Line> {
        self.lines.iter().cloned().collect()
    }

    /// Begins a check: forgets what came before.
    pub fn begin_check(&mut self) {
        self.began = self.now;
        self.arrivals.clear();
        self.taken = 0;
        self.overflow = false;
        self.is_sure = false;
        self.lines.clear();
    }

    /// Whether more came than a check may see.
    pub fn overflowed(&self) -> bool {
        self.overflow
    }

    fn record(&mut self, side: Side, bytes: Vec<u8>, text: String) {
        if self.lines.len() == MAX_LINES {
            self.lines.pop_front();
        }
        self.lines.push_back(Line {
            at: self.now.saturating_sub(self.began),
            side,
            bytes,
            text,
        });
    }

    /// How long `bytes` take on the line.
    fn line_time(&self, bytes: usize) -> Duration {
        let Some(baud) = self.setup.baud else {
            return Duration::ZERO;
        };
        Duration::from_secs_f64(bytes as f64 * 10.0 / f64::from(baud.get()))
    }

    /// Puts bytes on the line; gives when the last of them is through.
    fn put(&mut self, bytes: &[u8], text: String) -> Judged<Duration> {
        if self.watch.is_moved_by(bytes) && !self.may_move {
            return not_judged("the kit does not send bytes that could move a rotor");
        }
        self.outbox.extend_from_slice(bytes);
        self.line_free_at = self.line_free_at.max(self.now) + self.line_time(bytes.len());
        self.record(Side::Pc, bytes.to_vec(), text);
        Ok(self.line_free_at)
    }

    /// Bytes of the longest status that may be on the line, and of an error behind it.
    fn status_and_error_len(&self) -> usize {
        let overhead = match self.setup.profile {
            Profile::Classic => 0,
            Profile::Extended => 6,
        };
        let masks = [self.mask, self.mask_before].map(StatusMask::status_frame_len);
        masks.into_iter().fold(0, usize::max) + 5 + 2 * overhead
    }

    /// Keeps what a command changes of how statuses come.
    fn follow(&mut self, message: &Uplink) {
        match *message {
            Uplink::Command(Command::Write16 {
                port: port::STATUS_MASK,
                value,
            }) => {
                self.mask_before = self.mask;
                self.mask = StatusMask(value);
            }
            Uplink::Command(Command::Write16 {
                port: port::STATUS_PERIOD_MS,
                value: value @ 1..=10_000,
            }) => self.period = Duration::from_millis(value.into()),
            _ => {}
        }
    }
}

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

    /// The same; `passes_others`: acknowledgements of other commands may come before it.
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
        let patience = match wire.setup.is_lossy {
            true => LOSSY_PATIENCE,
            false => 1,
        };
        wire.now + each * (count as u32 + 2) * patience + wire.setup.slack
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

    /// The errors of the link that come with the next `count` statuses: each stands right behind one, so one more is waited for.
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

    /// Sends `pieces` with a pause before each but the first, then a command with a known answer, and gives what came because
    /// of them.
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

/// Encodes a message under the next number of its row.
fn encode(wire: &mut Wire, message: Uplink) -> (Vec<u8>, Sequence) {
    let number = match message {
        Uplink::Command(_) => &mut wire.command_number,
        Uplink::Waypoint(_) => &mut wire.waypoint_number,
    };
    let sequence = *number;
    *number = number.next();
    let frame = message.encode_in(wire.setup.profile, sequence);
    (frame.as_bytes().to_vec(), sequence)
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

/// A command in words.
pub fn describe_command(command: &Command) -> String {
    match command {
        Command::Read16 { port } => format!("read {port}"),
        Command::Write16 { port, value } => format!("write {port}: {value}"),
        Command::Read32 { port } => format!("read {port} (32 bits)"),
        Command::Write32 { port, value } => format!("write {port}: {value} (32 bits)"),
        Command::ClearErrors => "clear errors".to_owned(),
        Command::ActivateStatus => "activate status transmission".to_owned(),
        Command::InvalidatePath => "invalidate path".to_owned(),
        Command::Following { on: true } => "following on".to_owned(),
        Command::Following { on: false } => "following off".to_owned(),
    }
}

fn describe_uplink(message: &Uplink) -> String {
    match message {
        Uplink::Command(command) => describe_command(command),
        Uplink::Waypoint(waypoint) => format!(
            "waypoint {} {} {}",
            waypoint.latitude_deg, waypoint.longitude_deg, waypoint.altitude_m
        ),
    }
}

fn describe_downlink(message: &Downlink) -> String {
    match message {
        Downlink::Status(status) => {
            let time = match status.time_ms {
                Some(time) => format!("time {time} ms, "),
                None => String::new(),
            };
            format!(
                "status: mask 0x{:04X}, {time}flag {}",
                status.mask().0,
                u8::from(status.flying)
            )
        }
        Downlink::FlowControl(FlowControl::Send) => "flow control 1".to_owned(),
        Downlink::FlowControl(FlowControl::Stop) => "flow control 0".to_owned(),
        Downlink::Ack { command } => format!("command {command} is acknowledged"),
        Downlink::Ack16 { command, value } => format!("command {command}: {value}"),
        Downlink::Ack32 { command, value } => format!("command {command}: {value}"),
        Downlink::Error(code) => code.to_string(),
    }
}
