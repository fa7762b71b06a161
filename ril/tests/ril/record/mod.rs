//! `ril record` with real processes: what is in the files, and what is not, whatever becomes of the recorder.

mod disk;
pub mod feed;
mod flight;
mod kills;
mod log_lines;
mod losses;
mod starved;
