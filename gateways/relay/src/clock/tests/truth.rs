//! The true offset lies within the shown uncertainty, whatever the link does.

use fastrand::Rng;
use ipc_types::MonotonicNs;

use super::link::{Clocks, Link, SECOND, between, magnitude};
use crate::clock::{Clock, Exchange, RemoteNs, Suspended};

/// Compares everything that `clock` says of the moment `at` with the truth.
pub fn assert_true_at(clock: &Clock, clocks: &Clocks, at: u64, context: &dyn std::fmt::Debug) {
    let Some(estimate) = clock.estimate(MonotonicNs(at)) else {
        return;
    };
    let truth = clocks.offset_at(at);
    let error = (i128::from(estimate.offset_ns) - truth).unsigned_abs();
    assert!(
        error <= u128::from(estimate.uncertainty_ns),
        "{error} ns off at {at}: {estimate:?}, {clocks:?}, {context:?}"
    );

    let remote = clocks.remote(at);
    let shown = clock.to_remote(MonotonicNs(at)).expect("an estimate");
    assert!(shown.0.abs_diff(remote.0) <= estimate.uncertainty_ns);
    let local = clock.to_local(remote).expect("an estimate");
    let uncertainty_ns = clock.estimate(local).expect("an estimate").uncertainty_ns;
    assert!(
        local.0.abs_diff(at) <= uncertainty_ns,
        "{local:?} for {at} ± {uncertainty_ns}: {clocks:?}, {context:?}"
    );
}

/// Lets `clock` take what `link` brings in `duration_s`, and checks it before and after each exchange and at moments
/// around.
fn assert_true_throughout(
    clocks: &Clocks,
    link: &Link,
    duration_s: f64,
    period_s: f64,
    random: &mut Rng,
) {
    let mut clock = Clock::new();
    for exchange in link.exchanges(clocks, duration_s, period_s, random) {
        let at = exchange.received.0;
        assert_true_at(&clock, clocks, at, link);
        if let Err(rejected) = clock.take(&exchange) {
            panic!("{rejected}: {exchange:?}");
        }
        assert_true_at(&clock, clocks, at, link);
        let distance = magnitude(random, 1e6, 3e12) as u64;
        assert_true_at(&clock, clocks, at + distance, link);
        if at > clocks.start_ns + distance {
            assert_true_at(&clock, clocks, at - distance, link);
        }
    }
    assert_eq!(clock.resets(), 0, "{clocks:?}, {link:?}");
}

#[test]
fn the_truth_lies_within_the_uncertainty_on_ten_thousand_links() {
    for seed in 0..10_000 {
        let random = &mut Rng::with_seed(seed);
        let clocks = Clocks::random(random);
        let link = Link::random(random);
        let period_s = between(random, 0.5, 1.0);
        let duration_s = magnitude(random, 5.0, 60.0);
        assert_true_throughout(&clocks, &link, duration_s, period_s, random);
    }
}

#[test]
fn the_truth_lies_within_the_uncertainty_for_many_minutes_of_bad_links() {
    for seed in 20_000..20_040 {
        let random = &mut Rng::with_seed(seed);
        let clocks = Clocks::random(random);
        let link = Link::random(random);
        assert_true_throughout(&clocks, &link, 3000.0, 1.0, random);
    }
}

#[test]
fn the_truth_lies_within_the_uncertainty_for_24_hours_at_100_ppm_and_zeros_hours_apart() {
    let random = &mut Rng::with_seed(24);
    let mut clocks = Clocks::steady(-7 * 3600 * i128::from(SECOND), 100_000.0);
    clocks.start_ns = 50_000 * SECOND;
    let link = Link {
        there_ns: 3e6,
        back_ns: 1e6,
        jitter_ns: 2e7,
        lost: 0.1,
        burst_once_in: 100.0,
        outage_once_in: 2000.0,
        outage_s: 300.0,
    };
    assert_true_throughout(&clocks, &link, 24.0 * 3600.0, 2.0, random);
}

