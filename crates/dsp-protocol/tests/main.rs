//! The wire protocol from outside: vectors, tables of the documentation, properties, damage.

mod accuracy;
mod common;
mod contract;
mod firmware;
mod integrity;
mod round_trip;
mod stream;
mod undetected;
mod vectors;
