//! Flights whose true altitude is known: made of random numbers, and of the simulated helicopter.

mod flights;
mod simulated;

use proptest::prelude::*;

use super::*;
use crate::calibration::Calibration;
use crate::fields::plausible;
use crate::translate::translate;
use ipc_types::MonotonicNs;
use ipc_types::payload::{DspGeographic, DspGpsVelocity};

/// The simulated converters' steps, which are the calibration's defaults.
const SONAR_STEP_M: f64 = 0.0025;
const BAROMETER_STEP_M: f64 = 0.25;
const BAROMETER_ZERO_ADC: f64 = 500.0;

/// Feeds `raw` as the core does.
fn feed(estimator: &mut AltitudeEstimator, raw: &DspTelemetry) -> HeroEstimate {
    let (raw, _) = plausible(raw);
    let hero = translate(&raw, &Calibration::default(), MonotonicNs(1));
    estimator.update(&raw, &hero)
}

/// A sample with the groups that matter here, `index` × 20 ms after the DSP's boot.
fn sample(index: u32) -> DspTelemetry {
    let groups = [
        Group::Time,
        Group::Geographic,
        Group::GpsVelocity,
        Group::GpsQuality,
        Group::Barometer,
        Group::Sonar,
    ];
    DspTelemetry {
        sequence: u64::from(index) + 1,
        epoch_ns: 1,
        received_ns: 1_000_000_000 + u64::from(index) * 20_000_000,
        dsp_time_ms: index * 20,
        valid_groups: groups.iter().fold(0, |mask, group| mask | group.bit()),
        gps_quality: 4,
        geographic: DspGeographic {
            latitude_deg: 37.0,
            longitude_deg: -6.0,
            altitude_m: 0.0,
        },
        ..DspTelemetry::default()
    }
}

/// A sample of a helicopter that hovers at `altitude_m`, 5 m over the ground, all sensors exact.
fn hovering(index: u32, altitude_m: f64) -> DspTelemetry {
    let mut raw = sample(index);
    raw.geographic.altitude_m = altitude_m;
    raw.barometer_adc = (BAROMETER_ZERO_ADC + altitude_m / BAROMETER_STEP_M).round() as u32;
    raw.sonar_adc = (5.0 / SONAR_STEP_M) as u32;
    raw
}

fn estimator() -> AltitudeEstimator {
    AltitudeEstimator::new(&AltitudeConfig::default())
}

/// Hovers with all sensors for `samples`; gives the last estimate.
fn hover(
    estimator: &mut AltitudeEstimator,
    samples: std::ops::Range<u32>,
    change: impl Fn(&mut DspTelemetry),
) -> HeroEstimate {
    let mut estimate = HeroEstimate::default();
    for index in samples {
        let mut raw = hovering(index, 100.0);
        change(&mut raw);
        estimate = feed(estimator, &raw);
    }
    estimate
}

fn assert_near(estimate: &HeroEstimate, altitude_m: f64, tolerance_m: f64) {
    assert_eq!(estimate.valid, 1, "{estimate:?}");
    let error_m = (estimate.altitude_m - altitude_m).abs();
    assert!(error_m <= tolerance_m, "{estimate:?}, not {altitude_m}");
}

#[test]
fn nothing_is_estimated_before_there_is_an_altitude() {
    let mut estimator = estimator();
    let sonar_alone = |raw: &mut DspTelemetry| {
        raw.valid_groups = Group::Time.bit() | Group::Sonar.bit();
    };
    let estimate = hover(&mut estimator, 0..100, sonar_alone);
    assert_eq!(estimate, HeroEstimate::default());
    let estimate = hover(&mut estimator, 100..101, |_| {});
    assert_near(&estimate, 100.0, 0.2);
    assert_eq!(estimate.inputs, INPUT_GPS | INPUT_BAROMETER | INPUT_SONAR);
}

#[test]
fn a_gps_without_fix_or_of_unknown_quality_is_not_used() {
    for quality in [0, 6, 7] {
        let no_fix = |raw: &mut DspTelemetry| {
            raw.gps_quality = quality;
            raw.geographic = DspGeographic::default();
        };
        let mut estimator = estimator();
        let estimate = hover(&mut estimator, 0..100, no_fix);
        // The barometer alone, whose offset is unknown.
        assert_near(&estimate, 100.0, 0.2);
        assert_eq!(estimate.inputs & INPUT_GPS, 0);
        assert!(estimate.altitude_variance_m2 > 90.0, "{estimate:?}");
    }
    let unknown = |raw: &mut DspTelemetry| raw.valid_groups &= !Group::GpsQuality.bit();
    let estimate = hover(&mut estimator(), 0..100, unknown);
    assert_eq!(estimate.inputs & INPUT_GPS, 0);
}

#[test]
fn each_kind_of_fix_has_its_variance() {
    let variances = [1, 5, 4].map(|quality| {
        let fix = |raw: &mut DspTelemetry| {
            raw.gps_quality = quality;
            raw.valid_groups &= !Group::Barometer.bit();
        };
        hover(&mut estimator(), 0..500, fix).altitude_variance_m2
    });
    assert!(variances[0] > 4.0 && variances[0] < 10.0, "{variances:?}");
    assert!(variances[1] > 0.1 && variances[1] < 0.5, "{variances:?}");
    assert!(
        variances[2] > 0.001 && variances[2] < 0.005,
        "{variances:?}"
    );
}

