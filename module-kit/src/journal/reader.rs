//! [`Reader`]: pieces to records. It notices what is missing, and goes on at the next snapshot.

use ipc_types::JournalPiece;

use super::bytes::{Cursor, Malformed};
use super::writer::MAX_RECORD;

/// Most bytes of a record's length.
const LENGTH_BYTES: usize = 10;

/// Why the records before a piece do not go on in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Break {
    /// So many pieces are missing.
    Lost(u64),
    /// Another process publishes the journal.
    Restarted,
    /// The writer began again: too much waited, or a piece could not be published.
    BegunAgain,
}

/// Where a piece stands in its journal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Place {
    epoch_ns: u64,
    sequence: u64,
    beginnings: u32,
}

/// Takes the pieces of one journal in the order of their numbers, and gives its records.
///
/// It keeps at most one record that is not complete: [`MAX_RECORD`] bytes.
#[derive(Clone, Debug, Default)]
pub struct Reader {
    last: Option<Place>,
    /// Records can be read: a piece that begins was seen, and none is missing since.
    is_reading: bool,
    bytes: Vec<u8>,
    /// How many of them were given.
    given: usize,
    lost: u64,
}

impl Reader {
    /// Nothing was read.
    pub fn new() -> Reader {
        Reader::default()
    }

    /// Takes the next piece; afterwards call [`Reader::next`] until there is nothing. A piece that was there before is ignored.
    /// Says when the records before it do not go on.
    pub fn take<P: JournalPiece>(&mut self, piece: &P) -> Option<Break> {
        let place = Place {
            epoch_ns: piece.epoch_ns(),
            sequence: piece.sequence(),
            beginnings: piece.beginnings(),
        };
        let broken = match self.last {
            None => None,
            Some(last) if last.epoch_ns != place.epoch_ns => Some(Break::Restarted),
            Some(last) if place.sequence <= last.sequence => return None,
            Some(last) if place.sequence > last.sequence + 1 => {
                Some(Break::Lost(place.sequence - last.sequence - 1))
            }
            Some(last) if last.beginnings != place.beginnings => Some(Break::BegunAgain),
            Some(_) => None,
        };
        self.last = Some(place);
        if let Some(Break::Lost(pieces)) = broken {
            self.lost = self.lost.saturating_add(pieces);
        }
        if broken.is_some() {
            self.stop();
        }
        if piece.begins() {
            self.stop();
            self.is_reading = true;
        }
        if self.is_reading {
            self.bytes.drain(..self.given);
            self.given = 0;
            self.bytes.extend_from_slice(piece.bytes_of_journal());
        }
        broken
    }

    /// The next whole record.
    ///
    /// # Errors
    /// The bytes are no record. Reading goes on at the next piece that begins.
    #[allow(clippy::should_implement_trait)] // What it gives is borrowed.
    pub fn next(&mut self) -> Result<Option<&[u8]>, Malformed> {
        let rest = self.bytes.get(self.given..).unwrap_or_default();
        let mut cursor = Cursor::new(rest);
        let length = match cursor.count(MAX_RECORD) {
            Ok(length) => length,
            // The length may go on in the next piece.
            Err(Malformed)
                if rest.len() < LENGTH_BYTES && rest.iter().all(|byte| byte & 0x80 != 0) =>
            {
                return Ok(None);
            }
            Err(Malformed) => {
                self.stop();
                return Err(Malformed);
            }
        };
        if cursor.rest().len() < length {
            return Ok(None);
        }
        let begin = self.bytes.len() - cursor.rest().len();
        self.given = begin + length;
        Ok(self.bytes.get(begin..self.given))
    }

    /// Gives every whole record to `take`.
    ///
    /// # Errors
    /// The bytes are no record, or `take` says that a record is none: the rest of what was read is dropped, and reading goes on at
    /// the next piece that begins.
    pub fn drain(
        &mut self,
        mut take: impl FnMut(&[u8]) -> Result<(), Malformed>,
    ) -> Result<(), Malformed> {
        while let Some(record) = self.next()? {
            if let Err(malformed) = take(record) {
                self.stop();
                return Err(malformed);
            }
        }
        Ok(())
    }

    /// The records read so far are damaged: goes on at the next piece that begins.
    pub fn stop(&mut self) {
        self.is_reading = false;
        self.bytes.clear();
        self.given = 0;
    }

    /// Whether records can be read; not before the first snapshot, and not between a loss and the next one.
    pub fn is_reading(&self) -> bool {
        self.is_reading
    }

    /// Pieces that are missing so far.
    pub fn lost(&self) -> u64 {
        self.lost
    }
}
