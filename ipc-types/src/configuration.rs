//! The configuration that a process runs with, in pieces: [`ConfigurationText`] divides it, [`ConfigurationReader`]
//! makes the whole of what comes.
//!
//! Both are pure. A text that its pieces contradict is left out: what is not known is not judged by.

use crate::module::{OfModule, StatusModule};
use crate::payload::{CONFIGURATION_ROOM, ConfigurationPiece};
use crate::random::{FNV_BASIS, fnv};

/// Marks what the bridge publishes in a struct that status publishes as well.
#[derive(Clone, Copy, Debug)]
pub enum OfBridge {}

/// A piece of the bridge's configuration, topic `bridge/configuration`.
pub type BridgeConfiguration = OfModule<OfBridge, ConfigurationPiece>;

/// A piece of status' configuration, topic `status/configuration`.
pub type StatusConfiguration = OfModule<StatusModule, ConfigurationPiece>;

/// Recorders, gateways, and commands that look: twice as many cost 2 MiB of shared memory more.
const MAX_SUBSCRIBERS: usize = 16;

crate::topic!(
    BridgeConfiguration,
    "bridge/configuration",
    "bridge",
    MAX_SUBSCRIBERS
);
crate::topic!(
    StatusConfiguration,
    "status/configuration",
    "status",
    MAX_SUBSCRIBERS
);

/// Longest text, bytes: that of a configuration file. Of a longer one a reader takes nothing.
pub const MAX_CONFIGURATION_LEN: usize = 1 << 20;

/// A configuration as a text, which is ready to be sent.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ConfigurationText {
    text: String,
    hash: u64,
}

impl ConfigurationText {
    /// Of this text.
    pub fn new(text: String) -> ConfigurationText {
        debug_assert!(
            text.len() <= MAX_CONFIGURATION_LEN,
            "a configuration has a bound"
        );
        let hash = fnv(FNV_BASIS, text.as_bytes());
        ConfigurationText { text, hash }
    }

    /// How many pieces it has; one if it is empty.
    pub fn pieces(&self) -> usize {
        self.text.len().div_ceil(CONFIGURATION_ROOM).max(1)
    }

    /// The piece `index`, counted from 0, of configuration `revision`, without what its publisher writes. It allocates
    /// nothing.
    pub fn piece(&self, index: usize, revision: u32) -> ConfigurationPiece {
        let first = (index * CONFIGURATION_ROOM).min(self.text.len());
        let rest = &self.text.as_bytes()[first..];
        let bytes = &rest[..rest.len().min(CONFIGURATION_ROOM)];
        let mut piece = ConfigurationPiece {
            hash: self.hash,
            revision,
            piece: index as u32,
            pieces: self.pieces() as u32,
            total: self.text.len() as u32,
            length: bytes.len() as u32,
            ..ConfigurationPiece::default()
        };
        piece.data[..bytes.len()].copy_from_slice(bytes);
        piece
    }
}

/// Which text a piece is of: publisher, revision, hash, bytes.
type Stamp = (u64, u32, u64, u32);

/// Takes pieces in the order in which they come, and keeps the last text that came whole.
#[derive(Clone, Debug, Default)]
pub struct ConfigurationReader {
    /// The text that is being read: what has come of it, and how many pieces.
    reading: Option<(Stamp, Vec<u8>, u32)>,
    whole: Option<(Stamp, String)>,
}

impl ConfigurationReader {
    /// Nothing is known.
    pub fn new() -> ConfigurationReader {
        ConfigurationReader::default()
    }

