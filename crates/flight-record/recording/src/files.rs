//! [`Files`]: which file is open, what is to be done with it next, and what follows when the disk does not take it.
//!
//! ```text
//! messages ─▶ inbox ─▶ chunk ─▶ steps ─▶ next: an action ─▶ done
//!               ▲                                            │
//!               └── trouble: the next file, after 5 s ◀──────┘
//! ```

mod plan;

use std::collections::VecDeque;
use std::time::Duration;

use ipc_types::MonotonicNs;

use crate::action::{DiskError, DiskErrorKind, FileAction};
use crate::encoder::Encoder;
use crate::inbox::Inbox;
use crate::notes::{Trouble, split_event};
use crate::settings::{Anchor, FlightInfo, Settings};

/// Between two attempts after the disk did not take something.
pub const RETRY_PERIOD: Duration = Duration::from_secs(5);

/// The files of a recorder.
#[derive(Debug)]
pub(crate) struct Files {
    settings: Settings,
    pub(crate) info: FlightInfo,
    pub(crate) inbox: Inbox,
    /// What the clocks showed at the last wake.
    pub(crate) anchor: Anchor,
    /// When the recording began.
    begun: MonotonicNs,
    /// The time of the last call.
    pub(crate) now: MonotonicNs,
    goal: Goal,
    /// Whether the end was asked for. A split that was asked for before it is still done.
    is_ending: bool,
    file: Option<OpenFile>,
    /// What is to be done next; the first one is outstanding if `is_outstanding`.
    steps: VecDeque<FileStep>,
    is_outstanding: bool,
    trouble: Option<Trouble>,
    next_index: u32,
    totals: Totals,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Goal {
    Record,
    /// Write as many entries as these, then finish the file.
    Split(usize),
    End,
    Ended,
}

/// An action, and what it means that it was done.
#[derive(Debug)]
struct FileStep {
    action: FileAction,
    then: Then,
}

#[derive(Clone, Copy, Debug)]
enum Then {
    Created,
    /// The file has this length now, with what the queue has given.
    Written(u64),
    Synced,
    Closed,
    /// A failure is ignored: the file failed already. What it has of a chunk lies within its filler.
    LastSynced,
    GivenUp,
}

impl Files {
    pub(crate) fn new(settings: Settings, info: FlightInfo, anchor: Anchor) -> Files {
        Files {
            inbox: Inbox::new(info.robot, settings.queue_bytes),
            settings,
            info,
            anchor,
            begun: anchor.monotonic,
            now: anchor.monotonic,
            goal: Goal::Record,
            is_ending: false,
            file: None,
            steps: VecDeque::new(),
            is_outstanding: false,
            trouble: None,
            next_index: 0,
            totals: Totals::default(),
        }
    }

    pub(crate) fn next(&mut self) -> Option<FileAction> {
        if self.is_outstanding || self.is_ended() || self.is_paused() {
            return None;
        }
        if self.steps.is_empty() {
            self.plan();
        }
        let action = self.steps.front()?.action.clone();
        self.is_outstanding = true;
        Some(action)
    }

    pub(crate) fn done(&mut self, result: Result<(), DiskError>) {
        if !std::mem::take(&mut self.is_outstanding) {
            return;
        }
        let Some(step) = self.steps.front() else {
            return;
        };
        match (result, step.then) {
            (Err(_), Then::LastSynced) => drop(self.steps.pop_front()),
            (Ok(()), _) | (Err(_), Then::GivenUp) => self.succeed(),
            (Err(error), _) => self.fail(&error),
        }
    }

    pub(crate) fn deadline(&self) -> Option<MonotonicNs> {
        if self.is_outstanding || self.is_ended() {
            return None;
        }
        if let Some(retry_at) = self.retry_at() {
            return Some(retry_at);
        }
        [self.flush_at(), self.sync_at(), self.split_at()]
            .into_iter()
            .flatten()
            .min()
    }

    /// Begins another file if that is due.
    pub(crate) fn split_if_due(&mut self) {
        if self.split_at().is_some_and(|at| at <= self.now) {
            self.split();
        }
    }

    /// Begins another file, when what waits now is written.
    pub(crate) fn split(&mut self) {
        if self.goal == Goal::Record
            && let Some(file) = &self.file
        {
            let event = split_event(self.now, file.index + 1);
            self.inbox.event(self.now, &event);
            self.goal = Goal::Split(self.inbox.queue.len());
        }
    }

    /// Finishes, with one attempt.
    pub(crate) fn end(&mut self) {
        if self.is_ended() {
            return;
        }
        self.is_ending = true;
        if self.goal == Goal::Record {
            self.goal = Goal::End;
        }
        self.inbox.add_loss_events(self.now);
        self.set_retry(None);
        let has_file = self.file.is_some() || self.totals.files == 0;
        if !has_file && self.inbox.queue.len() == 0 {
            self.goal = Goal::Ended;
        }
    }

    pub(crate) fn is_ended(&self) -> bool {
        self.goal == Goal::Ended
    }

    pub(crate) fn totals(&self) -> Totals {
        let queue = &self.inbox.queue;
        Totals {
            added: self.totals.written + queue.messages() + queue.dropped(),
            waiting: queue.messages(),
            dropped: queue.dropped(),
            ..self.totals
        }
    }

    fn retry_at(&self) -> Option<MonotonicNs> {
        self.trouble.as_ref().and_then(|trouble| trouble.retry_at)
    }

    /// Whether the disk is left alone for a while.
    fn is_paused(&self) -> bool {
        self.retry_at().is_some_and(|at| at > self.now)
    }

