//! Which groups of a sample hold values that can be (`docs/protocol.md` section 9).
//!
//! The bridge publishes no others. But any bit pattern may lie in shared memory when a neighbour is faulty, and status is
//! the last who looks before upper layers fly by it. A group with a value that cannot be is treated as one that was not
//! transmitted: not valid, zero, and told to the operator once.

use ipc_types::TelemetryGroup as Group;
use ipc_types::payload::{
    DspAcceleration, DspAngularRate, DspAttitude, DspGeographic, DspGpsVelocity, DspPanTilt,
    DspReferences, DspServoPulses, DspSupply, DspTelemetry, DspXy,
};

use crate::group::GroupSet;

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
const MIN_PULSE_US: u32 = 500;
const MAX_PULSE_US: u32 = 2500;
const MAX_ADC: u32 = 4095;
const MAX_BATTERY_MV: u32 = 60_000;
const MAX_FUEL_PERCENT: u32 = 100;
const MAX_ROTOR_RPM: u32 = 4000;
const MAX_REFERENCE_SPEED_MPS: f32 = 100.0;

/// The sample as it may be believed, and the groups that were taken from it: those that are said to be valid and hold a
/// value outside the limits.
pub fn believable(dsp: &DspTelemetry) -> (DspTelemetry, GroupSet) {
    let impossible = impossible_groups(dsp);
    let believable = DspTelemetry {
        valid_groups: GroupSet(dsp.valid_groups).without(impossible).0,
        flying: u8::from(dsp.is_flying()),
        ..*dsp
    };
    (believable, impossible)
}

fn impossible_groups(dsp: &DspTelemetry) -> GroupSet {
    let valid = GroupSet(dsp.valid_groups);
    valid
        .groups()
        .filter(|group| !can_be(dsp, *group))
        .collect()
}

/// Whether the values of `group` can be.
fn can_be(dsp: &DspTelemetry, group: Group) -> bool {
    match group {
        // Any number of milliseconds can have passed.
        Group::Time => true,
        Group::Geographic => geographic(dsp.geographic),
        Group::Xy => xy(dsp.xy),
        Group::GpsVelocity => gps_velocity(dsp.gps_velocity),
        Group::GpsQuality => dsp.gps_quality <= MAX_GPS_QUALITY,
        Group::Attitude => attitude(dsp.attitude),
        Group::Acceleration => acceleration(dsp.acceleration),
        Group::AngularRate => angular_rate(dsp.angular_rate),
        Group::PilotPwm => pulses(dsp.pilot_pwm),
        Group::Sonar => dsp.sonar_adc <= MAX_ADC,
        Group::Supply => supply(dsp.supply),
        Group::PanTilt => pan_tilt(dsp.pan_tilt),
        Group::RotorSpeed => dsp.rotor_rpm <= MAX_ROTOR_RPM,
        Group::Barometer => dsp.barometer_adc <= MAX_ADC,
        Group::Actuation => pulses(dsp.actuation),
        Group::References => references(dsp.references),
    }
}

/// Whether all of `values` lie within ±`limit`; what is no number does not.
fn within<const N: usize>(values: [f32; N], limit: f32) -> bool {
    values.iter().all(|value| value.abs() <= limit)
}

fn is_altitude(altitude_m: f64) -> bool {
    (MIN_ALTITUDE_M..=MAX_ALTITUDE_M).contains(&altitude_m)
}

fn geographic(position: DspGeographic) -> bool {
    let DspGeographic {
        latitude_deg,
        longitude_deg,
        altitude_m,
    } = position;
    latitude_deg.abs() <= MAX_LATITUDE_DEG
        && longitude_deg.abs() <= MAX_LONGITUDE_DEG
        && is_altitude(altitude_m)
}

fn xy(position: DspXy) -> bool {
    let DspXy { x_m, y_m } = position;
    x_m.abs() <= MAX_XY_M && y_m.abs() <= MAX_XY_M
}

fn gps_velocity(velocity: DspGpsVelocity) -> bool {
    let DspGpsVelocity {
        horizontal_speed_mps,
        vertical_speed_mps,
        heading_deg,
    } = velocity;
    (0.0..=MAX_HORIZONTAL_SPEED_MPS).contains(&horizontal_speed_mps)
        && within([vertical_speed_mps], MAX_VERTICAL_SPEED_MPS)
        && (0.0..=MAX_HEADING_DEG).contains(&heading_deg)
}