    /// Takes a piece. Says whether another text is whole now. After a piece that was lost, the text begins again with
    /// its first piece.
    pub fn take(&mut self, piece: &ConfigurationPiece) -> bool {
        let ConfigurationPiece {
            epoch_ns,
            revision,
            hash,
            total,
            ..
        } = *piece;
        let stamp = (epoch_ns, revision, hash, total);
        let is_known = self.whole.as_ref().is_some_and(|(of, _)| *of == stamp);
        if is_known || total as usize > MAX_CONFIGURATION_LEN {
            self.reading = None;
            return false;
        }
        let (mut bytes, next) = match self.reading.take() {
            Some((of, bytes, next)) if of == stamp && piece.piece == next => (bytes, next),
            _ if piece.piece == 0 => (Vec::new(), 0),
            _ => return false,
        };
        bytes.extend(piece.bytes_of_text());
        if bytes.len() < total as usize && piece.piece + 1 < piece.pieces {
            self.reading = Some((stamp, bytes, next + 1));
            return false;
        }
        let is_whole = bytes.len() == total as usize && fnv(FNV_BASIS, &bytes) == hash;
        let Some(text) = String::from_utf8(bytes).ok().filter(|_| is_whole) else {
            return false;
        };
        self.whole = Some((stamp, text));
        true
    }

    /// The last text that came whole; `None` if none has.
    pub fn text(&self) -> Option<&str> {
        self.whole.as_ref().map(|(_, text)| text.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pieces(text: &str, revision: u32) -> Vec<ConfigurationPiece> {
        let text = ConfigurationText::new(text.to_owned());
        let piece = |index| text.piece(index, revision);
        (0..text.pieces()).map(piece).collect()
    }

    fn take_all(reader: &mut ConfigurationReader, pieces: &[ConfigurationPiece]) -> usize {
        pieces.iter().filter(|piece| reader.take(piece)).count()
    }

    #[test]
    fn the_pieces_are_the_text_again_whatever_its_length() {
        let room = CONFIGURATION_ROOM;
        for (len, expected) in [(0, 1), (1, 1), (room, 1), (room + 1, 2), (10 * room, 10)] {
            // A letter of two bytes lies across the border of two pieces.
            let text = ["a", &"\u{e9}".repeat(len / 2)].concat();
            let text = &text[..if text.is_char_boundary(len) {
                len
            } else {
                len + 1
            }
            .min(text.len())];
            let pieces = pieces(text, 1);
            assert!((expected..=expected + 1).contains(&pieces.len()), "{len}");
            let mut reader = ConfigurationReader::new();
            assert_eq!(take_all(&mut reader, &pieces), 1, "{len}");
            assert_eq!(reader.text(), Some(text), "{len}");
            assert_eq!(take_all(&mut reader, &pieces), 0, "it is known");
        }
    }

    #[test]
    fn the_last_whole_text_stays_until_the_next_one_is_whole() {
        let [first, second] = [1, 2].map(|revision| {
            let text = format!("a = {revision}\n").repeat(400);
            (text.clone(), pieces(&text, revision))
        });
        let mut reader = ConfigurationReader::new();
        // It comes in the middle, and misses one.
        assert_eq!(take_all(&mut reader, &first.1[1..]), 0);
        let (last, before) = first.1.split_last().unwrap();
        assert_eq!(take_all(&mut reader, &before[..1]), 0);
        assert!(!reader.take(last));
        assert_eq!(reader.text(), None);
        assert_eq!(take_all(&mut reader, &first.1), 1);
        assert_eq!(take_all(&mut reader, &second.1[..2]), 0);
        assert_eq!(reader.text(), Some(first.0.as_str()));
        assert_eq!(take_all(&mut reader, &second.1[2..]), 1);
        assert_eq!(reader.text(), Some(second.0.as_str()));
    }

    #[test]
    fn a_text_that_its_pieces_contradict_is_none() {
        type Change = fn(&mut ConfigurationPiece);
        let table: [(&str, Change); 5] = [
            ("another byte", |piece| piece.data[3] ^= 1),
            ("no UTF-8", |piece| piece.data[3] = 0xff),
            ("fewer bytes", |piece| piece.length -= 1),
            ("too long", |piece| piece.total = u32::MAX),
            ("another publisher", |piece| piece.epoch_ns += 1),
        ];
        for (what, change) in table {
            let mut pieces = pieces(&"key = 'value'\n".repeat(150), 1);
            change(&mut pieces[1]);
            let mut reader = ConfigurationReader::new();
            assert_eq!(take_all(&mut reader, &pieces), 0, "{what}");
            assert_eq!(reader.text(), None, "{what}");
        }
    }
}
