//! The checks, by what they are about.

pub mod boot;
pub mod commands;
pub mod errors;
pub mod extended;
pub mod flight;
pub mod frames;
pub mod groups;
pub mod path;
pub mod ports;
pub mod status;