    /// The first step was done.
    fn succeed(&mut self) {
        let Some(step) = self.steps.pop_front() else {
            return;
        };
        self.set_retry(None);
        match step.then {
            Then::Created => {
                self.next_index += 1;
                self.totals.files += 1;
                if let Some(file) = &mut self.file {
                    file.is_created = true;
                }
            }
            Then::Written(len) => self.written(len),
            Then::Synced | Then::LastSynced => {
                self.totals.synced += self.file.as_mut().map_or(0, OpenFile::synced);
            }
            Then::Closed => {
                self.file = None;
                match self.goal {
                    Goal::Split(_) if self.is_ending => self.goal = Goal::End,
                    Goal::Split(_) | Goal::Record => self.goal = Goal::Record,
                    Goal::End | Goal::Ended => self.ended(),
                }
            }
            Then::GivenUp => self.without_file(),
        }
    }

    fn written(&mut self, len: u64) {
        let (entries, messages) = self.inbox.queue.taken();
        if let Goal::Split(left) = &mut self.goal {
            *left = left.saturating_sub(entries);
        }
        self.totals.written += messages;
        if let Some(file) = &mut self.file {
            self.totals.bytes += len - file.len;
            file.written(len, messages, self.now);
        }
        self.inbox.report_losses(self.now);
        // An empty file says nothing: a full disk may have room for that.
        if entries > 0
            && let Some(trouble) = self.trouble.take()
        {
            let event = trouble.end_event(self.now);
            self.inbox.event(self.now, &event);
        }
    }

    /// The first step was not done.
    fn fail(&mut self, error: &DiskError) {
        if error.kind == DiskErrorKind::LowSpace && !self.is_ending {
            return self.note_trouble(&error.text);
        }
        self.give_up(&error.text);
    }

    /// Gives the file up, whose messages stay in it; those that it did not take stay in the queue.
    fn give_up(&mut self, reason: &str) {
        self.steps.clear();
        self.inbox.queue.take_back();
        self.note_trouble(reason);
        match &self.file {
            Some(file) if file.is_created => {
                let messages = file.messages;
                let is_whole = false;
                self.then(FileAction::Sync, Then::LastSynced);
                self.then(FileAction::Close { is_whole, messages }, Then::GivenUp);
                // The file is closed at once; only the next one waits.
                self.set_retry(None);
            }
            _ => self.without_file(),
        }
    }

    /// The file that failed is closed.
    fn without_file(&mut self) {
        self.file = None;
        if self.is_ending {
            return self.ended();
        }
        self.goal = Goal::Record;
        self.set_retry(Some(self.now + RETRY_PERIOD));
    }

    /// All is done. What still waits came too late, or was not taken.
    fn ended(&mut self) {
        self.inbox.queue.clear();
        self.goal = Goal::Ended;
    }

    fn set_retry(&mut self, at: Option<MonotonicNs>) {
        if let Some(trouble) = &mut self.trouble {
            trouble.retry_at = at;
        }
    }

    /// Takes note that the disk did not take something; an event when that is news.
    fn note_trouble(&mut self, reason: &str) {
        if let Some(trouble) = &mut self.trouble {
            trouble.attempts += 1;
        } else {
            let unsynced = self.file.as_ref().map_or(0, |file| file.unsynced);
            let (trouble, event) = Trouble::begin(self.now, reason, unsynced);
            self.inbox.event(self.now, &event);
            self.trouble = Some(trouble);
        }
        self.set_retry(Some(self.now + RETRY_PERIOD));
    }
}

/// The file that is being written.
#[derive(Debug)]
pub(crate) struct OpenFile {
    /// Gone when the rest of the file was made.
    pub(crate) encoder: Option<Encoder>,
    pub(crate) index: u32,
    /// Whether it was created; before that there is nothing to close.
    pub(crate) is_created: bool,
    /// When it was begun.
    pub(crate) begun: MonotonicNs,
    /// Bytes that the disk has taken as a whole.
    pub(crate) len: u64,
    /// Messages that the disk has taken.
    pub(crate) messages: u64,
    /// Messages of these that were not forced onto the disk yet.
    pub(crate) unsynced: u64,
    /// When the oldest of them was written.
    pub(crate) unsynced_since: Option<MonotonicNs>,
}

impl OpenFile {
    pub(crate) fn new(encoder: Encoder, index: u32, begun: MonotonicNs) -> OpenFile {
        OpenFile {
            encoder: Some(encoder),
            index,
            is_created: false,
            begun,
            len: 0,
            messages: 0,
            unsynced: 0,
            unsynced_since: None,
        }
    }

    /// The disk has taken the file up to `len`, with more `messages`.
    pub(crate) fn written(&mut self, len: u64, messages: u64, now: MonotonicNs) {
        self.len = len;
        self.messages += messages;
        self.unsynced += messages;
        self.unsynced_since.get_or_insert(now);
    }

    /// All that was written was forced onto the disk; gives how many messages.
    pub(crate) fn synced(&mut self) -> u64 {
        self.unsynced_since = None;
        std::mem::take(&mut self.unsynced)
    }
}

/// Counts of a recorder since its start. `added = written + waiting + dropped`. Events are not counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Totals {
    /// Messages that were added, the dropped ones included.
    pub added: u64,
    /// Messages that the disk has taken.
    pub written: u64,
    /// Messages that were forced onto the disk, of those that were written.
    pub synced: u64,
    /// Messages that wait in memory.
    pub waiting: u64,
    /// Messages that were dropped.
    pub dropped: u64,
    /// Bytes that the disk has taken, endings and indexes included.
    pub bytes: u64,
    /// Files that were begun.
    pub files: u32,
}
