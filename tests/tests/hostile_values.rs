//! Whatever lies in shared memory, status and what it publishes stay sane, and status believes exactly what the bridge
//! publishes. Every failure names the seed that repeats it.

use bridge::link::StatusSample;
use bridge::translate::dsp_telemetry;
use dsp_protocol::Status as DspStatus;
use dsp_protocol::downlink::{
    Acceleration, AngularRate, Attitude, Geographic, GpsVelocity, PanTilt, References, ServoPulses,
    Supply, Xy,
};
use ipc_types::payload::{DspErrorCounters, DspTelemetry, HeroTelemetry};
use ipc_types::{MonotonicNs, TelemetryGroup};
use ril_tests::Garbage;
use status::calibration::Calibration;
use status::core::{Input, InputCounts, Output, Status};
use status::fields::plausible;
use status::log::Logs;

const SEEDS: u64 = 20_000;

/// Every float of the sample with its name.
fn floats(hero: &HeroTelemetry) -> Vec<f64> {
    fn collect(value: &serde_json::Value, found: &mut Vec<f64>) {
        match value {
            // serde_json has no other form for what is not finite.
            serde_json::Value::Null => found.push(f64::NAN),
            serde_json::Value::Number(number) => found.extend(number.as_f64()),
            serde_json::Value::Object(fields) => {
                fields.values().for_each(|value| collect(value, found));
            }
            other => panic!("no field of telemetry is {other}"),
        }
    }
    let mut found = Vec::new();
    collect(
        &serde_json::to_value(hero).expect("plain numbers"),
        &mut found,
    );
    found
}

#[test]
fn nothing_that_cannot_be_is_translated_whatever_was_published() {
    let mut status = Status::new(Calibration::default(), Logs::default(), MonotonicNs(1));
    let (mut kept, mut left_out) = (0, 0);
    for seed in 0..SEEDS {
        let dsp: DspTelemetry = Garbage::new(seed).payload();
        let now = MonotonicNs(seed);
        let Some(Output::Telemetry(hero)) = status.apply(now, Input::Sample(dsp)) else {
            panic!("seed {seed}: each sample is translated");
        };
        let floats = floats(&hero);
        assert!(
            floats.iter().all(|value| value.is_finite()),
            "seed {seed}: {hero:#?}"
        );
        assert!(hero.flying <= 1, "seed {seed}");
        assert!(hero.sent() <= hero.received(), "seed {seed}");
        assert!(hero.sent_uncertainty_s >= 0.0, "seed {seed}");
        assert_eq!(
            hero.valid_groups & !u32::from(dsp.valid_groups),
            0,
            "seed {seed}"
        );
        let position = hero.geodetic;
        assert!(
            position.latitude_rad.abs() <= std::f64::consts::FRAC_PI_2,
            "seed {seed}"
        );
        assert!(
            position.longitude_rad.abs() <= std::f64::consts::PI,
            "seed {seed}"
        );
        kept += hero.valid_groups.count_ones();
        left_out += u32::from(dsp.valid_groups).count_ones() - hero.valid_groups.count_ones();

        status.apply(now, Input::Published(Ok(())));
        let counts = InputCounts {
            received: dsp.sequence,
            lost: dsp.epoch_ns,
            publisher_restarts: dsp.received_ns,
        };
        status.apply(now, Input::Step(counts));
        assert!(status.take_events().len() <= 8, "seed {seed}");
    }
    assert!(
        kept > 0 && left_out > 0,
        "one side was not tried: {kept}, {left_out}"
    );
}

/// A value at, just beyond or far from ±`limit`, or none at all.
fn single(garbage: &mut Garbage, limit: f32) -> f32 {
    let values = [
        0.0,
        limit,
        -limit,
        limit.next_up(),
        (-limit).next_down(),
        limit / 2.0,
        f32::NAN,
        f32::NEG_INFINITY,
    ];
    values[garbage.below(values.len() as u64) as usize]
}

fn double(garbage: &mut Garbage, limit: f64) -> f64 {
    let values = [
        0.0,
        limit,
        -limit,
        limit.next_up(),
        (-limit).next_down(),
        limit / 2.0,
        f64::NAN,
        f64::INFINITY,
    ];
    values[garbage.below(values.len() as u64) as usize]
}

