//! [`WaypointPosition`]: a place, as requests and the bridge's state give it.

/// A place to fly to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WaypointPosition {
    /// Latitude, degrees, north positive.
    pub latitude_deg: f64,
    /// Longitude, degrees, east positive.
    pub longitude_deg: f64,
    /// Altitude, m, same zero as telemetry.
    pub altitude_m: f64,
}
