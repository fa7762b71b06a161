//! The altitude from GPS, barometer and sonar, with its variance.
//!
//! | input | measures | its slow error |
//! |---|---|---|
//! | GPS altitude | altitude + GPS offset | wanders within minutes; its size follows the kind of fix |
//! | GPS climb speed | vertical speed | none |
//! | barometer | altitude + barometer offset | drifts with the weather; estimated against the GPS |
//! | sonar, near the ground | altitude − altitude of the ground | changes with the terrain |
//!
//! One Kalman filter knows altitude, vertical speed and the three slow errors. Because GPS wander is a state and not
//! mere noise, the variance does not shrink below what the kind of fix allows, however many samples are averaged.
//!
//! * **Outliers**: a number farther than [`GATE_SIGMAS`] from what is expected is left out.
//! * **Jumps**: if an input is left out for [`JUMP_AFTER_S`], its slow error has jumped (a roof under the sonar, a GPS
//!   that recovers); the filter then learns that error anew instead of ignoring the input for ever.
//! * **Disagreement**: while the GPS differs from barometer and sonar by more than its kind of fix explains, the
//!   estimate follows those two and its variance holds the difference. After [`DISAGREEMENT_S`] the GPS is right,
//!   because the estimate has its zero: the filter starts anew.
//! * **Time**: the DSP's clock when it is transmitted and goes on, else the time of reception. A reboot of the DSP and
//!   another bridge change neither the altitude nor the filter.
//! * **Gaps**: the variance grows with the time without samples. After [`MAX_GAP_S`] the filter starts anew.

use ipc_types::TelemetryGroup as Group;
use ipc_types::payload::{DspTelemetry, HeroEstimate, HeroTelemetry};
use serde::{Deserialize, Serialize};

use super::kalman::{Gaussian, Matrix, Measurement};
use super::{Estimator, INPUT_BAROMETER, INPUT_GPS, INPUT_SONAR};

runtime::ranged! {
    fn deviation_m(f64) in 0.001..=100.0;
    fn deviation_mps(f64) in 0.001..=10.0;
    fn range_m(f64) in 0.1..=100.0;
}

/// A number this many standard deviations from the expected one is an outlier.
pub const GATE_SIGMAS: f64 = 5.0;

/// An input that was left out for so long has jumped, s.
pub const JUMP_AFTER_S: f64 = 2.0;

/// Longest time between two samples that the model can bridge, s.
pub const MAX_GAP_S: f64 = 10.0;

/// A GPS that differs from the other inputs for so long is right, s. Multipath takes less.
pub const DISAGREEMENT_S: f64 = 60.0;

/// An offset of this many standard deviations of a fix is more than the fix explains.
const DISAGREEMENT_SIGMAS: f64 = 4.0;

/// Greatest standard deviation of an altitude that is published as valid, m.
pub const MAX_VALID_DEVIATION_M: f64 = 20.0;

/// How fast a helicopter changes its vertical speed: density of the white acceleration that the model assumes, m²/s³.
/// 1 m/s² that changes once a second.
const ACCELERATION_DENSITY: f64 = 1.0;

/// Time constant of GPS wander, s: that of ionosphere and multipath on a machine that moves.
const GPS_WANDER_S: f64 = 60.0;

/// How the barometer's offset drifts: m²/s. 2 m in an hour.
const BAROMETER_DRIFT: f64 = 4.0 / 3600.0;

/// How the ground rises and falls under the helicopter, m² for each metre of way: 3 m in 100 m.
const TERRAIN_ROUGHNESS: f64 = 9.0 / 100.0;

/// Speed over ground that is assumed without a GPS velocity, m/s.
const ASSUMED_SPEED_MPS: f64 = 3.0;

/// Variance of a state of which nothing is known: any altitude lies within 10 km.
const UNKNOWN_M2: f64 = 1e8;

/// Variance of a vertical speed of which nothing is known, (10 m/s)².
const UNKNOWN_SPEED_M2PS2: f64 = 100.0;

