//! Flight plans of other programs.
//!
//! * [`model`]: a plan as its author meant it; each altitude says what it is above;
//! * [`read`]: QGroundControl `.plan`, `QGC WPL 110`, GeoJSON, KML and GPX become that model; [`write`]: `.plan`;
//! * [`mavlink`]: mission items; [`meaning`]: what they mean for a helicopter;
//! * [`flight`]: what the helicopter does for a plan at a [`site`], in [`steps`]; [`timeline`]: when;
//! * [`check`]: whether the bridge and the DSP will take it, and what else the operator must know.
//!
//! Pure values: no file, no clock, no thread, no shared memory.

mod altitude;
pub mod check;
pub mod error;
pub mod finding;
pub mod flight;
pub mod format;
pub mod limits;
pub mod mavlink;
pub mod meaning;
pub mod model;
mod read;
pub mod site;
pub mod steps;
pub mod timeline;
pub mod write;

pub use error::ReadError;
pub use format::Format;
pub use model::Plan;
pub use read::read;
