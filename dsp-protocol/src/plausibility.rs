//! Which decoded values are implausible (`docs/protocol.md` section 9). The limits stand in the tables of [`crate::group`].

use crate::group::Status;
use crate::mask::StatusMask;

/// The groups of `status` that hold a value outside the limits of section 9. A group that is not carried is not in it.
pub fn implausible_groups(status: &Status) -> StatusMask {
    status.implausible_groups()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::group::{
        Acceleration, AngularRate, Attitude, Geographic, GpsVelocity, Group, PanTilt, References,
        ServoPulses, Supply, Xy,
    };

    /// Whether exactly `groups` are implausible in `status`.
    fn check(status: Status, groups: &[Group]) {
        let expected: StatusMask = groups.iter().copied().collect();
        assert_eq!(implausible_groups(&status), expected, "{status:?}");
    }

    /// A group with one of its fields at each of `good` values, then at each of `bad` values.
    fn check_field<T: Copy>(group: Group, good: &[T], bad: &[T], with: impl Fn(T) -> Status) {
        for value in good {
            check(with(*value), &[]);
        }
        for value in bad {
            check(with(*value), &[group]);
        }
    }

    /// A field whose absolute value is limited, in `f64`.
    fn check_limit_f64(group: Group, limit: f64, with: impl Fn(f64) -> Status) {
        let above = limit.next_up();
        let bad = [above, -above, f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
        check_field(group, &[0.0, limit, -limit], &bad, with);
    }

    /// A field whose absolute value is limited, in `f32`.
    fn check_limit_f32(group: Group, limit: f32, with: impl Fn(f32) -> Status) {
        let above = limit.next_up();
        let bad = [above, -above, f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
        check_field(group, &[0.0, limit, -limit], &bad, with);
    }

    /// One value of a group of `Copy` structs, set by field.
    macro_rules! field {
        ($group:ident: $kind:ident . $field:ident) => {
            |value| Status {
                $group: Some($kind {
                    $field: value,
                    ..$kind::default()
                }),
                ..Status::default()
            }
        };
    }

    #[test]
    fn positions_have_the_limits_of_section_9() {
        check_limit_f64(
            Group::Geographic,
            90.0,
            field!(geographic: Geographic.latitude_deg),
        );
        check_limit_f64(
            Group::Geographic,
            180.0,
            field!(geographic: Geographic.longitude_deg),
        );
        check_field(
            Group::Geographic,
            &[-1000.0, 0.0, 20_000.0],
            &[-1000.001, 20_000.001, f64::NAN, f64::INFINITY],
            field!(geographic: Geographic.altitude_m),
        );
        check_limit_f64(Group::Xy, 100_000.0, field!(xy: Xy.x_m));
        check_limit_f64(Group::Xy, 100_000.0, field!(xy: Xy.y_m));
    }

    #[test]
    fn gps_has_the_limits_of_section_9() {
        check_field(
            Group::GpsVelocity,
            &[0.0, 100.0],
            &[-0.01, 100.01, f32::NAN, f32::INFINITY],
            field!(gps_velocity: GpsVelocity.horizontal_speed_mps),
        );
        check_limit_f32(
            Group::GpsVelocity,
            50.0,
            field!(gps_velocity: GpsVelocity.vertical_speed_mps),
        );
        check_field(
            Group::GpsVelocity,
            &[0.0, 360.0],
            &[-0.01, 360.01, f32::NAN],
            field!(gps_velocity: GpsVelocity.heading_deg),
        );
        check_field(Group::GpsQuality, &[0, 8], &[9, 127], |quality| Status {
            gps_quality: Some(quality),
            ..Status::default()
        });
    }

    #[test]
    fn the_imu_has_the_limits_of_section_9() {
        check_limit_f32(Group::Attitude, 90.0, field!(attitude: Attitude.pitch_deg));
        check_limit_f32(Group::Attitude, 180.0, field!(attitude: Attitude.roll_deg));
        check_limit_f32(Group::Attitude, 180.0, field!(attitude: Attitude.yaw_deg));
        check_limit_f32(
            Group::Acceleration,
            160.0,
            field!(acceleration: Acceleration.x_mps2),
        );
        check_limit_f32(
            Group::Acceleration,
            160.0,
            field!(acceleration: Acceleration.y_mps2),
        );
        check_limit_f32(
            Group::Acceleration,
            160.0,
            field!(acceleration: Acceleration.z_mps2),
        );
        check_limit_f32(
            Group::AngularRate,
            20.0,
            field!(angular_rate: AngularRate.x_radps),
        );
        check_limit_f32(
            Group::AngularRate,
            20.0,
            field!(angular_rate: AngularRate.y_radps),
        );
        check_limit_f32(
            Group::AngularRate,
            20.0,
            field!(angular_rate: AngularRate.z_radps),
        );
    }

    #[test]
    fn every_servo_pulse_has_the_limits_of_section_9() {
        for channel in 0..5 {
            let pulses = |pulse| {
                let mut channels = [1500; 5];
                channels[channel] = pulse;
                let [collective_us, roll_us, pitch_us, tail_us, throttle_us] = channels;
                Some(ServoPulses {
                    collective_us,
                    roll_us,
                    pitch_us,
                    tail_us,
                    throttle_us,
                })
            };
            let (good, bad) = ([500, 2500], [0, 499, 2501, 16_383]);
            check_field(Group::PilotPwm, &good, &bad, |pulse| Status {
                pilot_pwm: pulses(pulse),
                ..Status::default()
            });
            check_field(Group::Actuation, &good, &bad, |pulse| Status {
                actuation: pulses(pulse),
                ..Status::default()
            });
        }
    }

    #[test]
    fn raw_values_and_supply_have_the_limits_of_section_9() {
        let (good, bad) = ([0, 4095], [4096, 16_383]);
        check_field(Group::Sonar, &good, &bad, |adc| Status {
            sonar_adc: Some(adc),
            ..Status::default()
        });
        check_field(Group::Barometer, &good, &bad, |adc| Status {
            barometer_adc: Some(adc),
            ..Status::default()
        });
        check_field(
            Group::PanTilt,
            &good,
            &bad,
            field!(pan_tilt: PanTilt.pan_adc),
        );
        check_field(
            Group::PanTilt,
            &good,
            &bad,
            field!(pan_tilt: PanTilt.tilt_adc),
        );
        check_field(Group::RotorSpeed, &[0, 4000], &[4001, 16_383], |rpm| {
            Status {
                rotor_rpm: Some(rpm),
                ..Status::default()
            }
        });
        check_field(
            Group::Supply,
            &[0, 60_000],
            &[60_001],
            field!(supply: Supply.battery_mv),
        );
        check_field(
            Group::Supply,
            &[0, 100],
            &[101, 127],
            field!(supply: Supply.fuel_percent),
        );
        check_field(
            Group::Supply,
            &[0, 1],
            &[2, 127],
            field!(supply: Supply.auto_switch),
        );
    }

    #[test]
    fn references_have_the_limits_of_section_9() {
        check_limit_f32(
            Group::References,
            100.0,
            field!(references: References.x_speed_mps),
        );
        check_limit_f32(
            Group::References,
            100.0,
            field!(references: References.y_speed_mps),
        );
        check_field(
            Group::References,
            &[-1000.0, 20_000.0],
            &[-1000.001, 20_000.001, f64::NAN],
            field!(references: References.altitude_m),
        );
        check_limit_f32(
            Group::References,
            90.0,
            field!(references: References.pitch_deg),
        );
        check_limit_f32(
            Group::References,
            180.0,
            field!(references: References.roll_deg),
        );
        check_limit_f32(
            Group::References,
            180.0,
            field!(references: References.yaw_deg),
        );
    }

    #[test]
    fn only_the_groups_that_are_wrong_are_named_and_the_time_never_is() {
        check(Status::default(), &[]);
        check(
            Status {
                time_ms: Some(u32::MAX),
                gps_quality: Some(9),
                rotor_rpm: Some(1500),
                sonar_adc: Some(5000),
                ..Status::default()
            },
            &[Group::GpsQuality, Group::Sonar],
        );
    }
}
