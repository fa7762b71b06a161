//! What the other machine's monotonic clock shows.