#[test]
fn the_barometer_holds_the_altitude_that_the_gps_taught_it() {
    let mut estimator = estimator();
    let low = |raw: &mut DspTelemetry| raw.barometer_adc -= 40; // 10 m
    hover(&mut estimator, 0..500, low);
    let lost = |raw: &mut DspTelemetry| {
        raw.barometer_adc -= 40;
        raw.gps_quality = 0;
        raw.valid_groups &= !Group::Sonar.bit();
    };
    let estimate = hover(&mut estimator, 500..3_500, lost);
    assert_near(&estimate, 100.0, 0.3);
    assert_eq!(estimate.inputs, INPUT_BAROMETER);
}

#[test]
fn an_outlier_moves_nothing() {
    let mut estimator = estimator();
    hover(&mut estimator, 0..500, |_| {});
    let wild = |raw: &mut DspTelemetry| {
        raw.geographic.altitude_m = 900.0;
        raw.barometer_adc = 3_000;
        raw.sonar_adc = 100;
    };
    let estimate = hover(&mut estimator, 500..510, wild);
    assert_near(&estimate, 100.0, 0.1);
    assert_eq!(estimate.inputs, 0);
}

#[test]
fn an_input_that_jumps_and_stays_is_taken_again() {
    type Jump = fn(&mut DspTelemetry);
    let jumps: [(Jump, u32); 3] = [
        (|raw| raw.geographic.altitude_m += 10.0, INPUT_GPS),
        (|raw| raw.barometer_adc += 200, INPUT_BAROMETER),
        // A roof.
        (|raw| raw.sonar_adc -= 1_200, INPUT_SONAR),
    ];
    for (jump, input) in jumps {
        let mut estimator = estimator();
        hover(&mut estimator, 0..2_000, |_| {});
        let estimate = hover(&mut estimator, 2_000..2_050, jump);
        assert_eq!(estimate.inputs & input, 0);
        let estimate = hover(&mut estimator, 2_050..2_200, jump);
        assert_ne!(estimate.inputs & input, 0, "{estimate:?}");
        assert_near(&estimate, 100.0, 0.5);
    }
}

#[test]
fn a_gps_that_disagrees_widens_the_variance_and_wins_after_a_minute() {
    let higher = |raw: &mut DspTelemetry| raw.geographic.altitude_m += 10.0;
    let mut estimator = estimator();
    hover(&mut estimator, 0..2_000, |_| {});
    let disagreeing = hover(&mut estimator, 2_000..4_000, higher);
    assert_near(&disagreeing, 100.0, 0.5);
    assert!(disagreeing.altitude_variance_m2 > 90.0, "{disagreeing:?}");
    // It was a passing error of the GPS.
    let mut recovered = estimator.clone();
    let estimate = hover(&mut recovered, 4_000..12_000, |_| {});
    assert_near(&estimate, 100.0, 0.1);
    assert!(estimate.altitude_variance_m2 < 0.01, "{estimate:?}");
    // It was wrong before.
    let estimate = hover(&mut estimator, 4_000..6_000, higher);
    assert_near(&estimate, 110.0, 0.1);
    assert!(estimate.altitude_variance_m2 < 0.01, "{estimate:?}");
}

#[test]
fn a_gps_that_disagrees_and_then_is_lost_does_not_win() {
    let mut estimator = estimator();
    hover(&mut estimator, 0..2_000, |_| {});
    hover(&mut estimator, 2_000..3_000, |raw| {
        raw.geographic.altitude_m += 10.0;
    });
    let lost = hover(&mut estimator, 3_000..9_000, |raw| raw.gps_quality = 0);
    assert_near(&lost, 100.0, 0.5);
    assert_eq!(lost.inputs, INPUT_BAROMETER | INPUT_SONAR);
    let back = hover(&mut estimator, 9_000..9_500, |_| {});
    assert_near(&back, 100.0, 0.2);
}

#[test]
fn sensors_at_the_end_of_their_range_say_nothing() {
    for adc in [0, 4095] {
        let ends = |raw: &mut DspTelemetry| {
            raw.barometer_adc = adc;
            raw.sonar_adc = adc;
        };
        let estimate = hover(&mut estimator(), 0..50, ends);
        assert_near(&estimate, 100.0, 0.01);
        assert_eq!(estimate.inputs, INPUT_GPS);
    }
    let far = |raw: &mut DspTelemetry| raw.sonar_adc = 3_300; // 8.25 m
    let estimate = hover(&mut estimator(), 0..50, far);
    assert_eq!(estimate.inputs & INPUT_SONAR, 0);
}

