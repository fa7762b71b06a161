//! Movements: when they have arrived, their limits, and what goes to the DSP for a path.

use std::time::Duration;

use dsp_protocol::Waypoint;
use dsp_protocol::downlink::Geographic;
use ipc_types::code::SenderLost;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};

use crate::geodesy::longitude_difference_deg;

checked!(MovementLimits);

runtime::ranged! {
    fn milliseconds(u64) in 1..=600_000;
    fn speed_mps(f64) in 0.01..=100.0;
    fn spacing_m(f64) in 0.1..=10_000.0;
    fn tolerance_deg(f64) in 1e-7..=1.0;
    fn tolerance_m(f64) in 0.01..=1000.0;
    fn seconds(f64) in 0.1..=86_400.0;
    fn distance_m(f64) in 1.0..=1_000_000.0;
    fn altitude_m(f64) in -1000.0..=20_000.0;
}

/// Until how long after its issue a hold, a landing or a stop may begin, when its request does not say. Longer than for
/// other movements: what ends a movement is never wrong for its age alone, but an order of another flight is.
pub const STOP_WITHIN: Duration = Duration::from_secs(30);

/// `[arrival]`
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct ArrivalConfig {
    /// Tolerance in latitude (`DELTA_DEG`).
    #[serde(deserialize_with = "tolerance_deg")]
    pub latitude_deg: f64,
    /// Tolerance in longitude (`DELTA_DEG`).
    #[serde(deserialize_with = "tolerance_deg")]
    pub longitude_deg: f64,
    /// Tolerance in altitude (`DELTA_M`).
    #[serde(deserialize_with = "tolerance_m")]
    pub altitude_m: f64,
    /// How long the helicopter must stay at the last waypoint when one before it was not seen to be reached; longer
    /// than the DSP ever rests before it goes on.
    #[serde(deserialize_with = "seconds")]
    pub dwell_s: f64,
    /// How long the helicopter may take from the box to the last waypoint itself before the path is ended.
    #[serde(deserialize_with = "seconds")]
    pub settle_s: f64,
}

impl Default for ArrivalConfig {
    fn default() -> Self {
        ArrivalConfig {
            // About 1.1 m to the north, and 0.9 m to the east at 37° of latitude.
            latitude_deg: 1e-5,
            longitude_deg: 1e-5,
            altitude_m: 1.0,
            // Twice the longest rest of a DSP between two waypoints of a path (`docs/protocol.md` section 8.4).
            dwell_s: 6.0,
            settle_s: 2.0,
        }
    }
}

impl ArrivalConfig {
    /// The box around a waypoint.
    pub fn tolerance(&self) -> Tolerance {
        Tolerance {
            latitude_deg: self.latitude_deg,
            longitude_deg: self.longitude_deg,
            altitude_m: self.altitude_m,
        }
    }

    /// How long the helicopter may take from the box to the last waypoint itself.
    pub fn settle(&self) -> Duration {
        Duration::from_secs_f64(self.settle_s)
    }

    /// How long a stay at the last waypoint counts as arrival.
    pub fn dwell(&self) -> Duration {
        Duration::from_secs_f64(self.dwell_s)
    }
}

/// `[movement]`
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(remote = "Self", deny_unknown_fields, default)]
pub struct MovementLimits {
    /// Within what time of its issue a movement must have begun on the DSP, when its request does not say.
    #[serde(deserialize_with = "milliseconds")]
    pub begin_within_ms: u64,
    /// After what time a movement that has begun is given up, besides the time for its length.
    #[serde(deserialize_with = "seconds")]
    pub time_limit_s: f64,
    /// Slowest average speed over a movement: its length divided by this is added to `time_limit_s`.
    #[serde(deserialize_with = "speed_mps")]
    pub min_speed_mps: f64,
    /// A waypoint farther than this from the helicopter is refused.
    #[serde(deserialize_with = "distance_m")]
    pub max_distance_m: f64,
    /// Lowest altitude of a waypoint.
    #[serde(deserialize_with = "altitude_m")]
    pub min_altitude_m: f64,
    /// Highest altitude of a waypoint.
    #[serde(deserialize_with = "altitude_m")]
    pub max_altitude_m: f64,
    /// What becomes of a path whose sender is lost, when its request does not say.
    #[serde(with = "by_name")]
    pub sender_lost: SenderLost,
}

/// Reads and writes a [`SenderLost`] by its name in the configuration file.
mod by_name {
    use ipc_types::code::SenderLost;
    use serde::de::{Deserialize, Deserializer, Error};
    use serde::ser::Serializer;

    pub fn serialize<S: Serializer>(value: &SenderLost, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(value.name())
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<SenderLost, D::Error> {
        let name = String::deserialize(from)?;
        let mut all = SenderLost::ALL.into_iter();
        all.find(|value| value.name() == name)
            .ok_or_else(|| D::Error::custom(format!("`{name}` is none of continue, hold, land")))
    }
}

impl Default for MovementLimits {
    fn default() -> Self {
        MovementLimits {
            begin_within_ms: 5000,
            time_limit_s: 600.0,
            min_speed_mps: 1.0,
            max_distance_m: 10_000.0,
            min_altitude_m: -1000.0,
            max_altitude_m: 20_000.0,
            sender_lost: SenderLost::Hold,
        }
    }
}

impl MovementLimits {
    fn check(&self) -> Result<(), String> {
        let (min, max) = (self.min_altitude_m, self.max_altitude_m);
        if min > max {
            return Err(format!(
                "min_altitude_m = {min} is greater than max_altitude_m = {max}: no waypoint could be flown to"
            ));
        }
        Ok(())
    }

    /// Within what time a movement must have begun when its request does not say.
    pub fn begin_within(&self) -> Duration {
        Duration::from_millis(self.begin_within_ms)
    }

    /// After what time a movement of `length_m` that has begun is given up.
    pub fn time_limit(&self, length_m: f64) -> Duration {
        // A path of 1024 waypoints, each half the Earth away, still fits.
        let seconds = self.time_limit_s + length_m / self.min_speed_mps;
        Duration::from_secs_f64(seconds.clamp(0.0, 1e12))
    }
}

/// `[trajectory]`
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrajectoryConfig {
    /// Which generator stands between the waypoints of a path and the DSP.
    pub kind: TrajectoryKind,
    /// `divide_legs`: longest distance between two points.
    #[serde(deserialize_with = "spacing_m")]
    pub spacing_m: f64,
}

/// The trajectory generators that are built in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TrajectoryKind {
    /// The waypoints themselves.
    #[default]
    PassThrough,
    /// Points between them, so that no leg is longer than `spacing_m`.
    DivideLegs,
}

impl Default for TrajectoryConfig {
    fn default() -> Self {
        TrajectoryConfig {
            kind: TrajectoryKind::PassThrough,
            spacing_m: 50.0,
        }
    }
}

/// Half the edges of the box around a waypoint (`DELTA_DEG`, `DELTA_M`).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tolerance {
    /// Degrees of latitude.
    pub latitude_deg: f64,
    /// Degrees of longitude.
    pub longitude_deg: f64,
    /// Metres of altitude.
    pub altitude_m: f64,
}

impl Tolerance {
    /// Whether `position` lies in the box around `target`. Longitudes are compared across the antimeridian.
    pub fn holds(&self, target: &Waypoint, position: &Geographic) -> bool {
        (target.latitude_deg - position.latitude_deg).abs() <= self.latitude_deg
            && longitude_difference_deg(target.longitude_deg, position.longitude_deg).abs()
                <= self.longitude_deg
            && (target.altitude_m - position.altitude_m).abs() <= self.altitude_m
    }
}
