//! [`BridgeJournal`] and [`StatusJournal`]: pieces of the input journals, from which a recording replays a module's
//! decisions.
//!
//! What the bytes of a piece mean is the module's own matter; `docs/journal.md` has it.

/// Bytes of a piece of the bridge's journal, and of status'.
pub const BRIDGE_JOURNAL_ROOM: usize = 4056;
/// Bytes of a piece of status' journal.
pub const STATUS_JOURNAL_ROOM: usize = 984;

shared_struct! {
    /// A piece of the bridge's input journal. Topic `bridge/journal`, published while there is a subscriber: when the piece is
    /// full, and at most a quarter of a second after its first byte.
    ///
    /// The bytes of all pieces one after the other are the journal. A piece that is missing shows in `sequence`; the journal can
    /// be read again from the next piece with `begins`.
    pub struct BridgeJournal("hero.BridgeJournal.v1") = 4096 {
        /// Counts the samples of this publisher from 1.
        pub sequence: u64,
        /// When the publishing process began.
        pub epoch_ns: u64,
        /// When this was published; in the file `tail` when its last byte was written.
        pub published_ns: u64,
        /// 1 when the first byte of `data` begins a record that is a snapshot: reading can begin here.
        pub begins: u32,
        /// Bytes of `data` that mean something, 0 ... 4056.
        pub length: u32,
        /// How often the journal was begun by this publisher: for the first subscriber, and after each loss.
        pub beginnings: u32,
        /// Always zero; keeps the size a multiple of eight.
        pub reserved: u32,
        /// The bytes, filled up with zeros.
        pub data: [u8; BRIDGE_JOURNAL_ROOM],
    }
}

shared_struct! {
    /// A piece of status' input journal. Topic `status/journal`; else as `BridgeJournal`.
    pub struct StatusJournal("hero.StatusJournal.v1") = 1024 {
        /// Counts the samples of this publisher from 1.
        pub sequence: u64,
        /// When the publishing process began.
        pub epoch_ns: u64,
        /// When this was published.
        pub published_ns: u64,
        /// 1 when the first byte of `data` begins a record that is a snapshot: reading can begin here.
        pub begins: u32,
        /// Bytes of `data` that mean something, 0 ... 984.
        pub length: u32,
        /// How often the journal was begun by this publisher: for the first subscriber, and after each loss.
        pub beginnings: u32,
        /// Always zero; keeps the size a multiple of eight.
        pub reserved: u32,
        /// The bytes, filled up with zeros.
        pub data: [u8; STATUS_JOURNAL_ROOM],
    }
}
