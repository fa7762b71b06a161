//! The bounds of files, and why one is no plan. What is beyond a bound is refused as a whole.

use std::fmt;

/// Longest file, bytes: an item of a `.plan` takes about 500 bytes, so 8 MiB hold twice [`MAX_ITEMS`].
pub const MAX_FILE_BYTES: usize = 8 << 20;

/// Most items, those inside of a survey counted each: eight of the longest paths that the bridge takes (1,024
/// waypoints), more than a tank of fuel lasts.
pub const MAX_ITEMS: usize = 8 * 1024;

/// Most fence areas of a plan: as many as the bridge takes.
pub const MAX_AREAS: usize = bridge::safety::fence::MAX_AREAS;

/// Most nodes of a file, elements, texts, members and list entries counted each: 48 for each of [`MAX_ITEMS`]. An item
/// of a survey takes about 20, a track point with what was measured there about 15.
pub const MAX_NODES: usize = 48 * MAX_ITEMS;

/// How deep XML elements may lie in each other. Folders of KML lie a few deep; the readers of XML call themselves for
/// each level, so a bound keeps the stack small.
pub const MAX_ELEMENT_DEPTH: usize = 64;

/// Longest name that is kept, characters: a line on a terminal stays readable.
pub const MAX_NAME_CHARS: usize = 48;

/// Longest reason of another library that is repeated, characters: three lines on a terminal.
pub const MAX_REASON_CHARS: usize = 240;

/// Why a file was not read: where the mistake is, and what it is.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct ReadError(String);

impl ReadError {
    /// The file was not looked into, or not to its end.
    pub(crate) fn new(reason: impl Into<String>) -> ReadError {
        ReadError(reason.into())
    }

    /// Something is wrong at a line, from 1.
    pub(crate) fn line(number: usize, reason: impl fmt::Display) -> ReadError {
        ReadError(format!("line {number}: {reason}"))
    }

    /// With the part of the file that it is about and the part's line, if it does not name a line itself.
    pub(crate) fn about(self, line: usize, part: &str) -> ReadError {
        match self.0.as_str() {
            reason if reason.starts_with("line ") => self,
            reason if reason.starts_with(part) => ReadError::line(line, reason),
            reason => ReadError::line(line, format_args!("{part}: {reason}")),
        }
    }

    /// Something is wrong in an item, or in another part of the file that has a name.
    pub(crate) fn part(name: impl fmt::Display, reason: impl fmt::Display) -> ReadError {
        ReadError(format!("{name}: {reason}"))
    }

    /// Something is wrong with the file as a whole.
    pub(crate) fn file(reason: impl fmt::Display) -> ReadError {
        ReadError::part("the file", reason)
    }

    /// There are more items than [`MAX_ITEMS`].
    pub(crate) fn too_many_items() -> ReadError {
        ReadError(format!("more than {MAX_ITEMS} items; divide the plan"))
    }
}
