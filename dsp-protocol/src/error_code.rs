//! Errors that the DSP reports (`docs/protocol.md` section 7).

/// A DSP error code; unknown ones are carried along.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
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
}
