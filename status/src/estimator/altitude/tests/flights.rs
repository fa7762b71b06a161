//! Many flights of random numbers: every sensor with noise and with the slow error that the real one has.

use dsp_sim::random::Random;

use super::*;

/// Ten samples a second: as the simulated helicopter flies fifty.
const PERIOD_S: f64 = 0.1;

/// How good the sensors of a flight are.
struct Sensors {
    gps_quality: u8,
    /// Size of the GPS altitude's wander, m, and its time constant, s.
    gps_wander_m: f64,
    wander_s: f64,
    /// Noise of a single GPS altitude, m.
    gps_noise_m: f64,
    /// How far the weather moves the barometer in an hour, m.
    barometer_drift_m: f64,
}

/// Sums of squares and counts over flights.
#[derive(Debug, Default)]
struct Score {
    samples: u64,
    inside: u64,
    estimate_m2: f64,
    gps_m2: f64,
}

impl Score {
    fn rms_m(&self, sum_m2: f64) -> f64 {
        (sum_m2 / self.samples as f64).sqrt()
    }

    fn part_inside(&self) -> f64 {
        self.inside as f64 / self.samples as f64
    }
}

/// Ten minutes over hilly ground, between hovering low and cruising high; the first ten seconds do not count.
fn fly(seed: u64, sensors: &Sensors, score: &mut Score) {
    let mut random = Random::new(seed, 1);
    let mut noise = |deviation: f64| random.gaussian() * deviation;
    let mut estimator = estimator();
    let (mut altitude_m, mut climb_mps, mut ground_m) = (120.0, 0.0, 115.0);
    let (mut wander_m, mut offset_m) = (noise(sensors.gps_wander_m), noise(8.0));
    let kept = (-PERIOD_S / sensors.wander_s).exp();
    let drift_m = sensors.barometer_drift_m * (PERIOD_S / 3600.0).sqrt();
    for index in 0..6_000_u32 {
        let time_s = f64::from(index) * PERIOD_S;
        let target_m = 130.0 + 12.0 * (time_s / 25.0).sin();
        // Flown like a helicopter: towards the target, with gusts.
        let acceleration = 0.3 * (target_m - altitude_m) - 1.2 * climb_mps;
        climb_mps += acceleration * PERIOD_S + noise(0.5 * PERIOD_S.sqrt());
        altitude_m += climb_mps * PERIOD_S;
        let speed_mps = 3.0;
        ground_m += noise(0.1 * (speed_mps * PERIOD_S).sqrt());
        wander_m = kept * wander_m + noise(sensors.gps_wander_m * (1.0 - kept * kept).sqrt());
        offset_m += noise(drift_m);

        let mut raw = sample(index * 5);
        raw.gps_quality = sensors.gps_quality;
        raw.geographic.altitude_m = altitude_m + wander_m + noise(sensors.gps_noise_m);
        raw.gps_velocity = DspGpsVelocity {
            horizontal_speed_mps: speed_mps as f32,
            vertical_speed_mps: (climb_mps + noise(0.08)) as f32,
            heading_deg: 0.0,
        };
        let barometer = (altitude_m + offset_m + noise(0.4)) / BAROMETER_STEP_M;
        raw.barometer_adc = (BAROMETER_ZERO_ADC + barometer).round().clamp(0.0, 4095.0) as u32;
        let sonar = (altitude_m - ground_m + noise(0.04)) / SONAR_STEP_M;
        raw.sonar_adc = sonar.round().clamp(0.0, 4095.0) as u32;

        let estimate = feed(&mut estimator, &raw);
        if time_s >= 10.0 {
            assert_eq!(estimate.valid, 1);
            let error_m = estimate.altitude_m - altitude_m;
            let within_m2 = 9.0 * estimate.altitude_variance_m2;
            score.samples += 1;
            score.inside += u64::from(error_m * error_m <= within_m2);
            score.estimate_m2 += error_m * error_m;
            score.gps_m2 += (raw.geographic.altitude_m - altitude_m).powi(2);
        }
    }
}

/// Flies with `sensors`; the estimate must beat the GPS by this factor, and its variance must be honest.
fn check(sensors: &Sensors, factor: f64) {
    let mut score = Score::default();
    for seed in 0..8 {
        fly(seed, sensors, &mut score);
    }
    let (estimate_m, gps_m) = (score.rms_m(score.estimate_m2), score.rms_m(score.gps_m2));
    let inside = score.part_inside();
    println!("estimate {estimate_m:.3} m, GPS {gps_m:.3} m, inside 3 sigma {inside:.5}");
    assert!(estimate_m * factor < gps_m, "{estimate_m} m, GPS {gps_m} m");
    assert!(inside > 0.99, "{inside} inside 3 sigma");
}

#[test]
fn with_a_resolved_carrier_phase_the_estimate_beats_the_gps_and_its_variance_holds() {
    check(
        &Sensors {
            gps_quality: 4,
            gps_wander_m: 0.02,
            wander_s: 60.0,
            gps_noise_m: 0.04,
            barometer_drift_m: 2.0,
        },
        1.5,
    );
}

#[test]
fn with_an_ordinary_fix_that_wanders_the_estimate_beats_the_gps_and_its_variance_holds() {
    check(
        &Sensors {
            gps_quality: 1,
            gps_wander_m: 3.0,
            wander_s: 60.0,
            gps_noise_m: 1.0,
            barometer_drift_m: 2.0,
        },
        1.5,
    );
}

#[test]
fn the_variance_holds_when_gps_and_barometer_are_slower_and_worse_than_the_model() {
    check(
        &Sensors {
            gps_quality: 1,
            gps_wander_m: 2.5,
            wander_s: 120.0,
            gps_noise_m: 0.5,
            barometer_drift_m: 4.0,
        },
        1.0,
    );
}
