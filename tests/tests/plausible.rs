//! What no consumer must ever see: a value that cannot be, or one that was never measured.

use ipc_types::TelemetryGroup;
use ipc_types::payload::{DspServoPulses, DspTelemetry};
use ril_tests::script::only_groups;

/// The limits of `docs/protocol.md` section 9, and that groups which are not valid are zero.
pub fn assert_plausible(sample: &DspTelemetry) {
    let rest = DspTelemetry {
        flying: sample.flying,
        ..only_groups(sample, sample.valid_groups)
    };
    assert_eq!(*sample, rest, "a group that is not valid holds something");
    assert!(sample.flying <= 1, "{sample:?}");
    for group in TelemetryGroup::ALL {
        assert!(is_plausible(sample, group), "{group:?} of {sample:?}");
    }
}

/// Zero, which stands where nothing is valid, is within all limits but those of the servos.
fn is_plausible(sample: &DspTelemetry, group: TelemetryGroup) -> bool {
    use TelemetryGroup as G;
    let within = |value: f64, limit: f64| value.abs() <= limit;
    let within32 =
        |values: &[f32], limit: f64| values.iter().all(|value| within(f64::from(*value), limit));
    let altitude = |value: f64| (-1000.0..=20_000.0).contains(&value);
    let pulses = |pulses: &DspServoPulses| {
        let DspServoPulses {
            collective_us,
            roll_us,
            pitch_us,
            tail_us,
            throttle_us,
        } = *pulses;
        !sample.valid(group)
            || [collective_us, roll_us, pitch_us, tail_us, throttle_us]
                .iter()
                .all(|pulse| (500..=2500).contains(pulse))
    };
    match group {
        G::Time => true,
        G::Geographic => {
            let position = &sample.geographic;
            within(position.latitude_deg, 90.0)
                && within(position.longitude_deg, 180.0)
                && altitude(position.altitude_m)
        }
        G::Xy => within(sample.xy.x_m, 1e5) && within(sample.xy.y_m, 1e5),
        G::GpsVelocity => {
            let velocity = &sample.gps_velocity;
            (0.0..=100.0).contains(&velocity.horizontal_speed_mps)
                && within32(&[velocity.vertical_speed_mps], 50.0)
                && (0.0..=360.0).contains(&velocity.heading_deg)
        }
        G::GpsQuality => sample.gps_quality <= 8,
        G::Attitude => {
            within32(&[sample.attitude.pitch_deg], 90.0)
                && within32(&[sample.attitude.roll_deg, sample.attitude.yaw_deg], 180.0)
        }
        G::Acceleration => {
            let force = &sample.acceleration;
            within32(&[force.x_mps2, force.y_mps2, force.z_mps2], 160.0)
        }
        G::AngularRate => {
            let rate = &sample.angular_rate;
            within32(&[rate.x_radps, rate.y_radps, rate.z_radps], 20.0)
        }
        G::PilotPwm => pulses(&sample.pilot_pwm),
        G::Actuation => pulses(&sample.actuation),
        G::Sonar => sample.sonar_adc <= 4095,
        G::Barometer => sample.barometer_adc <= 4095,
        G::PanTilt => sample.pan_tilt.pan_adc <= 4095 && sample.pan_tilt.tilt_adc <= 4095,
        G::Supply => {
            sample.supply.battery_mv <= 60_000
                && sample.supply.fuel_percent <= 100
                && sample.supply.auto_switch <= 1
        }
        G::RotorSpeed => sample.rotor_rpm <= 4000,
        G::References => {
            let references = &sample.references;
            within32(&[references.x_speed_mps, references.y_speed_mps], 100.0)
                && altitude(references.altitude_m.into())
                && within32(&[references.pitch_deg], 90.0)
                && within32(&[references.roll_deg, references.yaw_deg], 180.0)
        }
    }
}
