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
//! The seven low bits of each are a word of the Hamming(7,4) code: at least three bits differ between any two.

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

/// Whether `byte` is a header: the only bytes with their most significant bit set.
pub const fn is_header(byte: u8) -> bool {
    byte & 0x80 != 0
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
            0x80 | 0x5A,
            0x80 | 0x33,
        ];
        for (i, a) in all.iter().enumerate() {
            assert!(is_header(*a));
            for b in &all[..i] {
                assert!((a ^ b).count_ones() >= 3, "{a:#04x} and {b:#04x}");
            }
        }
    }
}
