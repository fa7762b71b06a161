//! The line as a value: bytes and time in, bytes out, and everything that came since the check began.

use std::collections::VecDeque;
use std::num::NonZeroU32;
use std::time::Duration;

use dsp_protocol::{
    Command, DecodeError, Decoded, Decoder, Downlink, Profile, Sequence, StatusMask, Uplink, port,
};

use crate::arrival::{Arrival, describe_downlink};
use crate::monitor::Monitor;
use crate::outcome::{Judged, not_judged};
use crate::permitted::MotionWatch;
use crate::report::{Line, Rejected, Side};

/// Arrivals that one check may see: two minutes of a status each 4 ms. Further ones are counted, and the check is not
/// judged.
const MAX_ARRIVALS: usize = 32_768;
/// Lines of a dialogue that are kept, the newest ones: a minute and a half with a status each 50 ms. Those of all
/// checks but of long flights are whole.
const MAX_LINES: usize = 2_048;

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
    /// Whether the line damages bytes. Then commands and single expectations are repeated, and a check that fails is
    /// tried again.
    pub is_lossy: bool,
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
    pub(crate) setup: Setup,
    pub(crate) now: Duration,
    /// When the check that is under way began.
    pub(crate) began: Duration,
    pub(crate) decoder: Decoder<Downlink>,
    /// Bytes of the frame that is arriving.
    pub(crate) arriving: Vec<u8>,
    pub(crate) arrivals: Vec<Arrival>,
    /// How many of them a check has taken.
    pub(crate) taken: usize,
    pub(crate) overflow: bool,
    pub(crate) outbox: Vec<u8>,
    pub(crate) line_free_at: Duration,
    pub(crate) wake_at: Option<Duration>,
    pub(crate) command_number: Sequence,
    pub(crate) waypoint_number: Sequence,
    pub(crate) watch: MotionWatch,
    pub(crate) may_move: bool,
    /// The mask that the kit wrote last, and the one before: a status of that may be on the line still.
    pub(crate) mask: StatusMask,
    pub(crate) mask_before: StatusMask,
    /// The status period that the kit wrote last.
    pub(crate) period: Duration,
    pub(crate) lines: VecDeque<Line>,
    pub(crate) monitor: Monitor,
    pub(crate) reset: Reset,
    /// Whether repeated attempts of the check agree that the DSP is wrong.
    pub(crate) is_sure: bool,
    /// The first rejected frame, or the first with a wrong check field: that says most.
    pub(crate) rejected: Option<Rejected>,
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
            rejected: None,
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
            let room = Rejected::MAX_BYTES.saturating_sub(self.arriving.len());
            self.arriving.extend(taken.iter().take(room));
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
            let bytes = std::mem::take(&mut self.arriving);
            let text = match &event {
                Ok(message) => describe_downlink(message),
                Err(error) => self.reject(*error, &bytes),
            };
            self.record(Side::Dsp, bytes, text);
            self.monitor.saw(&arrival, &self.lines);
            if self.arrivals.len() < MAX_ARRIVALS {
                self.arrivals.push(arrival);
            } else {
                self.overflow = true;
            }
        }
    }

    /// Keeps the rejected frame that says most; gives why it is rejected.
    fn reject(&mut self, error: DecodeError, bytes: &[u8]) -> String {
        let rejected = Rejected {
            error,
            bytes: bytes.to_vec(),
        };
        let text = format!("rejected: {}", rejected.describe(self.setup.profile));
        let kept = self.rejected.as_ref().map(|kept| kept.error);
        let says_more = error == DecodeError::Checksum && kept != Some(error);
        if kept.is_none() || says_more {
            self.rejected = Some(rejected);
        }
        text
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
        self.lines.clear();
        self.forget_arrivals();
    }

    /// Forgets what came, but not the dialogue.
    pub fn forget_arrivals(&mut self) {
        self.arrivals.clear();
        self.taken = 0;
        self.overflow = false;
        self.is_sure = false;
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
    pub(crate) fn line_time(&self, bytes: usize) -> Duration {
        let Some(baud) = self.setup.baud else {
            return Duration::ZERO;
        };
        Duration::from_secs_f64(bytes as f64 * 10.0 / f64::from(baud.get()))
    }

    /// Puts bytes on the line; gives when the last of them is through.
    pub(crate) fn put(&mut self, bytes: &[u8], text: String) -> Judged<Duration> {
        if self.watch.is_moved_by(bytes) && !self.may_move {
            return not_judged("the kit does not send bytes that could move a rotor");
        }
        self.outbox.extend_from_slice(bytes);
        self.line_free_at = self.line_free_at.max(self.now) + self.line_time(bytes.len());
        self.record(Side::Pc, bytes.to_vec(), text);
        Ok(self.line_free_at)
    }

    /// Bytes of the longest status that may be on the line, and of an error behind it.
    pub(crate) fn status_and_error_len(&self) -> usize {
        let overhead = match self.setup.profile {
            Profile::Classic => 0,
            Profile::Extended => 6,
        };
        let masks = [self.mask, self.mask_before].map(StatusMask::status_frame_len);
        masks.into_iter().fold(0, usize::max) + 5 + 2 * overhead
    }

    /// Keeps what a command changes of how statuses come.
    pub(crate) fn follow(&mut self, message: &Uplink) {
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

/// Encodes a message under the next number of its row.
pub(crate) fn encode(wire: &mut Wire, message: Uplink) -> (Vec<u8>, Sequence) {
    let number = match message {
        Uplink::Command(_) => &mut wire.command_number,
        Uplink::Waypoint(_) => &mut wire.waypoint_number,
    };
    let sequence = *number;
    *number = number.next();
    let frame = message.encode_in(wire.setup.profile, sequence);
    (frame.as_bytes().to_vec(), sequence)
}
