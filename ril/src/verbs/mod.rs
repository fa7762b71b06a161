//! The verbs of `ril`, a file or folder each. A verb imports what verbs share, never another verb.

pub mod check;
pub mod demo;
