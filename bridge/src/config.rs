//! Configuration of the bridge, `bridge.toml` (the source's `bridge.conf`).
//!
//! Every value has a default; the annotated example `bridge/bridge.toml` shows them all and is tested to parse to them.

use std::fmt;
use std::path::PathBuf;
use std::time::Duration;

use dsp_protocol::port::{self, Access, Port, Port16};
use dsp_protocol::{Command, Group, Profile, StatusMask};
use runtime::config::in_range;
use serde::de::{Error as _, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};

use crate::errors::ErrorTable;
use crate::flight::arrival::Tolerance;
use crate::line::coherence::Rule;

/// All of `bridge.toml`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BridgeConfig {
    /// The port.
    pub serial: SerialConfig,
    /// Times of the line.
    pub link: LinkConfig,
    /// What the DSP reports, and which samples are believed.
    pub status: StatusConfig,
    /// When a path has been flown.
    pub arrival: ArrivalConfig,
    /// Limits of movements.
    pub movement: MovementLimits,
    /// Which DSP errors end the functionality.
    pub errors: ErrorTable,
    /// The published state.
    pub state: StateConfig,
    /// Controller parameters.
    pub parameters: Parameters,
}

runtime::ranged! {
    fn baud_rate(u32) in 50..=4_000_000;
    fn milliseconds(u64) in 1..=600_000;
    fn state_period_ms(u64) in 10..=1000;
    fn tolerance_deg(f64) in 1e-7..=1.0;
    fn tolerance_m(f64) in 0.01..=1000.0;
    fn seconds(f64) in 0.1..=86_400.0;
    fn distance_m(f64) in 1.0..=1_000_000.0;
    fn altitude_m(f64) in -1000.0..=20_000.0;
}

/// `[serial]`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SerialConfig {
    /// Path of the port (`puerto_serie`).
    pub port: PathBuf,
    /// Bits per second; 8N1.
    #[serde(deserialize_with = "baud_rate")]
    pub baud_rate: u32,
    /// First pause before a port that is gone is opened again; doubled up to `reopen_max_ms`.
    #[serde(deserialize_with = "milliseconds")]
    pub reopen_min_ms: u64,
    /// Longest pause before a port that is gone is opened again.
    #[serde(deserialize_with = "milliseconds")]
    pub reopen_max_ms: u64,
}

impl Default for SerialConfig {
    fn default() -> Self {
        SerialConfig {
            port: PathBuf::from("/dev/ttyS0"),
            baud_rate: 115_200,
            reopen_min_ms: 20,
            reopen_max_ms: 100,
        }
    }
}

impl SerialConfig {
    /// Pause after `failures` failed openings in a row.
    pub fn reopen_pause(&self, failures: u32) -> Duration {
        back_off(self.reopen_min_ms, self.reopen_max_ms, failures)
    }
}

/// `[link]`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LinkConfig {
    /// How messages are framed: the same as at the DSP.
    #[serde(deserialize_with = "profile")]
    pub profile: Profile,
    /// How long one attempt of a command waits for its acknowledgement.
    #[serde(deserialize_with = "milliseconds")]
    pub ack_timeout_ms: u64,
    /// After how long without a valid message the link is silent; also how long an observation counts as known.
    #[serde(deserialize_with = "milliseconds")]
    pub silent_after_ms: u64,
    /// First pause after a start-up that was not answered; doubled up to `start_up_retry_max_ms`.
    #[serde(deserialize_with = "milliseconds")]
    pub start_up_retry_min_ms: u64,
    /// Longest pause after a start-up that was not answered.
    #[serde(deserialize_with = "milliseconds")]
    pub start_up_retry_max_ms: u64,
}

impl Default for LinkConfig {
    fn default() -> Self {
        LinkConfig {
            profile: Profile::Classic,
            ack_timeout_ms: 200,
            silent_after_ms: 1000,
            start_up_retry_min_ms: 100,
            start_up_retry_max_ms: 1000,
        }
    }
}

impl LinkConfig {
    /// How long one attempt waits for its acknowledgement.
    pub fn ack_timeout(&self) -> Duration {
        Duration::from_millis(self.ack_timeout_ms)
    }

    /// After how long without a valid message the link is silent.
    pub fn silent_after(&self) -> Duration {
        Duration::from_millis(self.silent_after_ms)
    }

    /// Pause after `failures` failed start-ups in a row.
    pub fn start_up_retry(&self, failures: u32) -> Duration {
        back_off(
            self.start_up_retry_min_ms,
            self.start_up_retry_max_ms,
            failures,
        )
    }
}

fn profile<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Profile, D::Error> {
    let name = String::deserialize(deserializer)?;
    Profile::from_name(&name).ok_or_else(|| {
        let known = Profile::ALL.map(Profile::name).join(" or ");
        D::Error::custom(format_args!("unknown profile `{name}`: it is {known}"))
    })
}

/// `min`, doubled for each failure after the first, never more than `max`.
fn back_off(min_ms: u64, max_ms: u64, failures: u32) -> Duration {
    let doubled = min_ms.saturating_mul(1 << failures.saturating_sub(1).min(32));
    Duration::from_millis(doubled.min(max_ms))
}

/// `[status]`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StatusConfig {
    /// Names of the groups that the DSP shall send (`mascara`).
    #[serde(deserialize_with = "groups")]
    pub groups: Vec<Group>,
    /// Which samples are published.
    pub coherence: Rule,
}

impl Default for StatusConfig {
    fn default() -> Self {
        StatusConfig {
            groups: Group::ALL.to_vec(),
            coherence: Rule::Immediate,
        }
    }
}

