//! The page and the plots, of flights that went well, badly and not at all, and of files that mean harm.

mod hostile;
mod long;
mod outline;
mod sample;
