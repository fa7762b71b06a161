//! The fields of samples by name, and how they are shown.
//!
//! Names use dots, as in `geographic.latitude_deg`, and brackets for elements of arrays, as in `cells[2].voltage_v`. What a
//! sample holds is said by its schema, so samples of any module can be shown. Of the robot's own, [`tables`] says more: a
//! value that means nothing, because its group was not transmitted or the thing has not happened yet, is shown as nothing
//! and never looks like data; and numbers that stand for something have their names.

mod selection;
pub mod tables;
#[cfg(test)]
mod tests;
mod tree;

pub(crate) use selection::field_names;
pub use selection::{Selection, UnknownField};
pub use tables::{Meaning, Shown};
pub use tree::{JsonLine, Plain, Tree};
