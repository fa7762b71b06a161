//! Which viewers may look and which may order, and which orders are taken.

pub(crate) mod access;
pub(crate) mod lease;
pub(crate) mod orders;
