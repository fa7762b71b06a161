//! [`Digest`]: what a kept flight has of an output.

use serde::{Deserialize, Serialize};

/// What was said, as far as it is kept: enough to see that something else is said.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Digest {
    /// The variant of the output.
    pub variant: u8,
    /// CRC-32 of the output in postcard's format.
    pub crc: [u8; 4],
}

impl Digest {
    /// The digest of an output.
    pub fn of<O: Serialize>(output: &O) -> Digest {
        // Writing into memory does not fail.
        let bytes = postcard::to_allocvec(output).unwrap_or_default();
        Digest {
            // The bytes of an enum begin with the number of its variant.
            variant: bytes.first().copied().unwrap_or_default(),
            crc: crc32fast::hash(&bytes).to_le_bytes(),
        }
    }
}
