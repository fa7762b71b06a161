//! Configuration of the simulator, `dsp-sim.toml`. Every value has a default; the annotated example
//! `dsp-sim/dsp-sim.toml` shows them all and is tested to parse to them.

use std::num::NonZeroU32;
use std::time::Duration;

use dsp_protocol::downlink::Geographic;
use dsp_protocol::{DspErrorCode, Profile, StatusMask};
use runtime::config::Deserializer;
use serde::Deserialize;
use serde::de::Error as _;

use crate::device::firmware::Firmware;
use crate::helicopter::Model;
use crate::helicopter::energy::EnergyModel;
use crate::helicopter::wind::WindModel;
use crate::simulator::Setup;

/// The configuration file that is read when none is named; it may be absent.
pub const DEFAULT_FILE: &str = "dsp-sim.toml";

/// Errors that the DSP can queue while it boots: the places of its queue (`docs/protocol.md` section 8.6).
const MAX_BOOT_ERRORS: usize = 16;

runtime::ranged! {
    fn baud_rate(u32) in 0..=4_000_000;
    // At the poles east has no direction.
    fn latitude_deg(f64) in -85.0..=85.0;
    fn longitude_deg(f64) in -180.0..=180.0;
    fn altitude_m(f64) in -500.0..=9_000.0;
    fn direction_deg(f64) in 0.0..=360.0;
    // Together no more than the helicopter can hold against.
    fn wind_mps(f64) in 0.0..=12.0;
    fn gust_mps(f64) in 0.0..=3.0;
    fn noise_level(f64) in 0.0..=10.0;
    // TOML has no unsigned integers.
    fn seed(u64) in 0..=i64::MAX.cast_unsigned();
    fn fix_after_s(f64) in 0.0..=3_600.0;
    fn battery_v(f64) in 0.0..=60.0;
    fn fuel_percent(f64) in 0.0..=100.0;
    fn drain_factor(f64) in 0.0..=1_000.0;
    fn take_off_delay_ms(u32) in 0..=10_000;
}

/// All of `dsp-sim.toml`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// The serial link.
    pub serial: SerialConfig,
    /// Where the helicopter stands at first.
    pub home: HomeConfig,
    /// The wind.
    pub wind: WindConfig,
    /// The noise of the sensors.
    pub noise: NoiseConfig,
    /// The GPS receiver.
    pub gps: GpsConfig,
    /// Battery and fuel.
    pub energy: EnergyConfig,
    /// The DSP's boot.
    pub boot: BootConfig,
    /// The DSP's firmware.
    pub dsp: DspConfig,
}

/// `[serial]`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SerialConfig {
    /// Bits per second of the serial link, 8N1; 0 lets bytes take no time.
    #[serde(deserialize_with = "baud_rate")]
    pub baud_rate: u32,
    /// What the DSP speaks; the bridge must speak the same (`docs/protocol.md` section 11).
    #[serde(deserialize_with = "profile")]
    pub profile: Profile,
}

impl Default for SerialConfig {
    fn default() -> Self {
        SerialConfig {
            baud_rate: 115_200,
            profile: Profile::Classic,
        }
    }
}

/// `[home]`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HomeConfig {
    /// Latitude, degrees, north positive.
    #[serde(deserialize_with = "latitude_deg")]
    pub latitude_deg: f64,
    /// Longitude, degrees, east positive.
    #[serde(deserialize_with = "longitude_deg")]
    pub longitude_deg: f64,
    /// Altitude of the ground, m.
    #[serde(deserialize_with = "altitude_m")]
    pub altitude_m: f64,
    /// Where the nose points, degrees clockwise from true north.
    #[serde(deserialize_with = "direction_deg")]
    pub heading_deg: f64,
}

impl Default for HomeConfig {
    fn default() -> Self {
        HomeConfig {
            latitude_deg: 37.411,
            longitude_deg: -6.001,
            altitude_m: 10.0,
            heading_deg: 0.0,
        }
    }
}

/// `[wind]`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WindConfig {
    /// Steady wind, m/s.
    #[serde(deserialize_with = "wind_mps")]
    pub speed_mps: f64,
    /// Where it comes from, degrees clockwise from true north.
    #[serde(deserialize_with = "direction_deg")]
    pub from_deg: f64,
    /// Standard deviation of the gusts along each axis, m/s.
    #[serde(deserialize_with = "gust_mps")]
    pub gust_mps: f64,
}

impl Default for WindConfig {
    fn default() -> Self {
        WindConfig {
            speed_mps: 3.0,
            from_deg: 240.0,
            gust_mps: 0.7,
        }
    }
}

