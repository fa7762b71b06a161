//! The gateway as a station sees it: datagrams and reports in, datagrams and orders out.

mod asks;
mod chance;
mod commands;
mod common;
mod fence;
mod home;
mod hostile;
mod kept;
mod meaning;
mod mission_file;
mod missions;
mod newest;
mod parameters;
mod script;
mod signing;
mod stations;
mod telemetry;
mod ways_out;
