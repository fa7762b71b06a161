//! [`Recorder`]: messages in, actions on files out. A pure value without file, clock and thread.

use ipc_types::MonotonicNs;

use crate::action::{DiskError, FileAction};
use crate::event::Event;
use crate::files::{Files, Totals};
use crate::notes::clock_event;
use crate::settings::{Anchor, Channel, ChannelId, FlightInfo, Settings};

/// Makes the files of a recording out of messages.
///
/// The caller performs one [`FileAction`] after the other, on a thread of its own if the disk may be slow:
///
/// 1. [`add`](Recorder::add) and [`event`](Recorder::event) whenever there is something to record; they never wait for
///    the disk;
/// 2. [`wake`](Recorder::wake) at the [`deadline`](Recorder::deadline);
/// 3. after each of these, and after [`done`](Recorder::done): perform what [`next`](Recorder::next) gives, and report
///    how that went by `done`;
/// 4. [`end`](Recorder::end), and actions until [`is_ended`](Recorder::is_ended).
#[derive(Debug)]
pub struct Recorder {
    files: Files,
}

impl Recorder {
    /// A recorder that has not begun a file. The first action opens it.
    pub fn new(settings: Settings, info: FlightInfo, anchor: Anchor) -> Recorder {
        Recorder {
            files: Files::new(settings, info, anchor),
        }
    }

    /// The id of a channel; the same one when it is known already. Each file that is open or will be opened has it,
    /// even without a message.
    ///
    /// There are at most [`MAX_CHANNELS`](crate::MAX_CHANNELS); beyond that, nothing is given.
    pub fn channel(&mut self, channel: Channel) -> Option<ChannelId> {
        self.files.inbox.channels.add(channel)
    }

    /// Says anew what is known of the flight: the present file has what is new from its next write on, and following
    /// ones begin with it.
    pub fn describe(&mut self, info: FlightInfo) {
        self.files.info = info;
    }

    /// Records a message: `cdr` is the message with its header of four bytes, `at` the time in it.
    ///
    /// `at`, or `now` if that is earlier, becomes its `publish_time`. Its `log_time` is the same, or later when
    /// messages of later times are in the file already: within a file, `log_time` never goes back. Nor is it ever later
    /// than `now`, or earlier than the recording.
    ///
    /// When the queue is full the message is dropped and counted; the file gets an event in its place.
    pub fn add(
        &mut self,
        now: MonotonicNs,
        channel: ChannelId,
        at: MonotonicNs,
        sequence: u32,
        cdr: &[u8],
    ) {
        self.files.now = now;
        self.files.inbox.message(now, channel, at, sequence, cdr);
    }

    /// Records an event, in its place among the messages.
    pub fn event(&mut self, now: MonotonicNs, event: &Event) {
        self.files.now = now;
        self.files.inbox.event(now, event);
    }

    /// The next thing to do with files, once; `None` while the answer to the last one is outstanding, or until the
    /// [`deadline`](Recorder::deadline).
    #[expect(clippy::should_implement_trait, reason = "it is asked again and again")]
    pub fn next(&mut self) -> Option<FileAction> {
        self.files.next()
    }

    /// The answer to the last action.
    pub fn done(&mut self, now: MonotonicNs, result: Result<(), DiskError>) {
        self.files.now = now;
        self.files.done(result);
    }

    /// When [`wake`](Recorder::wake) has to be called; nothing means not before the next call of another method.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        self.files.deadline()
    }

    /// Does what is due at `now`. `anchor` is what the clocks show now; the next file is begun with it.
    pub fn wake(&mut self, now: MonotonicNs, anchor: Anchor) {
        self.files.now = now;
        if let Some(event) = clock_event(now, self.files.anchor, anchor) {
            self.files.inbox.event(now, &event);
        }
        self.files.anchor = anchor;
        self.files.split_if_due();
    }

    /// Finishes the file and begins another one with the messages that come from now on.
    pub fn split(&mut self, now: MonotonicNs, anchor: Anchor) {
        self.files.now = now;
        self.files.anchor = anchor;
        self.files.split();
    }

    /// Finishes the recording; what cannot be written at the first attempt is lost.
    pub fn end(&mut self, now: MonotonicNs) {
        self.files.now = now;
        self.files.end();
    }

    /// Whether all is done after [`end`](Recorder::end).
    pub fn is_ended(&self) -> bool {
        self.files.is_ended()
    }

    /// The counts.
    pub fn totals(&self) -> Totals {
        self.files.totals()
    }
}
