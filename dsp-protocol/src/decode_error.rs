//! Why a decoder rejects bytes (`docs/protocol.md` sections 2 and 11).

/// Why bytes from the line were discarded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Refusal {
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

impl Refusal {
    /// All reasons, in the order of their counters.
    pub const ALL: [Refusal; 8] = [
        Refusal::Stray,
        Refusal::UnknownHeader,
        Refusal::Truncated,
        Refusal::Checksum,
        Refusal::Padding,
        Refusal::Value,
        Refusal::UnknownCommand,
        Refusal::OtherProfile,
    ];

    /// The reason in logs and test vectors.
    pub const fn name(self) -> &'static str {
        match self {
            Refusal::Stray => "stray",
            Refusal::UnknownHeader => "unknown_header",
            Refusal::Truncated => "truncated",
            Refusal::Checksum => "checksum",
            Refusal::Padding => "padding",
            Refusal::Value => "value",
            Refusal::UnknownCommand => "unknown_command",
            Refusal::OtherProfile => "other_profile",
        }
    }
}