/// `[noise]`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NoiseConfig {
    /// Noise of all sensors: 0 none, 1 usual.
    #[serde(deserialize_with = "noise_level")]
    pub level: f64,
    /// Seed of noise and gusts.
    #[serde(deserialize_with = "seed")]
    pub seed: u64,
}

impl Default for NoiseConfig {
    fn default() -> Self {
        NoiseConfig {
            level: 1.0,
            seed: 1,
        }
    }
}

/// `[gps]`
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GpsConfig {
    /// Time from the start to the first fix, s. Before it, quality, position and velocity read zero.
    #[serde(deserialize_with = "fix_after_s")]
    pub fix_after_s: f64,
}

/// `[energy]`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EnergyConfig {
    /// Voltage of the battery at rest when the simulator starts, V.
    #[serde(deserialize_with = "battery_v")]
    pub battery_v: f64,
    /// Fuel when the simulator starts, %.
    #[serde(deserialize_with = "fuel_percent")]
    pub fuel_percent: f64,
    /// How many times faster than usual both drain.
    #[serde(deserialize_with = "drain_factor")]
    pub drain_factor: f64,
}

impl Default for EnergyConfig {
    fn default() -> Self {
        let model = EnergyModel::default();
        EnergyConfig {
            battery_v: model.battery_v,
            fuel_percent: model.fuel_percent,
            drain_factor: model.drain_factor,
        }
    }
}

/// `[boot]`
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BootConfig {
    /// Errors that the DSP queues while it boots (`docs/protocol.md` section 7).
    #[serde(deserialize_with = "boot_errors")]
    pub errors: Vec<u16>,
}

/// `[dsp]`: switches for firmware that differs from `docs/protocol.md`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DspConfig {
    /// Whether the DSP has port 10004, the PC time-out.
    pub has_pc_timeout: bool,
    /// Whether the DSP has port 10003, the waypoint count.
    pub has_waypoint_count: bool,
    /// Whether a status can carry the DSP's time.
    pub has_time: bool,
    /// Whether a take-off is refused until waypoint following was switched on.
    pub refuses_take_off_before_start_up: bool,
    /// How long after its acknowledgement a take-off begins, ms.
    #[serde(deserialize_with = "take_off_delay_ms")]
    pub take_off_delay_ms: u32,
    /// Groups that a status carries although the mask does not ask for them, as bits of the mask.
    pub extra_groups: u16,
    /// What the DSP's clock reads at the start of the simulator, ms; it wraps to 0 after 4294967295.
    pub clock_start_ms: u32,
}

impl Default for DspConfig {
    fn default() -> Self {
        let firmware = Firmware::default();
        DspConfig {
            has_pc_timeout: firmware.has_pc_timeout,
            has_waypoint_count: firmware.has_waypoint_count,
            has_time: firmware.has_time,
            refuses_take_off_before_start_up: firmware.refuses_take_off_before_start_up,
            take_off_delay_ms: 0,
            extra_groups: firmware.extra_groups.0,
            clock_start_ms: firmware.clock_start_ms,
        }
    }
}

impl DspConfig {
    fn firmware(&self) -> Firmware {
        let DspConfig {
            has_pc_timeout,
            has_waypoint_count,
            has_time,
            refuses_take_off_before_start_up,
            take_off_delay_ms,
            extra_groups,
            clock_start_ms,
        } = *self;
        Firmware {
            has_pc_timeout,
            has_waypoint_count,
            has_time,
            refuses_take_off_before_start_up,
            take_off_delay: Duration::from_millis(take_off_delay_ms.into()),
            extra_groups: StatusMask(extra_groups),
            clock_start_ms,
        }
    }
}

impl Config {
    /// What is simulated.
    pub fn setup(&self) -> Setup {
        let errors = self.boot.errors.iter();
        Setup {
            model: Model {
                home: Geographic {
                    latitude_deg: self.home.latitude_deg,
                    longitude_deg: self.home.longitude_deg,
                    altitude_m: self.home.altitude_m,
                },
                heading_deg: self.home.heading_deg,
                wind: WindModel {
                    speed_mps: self.wind.speed_mps,
                    from_deg: self.wind.from_deg,
                    gust_mps: self.wind.gust_mps,
                },
                noise_level: self.noise.level,
                seed: self.noise.seed,
                gps_fix_after: Duration::from_secs_f64(self.gps.fix_after_s),
                energy: EnergyModel {
                    battery_v: self.energy.battery_v,
                    fuel_percent: self.energy.fuel_percent,
                    drain_factor: self.energy.drain_factor,
                },
            },
            baud: NonZeroU32::new(self.serial.baud_rate),
            receives_at_once: false,
            profile: self.serial.profile,
            boot_errors: errors.copied().map(DspErrorCode).collect(),
            firmware: self.dsp.firmware(),
            faults: None,
        }
    }
}

