//! [`Script`]: a flight written down in a few words, as telemetry that belongs together.
//!
//! It is no simulation: the helicopter moves along straight lines at constant speeds and stops at once. Who needs
//! physics uses the simulator. Who needs something odd edits the samples, which are plain values.

use ipc_types::payload::{
    DspAcceleration, DspGeographic, DspGpsVelocity, DspServoPulses, DspSupply, DspTelemetry, DspXy,
    HeroTelemetry,
};
use ipc_types::{MonotonicNs, TelemetryGroup};
use status::calibration::Calibration;
use status::translate::translate;

/// Metres of a degree of latitude on a sphere with the Earth's mean radius.
const DEGREE_M: f64 = 111_195.08;
/// Speed along the ground, m/s.
const CRUISE_MPS: f64 = 5.0;
/// Speed up and down, m/s.
const CLIMB_MPS: f64 = 2.0;
/// Rotor speed in flight, rpm.
const ROTOR_RPM: u32 = 1500;

/// A flight that is being written down; each step adds samples, one for each period.
///
/// ```
/// use ril_tests::Script;
///
/// let flight = Script::at(37.4, -5.9, 10.0).stand(1.0).take_off(20.0).fly(30.0, 40.0).land();
/// let highest_m = flight.dsp().iter().map(|sample| sample.geographic.altitude_m).fold(0.0, f64::max);
/// assert_eq!(highest_m, 30.0);
/// ```
#[derive(Clone, Debug)]
pub struct Script {
    home: DspGeographic,
    period_ms: u32,
    groups: u16,
    /// The state as of the last sample.
    now: DspTelemetry,
    height_m: f64,
    samples: Vec<DspTelemetry>,
}

impl Script {
    /// On the ground at this place, with all groups and ten samples a second.
    pub fn at(latitude_deg: f64, longitude_deg: f64, altitude_m: f64) -> Script {
        let home = DspGeographic {
            latitude_deg,
            longitude_deg,
            altitude_m,
        };
        let idle = DspServoPulses {
            collective_us: 1500,
            roll_us: 1500,
            pitch_us: 1500,
            tail_us: 1500,
            throttle_us: 1500,
        };
        Script {
            home,
            period_ms: 100,
            groups: u16::MAX,
            now: DspTelemetry {
                valid_groups: u16::MAX,
                gps_quality: 1,
                dsp_boots: 0,
                geographic: home,
                acceleration: DspAcceleration {
                    z_mps2: -9.81,
                    ..DspAcceleration::default()
                },
                pilot_pwm: idle,
                actuation: idle,
                supply: DspSupply {
                    battery_mv: 12_000,
                    fuel_percent: 100,
                    auto_switch: 1,
                },
                ..DspTelemetry::default()
            },
            height_m: 0.0,
            samples: Vec::new(),
        }
    }

    /// From here on one sample in so many ms.
    ///
    /// # Panics
    ///
    /// When that is 0.
    pub fn every_ms(mut self, period_ms: u32) -> Script {
        assert!(period_ms > 0, "samples need a period");
        self.period_ms = period_ms;
        self
    }

    /// From here on only these groups are valid; the others are zero.
    pub fn groups(mut self, groups: &[TelemetryGroup]) -> Script {
        self.groups = groups.iter().fold(0, |mask, group| mask | group.bit());
        self
    }

    /// Nothing moves for so many seconds, on the ground or in the air.
    pub fn stand(mut self, seconds: f64) -> Script {
        self.leg(0.0, 0.0, 0.0, seconds);
        self
    }

    /// Starts the rotor and climbs `height_m` at 2 m/s.
    pub fn take_off(mut self, height_m: f64) -> Script {
        self.now.flying = 1;
        self.now.rotor_rpm = ROTOR_RPM;
        self.climb(height_m);
        self
    }

    /// Flies so far to the east and to the north, on a straight line at 5 m/s.
    pub fn fly(mut self, east_m: f64, north_m: f64) -> Script {
        let course_deg = east_m.atan2(north_m).to_degrees();
        self.now.attitude.yaw_deg = course_deg as f32;
        self.now.gps_velocity.heading_deg = course_deg.rem_euclid(360.0) as f32;
        self.leg(east_m, north_m, 0.0, east_m.hypot(north_m) / CRUISE_MPS);
        self
    }

