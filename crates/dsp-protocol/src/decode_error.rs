//! Why a decoder rejects bytes (`docs/protocol.md` sections 2 and 11).

/// Why bytes from the line were discarded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum DecodeError {
    /// Bytes without a header before them; reported once for each run of them.
    Stray,
    /// A header that this direction does not have.
    UnknownHeader,
    /// A header arrived inside a message.
    Truncated,
    /// The checksum or the CRC is wrong (`CHECKSUMERROR`).
    Checksum,
    /// The checksum is right, but the unused bits of a value are not zero.
    Padding,
    /// The checksum is right, but a field has a value that it cannot have.
    Value,
    /// A command whose code is over 7; only the DSP's side sees it, and reports it as error 30.
    UnknownCommand,
    /// A header that this direction has in the other profile: the ends of the line are configured differently.
    OtherProfile,
}

impl DecodeError {
    /// All reasons, in the order of their counters.
    pub const ALL: [DecodeError; 8] = [
        DecodeError::Stray,
        DecodeError::UnknownHeader,
        DecodeError::Truncated,
        DecodeError::Checksum,
        DecodeError::Padding,
        DecodeError::Value,
        DecodeError::UnknownCommand,
        DecodeError::OtherProfile,
    ];

    /// The reason in logs and test vectors.
    pub const fn name(self) -> &'static str {
        match self {
            DecodeError::Stray => "stray",
            DecodeError::UnknownHeader => "unknown_header",
            DecodeError::Truncated => "truncated",
            DecodeError::Checksum => "checksum",
            DecodeError::Padding => "padding",
            DecodeError::Value => "value",
            DecodeError::UnknownCommand => "unknown_command",
            DecodeError::OtherProfile => "other_profile",
        }
    }
}
