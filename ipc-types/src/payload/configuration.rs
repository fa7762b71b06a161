//! [`ConfigurationPiece`]: pieces of the configuration that a process runs with, on the topics `bridge/configuration`
//! and `status/configuration`.
//!
//! [`ConfigurationReader`](crate::configuration::ConfigurationReader) makes the whole of them.

/// Bytes of text in one piece: a usual configuration has ten pieces.
pub const CONFIGURATION_ROOM: usize = 968;

shared_struct! {
    /// A piece of the configuration that a process runs with, as the text of its file. Topics `bridge/configuration` and
    /// `status/configuration`: all pieces when a subscriber has come, at each change, and now and then.
    ///
    /// The bytes of all pieces of one `epoch_ns` and `revision`, one after the other, are the text, TOML in UTF-8. It has every value, be it
    /// of the file, the command line or built in; a comment behind a value says which.
    pub struct ConfigurationPiece("hero.ConfigurationPiece.v1") = 1024 {
        /// Counts the samples of this publisher from 1.
        pub sequence: u64,
        /// When the publishing process began.
        pub epoch_ns: u64,
        /// When this was published.
        pub published_ns: u64,
        /// 64-bit FNV-1a of all bytes of the text.
        pub hash: u64,
        /// Counts the configurations of this process from 1: one more with each change.
        pub revision: u32,
        /// Which piece this is, from 0.
        pub piece: u32,
        /// Pieces of the text.
        pub pieces: u32,
        /// Bytes of the whole text.
        pub total: u32,
        /// Bytes of `data` that mean something.
        pub length: u32,
        /// Always zero; keeps the size a multiple of eight.
        pub reserved: u32,
        /// The bytes, filled up with zeros.
        pub data: [u8; CONFIGURATION_ROOM],
    }
}

impl ConfigurationPiece {
    /// The bytes that mean something.
    pub fn bytes_of_text(&self) -> &[u8] {
        &self.data[..(self.length as usize).min(CONFIGURATION_ROOM)]
    }
}
