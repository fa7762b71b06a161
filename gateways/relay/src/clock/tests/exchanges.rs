//! How small the uncertainty gets, which exchanges are rejected, and translation at the edges.

use fastrand::Rng;
use ipc_types::MonotonicNs;

use super::link::{Clocks, Link, MS, SECOND};
use super::truth::assert_true_at;
use crate::clock::{
    Clock, Estimate, Exchange, MAX_ROUND_TRIP_NS, MAX_STAMP_NS, Rejected, RemoteNs,
};

fn after(exchanges: &[Exchange]) -> (Clock, Estimate) {
    let mut clock = Clock::new();
    for exchange in exchanges {
        clock.take(exchange).expect("a plausible exchange");
    }
    let last = exchanges.last().expect("an exchange").received;
    let estimate = clock.estimate(last).expect("an estimate");
    (clock, estimate)
}

#[test]
fn the_uncertainty_after_one_exchange_is_half_its_round_trip() {
    let clocks = Clocks::steady(5, 0.0);
    let exchanges = Link::quiet().exchanges(&clocks, 1.0, 1.0, &mut Rng::with_seed(1));
    let (_, estimate) = after(&exchanges);
    let half_ns = estimate.round_trip_ns / 2;
    // The exchange takes up to 10.4 ms, in which 200 ppm make 2 µs.
    assert!((half_ns..half_ns + 2_200).contains(&estimate.uncertainty_ns));
}

#[test]
fn quiet_symmetric_delays_of_200_us_give_an_uncertainty_of_the_best_one_way_delay() {
    let clocks = Clocks::steady(3_600_000_000_000, -80_000.0);
    let exchanges = Link::quiet().exchanges(&clocks, 120.0, 1.0, &mut Rng::with_seed(2));
    let (_, estimate) = after(&exchanges);
    assert!(estimate.uncertainty_ns < 210_000, "{estimate:?}");
    assert!(estimate.drift_ppb.abs_diff(-80_000) <= estimate.drift_uncertainty_ppb);
    assert!(estimate.drift_uncertainty_ppb < 12_000, "{estimate:?}");
}

#[test]
fn slow_exchanges_do_not_spoil_what_quick_ones_have_shown() {
    let clocks = Clocks::steady(-1_000_000_000, 60_000.0);
    let random = &mut Rng::with_seed(3);
    let mut exchanges = Link::quiet().exchanges(&clocks, 120.0, 1.0, random);
    let mut slow = Link::quiet();
    slow.jitter_ns = 1e9;
    // From now on one in ten is quick.
    for second in 120..240 {
        let link = if second % 10 == 0 {
            &Link::quiet()
        } else {
            &slow
        };
        let mut later = clocks.clone();
        later.start_ns += second * SECOND;
        later.offset_ns = clocks.offset_at(later.start_ns);
        exchanges.extend(link.exchanges(&later, 1.0, 1.0, random));
    }
    let (clock, estimate) = after(&exchanges);
    assert!(estimate.uncertainty_ns < 300_000, "{estimate:?}");
    assert_true_at(&clock, &clocks, exchanges[239].received.0, &"");
}

#[test]
fn the_uncertainty_grows_while_no_exchange_comes() {
    let clocks = Clocks::steady(0, 90_000.0);
    let exchanges = Link::quiet().exchanges(&clocks, 120.0, 1.0, &mut Rng::with_seed(4));
    let (clock, at_once) = after(&exchanges);
    let last = exchanges[119].received.0;
    let uncertainty_after = |seconds: u64| {
        let at = last + seconds * SECOND;
        assert_true_at(&clock, &clocks, at, &seconds);
        let estimate = clock.estimate(MonotonicNs(at)).expect("an estimate");
        estimate.uncertainty_ns
    };
    assert_eq!(uncertainty_after(0), at_once.uncertainty_ns);
    // Drift known to ± 10 ppm, changing by 50 ppb/s.
    assert!((250_000..400_000).contains(&uncertainty_after(10)));
    assert!((5 * MS / 10..2 * MS).contains(&uncertainty_after(60)));
    // In the end it is ± 200 ppm about a middle of 90 ppm, which is cut off at 200 ppm.
    let an_hour = uncertainty_after(3601) - uncertainty_after(3600);
    assert!((100_000..200_000).contains(&an_hour), "{an_hour}");
    let late = uncertainty_after(100_001) - uncertainty_after(100_000);
    assert!((200_000..200_100).contains(&late), "{late}");
}

#[test]
fn the_estimate_survives_an_outage_of_half_an_hour() {
    let clocks = Clocks::steady(0, 90_000.0);
    let random = &mut Rng::with_seed(6);
    let mut exchanges = Link::quiet().exchanges(&clocks, 120.0, 1.0, random);
    let mut later = clocks.clone();
    later.start_ns += 1920 * SECOND;
    later.offset_ns = clocks.offset_at(later.start_ns);
    exchanges.extend(Link::quiet().exchanges(&later, 1.0, 1.0, random));
    let (clock, estimate) = after(&exchanges);
    assert_eq!(clock.resets(), 0);
    assert!(estimate.uncertainty_ns < 230_000, "{estimate:?}");
}

