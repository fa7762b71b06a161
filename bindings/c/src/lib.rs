//! The C library of the HERO RIL, and what it shares with the Python package.
//!
//! [`capi`] is the C ABI, whose contract is `include/hero_ril.h`. It only converts: pointers, codes, timeouts, panics.
//! What it converts to is safe Rust over [`ipc_types`]:
//!
//! * [`joining`]: taking part in the shared memory of a robot;
//! * [`service`]: which topic or request service a caller means, and what it expects there;
//! * [`topic`]: receiving samples one at a time;
//! * [`requests`]: [`Requests`](requests::Requests), one client of all of a robot's request services;
//! * [`serving`]: [`Serving`](serving::Serving), the server of one request service;
//! * [`module`]: [`OwnModule`](module::OwnModule), a module by the rules of [`module_kit`];
//! * [`place`]: places in a local frame, moments in UTC;
//! * [`error`]: what can go wrong, as a text and a code.

pub mod capi;
pub mod error;
pub mod joining;
pub mod module;
pub mod place;
pub mod requests;
pub mod service;
pub mod serving;
pub mod topic;