/// An integer at the ends of `low` … `high`, beyond them, or between.
fn integer(garbage: &mut Garbage, low: u16, high: u16) -> u16 {
    let values = [
        low,
        high,
        low.saturating_sub(1),
        high.saturating_add(1),
        low + (high - low) / 2,
        u16::MAX,
    ];
    values[garbage.below(values.len() as u64) as usize]
}

fn pulses(garbage: &mut Garbage) -> ServoPulses {
    // Mostly good, so that all five are good now and then.
    let mut pulse = || match garbage.below(8) {
        0 => integer(garbage, 500, 2500),
        _ => 1500,
    };
    ServoPulses {
        collective_us: pulse(),
        roll_us: pulse(),
        pitch_us: pulse(),
        tail_us: pulse(),
        throttle_us: pulse(),
    }
}

/// A message of the DSP at the limits of `docs/protocol.md` section 9.
fn borderline(garbage: &mut Garbage) -> DspStatus {
    DspStatus {
        flying: true,
        time_ms: Some(u32::MAX),
        geographic: Some(Geographic {
            latitude_deg: double(garbage, 90.0),
            longitude_deg: double(garbage, 180.0),
            altitude_m: [double(garbage, 20_000.0), double(garbage, 1000.0)]
                [garbage.below(2) as usize],
        }),
        xy: Some(Xy {
            x_m: double(garbage, 1e5),
            y_m: double(garbage, 1e5),
        }),
        gps_velocity: Some(GpsVelocity {
            horizontal_speed_mps: single(garbage, 100.0),
            vertical_speed_mps: single(garbage, 50.0),
            heading_deg: single(garbage, 360.0),
        }),
        gps_quality: Some(integer(garbage, 0, 8) as u8),
        attitude: Some(Attitude {
            pitch_deg: single(garbage, 90.0),
            roll_deg: single(garbage, 180.0),
            yaw_deg: single(garbage, 180.0),
        }),
        acceleration: Some(Acceleration {
            x_mps2: single(garbage, 160.0),
            y_mps2: single(garbage, 160.0),
            z_mps2: single(garbage, 160.0),
        }),
        angular_rate: Some(AngularRate {
            x_radps: single(garbage, 20.0),
            y_radps: single(garbage, 20.0),
            z_radps: single(garbage, 20.0),
        }),
        pilot_pwm: Some(pulses(garbage)),
        sonar_adc: Some(integer(garbage, 0, 4095)),
        supply: Some(Supply {
            battery_mv: integer(garbage, 0, 60_000),
            fuel_percent: integer(garbage, 0, 100) as u8,
            auto_switch: integer(garbage, 0, 1) as u8,
        }),
        pan_tilt: Some(PanTilt {
            pan_adc: integer(garbage, 0, 4095),
            tilt_adc: integer(garbage, 0, 4095),
        }),
        rotor_rpm: Some(integer(garbage, 0, 4000)),
        barometer_adc: Some(integer(garbage, 0, 4095)),
        actuation: Some(pulses(garbage)),
        references: Some(References {
            x_speed_mps: single(garbage, 100.0),
            y_speed_mps: single(garbage, 100.0),
            altitude_m: f64::from(
                [single(garbage, 20_000.0), single(garbage, 1000.0)][garbage.below(2) as usize],
            ),
            pitch_deg: single(garbage, 90.0),
            roll_deg: single(garbage, 180.0),
            yaw_deg: single(garbage, 180.0),
        }),
    }
}

#[test]
fn status_believes_exactly_what_the_bridge_publishes() {
    let (mut both, mut none) = ([0; 16], [0; 16]);
    for seed in 0..SEEDS {
        let message = borderline(&mut Garbage::new(seed));
        let sample = StatusSample {
            status: message,
            received: MonotonicNs(1),
            sent: Default::default(),
        };
        let mut dsp = DspTelemetry::default();
        dsp_telemetry(&sample, 1, &DspErrorCounters::default(), &mut dsp);
        let refused = message.implausible_groups().0;
        let (_, left_out) = plausible(&dsp);
        assert_eq!(left_out.0, refused, "seed {seed}: {message:#?}");
        for group in TelemetryGroup::ALL {
            let index = group.bit().trailing_zeros() as usize;
            match left_out.contains(group) {
                true => none[index] += 1,
                false => both[index] += 1,
            }
        }
    }
    // The time alone can be anything.
    let tried = |counts: [u32; 16]| counts.iter().filter(|count| **count > 0).count();
    assert_eq!((tried(both), tried(none)), (16, 15), "{both:?} {none:?}");
}