#[test]
fn the_shown_round_trip_is_the_shortest_of_the_last_minute() {
    let clocks = Clocks::steady(0, 0.0);
    let random = &mut Rng::with_seed(7);
    let mut exchanges = Link::quiet().exchanges(&clocks, 20.0, 1.0, random);
    let (_, quick) = after(&exchanges);
    assert!((360_000..400_000).contains(&quick.round_trip_ns));

    let mut slow = Link::quiet();
    slow.there_ns = 5e6;
    let mut later = clocks.clone();
    later.start_ns += 20 * SECOND;
    exchanges.extend(slow.exchanges(&later, 40.0, 1.0, random));
    assert_eq!(after(&exchanges).1.round_trip_ns, quick.round_trip_ns);
    exchanges.extend(slow.exchanges(&later, 80.0, 1.0, random));
    assert!(after(&exchanges).1.round_trip_ns > 5_000_000);
}

fn exchange(sent: u64, remote_received: u64, remote_sent: u64, received: u64) -> Exchange {
    Exchange {
        sent: MonotonicNs(sent),
        remote_received: RemoteNs(remote_received),
        remote_sent: RemoteNs(remote_sent),
        received: MonotonicNs(received),
        ..Exchange::default()
    }
}

#[test]
fn what_cannot_be_is_rejected_and_changes_nothing() {
    let second = 1_000_000_000;
    let cases = [
        (exchange(9, 50, 60, 8), Rejected::LocalBackwards),
        (exchange(5, 60, 59, 80), Rejected::RemoteBackwards),
        (exchange(5, 50, 80, 30), Rejected::HeldTooLong),
        (
            exchange(5, 0, 1_000_300_000, 5 + second),
            Rejected::HeldTooLong,
        ),
        (
            exchange(5, 50, 60, 6 + MAX_ROUND_TRIP_NS),
            Rejected::TooSlow,
        ),
        (exchange(5, 50, MAX_STAMP_NS + 1, 30), Rejected::OutOfRange),
        (exchange(5, u64::MAX, 1, 30), Rejected::OutOfRange),
    ];
    for (exchange, rejected) in cases {
        let mut clock = Clock::new();
        assert_eq!(clock.take(&exchange), Err(rejected));
        assert_eq!(clock.estimate(MonotonicNs(0)), None);
    }
}

#[test]
fn a_hold_that_drift_makes_seem_longer_than_the_exchange_is_taken() {
    let second = 1_000_000_000;
    let mut clock = Clock::new();
    clock
        .take(&exchange(5, 0, second + 150_000, 5 + second))
        .expect("plausible");
    let end = clock
        .estimate(MonotonicNs(5 + second))
        .expect("an estimate");
    assert_eq!(end.round_trip_ns, 0);
    // It rose by 150 µs at least, and by 200 µs at most.
    assert!((174_900..175_100).contains(&end.offset_ns));
    assert!((25_000..25_100).contains(&end.uncertainty_ns));
}

#[test]
fn the_longest_round_trip_and_the_greatest_stamp_are_taken() {
    let sent = MAX_STAMP_NS - MAX_ROUND_TRIP_NS;
    let mut clock = Clock::new();
    assert!(clock.take(&exchange(sent, 0, 0, MAX_STAMP_NS)).is_ok());
    let estimate = clock.estimate(MonotonicNs(sent)).expect("an estimate");
    assert!(estimate.uncertainty_ns >= MAX_ROUND_TRIP_NS / 2);
}

#[test]
fn before_the_first_exchange_nothing_is_known() {
    let clock = Clock::new();
    assert_eq!(clock.estimate(MonotonicNs(1)), None);
    assert_eq!(clock.to_local(RemoteNs(1)), None);
    assert_eq!(clock.to_remote(MonotonicNs(1)), None);
    assert_eq!(clock.resets(), 0);
}

#[test]
fn translated_moments_saturate_at_the_ends_of_the_clocks() {
    let second = 1_000_000_000;
    let mut behind = Clock::new();
    behind
        .take(&exchange(100 * second, 50, 60, 100 * second + 100))
        .expect("plausible");
    assert_eq!(behind.to_remote(MonotonicNs(second)), Some(RemoteNs(0)));
    assert_eq!(
        behind.to_local(RemoteNs(u64::MAX)),
        Some(MonotonicNs(u64::MAX))
    );

    let mut ahead = Clock::new();
    ahead
        .take(&exchange(0, 100 * second, 100 * second + 10, 100))
        .expect("plausible");
    assert_eq!(ahead.to_local(RemoteNs(second)), Some(MonotonicNs(0)));
    assert_eq!(
        ahead.to_remote(MonotonicNs(u64::MAX)),
        Some(RemoteNs(u64::MAX))
    );
}

#[test]
fn an_exchange_that_comes_twice_changes_nothing() {
    let mut clock = Clock::new();
    for start in [0, 1_000_000_000, 2_000_000_000] {
        let exchange = exchange(start, start + 70, start + 90, start + 200);
        clock.take(&exchange).expect("plausible");
        let once = clock.estimate(exchange.received);
        clock.take(&exchange).expect("plausible");
        assert_eq!(clock.estimate(exchange.received), once);
    }
}
