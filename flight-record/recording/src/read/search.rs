//! [`Search`]: where the next whole chunk lies behind a damaged place.

use mcap::records::op;

use super::record::{self, Record};

/// How often the bytes of a file are summed up at most, while chunks are searched. A damaged file needs one; a file that was
/// made to look like chunks everywhere could take hours.
const MAX_SUMS: usize = 4;

/// Searches chunks.
pub(super) struct Search<'a> {
    bytes: &'a [u8],
    /// Bytes that may be summed up.
    budget: usize,
}

impl<'a> Search<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Search<'a> {
        Search {
            bytes,
            budget: bytes.len().saturating_mul(MAX_SUMS),
        }
    }

    /// Where a chunk begins, at `from` or behind, whose checksum fits.
    pub(super) fn chunk_from(&mut self, mut from: usize) -> Option<usize> {
        loop {
            let rest = self.bytes.get(from..)?;
            let found = from + rest.iter().position(|byte| *byte == op::CHUNK)?;
            if self.is_chunk(&self.bytes[found..])? {
                return Some(found);
            }
            from = found + 1;
        }
    }

    /// Whether a chunk lies at the beginning; nothing when the search has to end.
    fn is_chunk(&mut self, bytes: &'a [u8]) -> Option<bool> {
        let chunk = Record::first(bytes).and_then(|record| record::chunk(record.content));
        let Some(chunk) = chunk else {
            return Some(false);
        };
        // Without a checksum, anything could look like a chunk.
        if chunk.crc == 0 || chunk.uncompressed_len != chunk.records.len() as u64 {
            return Some(false);
        }
        self.budget = self.budget.checked_sub(chunk.records.len())?;
        Some(chunk.compression.is_empty() && chunk.is_sound())
    }
}
