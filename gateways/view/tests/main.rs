//! The server as those at the other ends of its connections see it.

mod chance;
mod common;
mod foxglove;
mod http;
mod pages;
mod report;
