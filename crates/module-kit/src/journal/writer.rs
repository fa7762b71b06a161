//! [`JournalWriter`]: entries to pieces. A pure value; while nothing is recorded it is asked one question for each
//! input.
//!
//! A record is written before its sample is published, so nothing is allocated for one: every buffer keeps its memory,
//! and the bytes of pieces that were published are [given back](JournalWriter::give_back).

use std::collections::VecDeque;
use std::time::Duration;

use ipc_types::MonotonicNs;
use serde::Serialize;

use super::codec::{Codec, LogLine, MAX_RECORD, Malformed};

/// Bytes that may wait until they are published. When more come the journal loses them all, and begins again with a
/// snapshot.
pub const MAX_WAITING: usize = 4 << 20;

/// How long a piece that is not full waits for more records.
pub const DELAY: Duration = Duration::from_millis(200);

/// How long the journal goes on until there is another snapshot: a loss costs a reader at most so much of it. Later,
/// when a snapshot has more than a quarter of the bytes that were written since the last one.
pub const CHECKPOINT: Duration = Duration::from_secs(10);
const SNAPSHOT_SHARE: u64 = 4;

/// Buffers of published pieces that are kept. In a flight one piece is filled and one is published; the others are for
/// bursts.
const MAX_SPARE: usize = 8;

/// Bytes of the longest number in postcard's format.
const MAX_LENGTH: usize = 10;

/// A piece of a journal.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Piece {
    /// The first byte begins a record that is a snapshot.
    pub begins: bool,
    /// How often the journal has begun.
    pub beginnings: u32,
    /// The bytes, at most as many as a piece has room for.
    pub bytes: Vec<u8>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum WriterState {
    /// Nothing is recorded.
    Off,
    /// The next record must be a snapshot.
    Begins,
    /// Records are taken; when and how long the last snapshot was.
    On { since: MonotonicNs, length: u64 },
}

/// Turns entries into pieces of at most `room` bytes.
#[derive(Clone, Debug)]
pub struct JournalWriter {
    room: usize,
    state: WriterState,
    /// The piece that is being filled, and when it got its first byte.
    open: Piece,
    open_since: Option<MonotonicNs>,
    /// Full pieces, oldest first.
    full: VecDeque<Piece>,
    waiting: usize,
    /// Memory for the next pieces.
    spare: Vec<Vec<u8>>,
    /// A reader has come that needs a snapshot.
    is_asked: bool,
    /// Bytes since the last snapshot.
    since_snapshot: u64,
    beginnings: u32,
    losses: u64,
    codec: Codec,
    record: Vec<u8>,
}

impl JournalWriter {
    /// A writer that is off; its pieces have room for so many bytes.
    pub fn new(room: usize) -> JournalWriter {
        JournalWriter {
            room: room.max(1),
            state: WriterState::Off,
            open: Piece::default(),
            open_since: None,
            full: VecDeque::with_capacity(2 * MAX_SPARE),
            waiting: 0,
            spare: Vec::with_capacity(MAX_SPARE),
            is_asked: false,
            since_snapshot: 0,
            beginnings: 0,
            losses: 0,
            codec: Codec::default(),
            record: Vec::new(),
        }
    }

    /// A new journal begins with the next snapshot. What waits of the one before is dropped.
    pub fn start(&mut self) {
        self.stop();
        self.state = WriterState::Begins;
    }

    /// A reader has come: there is a snapshot before the next record. For those that read already the journal goes on.
    pub fn ask_for_snapshot(&mut self) {
        self.is_asked = self.is_on();
    }

    /// Nothing is recorded any more; what waits is dropped.
    pub fn stop(&mut self) {
        self.state = WriterState::Off;
        self.open.bytes.clear();
        self.open_since = None;
        self.full.clear();
        self.waiting = 0;
    }

    /// Whether a journal is written, or is about to be.
    pub fn is_started(&self) -> bool {
        self.state != WriterState::Off
    }

    /// Whether records are taken.
    pub fn is_on(&self) -> bool {
        matches!(self.state, WriterState::On { .. })
    }

    /// Whether a snapshot is to be written before the next record.
    pub fn wants_snapshot(&self, now: MonotonicNs) -> bool {
        match self.state {
            WriterState::Off => false,
            WriterState::Begins => true,
            WriterState::On { .. } if self.is_asked => true,
            WriterState::On { since, length } => {
                now.since(since) >= CHECKPOINT && self.since_snapshot >= SNAPSHOT_SHARE * length
            }
        }
    }