/// Converter values at which a sensor has reached the end of its range.
const ADC_ENDS: [u32; 2] = [0, 4095];

/// `[estimator.altitude]`: the standard deviation of each input.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct AltitudeConfig {
    /// GPS altitude with the carrier phase resolved (fix quality 4), m.
    #[serde(deserialize_with = "deviation_m")]
    pub gps_rtk_fixed_m: f64,
    /// GPS altitude with a floating carrier phase (fix quality 5), m.
    #[serde(deserialize_with = "deviation_m")]
    pub gps_rtk_float_m: f64,
    /// GPS altitude with any other fix (quality 1, 2, 3, 8), m.
    #[serde(deserialize_with = "deviation_m")]
    pub gps_m: f64,
    /// GPS climb speed, m/s.
    #[serde(deserialize_with = "deviation_mps")]
    pub gps_climb_mps: f64,
    /// Noise of the barometric altitude, m.
    #[serde(deserialize_with = "deviation_m")]
    pub barometer_m: f64,
    /// Offset of the barometric altitude before it is known, m.
    #[serde(deserialize_with = "deviation_m")]
    pub barometer_offset_m: f64,
    /// Noise of the sonar, m.
    #[serde(deserialize_with = "deviation_m")]
    pub sonar_m: f64,
    /// Greatest height that the sonar measures, m.
    #[serde(deserialize_with = "range_m")]
    pub sonar_range_m: f64,
}

impl Default for AltitudeConfig {
    fn default() -> Self {
        AltitudeConfig {
            gps_rtk_fixed_m: 0.05,
            gps_rtk_float_m: 0.5,
            gps_m: 3.0,
            gps_climb_mps: 0.1,
            barometer_m: 0.5,
            barometer_offset_m: 10.0,
            sonar_m: 0.05,
            sonar_range_m: 8.0,
        }
    }
}

/// Places of the states.
const ALTITUDE: usize = 0;
const CLIMB: usize = 1;
const GPS_OFFSET: usize = 2;
const BAROMETER_OFFSET: usize = 3;
const GROUND: usize = 4;
const STATES: usize = 5;

type Observation = [f64; STATES];

/// Number of [`Quantity`]s.
const QUANTITIES: usize = 4;

/// The four numbers of a sample that say something about the altitude.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Quantity {
    GpsAltitude,
    GpsClimb,
    Barometer,
    Sonar,
}

impl Quantity {
    /// The weight of each state in the number.
    fn observation(self) -> Observation {
        let mut weights = [0.0; STATES];
        match self {
            Quantity::GpsAltitude => (weights[ALTITUDE], weights[GPS_OFFSET]) = (1.0, 1.0),
            Quantity::GpsClimb => weights[CLIMB] = 1.0,
            Quantity::Barometer => (weights[ALTITUDE], weights[BAROMETER_OFFSET]) = (1.0, 1.0),
            Quantity::Sonar => (weights[ALTITUDE], weights[GROUND]) = (1.0, -1.0),
        }
        weights
    }

    /// The state that is learned anew when the number has jumped.
    fn slow_error(self) -> usize {
        match self {
            Quantity::GpsAltitude => GPS_OFFSET,
            Quantity::GpsClimb => CLIMB,
            Quantity::Barometer => BAROMETER_OFFSET,
            Quantity::Sonar => GROUND,
        }
    }

    /// Its bit of `HeroEstimate::inputs`.
    fn input(self) -> u32 {
        match self {
            Quantity::GpsAltitude => INPUT_GPS,
            Quantity::GpsClimb => 0,
            Quantity::Barometer => INPUT_BAROMETER,
            Quantity::Sonar => INPUT_SONAR,
        }
    }
}

/// A number of a sample, with the standard deviation of its noise.
#[derive(Clone, Copy, Debug)]
struct Reading {
    source: Quantity,
    measured: f64,
    deviation: f64,
}

