//! What `ril wait` waits for: conditions as values, judged by the newest samples and the time. Pure.

pub mod condition;
#[cfg(test)]
mod tests;
