//! The codec in C for firmware, `bindings/firmware`: made from this crate's tables, and the same as this crate to the
//! byte.

mod codec;
mod harness;
mod source;
