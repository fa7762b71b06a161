//! `ril` with the real processes, in shared memory of each test's own.

#[path = "../common/mod.rs"]
mod common;

mod audit;
mod authority;
mod cable;
mod chain;
mod consistency;
mod demo;
mod flight;
mod limits;
mod measuring;
mod parameters;
mod plans;
mod record;
mod relay;
mod replay;
mod requests;
mod robots;
mod topics;
mod usage;
mod watch;
mod watching;