/// The estimator.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct AltitudeEstimator {
    /// Not of what is saved.
    #[serde(skip)]
    config: AltitudeConfig,
    state: Gaussian<STATES>,
    previous: Option<Moment>,
    /// Deviation of the last GPS fix, m.
    gps_deviation_m: Option<f64>,
    /// For how long each source has been left out, s.
    rejected_s: [f64; QUANTITIES],
    /// For how long a GPS with a fix has differed from the other inputs, s.
    disagreement_s: f64,
}

impl AltitudeEstimator {
    /// An estimator that knows nothing yet.
    pub fn new(config: &AltitudeConfig) -> AltitudeEstimator {
        let offset_m2 = config.barometer_offset_m.powi(2);
        let mut variances = [UNKNOWN_M2; STATES];
        variances[CLIMB] = UNKNOWN_SPEED_M2PS2;
        variances[GPS_OFFSET] = 0.0;
        variances[BAROMETER_OFFSET] = offset_m2;
        AltitudeEstimator {
            config: config.clone(),
            state: Gaussian::independent([0.0; STATES], variances),
            previous: None,
            gps_deviation_m: None,
            rejected_s: [0.0; QUANTITIES],
            disagreement_s: 0.0,
        }
    }

    /// Forgets everything but that the last sample was taken at `moment`.
    fn restart(&mut self, moment: Moment) {
        *self = AltitudeEstimator::new(&self.config);
        self.previous = Some(moment);
    }

    /// Moves the state on by `elapsed_s`.
    fn predict(&mut self, elapsed_s: f64, hero: &HeroTelemetry) {
        let speed_mps = match self.gps_deviation(hero) {
            Some(_) if hero.valid(Group::GpsVelocity) => hero.velocity.ground_speed_mps.into(),
            _ => ASSUMED_SPEED_MPS,
        };
        let wander_kept = (-elapsed_s / GPS_WANDER_S).exp();
        // After a jump the offset may stay as large as it is.
        let wander_m = self.gps_deviation_m.unwrap_or(0.0);
        let wander_m = wander_m.max(self.state.mean[GPS_OFFSET].abs());
        let mut transition = identity();
        transition[ALTITUDE][CLIMB] = elapsed_s;
        transition[GPS_OFFSET][GPS_OFFSET] = wander_kept;
        let mut noise = [[0.0; STATES]; STATES];
        noise[ALTITUDE][ALTITUDE] = ACCELERATION_DENSITY * elapsed_s.powi(3) / 3.0;
        noise[ALTITUDE][CLIMB] = ACCELERATION_DENSITY * elapsed_s.powi(2) / 2.0;
        noise[CLIMB][ALTITUDE] = noise[ALTITUDE][CLIMB];
        noise[CLIMB][CLIMB] = ACCELERATION_DENSITY * elapsed_s;
        noise[GPS_OFFSET][GPS_OFFSET] = wander_m.powi(2) * (1.0 - wander_kept.powi(2));
        noise[BAROMETER_OFFSET][BAROMETER_OFFSET] = BAROMETER_DRIFT * elapsed_s;
        noise[GROUND][GROUND] = TERRAIN_ROUGHNESS * speed_mps * elapsed_s;
        self.state.predict(&transition, &noise);
    }

    /// Takes every reading of the sample; gives the bits of the inputs that were not left out.
    fn correct(&mut self, elapsed_s: f64, raw: &DspTelemetry, hero: &HeroTelemetry) -> u32 {
        let gps_deviation_m = self.gps_deviation(hero);
        if let Some(deviation_m) = gps_deviation_m
            && gps_deviation_m != self.gps_deviation_m
        {
            // Another kind of fix has an error of its own, which has nothing to do with the one before.
            self.gps_deviation_m = gps_deviation_m;
            self.state.replace(GPS_OFFSET, 0.0, deviation_m.powi(2));
        }
        let readings = self.readings(raw, hero).into_iter().flatten();
        readings.fold(0, |inputs, reading| inputs | self.take(reading, elapsed_s))
    }

