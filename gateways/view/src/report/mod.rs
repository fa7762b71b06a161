//! A recorded flight as the live view's page in one file, which needs no server and no network.
//!
//! * [`flight`]: [`FlightReport`], everything that the page shows, as a plain value;
//! * [`envelope`]: values and counts over time in bounded memory, whatever the length of the flight;
//! * `data`: the flight as JSON of bounded size; `file`: the page's files and that JSON in one file.
//!
//! A loader fills a [`FlightReport`]; here is neither a robot nor a format of files. Every text of a flight may come
//! from a damaged or hostile file. It is data for the page's script, which makes text of it and never markup.

mod data;
pub mod envelope;
mod file;
pub mod flight;

pub use file::page;
pub use flight::FlightReport;
