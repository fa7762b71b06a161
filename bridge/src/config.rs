//! Configuration of the bridge, `bridge.toml` (the source's `bridge.conf`).
//!
//! Every value has a default; the annotated example `bridge/bridge.toml` shows them all and is tested to parse to them.

use std::fmt;
use std::path::PathBuf;
use std::time::Duration;

use dsp_protocol::port::{self, Access, Port, Port16};
use dsp_protocol::{Command, Group, Profile, StatusMask};
use ipc_types::code::SafetyAction;
use runtime::config::in_range;
use serde::de::{Error as _, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};

use crate::errors::ErrorTable;
use crate::flight::arrival::Tolerance;
use crate::link::coherence::Rule;
use crate::link::commands::ATTEMPTS;
use crate::safety::fence::Fence;

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
    /// What goes to the DSP for a path.
    pub trajectory: TrajectoryConfig,
    /// Limits of movements.
    pub movement: MovementLimits,
    /// Rules of flight safety.
    pub safety: SafetyConfig,
    /// Where the helicopter may fly.
    pub fence: Fence,
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
    fn pc_timeout_ms(u16) in 0..=60_000;
    fn speed_mps(f64) in 0.01..=100.0;
    fn spacing_m(f64) in 0.1..=10_000.0;
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

/// Implements `Deserialize` for types that derive it as `#[serde(remote = "Self")]`: fields that are right each by itself
/// are then checked together.
macro_rules! checked {
    ($($config:ident),+) => {
        $(
            impl<'de> Deserialize<'de> for $config {
                fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                    let config = $config::deserialize(deserializer)?;
                    config.check().map_err(D::Error::custom)?;
                    Ok(config)
                }
            }
        )+
    };
}

checked!(LinkConfig, MovementLimits, SupplyLimits);

/// `[link]`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(remote = "Self", deny_unknown_fields, default)]
pub struct LinkConfig {
    /// How messages are framed: the same as at the DSP.
    #[serde(deserialize_with = "profile")]
    pub profile: Profile,
    /// After how long without a message from the bridge the DSP stops by itself; 0 never, and then the port is not touched.
    #[serde(deserialize_with = "pc_timeout_ms")]
    pub pc_timeout_ms: u16,
    /// How long one attempt of a command waits for its acknowledgement.
    #[serde(deserialize_with = "milliseconds")]
    pub ack_timeout_ms: u64,
    /// After how long without a valid message the link is silent, and after how long an observation is not known any more:
    /// at least this, and three observed periods.
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
            pc_timeout_ms: 2000,
            ack_timeout_ms: 200,
            silent_after_ms: 1000,
            start_up_retry_min_ms: 100,
            start_up_retry_max_ms: 1000,
        }
    }
}

impl LinkConfig {
    /// The DSP must not take a PC for gone that is still repeating its sign of life.
    fn check(&self) -> Result<(), String> {
        let shortest = (self.ack_timeout_ms * u64::from(ATTEMPTS)).saturating_mul(3) / 2;
        let timeout = u64::from(self.pc_timeout_ms);
        if timeout > 0 && timeout < shortest {
            return Err(format!(
                "pc_timeout_ms = {timeout} is too short for ack_timeout_ms = {}: 0, or at least {shortest}",
                self.ack_timeout_ms
            ));
        }
        Ok(())
    }

    /// How long one attempt waits for its acknowledgement.
    pub fn ack_timeout(&self) -> Duration {
        Duration::from_millis(self.ack_timeout_ms)
    }

