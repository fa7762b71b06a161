//! The status process of the HERO's Robot Implementation Layer (`STATUSMOD`): raw telemetry of the DSP in, the robot's
//! telemetry in SI units out, and logs of chosen groups.
//!
//! ```text
//! DspTelemetry ═▶ shell ─▶ core::Status ─┬▶ translate, estimator ─▶ shell ═▶ HeroTelemetry
//!                                        └▶ log::Logs ─▶ queue ─▶ log::writer ─▶ files
//!                                                 (one of each for each log, in a thread of its own)
//! ```
//!
//! * [`translate`](mod@translate) is the one seam between the DSP's units and the robot's, with [`calibration`] for raw
//!   numbers;
//! * [`fields`] names all values, and finds implausible ones, which a faulty neighbour may have published;
//! * [`estimator`] estimates what no single sensor measures well, if one is chosen;
//! * [`log`] writes tab-separated values, several logs at once, none of which can delay the telemetry: neither on a
//!   full disk nor on one that hangs. Each sample is a row in a file, or counted as lost;
//! * [`journal`]: a wrapper around the core that records its inputs, from which a replay makes what was published;
//! * [`core`] decides, given samples and the time: what happened, and when to wake up next;
//! * [`shell`] owns ports, clock, threads and the one wait; [`cli`] is the command line, [`config`] the file.
//!
//! Everything but [`shell`], [`cli`] and [`log::store`] is pure: values that a test builds with no thread, file or
//! clock.
//!
//! # Example
//!
//! ```
//! use ipc_types::payload::DspTelemetry;
//! use ipc_types::{MonotonicNs, TelemetryGroup};
//! use status::calibration::Calibration;
//! use status::core::{Input, Output, Status};
//! use status::log::Logs;
//!
//! let mut status = Status::new(Calibration::default(), Logs::default(), MonotonicNs(1));
//! let mut dsp = DspTelemetry {
//!     valid_groups: TelemetryGroup::Sonar.bit() | TelemetryGroup::Attitude.bit(),
//!     sonar_adc: 400,
//!     ..DspTelemetry::default()
//! };
//! dsp.attitude.yaw_deg = 90.0;
//!
//! let now = MonotonicNs(1_000);
//! let Some(Output::Telemetry(hero)) = status.apply(now, Input::Sample(dsp)) else {
//!     panic!("each sample is translated");
//! };
//! assert_eq!(hero.sonar_height_m, 1.0);
//! assert_eq!(hero.attitude.yaw_rad, std::f32::consts::FRAC_PI_2);
//! // A group that is not valid is zero, whatever its calibration makes of zero.
//! assert_eq!(hero.barometer_altitude_m, 0.0);
//!
//! status.apply(now, Input::Published(Ok(())));
//! assert_eq!(status.finish().published, 1);
//! ```

pub mod calibration;
pub mod cli;
pub mod config;
pub mod core;
pub mod estimator;
pub mod fields;
pub mod group;
pub mod journal;
pub mod log;
pub mod rate_limited;
pub mod shell;
#[cfg(test)]
mod test_samples;
#[cfg(test)]
mod test_store;
pub mod translate;

pub use core::{Input, Output};