    /// Writes a snapshot, in a piece of its own beginning.
    pub fn snapshot(&mut self, now: MonotonicNs, snapshot: &[u8]) {
        if self.state == WriterState::Off {
            return;
        }
        if self.state == WriterState::Begins {
            self.beginnings = self.beginnings.wrapping_add(1);
        }
        self.is_asked = false;
        self.close();
        self.open.begins = true;
        self.open.beginnings = self.beginnings;
        self.state = WriterState::On {
            since: now,
            length: 0,
        };
        self.write(now, |codec, out| codec.put_snapshot(now, snapshot, out));
        if let WriterState::On { length, .. } = &mut self.state {
            *length = self.record.len() as u64;
        }
        self.since_snapshot = 0;
    }

    /// Writes an input of the core. Nothing happens while entries are not taken; so with the other ones.
    pub fn input<I: Serialize>(&mut self, now: MonotonicNs, input: &I) {
        self.write(now, |codec, out| codec.put_input(now, input, out));
    }

    /// Writes what the core said to the last input.
    pub fn output<O: Serialize>(&mut self, output: &O) {
        let at = self.codec.at();
        self.write(at, |codec, out| codec.put_output(at, output, out));
    }

    /// Writes a line of the log, of the time `at`.
    pub fn line(&mut self, now: MonotonicNs, at: MonotonicNs, line: &LogLine<'_>) {
        self.write(now, |codec, out| codec.put_line(at, line, out));
    }

    fn write(
        &mut self,
        now: MonotonicNs,
        fill: impl FnOnce(&mut Codec, &mut Vec<u8>) -> Result<(), Malformed>,
    ) {
        if !self.is_on() {
            return;
        }
        let mut record = std::mem::take(&mut self.record);
        record.clear();
        let filled = fill(&mut self.codec, &mut record);
        if filled.is_err() || record.len() > MAX_RECORD || self.waiting + record.len() > MAX_WAITING
        {
            self.losses += 1;
            self.start();
        } else {
            self.append(now, &record);
        }
        self.record = record;
    }

    /// How often records were lost because too many waited, or one was too long.
    pub fn losses(&self) -> u64 {
        self.losses
    }

    /// The next piece to publish: one that is full, or has waited for [`DELAY`].
    pub fn next(&mut self, now: MonotonicNs) -> Option<Piece> {
        if self.full.is_empty() && self.open_since.is_some_and(|since| now >= since + DELAY) {
            self.close();
        }
        let piece = self.full.pop_front()?;
        self.waiting -= piece.bytes.len();
        Some(piece)
    }

    /// Takes the memory of a piece that was published.
    pub fn give_back(&mut self, piece: Piece) {
        if self.spare.len() < MAX_SPARE {
            self.spare.push(piece.bytes);
        }
    }

    /// The next piece, as if it had waited long enough.
    pub fn take_all(&mut self) -> impl Iterator<Item = Piece> + '_ {
        self.close();
        self.waiting = 0;
        self.full.drain(..)
    }

    /// Bytes that are not published.
    pub fn waiting(&self) -> usize {
        self.waiting
    }

    /// What is not published: how many pieces wait, and the one that is being filled.
    pub fn unpublished(&self) -> (u64, &Piece) {
        (self.full.len() as u64, &self.open)
    }

    /// When [`JournalWriter::next`] has a piece that was not full.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        self.open_since.map(|since| since + DELAY)
    }

    /// Whether pieces wait that are full.
    pub fn has_full(&self) -> bool {
        !self.full.is_empty()
    }

    fn append(&mut self, now: MonotonicNs, record: &[u8]) {
        let mut room = [0; MAX_LENGTH];
        // Writing a number where it has room does not fail.
        let length = postcard::to_slice(&record.len(), &mut room).unwrap_or_default();
        self.since_snapshot += (length.len() + record.len()) as u64;
        for mut bytes in [&*length, record] {
            while !bytes.is_empty() {
                let left = self.room - self.open.bytes.len();
                let (now_bytes, later) = bytes.split_at(left.min(bytes.len()));
                self.open.bytes.extend_from_slice(now_bytes);
                self.waiting += now_bytes.len();
                self.open_since.get_or_insert(now);
                bytes = later;
                if self.open.bytes.len() == self.room {
                    self.close();
                }
            }
        }
    }

    /// The open piece is complete, if it has a byte.
    fn close(&mut self) {
        self.open_since = None;
        if self.open.bytes.is_empty() {
            return;
        }
        let mut bytes = self.spare.pop().unwrap_or_default();
        bytes.clear();
        bytes.reserve(self.room);
        let next = Piece {
            begins: false,
            beginnings: self.beginnings,
            bytes,
        };
        let piece = std::mem::replace(&mut self.open, next);
        self.full.push_back(piece);
    }
}
