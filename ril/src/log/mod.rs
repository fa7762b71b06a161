//! Logs of flights: what `ril log` reads and says. Pure: [`recording`] takes bytes, and [`summary`] and [`row`] take rows.
//!
//! [`recording::Format`] is the one place to add another format of files: everything else goes by the trait
//! [`Recording`](recording::Recording).

pub mod duration;
pub mod recording;
pub mod row;
pub mod summary;
#[cfg(test)]
mod tests;