    /// What the sample says about the altitude. A sensor at the end of its range says nothing, nor does a GPS without
    /// fix.
    fn readings(&self, raw: &DspTelemetry, hero: &HeroTelemetry) -> [Option<Reading>; QUANTITIES] {
        let config = &self.config;
        let reading = |source, measured, deviation| Reading {
            source,
            measured,
            deviation,
        };
        let fix = self.gps_deviation(hero);
        let gps_altitude = fix.filter(|_| hero.valid(Group::Geographic));
        let gps_altitude = gps_altitude.map(|deviation_m| {
            reading(Quantity::GpsAltitude, hero.geodetic.altitude_m, deviation_m)
        });
        let gps_climb = fix.filter(|_| hero.valid(Group::GpsVelocity));
        let climb_mps = hero.velocity.up_mps.into();
        let gps_climb =
            gps_climb.map(|_| reading(Quantity::GpsClimb, climb_mps, config.gps_climb_mps));
        let is_measured = |group, adc| hero.valid(group) && !ADC_ENDS.contains(&adc);
        let altitude_m = hero.barometer_altitude_m.into();
        let barometer = is_measured(Group::Barometer, raw.barometer_adc).then_some(reading(
            Quantity::Barometer,
            altitude_m,
            config.barometer_m,
        ));
        let height_m = hero.sonar_height_m.into();
        let in_range = (0.0..=config.sonar_range_m).contains(&height_m);
        let sonar = (is_measured(Group::Sonar, raw.sonar_adc) && in_range).then_some(reading(
            Quantity::Sonar,
            height_m,
            config.sonar_m,
        ));
        [gps_altitude, gps_climb, barometer, sonar]
    }

    /// Takes one reading, unless it is an outlier; gives the bit of its input, or 0.
    fn take(&mut self, reading: Reading, elapsed_s: f64) -> u32 {
        let Reading {
            source,
            measured,
            deviation,
        } = reading;
        let measurement = Measurement {
            measured,
            variance: deviation * deviation,
            observation: source.observation(),
        };
        let innovation = self.state.innovation(&measurement);
        let rejected_s = &mut self.rejected_s[source as usize];
        if !innovation.is_within(GATE_SIGMAS) {
            *rejected_s += elapsed_s;
            if *rejected_s < JUMP_AFTER_S {
                return 0;
            }
            let slow_error = source.slow_error();
            self.state.covariance[slow_error][slow_error] += innovation.residual.powi(2);
        }
        *rejected_s = 0.0;
        self.state.correct(&measurement);
        source.input()
    }

    /// The deviation of the GPS altitude by the kind of its fix, m; nothing without a fix, or while its kind is not
    /// transmitted. A position that was dead-reckoned or typed in is no fix.
    fn gps_deviation(&self, hero: &HeroTelemetry) -> Option<f64> {
        if !hero.valid(Group::GpsQuality) {
            return None;
        }
        match hero.gps_quality {
            1 | 2 | 3 | 8 => Some(self.config.gps_m),
            4 => Some(self.config.gps_rtk_fixed_m),
            5 => Some(self.config.gps_rtk_float_m),
            _ => None,
        }
    }

    /// How far the GPS differs from the other inputs, m; 0 while its kind of fix explains it.
    fn disagreement_m(&self) -> f64 {
        let offset_m = self.state.mean[GPS_OFFSET].abs();
        let explained_m = DISAGREEMENT_SIGMAS * self.gps_deviation_m.unwrap_or(f64::INFINITY);
        if offset_m > explained_m {
            offset_m
        } else {
            0.0
        }
    }

