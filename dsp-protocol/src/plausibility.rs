//! Which decoded values cannot be (`docs/protocol.md` section 9).
//!
//! The limits are those of the helicopter and its sensors, not of the wire. What is not finite is never plausible.

use crate::downlink::{
    Acceleration, AngularRate, Attitude, Geographic, GpsVelocity, PanTilt, References, ServoPulses,
    Status, Supply, Xy,
};
use crate::mask::{Group, StatusMask};

const MAX_LATITUDE_DEG: f64 = 90.0;
const MAX_LONGITUDE_DEG: f64 = 180.0;
const MIN_ALTITUDE_M: f64 = -1000.0;
const MAX_ALTITUDE_M: f64 = 20_000.0;
const MAX_XY_M: f64 = 100_000.0;
const MAX_HORIZONTAL_SPEED_MPS: f32 = 100.0;
const MAX_VERTICAL_SPEED_MPS: f32 = 50.0;
const MAX_HEADING_DEG: f32 = 360.0;
const MAX_GPS_QUALITY: u8 = 8;
const MAX_PITCH_DEG: f32 = 90.0;
const MAX_ROLL_YAW_DEG: f32 = 180.0;
const MAX_ACCELERATION_MPS2: f32 = 160.0;
const MAX_ANGULAR_RATE_RADPS: f32 = 20.0;
const MIN_PULSE_US: u16 = 500;
const MAX_PULSE_US: u16 = 2500;
const MAX_ADC: u16 = 4095;
const MAX_BATTERY_MV: u16 = 60_000;
const MAX_FUEL_PERCENT: u8 = 100;
const MAX_ROTOR_RPM: u16 = 4000;
const MAX_REFERENCE_SPEED_MPS: f32 = 100.0;

/// The groups of `status` that hold a value outside the limits of section 9. A group that is not carried is not in it.
pub fn implausible_groups(status: &Status) -> StatusMask {
    // No `..`: a new group does not compile until its limits are stated.
    let Status {
        flying: _,
        time_ms: _,
        geographic,
        xy,
        gps_velocity,
        gps_quality,
        attitude,
        acceleration,
        angular_rate,
        pilot_pwm,
        sonar_adc,
        supply,
        pan_tilt,
        rotor_rpm,
        barometer_adc,
        actuation,
        references,
    } = status;
    [
        (Group::Geographic, geographic.is_none_or(geographic_can_be)),
        (Group::Xy, xy.is_none_or(xy_can_be)),
        (
            Group::GpsVelocity,
            gps_velocity.is_none_or(gps_velocity_can_be),
        ),
        (
            Group::GpsQuality,
            gps_quality.is_none_or(|quality| quality <= MAX_GPS_QUALITY),
        ),
        (Group::Attitude, attitude.is_none_or(attitude_can_be)),
        (
            Group::Acceleration,
            acceleration.is_none_or(acceleration_can_be),
        ),
        (
            Group::AngularRate,
            angular_rate.is_none_or(angular_rate_can_be),
        ),
        (Group::PilotPwm, pilot_pwm.is_none_or(pulses_can_be)),
        (Group::Sonar, sonar_adc.is_none_or(adc_can_be)),
        (Group::Supply, supply.is_none_or(supply_can_be)),
        (Group::PanTilt, pan_tilt.is_none_or(pan_tilt_can_be)),
        (
            Group::RotorSpeed,
            rotor_rpm.is_none_or(|speed| speed <= MAX_ROTOR_RPM),
        ),
        (Group::Barometer, barometer_adc.is_none_or(adc_can_be)),
        (Group::Actuation, actuation.is_none_or(pulses_can_be)),
        (Group::References, references.is_none_or(references_can_be)),
    ]
    .into_iter()
    .filter_map(|(group, plausible)| (!plausible).then_some(group))
    .collect()
}

/// Whether |value| is at most `limit`; NaN is not, since it compares false.
fn within_f32(value: f32, limit: f32) -> bool {
    value.abs() <= limit
}

/// Whether |value| is at most `limit`; NaN is not, since it compares false.
fn within_f64(value: f64, limit: f64) -> bool {
    value.abs() <= limit
}

fn altitude_can_be(altitude_m: f64) -> bool {
    (MIN_ALTITUDE_M..=MAX_ALTITUDE_M).contains(&altitude_m)
}

fn geographic_can_be(position: Geographic) -> bool {
    within_f64(position.latitude_deg, MAX_LATITUDE_DEG)
        && within_f64(position.longitude_deg, MAX_LONGITUDE_DEG)
        && altitude_can_be(position.altitude_m)
}

fn xy_can_be(position: Xy) -> bool {
    within_f64(position.x_m, MAX_XY_M) && within_f64(position.y_m, MAX_XY_M)
}

fn gps_velocity_can_be(velocity: GpsVelocity) -> bool {
    (0.0..=MAX_HORIZONTAL_SPEED_MPS).contains(&velocity.horizontal_speed_mps)
        && within_f32(velocity.vertical_speed_mps, MAX_VERTICAL_SPEED_MPS)
        && (0.0..=MAX_HEADING_DEG).contains(&velocity.heading_deg)
}

fn attitude_can_be(attitude: Attitude) -> bool {
    angles_can_be(attitude.pitch_deg, attitude.roll_deg, attitude.yaw_deg)
}

fn angles_can_be(pitch_deg: f32, roll_deg: f32, yaw_deg: f32) -> bool {
    within_f32(pitch_deg, MAX_PITCH_DEG)
        && within_f32(roll_deg, MAX_ROLL_YAW_DEG)
        && within_f32(yaw_deg, MAX_ROLL_YAW_DEG)
}

fn acceleration_can_be(acceleration: Acceleration) -> bool {
    [
        acceleration.x_mps2,
        acceleration.y_mps2,
        acceleration.z_mps2,
    ]
    .into_iter()
    .all(|axis| within_f32(axis, MAX_ACCELERATION_MPS2))
}

fn angular_rate_can_be(rate: AngularRate) -> bool {
    [rate.x_radps, rate.y_radps, rate.z_radps]
        .into_iter()
        .all(|axis| within_f32(axis, MAX_ANGULAR_RATE_RADPS))
}

fn pulses_can_be(pulses: ServoPulses) -> bool {
    [
        pulses.collective_us,
        pulses.roll_us,
        pulses.pitch_us,
        pulses.tail_us,
        pulses.throttle_us,
    ]
    .into_iter()
    .all(|pulse| (MIN_PULSE_US..=MAX_PULSE_US).contains(&pulse))
}

fn adc_can_be(adc: u16) -> bool {
    adc <= MAX_ADC
}

fn supply_can_be(supply: Supply) -> bool {
    supply.battery_mv <= MAX_BATTERY_MV
        && supply.fuel_percent <= MAX_FUEL_PERCENT
        && supply.auto_switch <= 1
}

fn pan_tilt_can_be(pan_tilt: PanTilt) -> bool {
    adc_can_be(pan_tilt.pan_adc) && adc_can_be(pan_tilt.tilt_adc)
}

fn references_can_be(references: References) -> bool {
    within_f32(references.x_speed_mps, MAX_REFERENCE_SPEED_MPS)
        && within_f32(references.y_speed_mps, MAX_REFERENCE_SPEED_MPS)
        && altitude_can_be(references.altitude_m)
        && angles_can_be(
            references.pitch_deg,
            references.roll_deg,
            references.yaw_deg,
        )
}

#[cfg(test)]
mod tests {
    use super::*;

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
