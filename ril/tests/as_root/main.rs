//! What only root can play in full, because it makes namespaces or becomes somebody else. `.ci/as-user` runs it as it is.

#[path = "../common/mod.rs"]
mod common;

mod doctor;
mod hostile;
mod operator;
mod package;
mod port;
mod terminal;
