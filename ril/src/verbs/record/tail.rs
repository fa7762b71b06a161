//! [`Tail`]: what the publisher of a journal had not published when it was killed. Those records are the ones that explain its end.

use ipc_types::{Ipc, JournalPiece, LeftTail, OpenError};

/// Follows the publisher of a journal, and has the rest of its journal when it is gone.
pub(super) struct Tail {
    ipc: Ipc,
    open: fn(&Ipc) -> Result<Option<LeftTail>, OpenError>,
    read: fn(&LeftTail, Piece) -> Option<Vec<u8>>,
    /// The last piece, and the file of its publisher; `None` before the first.
    last: Option<(Piece, Option<LeftTail>)>,
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
        Tail {
            ipc: ipc.clone(),
            open: Ipc::left_tail::<P>,
            read: read::<P>,
            last: None,
        }
    }

    /// Notes a piece that was published. Of a new publisher it returns what the one before had not published: a sample that comes before.
    pub fn follow(&mut self, piece: Piece) -> Option<Vec<u8>> {
        if let Some((last, _)) = &mut self.last
            && last.epoch_ns == piece.epoch_ns
        {
            *last = piece;
            return None;
        }
        let rest = self.take_rest();
        let tail = (self.open)(&self.ipc).unwrap_or_else(|error| {
            tracing::debug!(%error, "the tail of a journal cannot be opened");
            None
        });
        self.last = Some((piece, tail));
        rest
    }

    /// What comes after the last piece. `None` while its publisher lives, and if it had published all.
    pub fn take_rest(&mut self) -> Option<Vec<u8>> {
        let (last, tail) = self.last.as_ref()?;
        let rest = (self.read)(tail.as_ref()?, *last)?;
        self.last = None;
        Some(rest)
    }
}

/// The sample in the file, if it is the next after `last`.
fn read<P: JournalPiece>(tail: &LeftTail, last: Piece) -> Option<Vec<u8>> {
    let piece = tail.read::<P>()?;
    let is_next = piece.epoch_ns() == last.epoch_ns && piece.sequence() == last.sequence + 1;
    is_next.then(|| piece.bytes().to_vec())
}
