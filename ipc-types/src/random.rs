//! Unique names.

use crate::request_id::fresh_request_id;

/// Letters and digits that file names of every kind may have.
const LETTERS: &[u8; 32] = b"abcdefghijklmnopqrstuvwxyz234567";

/// A random name of `len` letters, five bits each, at most ten.
pub(crate) fn name(len: usize) -> String {
    letters(fresh_request_id(), len)
}

/// The lowest `5 · len` bits of `number` as letters.
pub(crate) fn letters(number: u64, len: usize) -> String {
    (0..len)
        .map(|index| {
            let bits = number.checked_shr(5 * index as u32).unwrap_or(0) & 31;
            char::from(LETTERS[bits as usize])
        })
        .collect()
}

/// A hash of `bytes`, of whose lowest bits every one depends on all of them.
pub(crate) fn hash(bytes: &[u8]) -> u64 {
    let hash = bytes.iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3)
    });
    hash ^ (hash >> 32)
}
