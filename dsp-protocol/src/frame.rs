//! Frames: 7-bit packing, header, checksum (`docs/protocol.md` sections 2 and 3).

/// The longest frame: a status with all groups.
pub const MAX_FRAME_LEN: usize = 128;

/// One encoded message, ready for the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame {
    bytes: [u8; MAX_FRAME_LEN],
    len: usize,
}

impl Frame {
    /// The bytes to send.
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes[..self.len]
    }
}
