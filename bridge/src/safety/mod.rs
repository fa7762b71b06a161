//! The safety rules that the bridge enforces itself, whatever a module asks for (`docs/safety.md`).
//!
//! Each rule is a pure value: it is made from its table of `bridge.toml`, is asked about a state or a movement, and
//! answers with the rule that is broken and by how much. What follows from the answer is decided by the caller.

pub mod fence;
pub mod ground;
