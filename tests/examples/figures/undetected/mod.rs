//! Damaged frames that a receiver takes for good ones (`docs/protocol.md` sections 10, 11).

pub mod damage;
pub mod measure;
pub mod traffic;
