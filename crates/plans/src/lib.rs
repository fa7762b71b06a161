//! Flight plans of other programs.
//!
//! * [`model`]: a plan as its author meant it; each altitude says what it is above;
//! * [`read`]: QGroundControl `.plan`, `QGC WPL 110`, GeoJSON, KML and GPX become that model; [`write`](mod@write):
//!   `.plan`;
//! * [`mavlink`]: mission items; [`meaning`]: what they mean for a helicopter;
//! * [`flight`]: what the helicopter does for a plan at a [`site`], in [`steps`]; [`timeline`]: when; [`executor`]: one
//!   after the other;
//! * [`check`]: whether the bridge and the DSP will take it, and what else the operator must know.
//!
//! Pure values: no file, no clock, no thread, no shared memory.
//!
//! # Example
//!
//! ```
//! use std::path::Path;
//!
//! use dsp_protocol::Waypoint;
//! use plans::check::check;
//! use plans::flight::{Flight, Step};
//! use plans::site::{Endurance, HomeSource, Site, Start};
//!
//! let list = "QGC WPL 110
//! 1 0 3 22 0 0 0 0 0 0 15 1
//! 2 0 3 16 0 0 0 0 37.4113 -6.001 18 1
//! 3 0 3 18 2 0 20 0 37.4113 -6.002 18 1
//! ";
//! let plan = plans::read(Path::new("circle.waypoints"), list.as_bytes())?;
//! let home = Waypoint { latitude_deg: 37.411, longitude_deg: -6.001, altitude_m: 10.0 };
//! let site = Site {
//!     home,
//!     is_home_altitude_known: true,
//!     home_source: HomeSource::Operator,
//!     start: Start::Ground(home),
//!     zero_above_sea_m: None,
//!     take_off_m: None,
//!     from: 1,
//!     is_for_flight: true,
//! };
//! let flight = Flight::new(&plan, &site);
//! assert_eq!(flight.steps[0], Step::TakeOff { item: Some(1), height_m: 15.0 });
//!
//! let findings = check(&plan, &flight, &site, None, &Endurance::default());
//! assert_eq!((findings[0].id, findings[0].items[0]), ("not-possible", 3));
//! assert_eq!(findings[0].text, "the helicopter cannot do NAV_LOITER_TURNS (18)");
//! # Ok::<(), plans::ReadError>(())
//! ```

pub mod check;
pub mod error;
pub mod executor;
pub mod finding;
pub mod flight;
pub mod format;
pub mod mavlink;
pub mod meaning;
pub mod model;
mod read;
pub mod site;
pub mod steps;
pub mod timeline;
pub mod write;

pub use error::ReadError;
pub use format::PlanFormat;
pub use model::Plan;
pub use read::read;
