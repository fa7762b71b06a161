//! Single exchanges: what is rejected, and translation at the edges.

use ipc_types::MonotonicNs;

use crate::clock::{Clock, Exchange, MAX_ROUND_TRIP_NS, MAX_STAMP_NS, Rejected, RemoteNs};

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
