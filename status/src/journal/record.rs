//! [`Record`]: one entry of the journal.

use ipc_types::MonotonicNs;
use ipc_types::module::State;
use ipc_types::payload::{DspTelemetry, HeroTelemetry};

use crate::core::InputCounts;

/// One entry of the journal.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// When; of an output the time of the input that caused it, host monotonic.
    pub at: MonotonicNs,
    /// What.
    pub entry: Entry,
}

/// What a record is.
#[derive(Clone, Debug, PartialEq)]
// A sample is most of what comes; a box would allocate for each.
#[allow(clippy::large_enum_variant)]
pub enum Entry {
    /// The whole core, before the inputs that follow. The bytes are those of a [`Snapshot`](super::Snapshot).
    Snapshot(Vec<u8>),
    /// A call of the core.
    Input(Input),
    /// What the core gave to be published.
    Output(Output),
}

/// A call of the core: each is a function of [`Status`](crate::core::Status).
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(clippy::large_enum_variant)]
pub enum Input {
    /// A sample of the bridge is to be translated.
    Translate(DspTelemetry),
    /// The last sample is to be logged; whether its translation was published.
    Record(bool),
    /// What the subscriber has counted, and that time has passed.
    Step(InputCounts),
    /// The state is to be published: in any case, or if it has changed.
    State {
        /// In any case.
        always: bool,
    },
}

/// What the core gave to be published.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(clippy::large_enum_variant)]
pub enum Output {
    /// A telemetry sample, but for `sequence` and `epoch_ns`, which are 0.
    Telemetry(HeroTelemetry),
    /// A state, but for `sequence`, `epoch_ns` and `published_ns`, which are 0.
    State(State),
}

/// The first byte of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
#[allow(missing_docs)] // The variants are those of the enums above.
pub enum Kind {
    Snapshot = 0x01,
    Translate = 0x10,
    Record = 0x11,
    Step = 0x12,
    State = 0x13,
    Telemetry = 0x20,
    Published = 0x21,
}

impl Kind {
    /// All of them.
    pub const ALL: [Kind; 7] = [
        Kind::Snapshot,
        Kind::Translate,
        Kind::Record,
        Kind::Step,
        Kind::State,
        Kind::Telemetry,
        Kind::Published,
    ];

    /// The kind with this byte; nothing when it is none of this version.
    pub fn of(byte: u8) -> Option<Kind> {
        Kind::ALL.into_iter().find(|kind| *kind as u8 == byte)
    }
}
