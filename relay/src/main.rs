//! The relay as a process of its own; `ril relay` starts it.

fn main() {}
