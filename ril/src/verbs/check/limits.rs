//! `[preflight]` of `ril.toml`: from where on a value is a warning, and from where on a failure.
//!
//! The defaults fit the helicopter of `dsp-sim.toml` (six cells, a tank for 40 minutes) and are derived in `ril.toml`.

use serde::de::Error as _;
use serde::{Deserialize, Deserializer};

runtime::ranged! {
    fn age_s(f64) in 0.1..=60.0;
    fn room_mib(u64) in 0..=1_048_576;
}

/// `[preflight]`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Limits {
    /// Samples older than this are no present, s.
    #[serde(deserialize_with = "age_s")]
    pub max_age_s: f64,
    /// Part of the DSP's messages that were rejected, %.
    #[serde(deserialize_with = "ceiling")]
    pub link_loss_percent: Threshold,
    /// Battery, V.
    #[serde(deserialize_with = "floor")]
    pub battery_v: Threshold,
    /// Fuel, %.
    #[serde(deserialize_with = "floor")]
    pub fuel_percent: Threshold,
    /// Qualities of the GPS fix that are good enough for a path.
    #[serde(deserialize_with = "qualities")]
    pub gps_quality_pass: Vec<u32>,
    /// Qualities of the GPS fix with which the helicopter flies, but not exactly.
    #[serde(deserialize_with = "qualities")]
    pub gps_quality_warn: Vec<u32>,
    /// Room for a flight's rows of each log beyond what the log leaves free, MiB.
    #[serde(deserialize_with = "room_mib")]
    pub log_room_mib: u64,
    /// Checks that warn if they cannot be made, instead of keeping the robot on the ground.
    pub may_be_unchecked: Vec<String>,
}

impl Default for Limits {
    fn default() -> Self {
        Limits {
            max_age_s: 1.0,
            link_loss_percent: Threshold {
                warn: 0.1,
                fail: 1.0,
            },
            battery_v: Threshold {
                warn: 24.0,
                fail: 23.0,
            },
            fuel_percent: Threshold {
                warn: 50.0,
                fail: 25.0,
            },
            gps_quality_pass: vec![4, 5],
            gps_quality_warn: vec![1, 2, 3, 8],
            log_room_mib: 64,
            may_be_unchecked: Vec::new(),
        }
    }
}

/// Two limits of a value.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Threshold {
    /// Beyond this it is a warning.
    pub warn: f64,
    /// Beyond this it is a failure.
    pub fail: f64,
}

impl Threshold {
    fn read<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Threshold, D::Error> {
        let limits = Threshold::deserialize(deserializer)?;
        for limit in [limits.warn, limits.fail] {
            if !(0.0..=100.0).contains(&limit) {
                return Err(D::Error::custom(format_args!(
                    "{limit} is out of range: 0 to 100"
                )));
            }
        }
        Ok(limits)
    }
}

/// Reads limits that a value should not fall below.
fn floor<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Threshold, D::Error> {
    let limits = Threshold::read(deserializer)?;
    match limits.warn >= limits.fail {
        true => Ok(limits),
        false => Err(D::Error::custom("fail must not be greater than warn")),
    }
}

/// Reads limits that a value should not exceed.
fn ceiling<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Threshold, D::Error> {
    let limits = Threshold::read(deserializer)?;
    match limits.warn <= limits.fail {
        true => Ok(limits),
        false => Err(D::Error::custom("fail must not be less than warn")),
    }
}

/// Reads qualities of a GPS fix, 0 … 8.
fn qualities<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<u32>, D::Error> {
    let list = Vec::<u32>::deserialize(deserializer)?;
    match list.iter().find(|quality| **quality > 8) {
        None => Ok(list),
        Some(quality) => Err(D::Error::custom(format_args!(
            "{quality} is no quality of a GPS fix: 0 to 8"
        ))),
    }
}