    /// Sinks to the ground at 2 m/s and stops the rotor.
    pub fn land(mut self) -> Script {
        self.climb(-self.height_m);
        self.now.flying = 0;
        self.now.rotor_rpm = 0;
        self.add();
        self
    }

    /// The DSP restarts: its clock stands at zero again.
    pub fn reboot(mut self) -> Script {
        self.now.dsp_time_ms = 0;
        self.now.dsp_boots += 1;
        self
    }

    /// The flight as the bridge publishes it. `received_ns` is 0: a stand-in fills in the moment of publishing.
    pub fn dsp(&self) -> &[DspTelemetry] {
        &self.samples
    }

    /// The flight as status publishes it, with the default calibration.
    pub fn hero(&self) -> Vec<HeroTelemetry> {
        let calibration = Calibration::default();
        self.samples
            .iter()
            .map(|sample| translate(sample, &calibration, MonotonicNs(0)))
            .collect()
    }

    fn climb(&mut self, height_m: f64) {
        self.leg(0.0, 0.0, height_m, height_m.abs() / CLIMB_MPS);
    }

    /// A straight line in `seconds`, of which the last sample lies at its end and stands still.
    fn leg(&mut self, east_m: f64, north_m: f64, up_m: f64, seconds: f64) {
        let steps = (seconds * 1000.0 / f64::from(self.period_ms)).ceil() as u32;
        let (start, start_height_m) = (self.now.xy, self.height_m);
        for step in 1..=steps {
            let part = f64::from(step) / f64::from(steps);
            let is_end = step == steps;
            self.now.xy = DspXy {
                x_m: start.x_m + part * east_m,
                y_m: start.y_m + part * north_m,
            };
            self.height_m = start_height_m + part * up_m;
            self.now.gps_velocity = DspGpsVelocity {
                horizontal_speed_mps: if is_end {
                    0.0
                } else {
                    (east_m.hypot(north_m) / seconds) as f32
                },
                vertical_speed_mps: if is_end { 0.0 } else { (up_m / seconds) as f32 },
                ..self.now.gps_velocity
            };
            self.add();
        }
    }

    /// One sample of the present state, one period after the last.
    fn add(&mut self) {
        let now = &mut self.now;
        now.dsp_time_ms += self.period_ms;
        let east_deg = now.xy.x_m / (DEGREE_M * self.home.latitude_deg.to_radians().cos());
        now.geographic = DspGeographic {
            latitude_deg: self.home.latitude_deg + now.xy.y_m / DEGREE_M,
            longitude_deg: (self.home.longitude_deg + east_deg + 180.0).rem_euclid(360.0) - 180.0,
            altitude_m: self.home.altitude_m + self.height_m,
        };
        now.sonar_adc = step_of(self.height_m, 0.0, 0.0025);
        now.barometer_adc = step_of(now.geographic.altitude_m, 500.0, 0.25);
        now.pan_tilt.pan_adc = 2048;
        now.pan_tilt.tilt_adc = 2048;
        now.references.altitude_m = now.geographic.altitude_m as f32;
        now.references.yaw_deg = now.attitude.yaw_deg;
        self.samples.push(only_groups(&self.now, self.groups));
    }
}

/// Value of a 12-bit converter for `metres`, with the default calibration of status.
fn step_of(metres: f64, zero: f64, m_per_step: f64) -> u32 {
    (zero + metres / m_per_step).round().clamp(0.0, 4095.0) as u32
}

