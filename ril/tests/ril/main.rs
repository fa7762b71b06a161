//! `ril` with the real processes, in shared memory of each test's own.

#[path = "../common/mod.rs"]
mod common;

mod as_root;
mod audit;
mod authority;
mod cable;
mod conform;
mod consistency;
mod demo;
mod doctor;
mod documents;
mod endurance;
mod field;
mod firmware;
mod flight;
mod hostile;
mod limits;
mod mavlink;
mod measuring;
mod operator;
mod package;
mod parameters;
mod plans;
mod port;
mod record;
mod relay;
mod replay;
mod requests;
mod robots;
mod stock_readers;
mod terminal;
mod topics;
mod usage;
mod view;
mod watch;
mod watching;
