//! The one seam between the DSP's telemetry and the robot's: SI units, radians, named axes
//! (`DSPHeroTelemetry2HeroTelemetry`).
//!
//! The source structs are taken apart without `..`, so that a new field does not compile until it is translated. A
//! group that is not valid stays zero: nothing is made up of numbers that were never measured. A position or a velocity
//! of a GPS without a fix is such a number.

use ipc_types::payload::{
    DspAcceleration, DspAngularRate, DspAttitude, DspGeographic, DspGpsVelocity, DspPanTilt,
    DspReferences, DspServoPulses, DspSupply, DspTelemetry, DspXy, HeroAcceleration,
    HeroAngularRate, HeroAttitude, HeroEstimate, HeroGeodetic, HeroLocal, HeroReferences,
    HeroServos, HeroSupply, HeroTelemetry, HeroVelocity,
};
use ipc_types::{MonotonicNs, TelemetryGroup as Group};

use crate::calibration::{Calibration, Potentiometer, Servo};

/// When the message left the DSP, and by how much earlier that may have been, s. Nobody knows it, and both are 0, if
/// that is after it was read, or if the uncertainty is not one.
fn sent((sent_ns, uncertainty_s): (u64, f64), received_ns: u64) -> (u64, f64) {
    let is_possible = sent_ns <= received_ns && (0.0..f64::INFINITY).contains(&uncertainty_s);
    match is_possible {
        true => (sent_ns, uncertainty_s),
        false => (0, 0.0),
    }
}

/// The robot's telemetry of `dsp`, to be published at `now`.
///
/// `sequence` and `epoch_ns` are left to the publisher, which counts its samples itself.
pub fn translate(dsp: &DspTelemetry, calibration: &Calibration, now: MonotonicNs) -> HeroTelemetry {
    let DspTelemetry {
        sequence: source_sequence,
        epoch_ns: source_epoch_ns,
        received_ns,
        sent_ns,
        sent_uncertainty_s,
        dsp_time_ms,
        valid_groups: _,
        flying,
        gps_quality,
        dsp_boots,
        dsp_errors,
        last_dsp_error_code,
        rotor_rpm,
        geographic,
        xy,
        gps_velocity,
        attitude,
        acceleration,
        angular_rate,
        pilot_pwm,
        actuation,
        sonar_adc,
        barometer_adc,
        supply,
        pan_tilt,
        references,
    } = *dsp;
    let (sent_ns, sent_uncertainty_s) = sent((sent_ns, sent_uncertainty_s), received_ns);
    let valid = Valid(dsp);
    let servos = |pulses| servos(pulses, &calibration.servo);
    let (pan_rad, tilt_rad) = valid.or_zero(Group::PanTilt, || camera(pan_tilt, calibration));
    HeroTelemetry {
        sequence: 0,
        epoch_ns: 0,
        source_sequence,
        source_epoch_ns,
        received_ns,
        sent_ns,
        sent_uncertainty_s,
        published_ns: now.0,
        dsp_time_s: valid.or_zero(Group::Time, || f64::from(dsp_time_ms) / 1000.0),
        valid_groups: u32::from(dsp.measured_groups()),
        flying: u32::from(flying),
        dsp_boots,
        dsp_errors,
        last_dsp_error_code,
        gps_quality: valid.or_zero(Group::GpsQuality, || u32::from(gps_quality)),
        geodetic: valid.or_zero(Group::Geographic, || geodetic(geographic)),
        local: valid.or_zero(Group::Xy, || local(xy)),
        velocity: valid.or_zero(Group::GpsVelocity, || velocity(gps_velocity)),
        attitude: valid.or_zero(Group::Attitude, || body_attitude(attitude)),
        acceleration: valid.or_zero(Group::Acceleration, || body_acceleration(acceleration)),
        angular_rate: valid.or_zero(Group::AngularRate, || body_angular_rate(angular_rate)),
        pilot: valid.or_zero(Group::PilotPwm, || servos(pilot_pwm)),
        actuation: valid.or_zero(Group::Actuation, || servos(actuation)),
        sonar_height_m: valid.or_zero(Group::Sonar, || {
            let sonar = &calibration.sonar;
            linear(sonar_adc, sonar.zero_adc, sonar.m_per_step) as f32
        }),
        barometer_altitude_m: valid.or_zero(Group::Barometer, || {
            let barometer = &calibration.barometer;
            linear(barometer_adc, barometer.zero_adc, barometer.m_per_step) as f32
        }),
        supply: valid.or_zero(Group::Supply, || supply_si(supply)),
        pan_rad,
        tilt_rad,
        rotor_radps: valid.or_zero(Group::RotorSpeed, || rotor_radps(rotor_rpm)),
        references: valid.or_zero(Group::References, || controller_references(references)),
        estimate: HeroEstimate::default(),
    }
}