impl Default for Setup {
    /// The defaults of the configuration.
    fn default() -> Self {
        Config::default().setup()
    }
}

fn profile<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Profile, D::Error> {
    let name = String::deserialize(deserializer)?;
    parse_profile(&name).map_err(D::Error::custom)
}

/// The profile that a file or the command line names, or what is wrong with it.
pub(crate) fn parse_profile(name: &str) -> Result<Profile, String> {
    Profile::from_name(name).ok_or_else(|| {
        let names = Profile::ALL.map(Profile::name).join("` or `");
        format!("`{name}` is no profile; it is `{names}`")
    })
}

fn boot_errors<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<u16>, D::Error> {
    let errors = Vec::<u16>::deserialize(deserializer)?;
    if errors.len() > MAX_BOOT_ERRORS {
        return Err(D::Error::custom(format_args!(
            "the DSP queues at most {MAX_BOOT_ERRORS} errors, not {}",
            errors.len()
        )));
    }
    Ok(errors)
}

#[cfg(test)]
mod tests {
    use runtime::config::proof;

    use super::*;

    #[test]
    fn the_annotated_example_says_the_defaults() {
        proof::assert_annotated::<Config>(include_str!("../dsp-sim.toml"), &[]);
    }

    #[test]
    fn what_cannot_be_is_refused_with_its_line() {
        proof::assert_refused::<Config>(
            r#"
            [serial]
            baud_rate = 5000000 #! 5000000 is out of range
            ---
            [serial]
            profile = "Extended" #! `Extended` is no profile; it is `classic` or `extended`
            ---
            [serial]
            baud = 9600 #! unknown field `baud`
            ---
            [home]

            latitude_deg = 90.0 #! 90 is out of range
            ---
            [wind]
            speed_mps = nan #! NaN is out of range
            ---
            [noise]
            seed = -1 #!
            ---
            [boot]
            errors = [70000] #!
            ---
            [boot]
            errors = [1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1] #! at most 16 errors
            ---
            [energy]
            fuel_percent = 101.0 #! 101 is
            ---
            [dsp]
            take_off_delay_ms = 10001 #! 10001 is
            ---
            [dsp]
            extra_groups = 65536 #!
            ---
            [engine] #! unknown field `engine`
            "#,
        );
    }

    #[test]
    fn the_setup_carries_every_value() {
        let text = "
            [serial]
            baud_rate = 0
            profile = 'extended'
            [home]
            latitude_deg = -1.0
            longitude_deg = 2.0
            altitude_m = 3.0
            heading_deg = 4.0
            [wind]
            speed_mps = 5.0
            from_deg = 6.0
            gust_mps = 0.7
            [noise]
            level = 8.0
            seed = 9
            [gps]
            fix_after_s = 10.0
            [energy]
            battery_v = 22.5
            fuel_percent = 30.0
            drain_factor = 13.0
            [boot]
            errors = [11]
            [dsp]
            has_pc_timeout = false
            has_waypoint_count = false
            has_time = false
            refuses_take_off_before_start_up = false
            take_off_delay_ms = 12
            extra_groups = 0x0D
            clock_start_ms = 4_294_967_295
        ";
        let config: Config = runtime::config::parse(text, "x.toml").unwrap();
        let expected = Setup {
            model: Model {
                home: Geographic {
                    latitude_deg: -1.0,
                    longitude_deg: 2.0,
                    altitude_m: 3.0,
                },
                heading_deg: 4.0,
                wind: WindModel {
                    speed_mps: 5.0,
                    from_deg: 6.0,
                    gust_mps: 0.7,
                },
                noise_level: 8.0,
                seed: 9,
                gps_fix_after: Duration::from_secs(10),
                energy: EnergyModel {
                    battery_v: 22.5,
                    fuel_percent: 30.0,
                    drain_factor: 13.0,
                },
            },
            baud: None,
            receives_at_once: false,
            profile: Profile::Extended,
            boot_errors: vec![DspErrorCode(11)],
            firmware: Firmware {
                has_pc_timeout: false,
                has_waypoint_count: false,
                has_time: false,
                refuses_take_off_before_start_up: false,
                take_off_delay: Duration::from_millis(12),
                extra_groups: StatusMask(0x0D),
                clock_start_ms: u32::MAX,
            },
            faults: None,
        };
        assert_eq!(config.setup(), expected);
    }
}
