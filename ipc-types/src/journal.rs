//! [`JournalPiece`]: the topics of the input journals.

use crate::payload::{
    BRIDGE_JOURNAL_ROOM, BridgeJournal, STATUS_JOURNAL_ROOM, SharedStruct, StatusJournal,
};
use crate::service::Topic;

/// Subscribers of a journal, in all processes: a recorder, one that takes its place, and two that look. A piece is large, and
/// the memory for all that can wait grows with this number.
pub const JOURNAL_SUBSCRIBERS: usize = 4;

/// A topic whose samples are pieces of a journal.
pub trait JournalPiece: Topic {
    /// Most bytes of a piece.
    const ROOM: usize;

    /// Fills in a piece that is all zeros. Of `bytes`, [`ROOM`](JournalPiece::ROOM) are taken.
    fn fill(&mut self, published_ns: u64, begins: bool, beginnings: u32, bytes: &[u8]);

    /// Whether reading can begin with this piece.
    fn begins(&self) -> bool;

    /// How often the journal was begun by this publisher.
    fn beginnings(&self) -> u32;

    /// The bytes that mean something; a length that the contract does not have is that of all.
    fn bytes_of_journal(&self) -> &[u8];
}

macro_rules! journal {
    ($piece:ty, $key:literal, $provider:literal, $room:expr) => {
        crate::topic!($piece, $key, $provider, JOURNAL_SUBSCRIBERS);

        impl JournalPiece for $piece {
            const ROOM: usize = $room;

            fn fill(&mut self, published_ns: u64, begins: bool, beginnings: u32, bytes: &[u8]) {
                let length = bytes.len().min($room);
                self.published_ns = published_ns;
                self.begins = begins.into();
                self.beginnings = beginnings;
                self.length = length as u32;
                self.data[..length].copy_from_slice(&bytes[..length]);
            }

            fn begins(&self) -> bool {
                self.begins == 1
            }

            fn beginnings(&self) -> u32 {
                self.beginnings
            }

            fn bytes_of_journal(&self) -> &[u8] {
                let length = usize::try_from(self.length).unwrap_or($room);
                &self.data[..length.min($room)]
            }
        }

        const _: () = assert!(<$piece as SharedStruct>::LAYOUT.size == $room + 40);
    };
}

journal!(
    BridgeJournal,
    "bridge/journal",
    "bridge",
    BRIDGE_JOURNAL_ROOM
);
journal!(
    StatusJournal,
    "status/journal",
    "status",
    STATUS_JOURNAL_ROOM
);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_piece_takes_what_it_has_room_for_and_gives_it_back() {
        let mut piece = BridgeJournal::default();
        piece.fill(7, true, 2, &[9; 5000]);
        assert!(piece.begins());
        assert_eq!(piece.bytes_of_journal(), &[9; BRIDGE_JOURNAL_ROOM][..]);
        piece.length = u32::MAX;
        assert_eq!(piece.bytes_of_journal().len(), BRIDGE_JOURNAL_ROOM);
        let mut piece = StatusJournal::default();
        piece.fill(7, false, 2, &[1, 2, 3]);
        assert!(!piece.begins());
        assert_eq!(piece.bytes_of_journal(), &[1, 2, 3]);
    }
}
