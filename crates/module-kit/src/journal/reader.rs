//! [`JournalReader`]: pieces to records. It notices what is missing, and goes on at the next snapshot.

use ipc_types::JournalPiece;
use serde::Deserialize;

use super::codec::{Codec, JournalRecord, MAX_RECORD, Malformed};

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
struct PieceIndex {
    epoch_ns: u64,
    sequence: u64,
    beginnings: u32,
}

/// Takes the pieces of one journal in the order of their numbers, and gives its records.
///
/// It keeps at most one record that is not complete: [`MAX_RECORD`] bytes.
#[derive(Clone, Debug, Default)]
pub struct JournalReader {
    last: Option<PieceIndex>,
    /// `None` if no record can be read: before the first piece that begins, after a loss, after damage.
    unread: Option<Unread>,
    codec: Codec,
    lost: u64,
}

/// Bytes of records.
#[derive(Clone, Debug, Default)]
struct Unread {
    bytes: Vec<u8>,
    /// How many of them were given.
    given: usize,
}

impl JournalReader {
    /// Nothing was read.
    pub fn new() -> JournalReader {
        JournalReader::default()
    }

    /// A reader of bytes that begin with a snapshot: the pieces of one journal, one after the other.
    pub fn of(bytes: Vec<u8>) -> JournalReader {
        JournalReader {
            unread: Some(Unread { bytes, given: 0 }),
            ..JournalReader::default()
        }
    }

    /// Takes the next piece; afterwards call [`JournalReader::next`] until there is nothing. A piece that was there
    /// before is ignored. Says when the records before it do not go on.
    pub fn take<P: JournalPiece>(&mut self, piece: &P) -> Option<Break> {
        let place = PieceIndex {
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
            self.unread = None;
        }
        if piece.begins() {
            self.unread = Some(Unread::default());
        }
        if let Some(Unread { bytes, given }) = &mut self.unread {
            bytes.drain(..std::mem::take(given));
            bytes.extend_from_slice(piece.bytes_of_journal());
        }
        broken
    }

    /// The next whole record.
    ///
    /// # Errors
    /// The bytes are no record of this version: the rest of what was taken is dropped, and reading goes on at the next
    /// snapshot.
    #[allow(clippy::should_implement_trait)] // What it gives is borrowed.
    pub fn next<'a, I, O>(&'a mut self) -> Result<Option<JournalRecord<'a, I, O>>, Malformed>
    where
        I: Deserialize<'a>,
        O: Deserialize<'a>,
    {
        let JournalReader { unread, codec, .. } = self;
        let kind = match unread
            .as_mut()
            .map_or(Ok(None), |unread| unread.next(codec))
        {
            Ok(None) => return Ok(None),
            Ok(Some(kind)) => kind,
            Err(malformed) => {
                *unread = None;
                return Err(malformed);
            }
        };
        let codec: &'a Codec = codec;
        match codec.entry(kind) {
            Ok(entry) => Ok(Some(JournalRecord {
                at: codec.at(),
                entry,
            })),
            Err(malformed) => {
                *unread = None;
                Err(malformed)
            }
        }
    }

    /// Pieces that are missing so far.
    pub fn lost(&self) -> u64 {
        self.lost
    }
}

impl Unread {
    /// Lets `codec` take the next record, if there is a whole one. Gives its kind.
    fn next(&mut self, codec: &mut Codec) -> Result<Option<u8>, Malformed> {
        let (length, rest) = match postcard::take_from_bytes::<usize>(&self.bytes[self.given..]) {
            Ok((length, rest)) if length <= MAX_RECORD => (length, rest),
            // The length goes on in the next piece.
            Err(postcard::Error::DeserializeUnexpectedEnd) => return Ok(None),
            _ => return Err(Malformed),
        };
        let Some(record) = rest.get(..length) else {
            return Ok(None);
        };
        self.given = self.bytes.len() - rest.len() + length;
        codec.take(record).map(Some)
    }
}
