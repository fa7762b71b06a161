//! A recorded flight as one self-contained page, and its plots as SVG for papers.
//!
//! * [`flight`]: [`Flight`], everything that a report shows, as a plain value;
//! * [`envelope`] and [`bins`]: values and counts over time in bounded memory, whatever the length of the flight;
//! * [`page()`]: the page; [`papers`]: one SVG file for each plot.
//!
//! Pure values: no file, no clock, no thread. The crate knows no robot and no file format: a loader fills a [`Flight`].
//!
//! The page needs no network and holds no script. Every text of a [`Flight`] may come from a damaged or hostile file: it is escaped,
//! and characters that only a terminal or a text direction would obey are replaced.
//!
//! # Example
//!
//! ```
//! use flight_report::envelope::Envelope;
//! use flight_report::flight::{Curve, Flight, Ink, Plot, Scale};
//!
//! let mut altitude = Envelope::new(1.0);
//! for second in 0..60 {
//!     altitude.push(f64::from(second), f64::from(second).sqrt());
//! }
//! let mut flight = Flight::new("Flight of robot 1", 60.0);
//! let mut plot = Plot::new("altitude", "Altitude", "m", Scale::Auto { least_span: 2.0 });
//! plot.curves.push(Curve::line("GPS", Ink::Blue, altitude));
//! flight.plots.push(plot);
//!
//! let page = flight_report::page(&flight)?;
//! assert!(page.starts_with("<!DOCTYPE html>") && page.contains("<polyline"));
//! assert_eq!(flight_report::papers(&flight)?[0].name, "altitude");
//! # Ok::<(), flight_report::DrawError>(())
//! ```

pub mod bins;
pub mod envelope;
pub mod flight;
mod page;
mod plot;
mod text;

pub use flight::Flight;
pub use page::page;
pub use plot::DrawError;
pub use plot::papers::{Paper, papers};
