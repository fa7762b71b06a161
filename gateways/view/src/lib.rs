//! The live view: a page in a browser, Foxglove and Lichtblick on one port.
//!
//! The process is [`cli`], [`shell`] and [`config`]; [`start`] is `ril view`, which finds or starts it. Everything else
//! has no socket, no clock, no thread and no file: [`Server`] is given bytes and times, and gives bytes, [`Event`]s and
//! a deadline. `docs/view-protocol.md` describes what goes over the wire.
//!
//! * `messages`: what a page gets of a robot, [`speaker`]: when; [`orders`]: what pages order, and what follows when no
//!   page is there any more; `replay`: a recording in the place of the robots;
//! * `metrics`: the robots for Prometheus;
//! * `invitation`: the address of the page for another machine;
//! * `http`: requests and answers; `websocket`: frames; `connection`: both, one after the other;
//! * `authority`: which viewers may look and order, which page commands, which orders are taken;
//! * `pages`, `viewer` and `outbox`: what pages are sent, by the newest rules; [`page`] has the messages;
//! * `foxglove`: any topic for panels of others;
//! * [`report`]: a recorded flight as the page in one file.

mod assets;
mod authority;
pub mod cli;
pub mod config;
mod connection;
mod event;
mod foxglove;
mod http;
mod invitation;
mod messages;
mod metrics;
pub mod orders;
mod outbox;
pub mod pace;
pub mod page;
mod pages;
mod replay;
pub mod report;
mod server;
pub mod shell;
pub mod speaker;
pub mod start;
mod viewer;
mod websocket;

pub use authority::lease::LEASE_TIME;
pub use authority::orders::{MAX_ORDERS, MEMORY};
pub use connection::{ANSWER_TIME, HEAD_TIME, IDLE_TIME, PING_PERIOD, SILENCE};
pub use event::{ChannelId, ConnectionId, Event, Instance, Peer, Settings, Token, ViewerId};
pub use foxglove::channels::{Channel, MAX_CHANNELS};
pub use http::refusal::{BUSY, PLAIN};
pub use http::request::MAX_HEAD_BYTES;
pub use http::tile::{FileRequest, Tile, Wanted};
pub use outbox::{MAX_TEXTS, MAX_UNSEEN};
pub use pages::{BEAT_PERIOD, OPEN_TIME};
pub use server::{MAX_HTTP, MAX_VIEWERS, Server};
pub use websocket::MAX_MESSAGE_BYTES;
