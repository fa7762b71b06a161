//! Schemas: what lies in a topic, as a text that goes along with it, so that programs read structs which they have
//! never seen.
//!
//! The text is a message definition of ROS 2 with all nested types, as an MCAP file with the encoding `ros2msg` has it.
//! [`text`](text()) writes it from a [`Layout`](crate::payload::Layout); [`Schema::parse`] reads it and works out size,
//! alignment and offsets, which are those of the struct in shared memory.
//!
//! ```text
//! # The flight battery.
//! #
//! # Layout: battery_watch.Battery.v1
//!
//! # Counts the samples of this publisher from 1.
//! uint64 sequence
//! # When the publisher began, host monotonic ns. [ns]
//! uint64 epoch_ns
//! # The cells, from the negative pole.
//! battery_watch_msgs/Cell[12] cells
//!
//! ================================================================================
//! MSG: battery_watch_msgs/Cell
//! # One cell of a battery.
//! #
//! # Layout: battery_watch.Cell.v1
//!
//! # Voltage under load. [V]
//! float32 voltage_v
//! ```
//!
//! | in shared memory | in the schema |
//! |---|---|
//! | `battery_watch.Cell.v1` | `battery_watch_msgs/Cell`, and the whole name in the comment `Layout:` |
//! | `u32`, `f64`, `[u8; 32]` | `uint32`, `float64`, `uint8[32]` |
//! | doc comment | comment above the field |
//! | unit, by the suffix of the name | `[V]` at the end of the comment, where ROS 2's tools look for units |
//!
//! The sample's bytes with [`CDR_HEADER`] in front are the message in ROS 2's serialization (CDR): little-endian, each
//! number aligned to its size, and no struct of the contract has padding, so both put every number at the same place.
//!
//! A schema comes from another process, or from a file: parsing is bounded ([`MAX_TEXT_LEN`], [`MAX_DEPTH`],
//! [`MAX_NUMBERS`], [`MAX_LISTED_LEN`], [`MAX_PAYLOAD_SIZE`](crate::payload::MAX_PAYLOAD_SIZE)), reading a value looks
//! at the bytes that are there, and neither panics.

mod definition;
pub mod generate;
mod leaf;
mod message;
mod parse;
#[cfg(test)]
mod tests;
mod text;

pub use definition::{LoadError, Schema, load};
pub use leaf::{Leaf, Value};
pub use message::{Field, Kind, Message};
pub use parse::{MAX_DEPTH, MAX_LISTED_LEN, MAX_NUMBERS, MAX_TEXT_LEN, SchemaError};
pub use text::text;

/// What stands before a sample's bytes to make them a CDR message: plain CDR, little-endian, no options.
pub const CDR_HEADER: [u8; 4] = [0, 1, 0, 0];

/// Name of the text's format in an MCAP file.
pub const ENCODING: &str = "ros2msg";