impl StatusConfig {
    /// The mask of the groups.
    pub fn mask(&self) -> StatusMask {
        self.groups.iter().copied().collect()
    }
}

fn groups<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Group>, D::Error> {
    Vec::<String>::deserialize(deserializer)?
        .iter()
        .map(|name| {
            Group::ALL
                .into_iter()
                .find(|group| group.name() == name)
                .ok_or_else(|| {
                    let known: Vec<_> = Group::ALL.iter().map(|group| group.name()).collect();
                    D::Error::custom(format_args!(
                        "unknown group `{name}`; the groups are {}",
                        known.join(", ")
                    ))
                })
        })
        .collect()
}

/// `[arrival]`
#[derive(Clone, Debug, PartialEq, Deserialize)]
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
    /// How long the helicopter must stay at the last waypoint when one before it was not seen to be reached; longer than
    /// the DSP ever rests before it goes on.
    #[serde(deserialize_with = "seconds")]
    pub dwell_s: f64,
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

    /// How long a stay at the last waypoint counts as arrival.
    pub fn dwell(&self) -> Duration {
        Duration::from_secs_f64(self.dwell_s)
    }
}

/// `[movement]`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MovementLimits {
    /// Within what time a movement must have begun on the DSP, when its request does not say.
    #[serde(deserialize_with = "milliseconds")]
    pub begin_within_ms: u64,
    /// After what time a movement that has begun is given up.
    #[serde(deserialize_with = "seconds")]
    pub time_limit_s: f64,
    /// A waypoint farther than this from the helicopter is refused.
    #[serde(deserialize_with = "distance_m")]
    pub max_distance_m: f64,
    /// Lowest altitude of a waypoint.
    #[serde(deserialize_with = "altitude_m")]
    pub min_altitude_m: f64,
    /// Highest altitude of a waypoint.
    #[serde(deserialize_with = "altitude_m")]
    pub max_altitude_m: f64,
}

impl Default for MovementLimits {
    fn default() -> Self {
        MovementLimits {
            begin_within_ms: 5000,
            time_limit_s: 600.0,
            max_distance_m: 10_000.0,
            min_altitude_m: -1000.0,
            max_altitude_m: 20_000.0,
        }
    }
}

impl MovementLimits {
    /// Within what time a movement must have begun when its request does not say.
    pub fn begin_within(&self) -> Duration {
        Duration::from_millis(self.begin_within_ms)
    }

    /// After what time a movement that has begun is given up.
    pub fn time_limit(&self) -> Duration {
        Duration::from_secs_f64(self.time_limit_s)
    }
}

/// `[state]`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StateConfig {
    /// The state is published at every change and at least this often.
    #[serde(deserialize_with = "state_period_ms")]
    pub period_ms: u64,
}

impl Default for StateConfig {
    fn default() -> Self {
        StateConfig { period_ms: 250 }
    }
}

impl StateConfig {
    /// Longest time between two published states.
    pub fn period(&self) -> Duration {
        Duration::from_millis(self.period_ms)
    }
}

/// `[parameters]`: values for the ports of `docs/protocol.md` section 6, by name; written
/// in the order of the port numbers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Parameters(Vec<Command>);

impl Parameters {
    /// The commands that write the parameters.
    pub fn writes(&self) -> impl Iterator<Item = Command> + '_ {
        self.0.iter().copied()
    }
}

impl<'de> Deserialize<'de> for Parameters {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(ParametersVisitor)
    }
}

struct ParametersVisitor;

impl<'de> Visitor<'de> for ParametersVisitor {
    type Value = Parameters;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a table of controller parameters")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Parameters, A::Error> {
        let mut writes = Vec::new();
        while let Some(name) = map.next_key::<String>()? {
            writes.push(map.next_value_seed(ParameterValue { name: &name })?);
        }
        // A table of TOML has no order.
        writes.sort_by_key(|(port, _)| *port);
        Ok(Parameters(
            writes.into_iter().map(|(_, write)| write).collect(),
        ))
    }
}

/// Reads the value of one parameter, so that an error points at its line.
struct ParameterValue<'a> {
    name: &'a str,
}

impl<'de> serde::de::DeserializeSeed<'de> for ParameterValue<'_> {
    type Value = (u16, Command);

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Self::Value, D::Error> {
        match port::by_name(self.name) {
            Some(Port::Bits32(port)) => {
                let value = in_range(deserializer, port.min..=port.max)?;
                let port = port.number;
                Ok((port, Command::Write32 { port, value }))
            }
            Some(Port::Bits16(port)) if is_parameter(port) => {
                let value: i32 = in_range(deserializer, port.min..=port.max)?;
                let port = port.number;
                // Within the port's range, so these are the 16 bits that section 6 asks for, signed or not.
                let value = value as u16;
                Ok((port, Command::Write16 { port, value }))
            }
            _ => Err(D::Error::custom(format_args!(
                "unknown parameter `{}`; the parameters are {}",
                self.name,
                parameter_names().join(", ")
            ))),
        }
    }
}

/// The mask belongs to `[status]`, the PC time-out to `[link]`, and no configuration file takes off or lands.
fn is_parameter(port: &Port16) -> bool {
    port.access != Access::Bridge
}

fn parameter_names() -> Vec<&'static str> {
    let bits16 = port::PORTS_16.iter().filter(|port| is_parameter(port));
    bits16
        .map(|port| port.name)
        .chain(port::PORTS_32.iter().map(|port| port.name))
        .collect()
}
