//! The report of a flight: what a log holds becomes a [`flight_report::Flight`]. Pure, and in bounded memory: it takes the samples one
//! after the other and keeps none of them.
//!
//! * [`row`]: a row of a log as the sample that it was made of;
//! * [`collector`]: samples become [`curves`], [`states`] over time and events; [`happenings`]: the events, bounded; [`clock`]: times;
//! * [`module`]: what the bridge said of itself; [`requests`]: what it was asked for; [`record`]: where both are in a record;
//! * [`words`]: the flight in sentences; [`scene`]: fence and plan on the map.

pub mod clock;
pub mod collector;
pub mod curves;
pub mod happenings;
pub mod module;
pub mod record;
pub mod requests;
pub mod row;
pub mod scene;
pub mod states;
#[cfg(test)]
mod tests;
pub mod words;
