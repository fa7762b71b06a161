//! [`Record`]: one entry of the journal.

use ipc_types::MonotonicNs;
use ipc_types::code::Reason;
use ipc_types::payload::{
    DspTelemetry, ModuleControl, ModuleState, MovementData, ParameterRequest, RequestReport,
};

use crate::flight::request::RequestKey;
use crate::safety::fence::Fence;

/// One entry of the journal.
#[derive(Clone, Debug, PartialEq)]
pub struct Record<'a> {
    /// When; of an output the time of the input that caused it, host monotonic.
    pub at: MonotonicNs,
    /// What.
    pub entry: Entry<'a>,
}

/// What a record is.
#[derive(Clone, Debug, PartialEq)]
// A sample is most of what comes; a box would allocate for each.
#[allow(clippy::large_enum_variant)]
pub enum Entry<'a> {
    /// The whole core, before the inputs that follow. The bytes are those of a [`Snapshot`](super::Snapshot).
    Snapshot(Vec<u8>),
    /// A call of the core.
    Input(Input<'a>),
    /// What the core said to the last input.
    Output(Output<'a>),
}

/// A call of the core: each is a function of [`Bridge`](crate::Bridge). `sender` is the process that sent a request, if it is known.
#[derive(Clone, Debug, PartialEq)]
pub enum Input<'a> {
    /// The serial port was opened.
    PortOpened,
    /// The serial port is gone.
    PortClosed,
    /// Bytes that one read of the port gave.
    Received(&'a [u8]),
    /// A control request.
    Control {
        /// To whom the reports go.
        key: RequestKey,
        /// Process id.
        sender: Option<u32>,
        /// The request.
        request: ModuleControl,
    },
    /// A control request to read the geofence again, and what was read.
    NewFence {
        /// To whom the reports go.
        key: RequestKey,
        /// Process id.
        sender: Option<u32>,
        /// The request.
        request: ModuleControl,
        /// The geofence, or why there is none.
        fence: Result<Fence, Reason>,
    },
    /// A movement request.
    Movement {
        /// To whom the reports go.
        key: RequestKey,
        /// Process id.
        sender: Option<u32>,
        /// The request.
        request: MovementData,
    },
    /// A parameter request.
    Parameter {
        /// To whom the reports go.
        key: RequestKey,
        /// Process id.
        sender: Option<u32>,
        /// The request.
        request: ParameterRequest,
    },
    /// The sender of a request is gone.
    SenderGone(RequestKey),
    /// Time has passed.
    Advance,
    /// The bridge is about to end.
    WindDown,
    /// The bridge ends.
    Close,
    /// The bytes for the port were asked for, and there were some.
    Transmit,
    /// The port took so many of them.
    Transmitted(usize),
    /// It was asked whether the kernel shall discard what it has not sent, and it shall.
    DiscardUnsent,
}

/// What the core said.
#[derive(Clone, Debug, PartialEq)]
// A sample is most of what comes; a box would allocate for each.
#[allow(clippy::large_enum_variant)]
pub enum Output<'a> {
    /// A telemetry sample, but for `sequence` and `epoch_ns`, which are 0.
    Telemetry(DspTelemetry),
    /// A state, but for `sequence`, `epoch_ns` and `published_ns`, which are 0.
    State(ModuleState),
    /// A report, and to whom.
    Report(RequestKey, RequestReport),
    /// Bytes that the port took.
    Sent(&'a [u8]),
}

/// The first byte of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
#[allow(missing_docs)] // The variants are those of the enums above.
pub enum Kind {
    Snapshot = 0x01,
    PortOpened = 0x10,
    PortClosed = 0x11,
    Received = 0x12,
    Control = 0x13,
    NewFence = 0x14,
    Movement = 0x15,
    Parameter = 0x16,
    SenderGone = 0x17,
    Advance = 0x18,
    WindDown = 0x19,
    Close = 0x1A,
    Transmit = 0x1B,
    Transmitted = 0x1C,
    DiscardUnsent = 0x1D,
    Telemetry = 0x20,
    State = 0x21,
    Report = 0x22,
    Sent = 0x23,
}

impl Kind {
    /// All of them.
    pub const ALL: [Kind; 19] = [
        Kind::Snapshot,
        Kind::PortOpened,
        Kind::PortClosed,
        Kind::Received,
        Kind::Control,
        Kind::NewFence,
        Kind::Movement,
        Kind::Parameter,
        Kind::SenderGone,
        Kind::Advance,
        Kind::WindDown,
        Kind::Close,
        Kind::Transmit,
        Kind::Transmitted,
        Kind::DiscardUnsent,
        Kind::Telemetry,
        Kind::State,
        Kind::Report,
        Kind::Sent,
    ];

    /// The kind with this byte; nothing when it is none of this version.
    pub fn of(byte: u8) -> Option<Kind> {
        Kind::ALL.into_iter().find(|kind| *kind as u8 == byte)
    }
}

impl Input<'_> {
    /// Its kind.
    pub fn kind(&self) -> Kind {
        match self {
            Input::PortOpened => Kind::PortOpened,
            Input::PortClosed => Kind::PortClosed,
            Input::Received(_) => Kind::Received,
            Input::Control { .. } => Kind::Control,
            Input::NewFence { .. } => Kind::NewFence,
            Input::Movement { .. } => Kind::Movement,
            Input::Parameter { .. } => Kind::Parameter,
            Input::SenderGone(_) => Kind::SenderGone,
            Input::Advance => Kind::Advance,
            Input::WindDown => Kind::WindDown,
            Input::Close => Kind::Close,
            Input::Transmit => Kind::Transmit,
            Input::Transmitted(_) => Kind::Transmitted,
            Input::DiscardUnsent => Kind::DiscardUnsent,
        }
    }
}
