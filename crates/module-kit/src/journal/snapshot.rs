//! Snapshots: a core and its configuration as bytes, which the same version of the core reads, and no other.

use serde::Serialize;
use serde::de::DeserializeOwned;

/// The bytes are no snapshot of this version's core, or of one that cannot say all that it knows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("these bytes are no snapshot of a core of this version that can be gone on with")]
pub struct NotASnapshot;

/// The bytes of `core`, behind the version of their meaning.
pub fn to_bytes(version: u32, core: &impl Serialize) -> Vec<u8> {
    // Writing into memory does not fail, and every type of a core can be written.
    postcard::to_allocvec(&(version, core)).unwrap_or_default()
}

/// The core that [`to_bytes`] was given.
///
/// # Errors
/// They are no snapshot, or one of another version.
pub fn from_bytes<T: DeserializeOwned>(version: u32, bytes: &[u8]) -> Result<T, NotASnapshot> {
    match postcard::take_from_bytes::<u32>(bytes) {
        // What stands behind another version means something else.
        Ok((found, core)) if found == version => match postcard::take_from_bytes(core) {
            Ok((core, [])) => Ok(core),
            _ => Err(NotASnapshot),
        },
        _ => Err(NotASnapshot),
    }
}

/// The configuration that a snapshot has as this text.
///
/// # Errors
/// It is none of this version.
pub fn config_of<C: DeserializeOwned>(text: &str) -> Result<C, NotASnapshot> {
    runtime::config::parse(text, "the journal").map_err(|_| NotASnapshot)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_snapshot_is_read_by_its_own_version_and_whole() {
        let bytes = to_bytes(3, &("core", 7u8));
        let read = |version, bytes: &[u8]| from_bytes::<(String, u8)>(version, bytes);
        assert_eq!(read(3, &bytes), Ok(("core".to_owned(), 7)));
        assert_eq!(read(4, &bytes), Err(NotASnapshot));
        assert_eq!(read(3, &bytes[..bytes.len() - 1]), Err(NotASnapshot));
        assert_eq!(read(3, &[&bytes[..], &[0]].concat()), Err(NotASnapshot));
        assert_eq!(read(3, &[]), Err(NotASnapshot));
    }
}
