//! Numbers, times, paragraphs and names as people read them. Pure but for the width of the terminal.

mod count;
mod duration;
mod number;
mod paragraph;
mod shell_word;
mod time_of_day;

pub use count::{count, count_irregular};
pub use duration::{duration, duration_with_tenths};
pub use number::{distance, items};
pub use paragraph::{columns, wrap};
pub use shell_word::shell_word;
pub use time_of_day::time_of_day;
