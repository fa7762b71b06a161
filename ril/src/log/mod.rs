//! Logs of flights: what `ril log` reads and says. [`recording`] takes bytes, [`summary`], [`row`] and [`report`] take rows.
//!
//! [`recording::Format`] is the one place to add another format of files: everything else goes by the trait
//! [`Recording`](recording::Recording), which [`mcap`] has for the records of `ril record`. [`check`](mod@check) says what is complete of these.

pub mod check;
pub mod mcap;
pub mod recording;
pub mod report;
pub mod row;
pub mod summary;
#[cfg(test)]
mod tests;
