//! The bounds of files. What is beyond one is refused as a whole.

/// Longest file, bytes: an item of a `.plan` takes about 500 bytes, so 8 MiB hold twice [`MAX_ITEMS`].
pub const MAX_FILE_BYTES: usize = 8 << 20;

/// Most items, those inside of a survey counted each: eight of the longest paths that the bridge takes (1,024 waypoints), more
/// than a tank of fuel lasts.
pub const MAX_ITEMS: usize = 8 * 1024;

/// Most fence areas of a plan: as many as the bridge takes.
pub const MAX_AREAS: usize = bridge::safety::fence::MAX_AREAS;

/// Most elements of an XML file: 12 for each of [`MAX_ITEMS`] track points.
pub const MAX_ELEMENTS: usize = 12 * MAX_ITEMS;

/// How deep XML elements may lie in each other. Folders of KML lie a few deep; the readers of XML call themselves for each
/// level, so a bound keeps the stack small.
pub const MAX_ELEMENT_DEPTH: usize = 64;

/// Longest name that is kept, characters: a line on a terminal stays readable.
pub const MAX_NAME_CHARS: usize = 48;

/// Longest reason of another library that is repeated, characters: three lines on a terminal.
pub const MAX_REASON_CHARS: usize = 240;
