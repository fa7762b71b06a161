//! [`expanded`]: the records of a chunk, which may be compressed with Zstandard or LZ4.

use std::io::{self, Read};

use lz4_flex::frame::FrameDecoder;
use ruzstd::decoding::StreamingDecoder;

use super::message::ReadError;
use super::record::{ChunkHead, MAX_EXPANDED_BYTES};

/// Why the records of a chunk with this head are not read, although nothing about it is wrong.
pub(super) fn refusal(head: &ChunkHead) -> Option<ReadError> {
    match head.compression.as_str() {
        "" => None,
        "zstd" | "lz4" => {
            let bytes = head.uncompressed_len;
            (bytes > MAX_EXPANDED_BYTES).then_some(ReadError::TooLong { bytes })
        }
        name => Some(ReadError::Compressed(name.to_owned())),
    }
}

/// The records of a chunk without [`refusal`], of which `bytes` lie in the file; `None` if these do not expand to what
/// its head says. It stops at the first byte that is too much.
pub(super) fn expanded(head: &ChunkHead, bytes: Vec<u8>) -> Option<Vec<u8>> {
    let limit = head.uncompressed_len;
    let mut records = Vec::new();
    let read = match head.compression.as_str() {
        "zstd" => zstd(&bytes, limit, &mut records),
        "lz4" => {
            let decoder = FrameDecoder::new(bytes.as_slice());
            decoder.take(limit + 1).read_to_end(&mut records).map(drop)
        }
        _ => return Some(bytes),
    };
    read.ok()?;
    (records.len() as u64 == limit).then_some(records)
}

/// Reads the frames that `bytes` are.
fn zstd(mut bytes: &[u8], limit: u64, records: &mut Vec<u8>) -> io::Result<()> {
    while !bytes.is_empty() && records.len() as u64 <= limit {
        let decoder = StreamingDecoder::new(&mut bytes).map_err(io::Error::other)?;
        let room = limit + 1 - records.len() as u64;
        decoder.take(room).read_to_end(records)?;
    }
    Ok(())
}
