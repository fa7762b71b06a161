//! Telemetry for the tests of this crate.

use ipc_types::payload::{
    DspAcceleration, DspAngularRate, DspAttitude, DspGeographic, DspGpsVelocity, DspPanTilt,
    DspReferences, DspServoPulses, DspSupply, DspTelemetry, DspXy,
};

/// A sample with all groups valid and a different number in every field.
pub(crate) fn full_sample() -> DspTelemetry {
    DspTelemetry {
        sequence: 41,
        epoch_ns: 1_000,
        received_ns: 5_000_000_000,
        sent_ns: 4_999_000_000,
        sent_uncertainty_s: 0.001,
        dsp_time_ms: 12_345,
        valid_groups: 0xFFFF,
        flying: 1,
        gps_quality: 4,
        dsp_boots: 2,
        dsp_errors: 3,
        last_dsp_error_code: 230,
        rotor_rpm: 1500,
        geographic: DspGeographic {
            latitude_deg: 30.0,
            longitude_deg: -45.0,
            altitude_m: 123.456,
        },
        xy: DspXy {
            x_m: -3.5,
            y_m: 4.25,
        },
        gps_velocity: DspGpsVelocity {
            horizontal_speed_mps: 10.0,
            vertical_speed_mps: -1.5,
            heading_deg: 300.0,
        },
        attitude: DspAttitude {
            pitch_deg: -30.0,
            roll_deg: 45.0,
            yaw_deg: 180.0,
        },
        acceleration: DspAcceleration {
            x_mps2: 0.5,
            y_mps2: -0.25,
            z_mps2: -9.75,
        },
        angular_rate: DspAngularRate {
            x_radps: 0.125,
            y_radps: -0.5,
            z_radps: 1.5,
        },
        pilot_pwm: DspServoPulses {
            collective_us: 1000,
            roll_us: 1250,
            pitch_us: 1500,
            tail_us: 1750,
            throttle_us: 2000,
        },
        actuation: DspServoPulses {
            collective_us: 2000,
            roll_us: 1750,
            pitch_us: 1500,
            tail_us: 1250,
            throttle_us: 1000,
        },
        sonar_adc: 1200,
        barometer_adc: 1000,
        supply: DspSupply {
            battery_mv: 11_100,
            fuel_percent: 75,
            auto_switch: 1,
        },
        pan_tilt: DspPanTilt {
            pan_adc: 3072,
            tilt_adc: 0,
        },
        references: DspReferences {
            x_speed_mps: 1.5,
            y_speed_mps: -2.5,
            altitude_m: 50.25,
            pitch_deg: -5.0,
            roll_deg: 10.0,
            yaw_deg: -90.0,
            reserved: 0,
        },
    }
}

/// The `sequence`-th sample of the bridge that began at `epoch_ns`.
pub(crate) fn sample(epoch_ns: u64, sequence: u64) -> DspTelemetry {
    DspTelemetry {
        sequence,
        epoch_ns,
        ..full_sample()
    }
}
