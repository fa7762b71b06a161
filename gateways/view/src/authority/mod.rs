//! Who may look, who may order, and which orders are taken.

pub(crate) mod access;
pub(crate) mod lease;
pub(crate) mod orders;