/// A sample, of which only valid groups are translated.
struct Valid<'a>(&'a DspTelemetry);

impl Valid<'_> {
    /// What `translate` makes of the group when it is valid, else zero.
    fn or_zero<T: Default>(&self, group: Group, translate: impl FnOnce() -> T) -> T {
        if self.0.valid(group) {
            translate()
        } else {
            T::default()
        }
    }
}

fn geodetic(dsp: DspGeographic) -> HeroGeodetic {
    let DspGeographic {
        latitude_deg,
        longitude_deg,
        altitude_m,
    } = dsp;
    HeroGeodetic {
        latitude_rad: latitude_deg.to_radians(),
        longitude_rad: longitude_deg.to_radians(),
        altitude_m,
    }
}

fn local(dsp: DspXy) -> HeroLocal {
    let DspXy { x_m, y_m } = dsp;
    HeroLocal {
        east_m: x_m,
        north_m: y_m,
    }
}

fn velocity(dsp: DspGpsVelocity) -> HeroVelocity {
    let DspGpsVelocity {
        horizontal_speed_mps,
        vertical_speed_mps,
        heading_deg,
    } = dsp;
    let (sin, cos) = f64::from(heading_deg).to_radians().sin_cos();
    let speed_mps = f64::from(horizontal_speed_mps);
    HeroVelocity {
        north_mps: (speed_mps * cos) as f32,
        east_mps: (speed_mps * sin) as f32,
        up_mps: vertical_speed_mps,
        ground_speed_mps: horizontal_speed_mps,
        course_rad: angle_rad(heading_deg.into()),
    }
}

fn body_attitude(dsp: DspAttitude) -> HeroAttitude {
    let DspAttitude {
        pitch_deg,
        roll_deg,
        yaw_deg,
    } = dsp;
    HeroAttitude {
        roll_rad: angle_rad(roll_deg.into()),
        pitch_rad: angle_rad(pitch_deg.into()),
        yaw_rad: angle_rad(yaw_deg.into()),
    }
}

fn body_acceleration(dsp: DspAcceleration) -> HeroAcceleration {
    let DspAcceleration {
        x_mps2,
        y_mps2,
        z_mps2,
    } = dsp;
    HeroAcceleration {
        forward_mps2: x_mps2,
        right_mps2: y_mps2,
        down_mps2: z_mps2,
    }
}

fn body_angular_rate(dsp: DspAngularRate) -> HeroAngularRate {
    let DspAngularRate {
        x_radps,
        y_radps,
        z_radps,
    } = dsp;
    HeroAngularRate {
        forward_radps: x_radps,
        right_radps: y_radps,
        down_radps: z_radps,
    }
}

/// The travel of each channel: −1 … 1 between the ends. A pulse beyond them gives more: it is shown, not hidden.
fn servos(dsp: DspServoPulses, servo: &Servo) -> HeroServos {
    let DspServoPulses {
        collective_us,
        roll_us,
        pitch_us,
        tail_us,
        throttle_us,
    } = dsp;
    let travel = |pulse_us| linear(pulse_us, servo.centre_us, 1.0 / servo.half_travel_us) as f32;
    HeroServos {
        collective: travel(collective_us),
        roll: travel(roll_us),
        pitch: travel(pitch_us),
        tail: travel(tail_us),
        throttle: travel(throttle_us),
    }
}

fn supply_si(dsp: DspSupply) -> HeroSupply {
    let DspSupply {
        battery_mv,
        fuel_percent,
        auto_switch,
    } = dsp;
    HeroSupply {
        battery_v: (f64::from(battery_mv) / 1000.0) as f32,
        fuel_fraction: (f64::from(fuel_percent) / 100.0) as f32,
        auto_switch,
    }
}