    fn estimate(&self, inputs: u32) -> HeroEstimate {
        let variance_m2 = self.state.covariance[ALTITUDE][ALTITUDE] + self.disagreement_m().powi(2);
        if variance_m2 > MAX_VALID_DEVIATION_M.powi(2) {
            return HeroEstimate::default();
        }
        HeroEstimate {
            altitude_m: self.state.mean[ALTITUDE],
            altitude_variance_m2: variance_m2,
            vertical_speed_mps: self.state.mean[CLIMB],
            inputs,
            valid: 1,
        }
    }
}

impl Estimator for AltitudeEstimator {
    fn update(&mut self, raw: &DspTelemetry, hero: &HeroTelemetry) -> HeroEstimate {
        let moment = Moment::of(raw, hero);
        let previous = self.previous.replace(moment);
        let elapsed_s = match previous.map(|previous| moment.seconds_since(&previous)) {
            // A sample without a newer time says nothing new.
            Some(Some(0.0)) => return self.estimate(0),
            Some(Some(elapsed_s)) => elapsed_s,
            Some(None) => {
                self.restart(moment);
                0.0
            }
            None => 0.0,
        };
        self.predict(elapsed_s, hero);
        let inputs = self.correct(elapsed_s, raw, hero);
        // A GPS that is silent disagrees no further.
        if self.disagreement_m() == 0.0 {
            self.disagreement_s = 0.0;
        } else if inputs & INPUT_GPS != 0 {
            self.disagreement_s += elapsed_s;
        }
        // Without any input the variance grows for ever; long before it loses its precision, nothing is known any more.
        let is_lost = self.state.covariance[ALTITUDE][ALTITUDE] > 2.0 * UNKNOWN_M2;
        if is_lost || !self.state.is_finite() || self.disagreement_s > DISAGREEMENT_S {
            self.restart(moment);
            return HeroEstimate::default();
        }
        self.estimate(inputs)
    }

    fn save(&self) -> Option<Vec<u8>> {
        postcard::to_allocvec(self).ok()
    }

    fn restore(&mut self, bytes: &[u8]) -> bool {
        let Ok(saved) = postcard::from_bytes::<AltitudeEstimator>(bytes) else {
            return false;
        };
        let config = self.config.clone();
        *self = AltitudeEstimator { config, ..saved };
        true
    }
}

/// When a sample was taken.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Moment {
    epoch_ns: u64,
    dsp_boots: u32,
    /// By the DSP's clock, if it is transmitted.
    dsp_time_ms: Option<u32>,
    received_ns: u64,
}

impl Moment {
    fn of(raw: &DspTelemetry, hero: &HeroTelemetry) -> Moment {
        Moment {
            epoch_ns: raw.epoch_ns,
            dsp_boots: raw.dsp_boots,
            dsp_time_ms: hero.valid(Group::Time).then_some(raw.dsp_time_ms),
            received_ns: raw.received_ns,
        }
    }

    /// Seconds from `previous` to this moment; `None` if it is not known, or longer than [`MAX_GAP_S`].
    fn seconds_since(&self, previous: &Moment) -> Option<f64> {
        let same_boot = (self.epoch_ns, self.dsp_boots) == (previous.epoch_ns, previous.dsp_boots);
        if let (true, Some(now_ms), Some(then_ms)) =
            (same_boot, self.dsp_time_ms, previous.dsp_time_ms)
        {
            // The DSP's clock wraps at 2³² ms.
            let elapsed_s = f64::from(now_ms.wrapping_sub(then_ms)) / 1e3;
            if elapsed_s <= MAX_GAP_S {
                return Some(elapsed_s);
            }
        }
        let elapsed_ns = self.received_ns.checked_sub(previous.received_ns)?;
        let elapsed_s = elapsed_ns as f64 / 1e9;
        (elapsed_s <= MAX_GAP_S).then_some(elapsed_s)
    }
}

fn identity() -> Matrix<STATES> {
    let mut matrix = [[0.0; STATES]; STATES];
    for (index, row) in matrix.iter_mut().enumerate() {
        row[index] = 1.0;
    }
    matrix
}

#[cfg(test)]
mod tests;
