//! Configuration of the operator's commands, `ril.toml`.
//!
//! Every value has a default; the annotated example `crates/operator/ril.toml` shows them all and is tested to parse to
//! them.

use std::time::Duration;

use runtime::config::in_range;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer};

/// The file that is read when none is named; it may be absent.
pub const DEFAULT_FILE: &str = "ril.toml";

/// All of `ril.toml`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Requests.
    pub request: RequestConfig,
    /// Samples.
    pub observe: ObserveConfig,
    /// Limits of the checks before a flight.
    pub preflight: PreflightLimits,
    /// Plans.
    pub plan: PlanConfig,
}

runtime::ranged! {
    fn timeout_s(f64) in MIN_TIMEOUT_S..=MAX_TIMEOUT_S;
    fn deadline_ms(u32) in 0..=MAX_DEADLINE_MS;
    fn reserve_s(f64) in 0.0..=86_400.0;
    fn age_s(f64) in 0.1..=60.0;
    fn room_mib(u64) in 0..=1_048_576;
}

/// Shortest time that waiting for another process makes sense, s.
pub const MIN_TIMEOUT_S: f64 = 0.01;

/// Longest timeout and duration, s: a day.
pub const MAX_TIMEOUT_S: f64 = 86_400.0;

/// Longest deadline of a request, ms: the same day.
pub const MAX_DEADLINE_MS: u32 = 86_400_000;

/// `[request]`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RequestConfig {
    /// How long the bridge has for its first answer, s.
    #[serde(deserialize_with = "timeout_s")]
    pub timeout_s: f64,
    /// Until how many ms after its issue the order may begin; 0 leaves it to the bridge.
    #[serde(deserialize_with = "deadline_ms")]
    pub deadline_ms: u32,
}

impl Default for RequestConfig {
    fn default() -> Self {
        RequestConfig {
            timeout_s: 2.0,
            deadline_ms: 0,
        }
    }
}

impl RequestConfig {
    /// How long the bridge has for its first answer.
    pub fn timeout(&self) -> Duration {
        Duration::from_secs_f64(self.timeout_s)
    }
}

/// `[observe]`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ObserveConfig {
    /// How long a sample is waited for, and a publisher that is gone, s.
    #[serde(deserialize_with = "timeout_s")]
    pub timeout_s: f64,
}

impl Default for ObserveConfig {
    fn default() -> Self {
        ObserveConfig { timeout_s: 2.0 }
    }
}

impl ObserveConfig {
    /// How long a sample is waited for, and a publisher that is gone.
    pub fn timeout(&self) -> Duration {
        Duration::from_secs_f64(self.timeout_s)
    }
}

/// `[preflight]`: from where on a value is a warning, and from where on a failure.
///
/// The defaults fit the helicopter of `dsp-sim.toml` (six cells, a tank for 40 minutes) and are derived in `ril.toml`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PreflightLimits {
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

impl Default for PreflightLimits {
    fn default() -> Self {
        PreflightLimits {
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

/// `[plan]`: what the checks of plans reckon with. What is not given is not checked, which the checks say.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PlanConfig {
    /// How fast the helicopter flies along a path, m/s. Without it the DSP is asked, or else `bridge.toml`.
    #[serde(deserialize_with = "speed_mps")]
    pub cruise_speed_mps: Option<f64>,
    /// How long battery and fuel last in flight, s.
    #[serde(deserialize_with = "endurance_s")]
    pub endurance_s: Option<f64>,
    /// How much of that shall be left at the end, s.
    #[serde(deserialize_with = "reserve_s")]
    pub reserve_s: f64,
    /// How high telemetry's zero of altitude is above sea, m. Without it no plan with altitudes above sea is flown.
    #[serde(deserialize_with = "zero_above_sea_m")]
    pub zero_above_sea_m: Option<f64>,
}

impl Default for PlanConfig {
    fn default() -> Self {
        PlanConfig {
            cruise_speed_mps: None,
            endurance_s: None,
            reserve_s: 120.0,
            zero_above_sea_m: None,
        }
    }
}

fn speed_mps<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    in_range(deserializer, 0.1..=100.0).map(Some)
}

fn endurance_s<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    in_range(deserializer, 1.0..=86_400.0).map(Some)
}

fn zero_above_sea_m<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    in_range(deserializer, -1000.0..=10_000.0).map(Some)
}

#[cfg(test)]
mod tests {
    use runtime::config::proof::{assert_annotated, assert_refused};

    use super::*;

    #[test]
    fn the_annotated_example_is_the_default() {
        assert_annotated::<Config>(include_str!("../ril.toml"), &[]);
    }

    #[test]
    fn mistakes_are_reported_with_line_and_reason() {
        assert_refused::<Config>(
            r#"
            [requets] #! unknown field `requets`
            ---
            [request]
            timeout = 1 #! did you mean `timeout_s`?
            ---
            [request]

            timeout_s = 0 #! 0 is out of range
            ---
            [request]
            deadline_ms = -1 #!
            ---
            [observe]
            timeout_s = 'long' #! invalid type: string
            ---
            [preflight]
            battery_v = { warn = 22.0, fail = 23.0 } #! fail must not be greater than warn
            ---
            [preflight]
            link_loss_percent = { warn = 2.0, fail = 1.0 } #! fail must not be less than warn
            ---
            [preflight]
            fuel_percent = { warn = 101, fail = 1 } #! 101 is out of range: 0 to 100
            ---
            [preflight]
            gps_quality_pass = [4, 9] #! 9 is no quality of a GPS fix
            ---
            [preflight]
            battery = 1 #! did you mean `battery_v`?
            "#,
        );
    }
}
