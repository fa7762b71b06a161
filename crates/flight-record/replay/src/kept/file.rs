//! [`KeptFlight`]: a kept flight as the bytes of its file.

use std::borrow::Cow;

use ipc_types::MonotonicNs;
use ipc_types::payload::{
    DspTelemetry, ModuleControl, MovementData, ParameterRequest, SharedStruct,
};
use ipc_types::schema::Schema;
use serde::{Deserialize, Serialize};

/// The first bytes of a file.
pub const MAGIC: [u8; 8] = *b"RIL kept";

/// The version of the format, which is that of the inputs too: `bridge::Input` and `status::Input` in postcard's
/// format.
const VERSION: u32 = 2;

/// Longest flight that is read, bytes before they were compressed: some ten hours.
const MAX_FLIGHT: usize = 512 << 20;

/// How hard it is compressed, of ten: more costs time, and saves nothing.
const LEVEL: u8 = 9;

/// Bytes before what is compressed: the magic, the version, and the checksum.
const HEAD: usize = 16;

/// Why bytes are no kept flight.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NotKept {
    /// The first bytes are others.
    #[error("it is no kept flight: its first bytes are not `RIL kept`")]
    Foreign,
    /// The file has another version of the format.
    #[error("its format is version {0}, and this program reads version {VERSION}")]
    Version(u32),
    /// The checksum does not fit, or what it covers is no flight.
    #[error("it is damaged: the checksum is another one")]
    Damaged,
    /// An input of another layout.
    #[error("it has inputs `{0}` of another layout than this program's")]
    Layout(String),
    /// There is nothing to keep.
    #[error("the recording has no journal that begins")]
    Empty,
}

/// Whether a file with these first bytes is meant to be a kept flight.
pub fn is_kept(first: &[u8]) -> bool {
    first.starts_with(&MAGIC)
}

/// What a file has.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct KeptFlight {
    /// The structs of shared memory among the inputs, with the hash of their layout.
    pub layouts: Vec<(String, u64)>,
    /// The bytes of the line, as they were received.
    pub received: Vec<u8>,
    /// The journal of the bridge, with a [`Beginning`] in the place of each snapshot and a [`Digest`](super::Digest) in
    /// that of each output, and inputs that refer to what is in the file already.
    pub bridge: Vec<u8>,
    /// The journal of status, in the form that `bridge` has.
    pub status: Vec<u8>,
}

/// How a core begins.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Beginning<'a> {
    /// The core begins with its process, at this moment and with this configuration.
    Fresh(MonotonicNs, Cow<'a, str>),
    /// The core begins with a snapshot, because the recording began later: for the version that made it alone.
    Snapshot(&'a [u8]),
}

impl Beginning<'_> {
    pub fn is_snapshot(&self) -> bool {
        matches!(self, Beginning::Snapshot(_))
    }
}

impl KeptFlight {
    /// `has_samples` says whether status was given samples that this bridge has not made.
    pub fn new(received: Vec<u8>, bridge: Vec<u8>, status: Vec<u8>, has_samples: bool) -> Self {
        let mut layouts = requests();
        layouts.extend(has_samples.then(layout::<DspTelemetry>));
        KeptFlight {
            layouts,
            received,
            bridge,
            status,
        }
    }

    /// The bytes of the file.
    pub fn write(&self) -> Vec<u8> {
        // Writing into memory does not fail.
        let flight = postcard::to_allocvec(self).unwrap_or_default();
        let compressed = miniz_oxide::deflate::compress_to_vec(&flight, LEVEL);
        let mut file = Vec::with_capacity(HEAD + compressed.len());
        file.extend_from_slice(&MAGIC);
        file.extend_from_slice(&VERSION.to_le_bytes());
        file.extend_from_slice(&crc32fast::hash(&compressed).to_le_bytes());
        file.extend_from_slice(&compressed);
        file
    }

    /// The flight in a file.
    ///
    /// # Errors
    /// See [`NotKept`].
    pub fn read(file: &[u8]) -> Result<KeptFlight, NotKept> {
        if !is_kept(file) {
            return Err(NotKept::Foreign);
        }
        let (head, compressed) = file.split_at_checked(HEAD).ok_or(NotKept::Damaged)?;
        let number = |at: usize| {
            let bytes = head[at..].first_chunk();
            bytes.map_or(0, |bytes| u32::from_le_bytes(*bytes))
        };
        if number(8) != VERSION {
            return Err(NotKept::Version(number(8)));
        }
        if number(12) != crc32fast::hash(compressed) {
            return Err(NotKept::Damaged);
        }
        let flight = miniz_oxide::inflate::decompress_to_vec_with_limit(compressed, MAX_FLIGHT)
            .map_err(|_| NotKept::Damaged)?;
        let flight: KeptFlight = postcard::from_bytes(&flight).map_err(|_| NotKept::Damaged)?;
        let mut own = requests();
        own.push(layout::<DspTelemetry>());
        match flight.layouts.iter().find(|layout| !own.contains(layout)) {
            Some((name, _)) => Err(NotKept::Layout(name.clone())),
            None => Ok(flight),
        }
    }
}

fn layout<T: SharedStruct>() -> (String, u64) {
    (T::NAME.to_owned(), Schema::of::<T>().layout_hash())
}

/// The structs of requests.
fn requests() -> Vec<(String, u64)> {
    vec![
        layout::<ModuleControl>(),
        layout::<MovementData>(),
        layout::<ParameterRequest>(),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flight() -> KeptFlight {
        KeptFlight::new(vec![7; 100], (0..200).collect(), b"status".to_vec(), false)
    }

    fn error(file: &[u8]) -> NotKept {
        KeptFlight::read(file).expect_err("an error")
    }

    #[test]
    fn a_flight_is_read_as_it_was_written() {
        let file = flight().write();
        assert!(is_kept(&file));
        let read = KeptFlight::read(&file).unwrap();
        assert_eq!(read.bridge, flight().bridge);
        assert_eq!(
            (read.received, read.status),
            (vec![7; 100], b"status".to_vec())
        );
    }

    #[test]
    fn a_file_that_is_foreign_damaged_or_of_another_version_is_an_error_that_says_so() {
        let file = flight().write();
        assert_eq!(error(b""), NotKept::Foreign);
        assert_eq!(error(b"\x89MCAP0\r\n and more"), NotKept::Foreign);
        for len in MAGIC.len()..file.len() {
            let error = error(&file[..len]);
            assert_eq!(error, NotKept::Damaged, "{len} bytes");
        }
        for at in MAGIC.len()..file.len() {
            let mut damaged = file.clone();
            damaged[at] ^= 0x40;
            let expected = match at {
                8..12 => NotKept::Version(VERSION ^ (0x40 << (8 * (at - 8)))),
                _ => NotKept::Damaged,
            };
            assert_eq!(error(&damaged), expected, "byte {at}");
        }
    }

    #[test]
    fn inputs_of_another_layout_are_named() {
        let mut other = flight();
        other.layouts[1].1 ^= 1;
        let NotKept::Layout(name) = error(&other.write()) else {
            panic!("not the layout");
        };
        assert_eq!(name, MovementData::NAME);
    }

    #[test]
    fn lengths_that_a_stranger_made_up_are_refused() {
        // The checksum fits.
        let compressed = miniz_oxide::deflate::compress_to_vec(&[0xFF; 64], LEVEL);
        let mut file = flight().write();
        file.truncate(HEAD);
        file[12..].copy_from_slice(&crc32fast::hash(&compressed).to_le_bytes());
        file.extend_from_slice(&compressed);
        assert_eq!(error(&file), NotKept::Damaged);
    }
}