fn attitude(attitude: DspAttitude) -> bool {
    let DspAttitude {
        pitch_deg,
        roll_deg,
        yaw_deg,
    } = attitude;
    angles(pitch_deg, roll_deg, yaw_deg)
}

fn angles(pitch_deg: f32, roll_deg: f32, yaw_deg: f32) -> bool {
    within([pitch_deg], MAX_PITCH_DEG) && within([roll_deg, yaw_deg], MAX_ROLL_YAW_DEG)
}

fn acceleration(acceleration: DspAcceleration) -> bool {
    let DspAcceleration {
        x_mps2,
        y_mps2,
        z_mps2,
    } = acceleration;
    within([x_mps2, y_mps2, z_mps2], MAX_ACCELERATION_MPS2)
}

fn angular_rate(rate: DspAngularRate) -> bool {
    let DspAngularRate {
        x_radps,
        y_radps,
        z_radps,
    } = rate;
    within([x_radps, y_radps, z_radps], MAX_ANGULAR_RATE_RADPS)
}

fn pulses(pulses: DspServoPulses) -> bool {
    let DspServoPulses {
        collective_us,
        roll_us,
        pitch_us,
        tail_us,
        throttle_us,
    } = pulses;
    [collective_us, roll_us, pitch_us, tail_us, throttle_us]
        .iter()
        .all(|pulse_us| (MIN_PULSE_US..=MAX_PULSE_US).contains(pulse_us))
}

fn supply(supply: DspSupply) -> bool {
    let DspSupply {
        battery_mv,
        fuel_percent,
        auto_switch,
    } = supply;
    battery_mv <= MAX_BATTERY_MV && fuel_percent <= MAX_FUEL_PERCENT && auto_switch <= 1
}

fn pan_tilt(pan_tilt: DspPanTilt) -> bool {
    let DspPanTilt { pan_adc, tilt_adc } = pan_tilt;
    pan_adc <= MAX_ADC && tilt_adc <= MAX_ADC
}

fn references(references: DspReferences) -> bool {
    let DspReferences {
        x_speed_mps,
        y_speed_mps,
        altitude_m,
        pitch_deg,
        roll_deg,
        yaw_deg,
        reserved: _,
    } = references;
    within([x_speed_mps, y_speed_mps], MAX_REFERENCE_SPEED_MPS)
        && is_altitude(altitude_m.into())
        && angles(pitch_deg, roll_deg, yaw_deg)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_samples::full_sample;

    #[test]
    fn what_can_be_is_left_alone_and_what_cannot_is_named() {
        assert_eq!(impossible_groups(&full_sample()), GroupSet::default());
        type Change = fn(&mut DspTelemetry);
        let cases: [(Group, &[Change]); 10] = [
            (
                Group::Geographic,
                &[
                    |dsp| dsp.geographic.latitude_deg = 4e4,
                    |dsp| dsp.geographic.longitude_deg = f64::NAN,
                    |dsp| dsp.geographic.altitude_m = f64::INFINITY,
                ],
            ),
            (Group::Xy, &[|dsp| dsp.xy.y_m = -1e6]),
            (
                Group::GpsVelocity,
                &[
                    |dsp| dsp.gps_velocity.horizontal_speed_mps = -1.0,
                    |dsp| dsp.gps_velocity.heading_deg = 361.0,
                ],
            ),
            (Group::GpsQuality, &[|dsp| dsp.gps_quality = 9]),
            (Group::Attitude, &[|dsp| dsp.attitude.pitch_deg = -91.0]),
            (Group::PilotPwm, &[|dsp| dsp.pilot_pwm.tail_us = u32::MAX]),
            (Group::Sonar, &[|dsp| dsp.sonar_adc = 4096]),
            (Group::Supply, &[|dsp| dsp.supply.auto_switch = 2]),
            (Group::RotorSpeed, &[|dsp| dsp.rotor_rpm = 4001]),
            (
                Group::References,
                &[|dsp| dsp.references.yaw_deg = f32::NAN],
            ),
        ];
        for (group, changes) in cases {
            for change in changes {
                let mut dsp = full_sample();
                change(&mut dsp);
                assert_eq!(impossible_groups(&dsp), GroupSet::from_iter([group]));
                // A group that is not valid holds nothing that could be impossible.
                dsp.valid_groups &= !group.bit();
                assert_eq!(impossible_groups(&dsp), GroupSet::default());
            }
        }
    }
}