/// Pan and tilt, rad.
fn camera(dsp: DspPanTilt, calibration: &Calibration) -> (f32, f32) {
    let DspPanTilt { pan_adc, tilt_adc } = dsp;
    (
        camera_rad(pan_adc, &calibration.pan),
        camera_rad(tilt_adc, &calibration.tilt),
    )
}

fn camera_rad(adc: u32, potentiometer: &Potentiometer) -> f32 {
    angle_rad(linear(
        adc,
        potentiometer.zero_adc,
        potentiometer.deg_per_step,
    ))
}

/// What a raw number stands for, by the straight line of its calibration.
fn linear(raw: u32, zero: f64, per_step: f64) -> f64 {
    (f64::from(raw) - zero) * per_step
}

/// The angle of `deg` degrees in radians, brought into −π … π. Angles within −180° … 180° keep their sign.
fn angle_rad(deg: f64) -> f32 {
    let wrapped = if deg.abs() <= 180.0 {
        deg
    } else {
        (deg + 180.0).rem_euclid(360.0) - 180.0
    };
    wrapped.to_radians() as f32
}

fn rotor_radps(rpm: u32) -> f32 {
    (f64::from(rpm) * std::f64::consts::TAU / 60.0) as f32
}

fn controller_references(dsp: DspReferences) -> HeroReferences {
    let DspReferences {
        x_speed_mps,
        y_speed_mps,
        altitude_m,
        pitch_deg,
        roll_deg,
        yaw_deg,
        reserved: _,
    } = dsp;
    HeroReferences {
        north_mps: y_speed_mps,
        east_mps: x_speed_mps,
        altitude_m,
        roll_rad: angle_rad(roll_deg.into()),
        pitch_rad: angle_rad(pitch_deg.into()),
        yaw_rad: angle_rad(yaw_deg.into()),
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, FRAC_PI_6, PI, TAU};
    use std::f64::consts;

    use super::*;
    use crate::test_samples::full_sample;

    fn hero(dsp: &DspTelemetry) -> HeroTelemetry {
        translate(dsp, &Calibration::default(), MonotonicNs(9))
    }

    /// Equal to the last digit but two of a single-precision number.
    fn near(actual: f32, expected: f32) {
        let tolerance = 4.0 * f32::EPSILON * expected.abs().max(1.0);
        assert!(
            (actual - expected).abs() <= tolerance,
            "{actual} is not {expected}"
        );
    }

    #[test]
    fn every_group_by_hand() {
        let hero = hero(&full_sample());
        assert_eq!(hero.dsp_time_s, 12.345);
        // 30° and −45°, to a hundredth of a micrometre on the ground.
        assert!((hero.geodetic.latitude_rad - consts::FRAC_PI_6).abs() < 1e-15);
        assert!((hero.geodetic.longitude_rad + consts::FRAC_PI_4).abs() < 1e-15);
        assert_eq!(hero.geodetic.altitude_m, 123.456);
        assert_eq!((hero.local.east_m, hero.local.north_m), (-3.5, 4.25));
        // 10 m/s on course 300°: north 10·cos 300° = 5, east 10·sin 300° = −8.660254; 300° is −60°.
        near(hero.velocity.north_mps, 5.0);
        near(hero.velocity.east_mps, -8.660_254);
        near(hero.velocity.course_rad, -PI / 3.0);
        assert_eq!(hero.velocity.ground_speed_mps, 10.0);
        assert_eq!(hero.velocity.up_mps, -1.5);
        assert_eq!(hero.gps_quality, 4);
        near(hero.attitude.pitch_rad, -FRAC_PI_6); // −30°
        near(hero.attitude.roll_rad, FRAC_PI_4); // 45°
        near(hero.attitude.yaw_rad, PI); // 180°
        let acceleration = hero.acceleration;
        assert_eq!(acceleration.forward_mps2, 0.5);
        assert_eq!(acceleration.right_mps2, -0.25);
        assert_eq!(acceleration.down_mps2, -9.75);
        let rate = hero.angular_rate;
        assert_eq!(
            (rate.forward_radps, rate.right_radps, rate.down_radps),
            (0.125, -0.5, 1.5)
        );
        near(hero.sonar_height_m, 3.0); // 1200 · 0.0025
        assert_eq!(hero.barometer_altitude_m, 125.0); // (1000 − 500) · 0.25
        near(hero.supply.battery_v, 11.1);
        near(hero.supply.fuel_fraction, 0.75);
        assert_eq!(hero.supply.auto_switch, 1);
        near(hero.pan_rad, FRAC_PI_4); // half of the way to the right
        near(hero.tilt_rad, -FRAC_PI_2); // all of the way down
        near(hero.rotor_radps, 25.0 * TAU); // 1500 rpm
        let references = hero.references;
        assert_eq!((references.east_mps, references.north_mps), (1.5, -2.5));
        assert_eq!(references.altitude_m, 50.25);
        near(references.pitch_rad, -PI / 36.0); // −5°
        near(references.roll_rad, PI / 18.0); // 10°
        near(references.yaw_rad, -FRAC_PI_2); // −90°
    }

    #[test]
    fn servo_pulses_become_travel_on_every_channel() {
        let hero = hero(&full_sample());
        let channels = |servos: HeroServos| {
            [
                servos.collective,
                servos.roll,
                servos.pitch,
                servos.tail,
                servos.throttle,
            ]
        };
        // Pilot: 1000, 1250, 1500, 1750, 2000 µs; actuation the other way round.
        assert_eq!(channels(hero.pilot), [-1.0, -0.5, 0.0, 0.5, 1.0]);
        assert_eq!(channels(hero.actuation), [1.0, 0.5, 0.0, -0.5, -1.0]);
    }

    #[test]
    fn origin_counters_and_times_go_along() {
        let dsp = full_sample();
        let hero = hero(&dsp);
        assert_eq!(hero.published_ns, 9);
        // The publisher's business.
        assert_eq!((hero.sequence, hero.epoch_ns), (0, 0));
        assert_eq!(
            (hero.source_sequence, hero.source_epoch_ns, hero.received_ns),
            (dsp.sequence, dsp.epoch_ns, dsp.received_ns)
        );
        assert_eq!(
            (hero.sent_ns, hero.sent_uncertainty_s),
            (dsp.sent_ns, dsp.sent_uncertainty_s)
        );
        let read = dsp.received_ns;
        for (sent_ns, uncertainty_s, expected) in [
            (read, 0.0, (read, 0.0)),
            (read + 1, 0.0, (0, 0.0)),
            (read, -0.1, (0, 0.0)),
            (read, f64::NAN, (0, 0.0)),
            (read, f64::INFINITY, (0, 0.0)),
        ] {
            assert_eq!(sent((sent_ns, uncertainty_s), read), expected);
        }
        assert_eq!(
            (hero.dsp_boots, hero.dsp_errors, hero.last_dsp_error_code),
            (dsp.dsp_boots, dsp.dsp_errors, dsp.last_dsp_error_code)
        );
        assert_eq!((hero.flying, hero.valid_groups), (1, 0xFFFF));
    }

    #[test]
    fn a_group_that_is_not_valid_is_zero_and_the_others_stay() {
        let all = hero(&full_sample());
        for group in Group::ALL {
            let mut dsp = full_sample();
            dsp.valid_groups = !group.bit();
            let without = hero(&dsp);
            dsp.valid_groups = group.bit();
            let only = hero(&dsp);
            assert_eq!(without.valid_groups, u32::from(!group.bit()));
            for (other, lens) in lenses() {
                let (given, empty) = if other == group {
                    (&only, &without)
                } else {
                    (&without, &only)
                };
                assert_eq!(lens(given), lens(&all), "{group:?}: {other:?}");
                assert!(lens(empty).iter().all(|&value| value == 0.0));
            }
        }
    }

    #[test]
    fn without_a_fix_there_is_no_position_and_no_velocity() {
        let mut dsp = full_sample();
        dsp.gps_quality = 0;
        let hero = hero(&dsp);
        for (group, lens) in lenses() {
            let is_of_a_fix = Group::OF_A_FIX & group.bit() != 0;
            assert_eq!(hero.valid(group), !is_of_a_fix, "{group:?}");
            if is_of_a_fix {
                assert!(lens(&hero).iter().all(|&value| value == 0.0), "{group:?}");
            }
        }
        assert_eq!(hero.valid_groups, u32::from(!Group::OF_A_FIX));
    }

    /// Gives the values of one group.
    type Lens = fn(&HeroTelemetry) -> Vec<f64>;

    fn lenses() -> Vec<(Group, Lens)> {
        fn wide(values: &[f32]) -> Vec<f64> {
            values.iter().map(|&value| value.into()).collect()
        }
        vec![
            (Group::Time, |h| vec![h.dsp_time_s]),
            (Group::Geographic, |h| {
                let g = h.geodetic;
                vec![g.latitude_rad, g.longitude_rad, g.altitude_m]
            }),
            (Group::Xy, |h| vec![h.local.east_m, h.local.north_m]),
            (Group::GpsVelocity, |h| {
                let v = h.velocity;
                let speeds = [v.north_mps, v.east_mps, v.up_mps, v.ground_speed_mps];
                [wide(&speeds), wide(&[v.course_rad])].concat()
            }),
            (Group::GpsQuality, |h| vec![h.gps_quality.into()]),
            (Group::Attitude, |h| {
                let a = h.attitude;
                wide(&[a.roll_rad, a.pitch_rad, a.yaw_rad])
            }),
            (Group::Acceleration, |h| {
                let a = h.acceleration;
                wide(&[a.forward_mps2, a.right_mps2, a.down_mps2])
            }),
            (Group::AngularRate, |h| {
                let r = h.angular_rate;
                wide(&[r.forward_radps, r.right_radps, r.down_radps])
            }),
            (Group::PilotPwm, |h| {
                let s = h.pilot;
                wide(&[s.collective, s.roll, s.pitch, s.tail, s.throttle])
            }),
            (Group::Sonar, |h| wide(&[h.sonar_height_m])),
            (Group::Supply, |h| {
                let s = h.supply;
                let switch = vec![s.auto_switch.into()];
                [wide(&[s.battery_v, s.fuel_fraction]), switch].concat()
            }),
            (Group::PanTilt, |h| wide(&[h.pan_rad, h.tilt_rad])),
            (Group::RotorSpeed, |h| wide(&[h.rotor_radps])),
            (Group::Barometer, |h| wide(&[h.barometer_altitude_m])),
            (Group::Actuation, |h| {
                let s = h.actuation;
                wide(&[s.collective, s.roll, s.pitch, s.tail, s.throttle])
            }),
            (Group::References, |h| {
                let r = h.references;
                let speeds = wide(&[r.north_mps, r.east_mps, r.altitude_m]);
                [speeds, wide(&[r.roll_rad, r.pitch_rad, r.yaw_rad])].concat()
            }),
        ]
    }

    #[test]
    fn the_default_calibrations_are_the_documented_lines() {
        let at = |raw| {
            let mut dsp = full_sample();
            (dsp.sonar_adc, dsp.barometer_adc, dsp.pilot_pwm.roll_us) = (raw, raw, raw);
            (dsp.pan_tilt.pan_adc, dsp.pan_tilt.tilt_adc) = (raw, raw);
            hero(&dsp)
        };
        for (adc, expected_m) in [(0, 0.0), (400, 1.0), (4095, 10.2375)] {
            assert_eq!(at(adc).sonar_height_m, expected_m);
        }
        for (adc, expected_m) in [(0, -125.0), (500, 0.0), (700, 50.0), (4095, 898.75)] {
            assert_eq!(at(adc).barometer_altitude_m, expected_m);
        }
        for (adc, expected_rad) in [(0, -FRAC_PI_2), (2048, 0.0), (3072, FRAC_PI_4)] {
            assert_eq!(
                (at(adc).pan_rad, at(adc).tilt_rad),
                (expected_rad, expected_rad)
            );
        }
        for (pulse_us, expected) in [(1000, -1.0), (1500, 0.0), (2000, 1.0), (2500, 2.0)] {
            assert_eq!(at(pulse_us).pilot.roll, expected);
        }
    }

    #[test]
    fn angles_come_into_one_turn() {
        for (deg, expected_rad) in [
            (0.0, 0.0),
            (90.0, FRAC_PI_2),
            (180.0, PI),
            (-180.0, -PI),
            (270.0, -FRAC_PI_2),
            (360.0, 0.0),
            (-270.0, FRAC_PI_2),
            (765.0, FRAC_PI_4),
        ] {
            assert_eq!(angle_rad(deg), expected_rad, "{deg}");
        }
        assert!(angle_rad(f64::NAN).is_nan());
        assert!(angle_rad(f64::INFINITY).is_nan());
    }
}
