//! Estimates of what no single sensor measures well, through one trait.
//!
//! An estimator is fed with every sample and publishes its result in `HeroTelemetry::estimate`. `[estimator] kind` in
//! `status.toml` chooses one; by default there is none. Measured values are never replaced by estimated ones.
//!
//! * [`altitude`] estimates the altitude from GPS, barometer and sonar;
//! * [`config`] is the configuration, and builds the estimator that it chooses;
//! * [`kalman`] is the filter that [`altitude`] is made with.

pub mod altitude;
pub mod config;
pub mod kalman;

use ipc_types::payload::{DspTelemetry, HeroEstimate, HeroTelemetry};

/// Estimates something from the telemetry, sample by sample.
///
/// It is pure: the times in the samples are its only clock. It must give finite numbers for every sequence of samples.
/// An estimator of another crate runs with `Status::with_estimator` or `Shell::with_estimator`; inputs that are not in
/// the telemetry are fields of its own.
///
/// ```
/// use ipc_types::payload::{DspTelemetry, HeroEstimate, HeroTelemetry};
/// use status::estimator::{Estimator, INPUT_BAROMETER};
///
/// /// Takes the barometer as it is.
/// struct BarometerAlone;
///
/// impl Estimator for BarometerAlone {
///     fn update(&mut self, _raw: &DspTelemetry, hero: &HeroTelemetry) -> HeroEstimate {
///         HeroEstimate {
///             altitude_m: f64::from(hero.barometer_altitude_m),
///             altitude_variance_m2: 100.0,
///             inputs: INPUT_BAROMETER,
///             valid: 1,
///             ..HeroEstimate::default()
///         }
///     }
/// }
/// ```
pub trait Estimator {
    /// Takes the next sample and gives the estimate for its moment.
    ///
    /// `raw` holds plausible values only: a group with others is marked as not valid. `hero` is the same sample in SI
    /// units. A gap, another bridge and a reboot of the DSP show in the sample's own fields (`sequence`, `epoch_ns`,
    /// `dsp_boots`, `dsp_time_ms`, `received_ns`).
    fn update(&mut self, raw: &DspTelemetry, hero: &HeroTelemetry) -> HeroEstimate;

    /// All that it knows as bytes, for the journal; `None` if it has no way to say so. Recordings are then not
    /// replayed.
    fn save(&self) -> Option<Vec<u8>> {
        None
    }

    /// Knows from now on what another one of its kind gave as these bytes, bit for bit; false when they are none of its
    /// own.
    fn restore(&mut self, _bytes: &[u8]) -> bool {
        false
    }
}

/// Bit of `HeroEstimate::inputs`: the GPS altitude took part.
pub const INPUT_GPS: u32 = 1 << 0;
/// Bit of `HeroEstimate::inputs`: the barometer took part.
pub const INPUT_BAROMETER: u32 = 1 << 1;
/// Bit of `HeroEstimate::inputs`: the sonar took part.
pub const INPUT_SONAR: u32 = 1 << 2;
