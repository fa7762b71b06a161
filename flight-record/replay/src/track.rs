//! [`Track`]: one journal on its way from pieces to a verdict.

use ipc_types::JournalPiece;
use module_kit::journal::bytes::Malformed;
use module_kit::journal::{LogLine, Reader};

use crate::tally::Tally;
use crate::verdict::JournalVerdict;

/// A core that is driven by its journal.
pub trait Driven {
    /// The records before do not go on: the core is dropped until the next snapshot.
    fn stop(&mut self, tally: &mut Tally);

    /// Takes a record.
    ///
    /// # Errors
    /// It is none; the core is then dropped.
    fn take(&mut self, record: &[u8], tally: &mut Tally) -> Result<(), Malformed>;
}

/// One journal.
#[derive(Debug)]
pub struct Track<C> {
    reader: Reader,
    pub core: C,
    tally: Tally,
}

impl<C: Driven> Track<C> {
    pub fn new(core: C) -> Track<C> {
        Track {
            reader: Reader::new(),
            core,
            tally: Tally::default(),
        }
    }

    /// Takes the next sample of the topic.
    pub fn take<P: JournalPiece>(&mut self, piece: &P) {
        let Track {
            reader,
            core,
            tally,
        } = self;
        tally.verdict.pieces += 1;
        tally.verdict.bytes += piece.bytes_of_journal().len() as u64;
        if let Some(cause) = reader.take(piece) {
            core.stop(tally);
            tally.broken(cause);
        }
        let read = reader.drain(|record| match LogLine::of(record)? {
            // Nothing that is published follows from it.
            Some(_) => Ok(()),
            None => core.take(record, tally),
        });
        if read == Err(Malformed) {
            tally.verdict.damaged += 1;
            core.stop(tally);
            tally.end();
        }
    }

    pub fn finish(mut self) -> JournalVerdict {
        self.core.stop(&mut self.tally);
        self.tally.end();
        self.tally.verdict.pieces_lost = self.reader.lost();
        self.tally.verdict
    }
}