#[test]
fn a_drift_that_swings_as_fast_as_is_assumed_stays_within_the_uncertainty() {
    for seed in 30_000..30_020 {
        let random = &mut Rng::with_seed(seed);
        let mut clocks = Clocks::random(random);
        clocks.swing_s = magnitude(random, 20.0, 20_000.0);
        clocks.swing_ppb = (49.0 * clocks.swing_s / std::f64::consts::TAU).min(100_000.0);
        clocks.drift_ppb = between(random, -1.0, 1.0) * (198_000.0 - clocks.swing_ppb);
        assert_true_throughout(&clocks, &Link::quiet(), 1000.0, 1.0, random);
    }
}

#[test]
fn a_drift_that_is_corrected_abruptly_stays_within_the_uncertainty_on_the_quickest_link() {
    for seed in 31_000..31_020 {
        let random = &mut Rng::with_seed(seed);
        let mut clocks = Clocks::random(random);
        clocks.tremble_ppb = 990.0;
        clocks.tremble_s = magnitude(random, 2.0, 200.0);
        let mut link = Link::quiet();
        (link.there_ns, link.back_ns, link.jitter_ns) = (50.0, 20.0, 10.0);
        assert_true_throughout(&clocks, &link, 500.0, 1.0, random);
    }
}

#[test]
fn the_uncertainty_bounds_translated_moments_when_the_truth_lies_at_its_very_edge() {
    let clocks = Clocks::steady(0, -199_900.0);
    let mut link = Link::quiet();
    // Only the request takes time, so the offset is the least that is possible.
    (link.there_ns, link.back_ns, link.jitter_ns) = (2e9, 0.0, 0.0);
    let exchange = link.exchanges(&clocks, 1.0, 1.0, &mut Rng::with_seed(1))[0];
    let mut clock = Clock::new();
    clock.take(&exchange).expect("plausible");

    let at = exchange.received;
    let remote = clock.to_remote(at).expect("an estimate");
    assert_eq!(clock.to_local(remote), Some(at));
    let mut truth = at.0;
    for _ in 0..6 {
        truth = (i128::from(remote.0) - clocks.offset_at(truth)) as u64;
    }
    assert_eq!(clocks.remote(truth), remote);
    let uncertainty_ns = clock.estimate(at).expect("an estimate").uncertainty_ns;
    let error_ns = truth.abs_diff(at.0);
    assert!(
        (error_ns..error_ns + 100_000).contains(&uncertainty_ns),
        "{error_ns}, {uncertainty_ns}"
    );
}

#[test]
fn any_time_stamps_of_the_robot_are_taken_or_rejected_without_harm() {
    let random = &mut Rng::with_seed(5);
    let any = |random: &mut Rng| random.u64(..) >> (random.u64(..) % 64);
    let mut clock = Clock::new();
    let (mut taken, mut rejected) = (0, 0);
    for second in 0..50_000 {
        let sent = (second * SECOND) << (second / 40_000 * 12);
        let remote_received = any(random);
        let held_ns = magnitude(random, 1.0, 1e11) as u64;
        let exchange = Exchange {
            sent: MonotonicNs(sent),
            remote_received: RemoteNs(remote_received),
            remote_sent: RemoteNs(remote_received.saturating_add(held_ns)),
            received: MonotonicNs(sent + magnitude(random, 1e3, 3e10) as u64),
            suspended: Suspended {
                remote_ns: any(random) >> 32,
                ..Suspended::default()
            },
        };
        match clock.take(&exchange) {
            Ok(_) => taken += 1,
            Err(_) => rejected += 1,
        }
        for at in [0, any(random), u64::MAX] {
            let _ = clock.estimate(MonotonicNs(at));
            let _ = clock.to_remote(MonotonicNs(at));
            let _ = clock.to_local(RemoteNs(at));
        }
    }
    assert!(taken > 1000 && rejected > 1000, "{taken}, {rejected}");
}
