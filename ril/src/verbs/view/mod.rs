//! `ril view`, `ril run view`: robots in a browser, and for Foxglove.
//!
//! The crate `view` speaks HTTP, WebSocket and the protocols on top, as pure values. Here are
//! * `start`: the command that finds or starts the server and opens the page; `run_file`: how it finds it;
//! * [`server`]: the process; `shell`: its loop, `sockets`: its connections, `tls`: what hides them;
//! * `fleet`: the robots with their ports and [models](crate::robot::model); `messages` and `held`: what is said of one, `speaker`: when;
//! * `channels`: their topics for Foxglove;
//! * `orders`, `checks`, `check`, `preflight`: what pages order, and what they ask before; `page_lost`: when no page is there any more;
//! * `invitation`: the address of the page for another machine.

mod channels;
mod check;
mod checks;
mod fleet;
mod held;
mod invitation;
mod messages;
pub mod options;
mod orders;
mod page_lost;
mod preflight;
mod run_file;
pub mod server;
mod shell;
mod sockets;
mod speaker;
mod start;
mod tls;

pub use start::view;
