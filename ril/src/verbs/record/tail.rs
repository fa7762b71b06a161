//! [`Tail`]: what the publisher of a journal had not published when it was killed. Those records are the ones that explain its end.

use ipc_types::{Ipc, JournalPiece, LeftTail, OpenError};

/// Follows the publishers of a journal, and has the rest of the journal of one that is gone.
pub(super) struct Tail {
    ipc: Ipc,
    open: fn(&Ipc) -> Result<Option<LeftTail>, OpenError>,
    read: fn(&LeftTail, Option<Piece>) -> Option<Vec<u8>>,
    /// That of the publisher that lived when it was opened.
    file: Option<LeftTail>,
    /// The last piece of that publisher.
    last: Option<Piece>,
}

/// Which piece of which publisher.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Piece {
    pub epoch_ns: u64,
    pub sequence: u64,
}

impl Tail {
    /// Of the journal whose pieces are `P`.
    pub fn of<P: JournalPiece>(ipc: &Ipc) -> Tail {
        let mut tail = Tail {
            ipc: ipc.clone(),
            open: Ipc::left_tail::<P>,
            read: read::<P>,
            file: None,
            last: None,
        };
        tail.open_next();
        tail
    }

    /// Notes a piece that was published. Of a new publisher it returns what the one before had not published: a sample that comes before.
    pub fn follow(&mut self, piece: Piece) -> Option<Vec<u8>> {
        let is_other = self
            .last
            .is_some_and(|last| last.epoch_ns != piece.epoch_ns);
        let rest = is_other.then(|| self.take_rest()).flatten();
        self.last = Some(piece);
        rest
    }

    /// What comes after the last piece, if its publisher is gone and had not published all. From here on it follows the next one.
    pub fn take_rest(&mut self) -> Option<Vec<u8>> {
        let file = self.file.take_if(|file| file.is_left());
        let rest = file.and_then(|file| (self.read)(&file, self.last));
        if self.file.is_none() {
            self.last = None;
            self.open_next();
        }
        rest
    }

    fn open_next(&mut self) {
        let opened = (self.open)(&self.ipc);
        if let Err(error) = &opened {
            tracing::debug!(%error, "the tail of a journal cannot be opened");
        }
        // What the dead have left was taken, or belongs to a time that is not recorded.
        self.file = opened.ok().flatten().filter(|file| !file.is_left());
    }
}

/// The sample in the file, if it goes on after `last`, or is the first.
fn read<P: JournalPiece>(tail: &LeftTail, last: Option<Piece>) -> Option<Vec<u8>> {
    let piece = tail.read::<P>()?;
    let goes_on = match last {
        Some(last) => piece.epoch_ns() == last.epoch_ns && piece.sequence() == last.sequence + 1,
        None => piece.begins(),
    };
    goes_on.then(|| piece.bytes().to_vec())
}
