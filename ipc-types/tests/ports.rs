//! The suites that share one program, because none changes anything that belongs to the whole process.

mod event_loop;
mod foreign;
mod publish;
mod request;
mod support;
