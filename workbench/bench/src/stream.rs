//! What is sent: full status frames as they come from the DSP, and a sample of telemetry.

use dsp_protocol::downlink::{
    Acceleration, AngularRate, Attitude, Geographic, GpsVelocity, PanTilt, References, ServoPulses,
    Supply, Xy,
};
use dsp_protocol::{Downlink, Frame, Profile, Sequence, Status};
use ipc_types::payload::{HeroAttitude, HeroGeodetic, HeroTelemetry};

/// A status with all groups, plausible, whose DSP time is `time_ms`; its other values vary with it.
pub fn full_status(time_ms: u32, flying: bool) -> Status {
    let phase = f64::from(time_ms % 1000) / 1000.0;
    let small = phase as f32;
    let pulses = ServoPulses {
        collective_us: 1500 + (time_ms % 100) as u16,
        roll_us: 1480,
        pitch_us: 1520,
        tail_us: 1600,
        throttle_us: 1700,
    };
    Status {
        flying,
        time_ms: Some(time_ms),
        geographic: Some(Geographic {
            latitude_deg: 37.4 + phase * 1e-4,
            longitude_deg: -5.9 - phase * 1e-4,
            altitude_m: 10.0 + phase,
        }),
        xy: Some(Xy {
            x_m: phase,
            y_m: -phase,
        }),
        gps_velocity: Some(GpsVelocity {
            horizontal_speed_mps: small,
            vertical_speed_mps: -small,
            heading_deg: 90.0,
        }),
        gps_quality: Some(4),
        attitude: Some(Attitude {
            pitch_deg: small,
            roll_deg: -small,
            yaw_deg: 45.0,
        }),
        acceleration: Some(Acceleration {
            x_mps2: small,
            y_mps2: 0.0,
            z_mps2: -9.81,
        }),
        angular_rate: Some(AngularRate {
            x_radps: small,
            y_radps: 0.0,
            z_radps: -small,
        }),
        pilot_pwm: Some(pulses),
        sonar_adc: Some(512),
        supply: Some(Supply {
            battery_mv: 12_000,
            fuel_percent: 80,
            auto_switch: 1,
        }),
        pan_tilt: Some(PanTilt {
            pan_adc: 512,
            tilt_adc: 512,
        }),
        rotor_rpm: Some(1500),
        barometer_adc: Some(600),
        actuation: Some(pulses),
        references: Some(References {
            x_speed_mps: small,
            y_speed_mps: 0.0,
            altitude_m: 10.0,
            pitch_deg: 0.0,
            roll_deg: 0.0,
            yaw_deg: 45.0,
        }),
    }
}

/// A sample as it may be in flight: numbers with all their digits, which is what text has to carry.
pub fn telemetry() -> HeroTelemetry {
    HeroTelemetry {
        valid_groups: 0xffff,
        flying: 1,
        dsp_time_s: 1234.567,
        geodetic: HeroGeodetic {
            latitude_rad: 0.652_853_912_345_678,
            longitude_rad: -0.104_512_345_678_9,
            altitude_m: 123.456,
        },
        attitude: HeroAttitude {
            roll_rad: 0.012_345_6,
            pitch_rad: -0.023_456_7,
            yaw_rad: 1.234_567_8,
        },
        ..HeroTelemetry::default()
    }
}

/// The frame of [`full_status`] in the classic profile.
pub fn frame(time_ms: u32, flying: bool) -> Frame {
    Downlink::Status(full_status(time_ms, flying)).encode()
}

/// `count` full status frames in `profile`, one after the other.
pub fn frames(profile: Profile, count: u32) -> Vec<Vec<u8>> {
    let mut sequence = Sequence::FIRST;
    (0..count)
        .map(|time_ms| {
            let status = Downlink::Status(full_status(time_ms, true));
            let frame = status.encode_in(profile, sequence, Sequence::FIRST);
            sequence = sequence.next();
            frame.as_bytes().to_vec()
        })
        .collect()
}

/// Flips one bit in every hundredth of `frames`, each elsewhere. The same every time.
pub fn corrupt(frames: &mut [Vec<u8>]) {
    // Knuth's multiplicative congruential generator, from a fixed seed.
    let mut state = 0x5DEE_CE66_u64;
    for frame in frames.iter_mut().step_by(100) {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let bit = (state >> 33) as usize % (frame.len() * 8);
        frame[bit / 8] ^= 1 << (bit % 8);
    }
}

/// The DSP time in a classic status frame whose mask has it first, `None` for another frame.
pub fn time_ms_of(frame: &[u8]) -> Option<u32> {
    // Header, mask (3) and flags come first, then five digits of seven bits.
    let digits: [u8; 5] = frame.get(5..10)?.try_into().ok()?;
    Some(
        digits
            .iter()
            .fold(0, |value, digit| value << 7 | u32::from(*digit)),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_frame_has_all_groups_and_its_time() {
        for time_ms in [0, 1, 127, 128, 123_456_789] {
            let frame = frame(time_ms, true);
            assert_eq!(frame.as_bytes().len(), 128);
            assert_eq!(time_ms_of(frame.as_bytes()), Some(time_ms));
        }
        assert_eq!(time_ms_of(&[0xE9]), None);
    }

    #[test]
    fn one_frame_in_a_hundred_is_corrupted_by_one_bit() {
        let sound = frames(Profile::Extended, 1000);
        let mut corrupted = sound.clone();
        corrupt(&mut corrupted);
        let flipped: u32 = sound
            .concat()
            .iter()
            .zip(corrupted.concat())
            .map(|(a, b)| (a ^ b).count_ones())
            .sum();
        assert_eq!(flipped, 10);
    }
}
