//! The calls to the file system in every order of several processes: the model that stands in for it, and what is
//! explored over it.

pub(crate) mod model;
mod orders;
