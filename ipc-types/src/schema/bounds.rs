//! How much a schema may describe.

/// Longest text that is parsed, bytes. The longest of the robot's own has 12 kB.
pub const MAX_TEXT_LEN: usize = 256 << 10;

/// How deep structs may be nested, the outermost included. The robot's own are two deep.
pub const MAX_DEPTH: usize = 16;

/// Longest list of a payload's numbers, bytes: each with its full name, such as `cells[2].voltage_v`, its type and its comment. Names in
/// the text of a schema may be as long as the text, and the name of a struct stands before that of each number in it.
pub const MAX_LISTED_LEN: usize = 4 << 20;

/// Most numbers of a payload that have a name of their own; an array of numbers is one.
pub const MAX_NUMBERS: usize = 1 << 14;
