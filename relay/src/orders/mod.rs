//! Requests that are executed at most once.