/// `sample` with only these groups of the status mask; the values of the others are zero, as the contract has them.
pub fn only_groups(sample: &DspTelemetry, groups: u16) -> DspTelemetry {
    let mut only = DspTelemetry {
        sequence: sample.sequence,
        epoch_ns: sample.epoch_ns,
        received_ns: sample.received_ns,
        sent_ns: sample.sent_ns,
        sent_uncertainty_s: sample.sent_uncertainty_s,
        valid_groups: groups,
        flying: sample.flying,
        dsp_boots: sample.dsp_boots,
        dsp_errors: sample.dsp_errors,
        last_dsp_error_code: sample.last_dsp_error_code,
        ..DspTelemetry::default()
    };
    for group in TelemetryGroup::ALL {
        if groups & group.bit() == 0 {
            continue;
        }
        match group {
            TelemetryGroup::Time => only.dsp_time_ms = sample.dsp_time_ms,
            TelemetryGroup::Geographic => only.geographic = sample.geographic,
            TelemetryGroup::Xy => only.xy = sample.xy,
            TelemetryGroup::GpsVelocity => only.gps_velocity = sample.gps_velocity,
            TelemetryGroup::GpsQuality => only.gps_quality = sample.gps_quality,
            TelemetryGroup::Attitude => only.attitude = sample.attitude,
            TelemetryGroup::Acceleration => only.acceleration = sample.acceleration,
            TelemetryGroup::AngularRate => only.angular_rate = sample.angular_rate,
            TelemetryGroup::PilotPwm => only.pilot_pwm = sample.pilot_pwm,
            TelemetryGroup::Sonar => only.sonar_adc = sample.sonar_adc,
            TelemetryGroup::Supply => only.supply = sample.supply,
            TelemetryGroup::PanTilt => only.pan_tilt = sample.pan_tilt,
            TelemetryGroup::RotorSpeed => only.rotor_rpm = sample.rotor_rpm,
            TelemetryGroup::Barometer => only.barometer_adc = sample.barometer_adc,
            TelemetryGroup::Actuation => only.actuation = sample.actuation,
            TelemetryGroup::References => only.references = sample.references,
        }
    }
    only
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flight() -> Script {
        Script::at(37.0, -6.0, 10.0)
            .stand(0.5)
            .take_off(20.0)
            .fly(30.0, 40.0)
            .land()
    }

    #[test]
    fn a_flight_goes_where_it_is_told_in_the_time_that_it_takes() {
        let script = flight();
        // Half a second, 10 s up, 10 s along, 10 s down, and one sample on the ground.
        assert_eq!(script.dsp().len(), 5 + 100 + 100 + 100 + 1);
        let last = script.dsp()[305];
        assert_eq!((last.dsp_time_ms, last.flying), (30_600, 0));
        assert!((last.xy.x_m - 30.0).abs() < 1e-9 && (last.xy.y_m - 40.0).abs() < 1e-9);
        assert!((last.geographic.altitude_m - 10.0).abs() < 1e-9);
        assert!((last.geographic.latitude_deg - 37.0 - 40.0 / DEGREE_M).abs() < 1e-12);
        let flown = script.dsp()[150];
        assert_eq!(flown.gps_velocity.horizontal_speed_mps, 5.0);
        assert!((flown.attitude.yaw_deg - 36.87).abs() < 0.01);
    }

    #[test]
    fn the_dsp_s_clock_runs_evenly_until_it_reboots() {
        let script = flight().every_ms(20).reboot().stand(0.1);
        let times: Vec<_> = script
            .dsp()
            .iter()
            .map(|sample| sample.dsp_time_ms)
            .collect();
        assert!(times[..306].windows(2).all(|pair| pair[1] - pair[0] == 100));
        assert_eq!(times[306..], [20, 40, 60, 80, 100]);
        assert_eq!(script.dsp()[306].dsp_boots, 1);
    }

    #[test]
    fn groups_that_are_left_out_are_zero() {
        let groups = [TelemetryGroup::Time, TelemetryGroup::Supply];
        let script = Script::at(37.0, -6.0, 10.0).groups(&groups).stand(0.1);
        let expected = DspTelemetry {
            valid_groups: 1 | 1 << 10,
            dsp_time_ms: 100,
            supply: DspSupply {
                battery_mv: 12_000,
                fuel_percent: 100,
                auto_switch: 1,
            },
            ..DspTelemetry::default()
        };
        assert_eq!(script.dsp(), [expected]);
    }

    #[test]
    fn raw_values_and_si_values_say_the_same() {
        let script = Script::at(37.0, 179.9999, 10.0)
            .take_off(5.0)
            .fly(40.0, 0.0);
        let hero = *script.hero().last().expect("samples");
        assert_eq!(hero.sonar_height_m, 5.0);
        assert_eq!(hero.barometer_altitude_m, 15.0);
        assert!((hero.geodetic.altitude_m - 15.0).abs() < 1e-9);
        assert!(
            hero.geodetic.longitude_rad < -3.0,
            "across the antimeridian"
        );
        assert_eq!(hero.dsp_time_s, 10.5);
    }
}
