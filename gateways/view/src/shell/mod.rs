//! `ril view`, `ril run view`: robots in a browser, and for Foxglove; `ril view FILE`: a recording.
//!
//! The crate `view` speaks HTTP, WebSocket and the protocols on top, as pure values. Here are
//! * `start`: the command that finds or starts the server, and opens its page; or shows a recording;
//! * [`server`]: the process; `shell`: its loop, `sockets`: its connections, `tls`: what hides them;
//! * `fleet`: the robots with their ports and [models](operator::robot::model); `messages`: the messages about one, `speaker`: when they are sent;
//! * `foxglove`: what Foxglove and Lichtblick get and order;
//! * `files`: what is read from a disk: imagery, and the report of a recording;
//! * `replay`: a recording in the place of the robots;
//! * `orders`: what pages order, and what follows when no page is there any more; `checks`: what they ask before;
//! * `invitation`: the address of the page for another machine.

mod checks;
mod files;
mod fleet;
mod foxglove;
mod invitation;
mod messages;
pub mod options;
mod orders;
mod replay;
pub mod server;
mod shell;
mod sockets;
mod speaker;
mod start;
mod tls;

pub use start::view;