    /// After how long without a message from the bridge the DSP stops by itself.
    pub fn pc_timeout(&self) -> Duration {
        Duration::from_millis(self.pc_timeout_ms.into())
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
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(remote = "Self", deny_unknown_fields, default)]
pub struct MovementLimits {
    /// Within what time a movement must have begun on the DSP, when its request does not say.
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
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrajectoryConfig {
    /// Which generator stands between the waypoints of a path and the DSP.
    pub kind: TrajectoryKind,
    /// `divide_legs`: longest distance between two points.
    #[serde(deserialize_with = "spacing_m")]
    pub spacing_m: f64,
}

/// The trajectory generators that are built in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
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

/// `[safety]`: the rules that the bridge enforces in flight (`docs/safety.md`).
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SafetyConfig {
    /// Whether the pilot's switch on manual refuses movements and ends the one under way.
    pub pilot_switch: bool,
    /// What happens when the helicopter itself is outside the geofence.
    pub fence_breach: BreachAction,
    /// What happens when the link comes back after it was lost in flight.
    pub link_loss: BreachAction,
    /// How long a supply must be below a limit before the rule acts.
    #[serde(deserialize_with = "seconds")]
    pub supply_for_s: f64,
    /// Battery limits, V.
    pub battery_v: SupplyLimits,
    /// Fuel limits, %.
    pub fuel_percent: SupplyLimits,
}

impl Default for SafetyConfig {
    fn default() -> Self {
        SafetyConfig {
            pilot_switch: true,
            fence_breach: BreachAction::Hold,
            link_loss: BreachAction::Hold,
            supply_for_s: 2.0,
            battery_v: SupplyLimits::default(),
            fuel_percent: SupplyLimits::default(),
        }
    }
}

/// What is done about a breach in flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BreachAction {
    /// It is shown and logged.
    Warn,
    /// A path is ended; the helicopter hovers.
    Hold,
    /// A path is ended, and the bridge orders a landing.
    Land,
}

/// Limits of a supply; one that is not given is not watched.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(remote = "Self", deny_unknown_fields, default)]
pub struct SupplyLimits {
    /// Below this it is shown and logged.
    pub warn: Option<f64>,
    /// Below this no movement begins but landing.
    pub refuse: Option<f64>,
    /// Below this a path is ended; the helicopter hovers.
    pub hold: Option<f64>,
    /// Below this a path is ended, and the bridge orders a landing.
    pub land: Option<f64>,
}

impl SupplyLimits {
    /// The limits from mild to severe, those that are given.
    pub fn steps(&self) -> impl Iterator<Item = (SafetyAction, f64)> {
        [
            (SafetyAction::Warn, self.warn),
            (SafetyAction::Refuse, self.refuse),
            (SafetyAction::Hold, self.hold),
            (SafetyAction::Land, self.land),
        ]
        .into_iter()
        .filter_map(|(action, limit)| limit.map(|limit| (action, limit)))
    }

    /// A milder action comes first, so its limit is the higher one.
    fn check(&self) -> Result<(), String> {
        if let Some((_, limit)) = self
            .steps()
            .find(|(_, limit)| !(0.0..=100.0).contains(limit))
        {
            return Err(format!("{limit} is out of range: 0 to 100"));
        }
        let falls = self
            .steps()
            .zip(self.steps().skip(1))
            .all(|((_, mild), (_, severe))| mild >= severe);
        if falls {
            Ok(())
        } else {
            Err("the limits must fall in the order warn, refuse, hold, land".to_owned())
        }
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
    /// How many there are.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The command that writes the parameter of this index, which must be below [`Parameters::len`].
    pub fn write(&self, index: usize) -> Command {
        self.0[index]
    }

    /// The commands that write the parameters.
    pub fn writes(&self) -> impl Iterator<Item = Command> + '_ {
        self.0.iter().copied()
    }

    /// The radius in which the DSP takes a waypoint for reached: the one that was written, or that of its boot.
    pub fn acceptance_radius_m(&self) -> f64 {
        let written = self.0.iter().find_map(|write| match write {
            Command::Write32 {
                port: port::ACCEPTANCE_RADIUS_M,
                value,
            } => Some(*value),
            _ => None,
        });
        let at_boot = port::port32(port::ACCEPTANCE_RADIUS_M).map(|port| port.boot);
        f64::from(written.or(at_boot).unwrap_or_default())
    }

    /// Writes `write` as well from now on; one to the same port is replaced. There is one for each port at most.
    pub fn set(&mut self, write: Command) {
        match self
            .0
            .iter_mut()
            .find(|other| port_of(other) == port_of(&write))
        {
            Some(other) => *other = write,
            None => self.0.push(write),
        }
    }
}

/// The port that a command writes or reads.
fn port_of(command: &Command) -> Option<u16> {
    match command {
        Command::Read16 { port }
        | Command::Write16 { port, .. }
        | Command::Read32 { port }
        | Command::Write32 { port, .. } => Some(*port),
        _ => None,
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
