//! Errors that the DSP reports (`docs/protocol.md` section 7).

use core::fmt;

/// A DSP error code; unknown ones are carried along.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DspErrorCode(pub u16);

impl DspErrorCode {
    /// Queue of a uart full; also a waypoint that found the path buffer full.
    pub const UART_QUEUE_FULL: DspErrorCode = DspErrorCode(15);
    /// A command that could not be carried out.
    pub const INVALID_COMMAND: DspErrorCode = DspErrorCode(30);
    /// A header from the PC that the DSP does not know.
    pub const UNKNOWN_HEADER: DspErrorCode = DspErrorCode(100);
    /// A message from the PC with a wrong checksum.
    pub const PC_CHECKSUM: DspErrorCode = DspErrorCode(102);

    /// The documented codes, ascending; a code's place here is its place in the counters of the module state.
    pub const KNOWN: [DspErrorCode; 26] = [
        DspErrorCode(1),
        DspErrorCode(2),
        DspErrorCode(3),
        DspErrorCode(4),
        DspErrorCode(5),
        DspErrorCode(6),
        DspErrorCode(7),
        DspErrorCode(8),
        DspErrorCode(9),
        DspErrorCode(10),
        DspErrorCode(11),
        DspErrorCode(12),
        DspErrorCode(13),
        DspErrorCode(14),
        DspErrorCode(15),
        DspErrorCode(18),
        DspErrorCode(20),
        DspErrorCode(21),
        DspErrorCode(22),
        DspErrorCode(30),
        DspErrorCode(40),
        DspErrorCode(45),
        DspErrorCode(46),
        DspErrorCode(100),
        DspErrorCode(102),
        DspErrorCode(300),
    ];

    /// The code's place in [`DspErrorCode::KNOWN`]; `None` for an unknown code.
    pub fn counter_index(self) -> Option<usize> {
        Self::KNOWN.binary_search(&self).ok()
    }

    /// The code's meaning in words.
    pub const fn text(self) -> &'static str {
        match self.0 {
            1 => "receive queue of sci_a full (interrupt)",
            2 => "receive queue of sci_b full (interrupt)",
            3 => "blocking read of sci_a with an empty queue",
            4 => "blocking read of sci_b with an empty queue",
            5 => "write to sci_a with a full queue",
            6 => "write to sci_b with a full queue",
            7 => "invalid port when sending by sci",
            8 => "PWM output write error (nwords is not 1)",
            9 => "invalid uart in read or write",
            10 => "receive queue of uart 1 full",
            11 => "receive queue of uart 2 full",
            12 => "framing error in uart 1 (interrupt)",
            13 => "framing error in uart 2 (interrupt)",
            14 => "uart queue empty",
            15 => "uart queue full, or a waypoint found the path buffer full",
            18 => "scheduler: the foreground process ran over 1 s",
            20 => "default read driver routine",
            21 => "default write driver routine",
            22 => "default interrupt routine",
            30 => "invalid command",
            40 => "IMU checksum",
            45 => "GPS CRC",
            46 => "GPS unexpected state",
            100 => "unknown header from the PC",
            102 => "checksum error from the PC",
            300 => "DDS-10 radio receiver checksum",
            _ => "unknown DSP error",
        }
    }
}

impl fmt::Display for DspErrorCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "DSP error {}: {}", self.0, self.text())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_known_code_has_its_place_and_a_text_of_its_own() {
        for (index, code) in DspErrorCode::KNOWN.into_iter().enumerate() {
            assert_eq!(code.counter_index(), Some(index));
            assert_ne!(code.text(), "unknown DSP error", "{}", code.0);
            for other in &DspErrorCode::KNOWN[..index] {
                assert_ne!(code.text(), other.text());
            }
        }
    }

    #[test]
    fn only_known_codes_have_a_place_and_a_text() {
        for code in (0..=u16::MAX).map(DspErrorCode) {
            let known = DspErrorCode::KNOWN.contains(&code);
            assert_eq!(code.counter_index().is_some(), known, "{}", code.0);
            assert_eq!(code.text() != "unknown DSP error", known, "{}", code.0);
        }
    }

    #[test]
    fn it_is_shown_with_its_number_and_meaning() {
        assert_eq!(
            DspErrorCode::PC_CHECKSUM.to_string(),
            "DSP error 102: checksum error from the PC"
        );
        assert_eq!(
            DspErrorCode(777).to_string(),
            "DSP error 777: unknown DSP error"
        );
    }
}
