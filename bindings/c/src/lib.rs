//! The C library of the HERO RIL, and what it shares with the Python package.
//!
//! [`capi`] is the C ABI, whose contract is `include/hero_ril.h`. It only converts: pointers, codes, timeouts, panics. What it
//! converts to is safe Rust over [`ipc_types`]:
//!
//! * [`topic`]: which topic a caller means, and its [`Inbox`](topic::Inbox) of samples;
//! * [`requests`]: [`Requests`](requests::Requests), one client of all of a robot's request services;
//! * [`error`]: what can go wrong, as a text and a code.

pub mod capi;
pub mod error;
pub mod requests;
pub mod topic;
