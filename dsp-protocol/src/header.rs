//! The headers of both directions (`docs/protocol.md` section 2).
//!
//! | constant | byte | direction | message | length in bytes |
//! |---|---|---|---|---|
//! | [`STATUS`] | `0xE9` | DSP → PC | status | 6 + groups of its mask |
//! | [`FLOW_CONTROL`] | `0xAA` | DSP → PC | flow control | 3 |
//! | [`ACK`] | `0xC3` | DSP → PC | acknowledgement without data | 3 |
//! | [`ACK_16`] | `0xCC` | DSP → PC | acknowledgement with 16 bits | 6 |
//! | [`ACK_32`] | `0xA5` | DSP → PC | acknowledgement with 32 bits | 8 |
//! | [`ERROR`] | `0xE6` | DSP → PC | error | 5 |
//! | [`COMMAND`] | `0xF0` | PC → DSP | command | 3 … 11, by its code |
//! | [`WAYPOINT`] | `0x99` | PC → DSP | waypoint | 17 |
//!
//! | [`EXTENDED_DOWNLINK`] | `0xDA` | DSP → PC | any, in the extended profile | 6 or 7 more |
//! | [`EXTENDED_UPLINK`] | `0xB3` | PC → DSP | any, in the extended profile | 6 more |
//!
//! The seven low bits of each are a word of the Hamming(7,4) code: at least three bits differ between any two. In the
//! extended profile the seven low bits of a message's header are its *kind*.

/// DSP → PC: status (`ESTADOS`).
pub const STATUS: u8 = 0xE9;
/// DSP → PC: flow control (`CONTROLFLUJO`).
pub const FLOW_CONTROL: u8 = 0xAA;
/// DSP → PC: acknowledgement without data (`COMMANDACK`).
pub const ACK: u8 = 0xC3;
/// DSP → PC: acknowledgement with 16 bits (`COMMANDACK16`).
pub const ACK_16: u8 = 0xCC;
/// DSP → PC: acknowledgement with 32 bits (`COMMANDACK32`).
pub const ACK_32: u8 = 0xA5;
/// DSP → PC: error (`DSPERROR`).
pub const ERROR: u8 = 0xE6;
/// PC → DSP: command.
pub const COMMAND: u8 = 0xF0;
/// PC → DSP: waypoint.
pub const WAYPOINT: u8 = 0x99;
/// DSP → PC: every message in the extended profile.
pub const EXTENDED_DOWNLINK: u8 = 0xDA;
/// PC → DSP: every message in the extended profile.
pub const EXTENDED_UPLINK: u8 = 0xB3;

/// Whether `byte` is a header: the only bytes with their most significant bit set.
pub const fn is_header(byte: u8) -> bool {
    byte & 0x80 != 0
}

/// Whether `header` is that of one of the three acknowledgements.
pub const fn is_acknowledgement(header: u8) -> bool {
    matches!(header, ACK | ACK_16 | ACK_32)
}

/// The kind, in the extended profile, of the message with the classic `header`.
pub const fn kind_of(header: u8) -> u8 {
    header & 0x7F
}

/// The classic header of the message with this kind in the extended profile.
pub const fn of_kind(kind: u8) -> u8 {
    kind | 0x80
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_two_headers_differ_in_at_least_three_bits() {
        let all = [
            STATUS,
            FLOW_CONTROL,
            ACK,
            ACK_16,
            ACK_32,
            ERROR,
            COMMAND,
            WAYPOINT,
            EXTENDED_DOWNLINK,
            EXTENDED_UPLINK,
        ];
        for (i, a) in all.iter().enumerate() {
            assert!(is_header(*a));
            for b in &all[..i] {
                assert!((a ^ b).count_ones() >= 3, "{a:#04x} and {b:#04x}");
            }
        }
    }
}
