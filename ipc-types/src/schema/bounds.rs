//! How much a schema may describe.

/// Longest text that is parsed, bytes. The longest of the robot's own has 12 kB.
pub const MAX_TEXT_LEN: usize = 256 << 10;

/// How deep structs may be nested, the outermost included. The robot's own are two deep.
pub const MAX_DEPTH: usize = 16;

/// Most numbers of a payload that have a name of their own; an array of numbers is one.
pub const MAX_NUMBERS: usize = 1 << 14;