#[test]
fn a_reboot_of_the_dsp_and_a_wrap_of_its_clock_are_no_gap() {
    let before = |estimator: &mut AltitudeEstimator| hover(estimator, 0..500, |_| {});
    let (mut rebooted, mut wrapped) = (estimator(), estimator());
    let settled = before(&mut rebooted);
    hover(&mut wrapped, 0..500, |raw| {
        raw.dsp_time_ms = raw.dsp_time_ms.wrapping_sub(500 * 20);
    });
    let reboot = |raw: &mut DspTelemetry| {
        raw.dsp_boots = 1;
        raw.dsp_time_ms -= 500 * 20;
    };
    for estimate in [
        hover(&mut rebooted, 500..501, reboot),
        hover(&mut wrapped, 500..501, |raw| raw.dsp_time_ms -= 500 * 20),
    ] {
        assert_near(&estimate, 100.0, 0.05);
        let variance_m2 = estimate.altitude_variance_m2;
        assert!(variance_m2 < 1.1 * settled.altitude_variance_m2);
    }
}

#[test]
fn the_variance_grows_with_a_gap_and_a_long_one_starts_anew() {
    let mut estimator = estimator();
    let settled = hover(&mut estimator, 0..500, |_| {});
    let no_input = |raw: &mut DspTelemetry| raw.valid_groups = Group::Time.bit();
    let gap_of_5_s = hover(&mut estimator, 750..751, no_input);
    assert!(gap_of_5_s.altitude_variance_m2 > 10.0 * settled.altitude_variance_m2);
    assert_near(&gap_of_5_s, 100.0, 1.0);
    let gap_of_20_s = hover(&mut estimator, 1_750..1_751, no_input);
    assert_eq!(gap_of_20_s, HeroEstimate::default());
    assert_near(&hover(&mut estimator, 1_751..1_752, |_| {}), 100.0, 0.2);
}

#[test]
fn without_any_input_the_estimate_ends_and_comes_back() {
    let mut estimator = estimator();
    hover(&mut estimator, 0..500, |_| {});
    let no_input = |raw: &mut DspTelemetry| raw.valid_groups = Group::Time.bit();
    // A quarter of an hour.
    let estimate = hover(&mut estimator, 500..45_500, no_input);
    assert_eq!(estimate, HeroEstimate::default());
    assert_near(&hover(&mut estimator, 45_500..45_510, |_| {}), 100.0, 0.2);
}

#[test]
fn a_repeated_sample_adds_no_confidence() {
    let mut estimator = estimator();
    let once = hover(&mut estimator, 0..10, |_| {});
    let again = feed(&mut estimator, &hovering(9, 100.0));
    assert_eq!(again, HeroEstimate { inputs: 0, ..once });
}

fn any_sample() -> impl Strategy<Value = DspTelemetry> {
    let numbers = (any::<u64>(), any::<u32>(), any::<u16>(), any::<u8>());
    let adcs = (any::<u32>(), 0..5_000_u32, 0..5_000_u32);
    let floats = (any::<f64>(), -2e3..3e4_f64, any::<f32>(), -60.0..60.0_f32);
    (numbers, adcs, floats, 0..200_u32, any::<u8>()).prop_map(
        |(
            (received_ns, time, groups, boots),
            (wild, sonar_adc, barometer_adc),
            floats,
            index,
            kind,
        )| {
            let (wild_m, altitude_m, wild_mps, climb_mps) = floats;
            let mut raw = sample(index);
            // Half of the samples follow each other; the other half holds anything.
            if kind & 1 != 0 {
                (raw.received_ns, raw.dsp_time_ms) = (received_ns, time);
                raw.dsp_boots = boots.into();
                raw.epoch_ns = received_ns >> 1;
            }
            if kind & 2 != 0 {
                raw.valid_groups = groups;
            }
            raw.gps_quality = kind >> 4;
            raw.geographic.altitude_m = if kind & 4 != 0 { wild_m } else { altitude_m };
            raw.gps_velocity = DspGpsVelocity {
                horizontal_speed_mps: wild_mps,
                vertical_speed_mps: climb_mps,
                heading_deg: 0.0,
            };
            (raw.sonar_adc, raw.barometer_adc) = (sonar_adc, barometer_adc);
            if kind & 8 != 0 {
                raw.sonar_adc = wild;
                raw.gps_velocity.horizontal_speed_mps = 1.0;
            }
            raw
        },
    )
}

proptest! {
    #[test]
    fn no_sequence_of_samples_gives_a_number_that_is_none(
        samples in proptest::collection::vec(any_sample(), 1..200)
    ) {
        let mut estimator = estimator();
        for raw in &samples {
            let estimate = feed(&mut estimator, raw);
            let HeroEstimate { altitude_m, altitude_variance_m2, vertical_speed_mps, inputs, valid } = estimate;
            prop_assert!(altitude_m.is_finite() && vertical_speed_mps.is_finite());
            prop_assert!((0.0..=400.0).contains(&altitude_variance_m2), "{estimate:?}");
            prop_assert!(inputs <= 7 && valid <= 1);
            prop_assert!(estimator.state.is_finite());
            prop_assert!((0..STATES).all(|i| estimator.state.covariance[i][i] >= 0.0), "{estimator:?}");
        }
    }
}
