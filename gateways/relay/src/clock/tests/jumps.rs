//! Suspends, reboots and steps of either side.

use fastrand::Rng;
use ipc_types::MonotonicNs;

use super::link::{Clocks, Jump, Link, MS, SECOND, between, magnitude};
use super::truth::assert_true_at;
use crate::clock::{Clock, Exchange, Rejected, RemoteNs};

/// Checks the truth before the jump, and from the first exchange on that was sent after it.
fn assert_noticed(clocks: &Clocks, random: &mut Rng) {
    let link = Link::random(random);
    let jumped = clocks.jumped_at().expect("a jump");
    let began = match clocks.jump {
        Jump::RemoteSuspend { at, .. } | Jump::RemoteReboot { at, .. } => at,
        _ => jumped,
    };
    let duration_s = (jumped - clocks.start_ns) as f64 / 1e9 + 60.0;
    let mut clock = Clock::new();
    let (mut before, mut after) = (false, false);
    for exchange in link.exchanges(clocks, duration_s, 0.5, random) {
        let at = exchange.received.0;
        let taken = clock.take(&exchange);
        if at < began {
            before |= taken.is_ok();
            assert_true_at(&clock, clocks, at, &link);
        }
        after |= exchange.sent.0 >= jumped && taken.is_ok();
        if after {
            assert_true_at(&clock, clocks, at, &link);
            assert_true_at(&clock, clocks, at + SECOND, &link);
        }
    }
    if before && after {
        assert_eq!(clock.resets(), 1, "{clocks:?}, {link:?}");
    }
}

#[test]
fn every_suspend_and_reboot_is_noticed_by_the_first_exchange_after_it() {
    for seed in 40_000..42_000 {
        let random = &mut Rng::with_seed(seed);
        let mut clocks = Clocks::random(random);
        let at = clocks.start_ns + between(random, 1e9, 60e9) as u64;
        let lasts_ns = magnitude(random, 6e6, 1e12) as u64;
        clocks.jump = match seed % 3 {
            0 => Jump::LocalSuspend { at, lasts_ns },
            1 => Jump::RemoteSuspend { at, lasts_ns },
            _ => Jump::RemoteReboot {
                at,
                lasts_ns: lasts_ns.max(11 * SECOND),
            },
        };
        assert_noticed(&clocks, random);
    }
}

#[test]
fn a_step_that_is_less_than_a_round_trip_is_noticed_within_seconds() {
    for seed in 50_000..50_300 {
        let random = &mut Rng::with_seed(seed);
        let mut clocks = Clocks::random(random);
        let size_ns = between(random, 30e6, 200e6) as i128;
        let by_ns = if seed % 2 == 0 { size_ns } else { -size_ns };
        let at = clocks.start_ns + between(random, 20e9, 600e9) as u64;
        clocks.jump = Jump::RemoteStep { at, by_ns };
        let mut link = Link::quiet();
        // The way is longer than the step, and wavers by less than a third of it.
        link.there_ns = between(random, 1.0, 3.0) * size_ns as f64;
        link.back_ns = between(random, 1.0, 3.0) * size_ns as f64;
        link.jitter_ns = size_ns as f64 / 8.0;
        let mut clock = Clock::new();
        for exchange in link.exchanges(&clocks, 900.0, 0.5, random) {
            let _ = clock.take(&exchange);
            let received = exchange.received.0;
            if received < at || received > at + 5 * SECOND {
                assert_true_at(&clock, &clocks, received, &link);
            }
        }
        assert_eq!(clock.resets(), 1, "{clocks:?}, {link:?}");
    }
}

#[test]
fn a_way_that_becomes_longer_or_shorter_in_one_direction_is_no_step() {
    for seed in 51_000..51_300 {
        let random = &mut Rng::with_seed(seed);
        let mut clocks = Clocks::random(random);
        let mut clock = Clock::new();
        for _ in 0..5 {
            let mut link = Link::quiet();
            let (changed, same) = (magnitude(random, 1e6, 5e8), 1e7);
            (link.there_ns, link.back_ns) = match seed % 2 {
                0 => (changed, same),
                _ => (same, changed),
            };
            link.jitter_ns = magnitude(random, 1e5, 1e8);
            let mut last = clocks.start_ns;
            for exchange in link.exchanges(&clocks, 120.0, 0.5, random) {
                let _ = clock.take(&exchange);
                last = exchange.received.0;
                assert_true_at(&clock, &clocks, last, &link);
            }
            // The clocks go on, and the way is another one.
            clocks.offset_ns = clocks.offset_at(last);
            clocks.start_ns = last;
        }
        assert_eq!(clock.resets(), 0, "{clocks:?}");
    }
}

/// One exchange per second with delays of 1 ms, beginning at 1000 s.
fn exchange(second: u64, offset_ns: i64) -> Exchange {
    let sent = (1000 + second) * SECOND;
    let remote = |local: u64| RemoteNs(local.saturating_add_signed(offset_ns));
    Exchange {
        sent: MonotonicNs(sent),
        remote_received: remote(sent + MS),
        remote_sent: remote(sent + 2 * MS),
        received: MonotonicNs(sent + 3 * MS),
        ..Exchange::default()
    }
}

fn clock_at_offset_0() -> Clock {
    let mut clock = Clock::new();
    for second in 0..10 {
        clock.take(&exchange(second, 0)).expect("plausible");
    }
    assert_eq!(clock.resets(), 0);
    let estimate = clock.estimate(MonotonicNs(1010 * SECOND));
    assert_eq!(estimate.expect("an estimate").round_trip_ns, 2 * MS);
    clock
}

#[test]
fn a_step_beyond_the_uncertainty_begins_anew_with_the_exchange_that_shows_it() {
    for step_ns in [-900_000_000_000, -3_000_000, 3_000_000, 3_600_000_000_000] {
        let mut clock = clock_at_offset_0();
        let contradicting = exchange(10, step_ns);
        clock.take(&contradicting).expect("plausible");
        assert_eq!(clock.resets(), 1);
        let estimate = clock.estimate(contradicting.received).expect("an estimate");
        assert!(estimate.offset_ns.abs_diff(step_ns) <= 1000);
        clock.take(&exchange(11, step_ns)).expect("plausible");
        assert_eq!(clock.resets(), 1);
    }
}

#[test]
fn exchanges_from_before_a_jump_that_come_late_are_superseded() {
    let mut clock = clock_at_offset_0();
    let mut late = exchange(10, 0);
    late.received.0 += 2 * SECOND;
    clock
        .take(&exchange(11, 500_000_000_000))
        .expect("plausible");
    assert_eq!(clock.take(&late), Err(Rejected::Superseded));
    assert_eq!(clock.resets(), 1);
}

#[test]
fn a_suspend_of_the_robot_that_contradicts_nothing_is_noticed_by_its_suspended_time() {
    let mut clock = clock_at_offset_0();
    let mut slow = exchange(10, 0);
    slow.received.0 += SECOND;
    slow.suspended.remote_ns = 20 * MS;
    clock.take(&slow).expect("plausible");
    assert_eq!(clock.resets(), 1);
}

#[test]
fn reading_errors_of_the_suspended_time_change_nothing() {
    let mut clock = clock_at_offset_0();
    for second in 10..30 {
        let mut noisy = exchange(second, 0);
        noisy.suspended.remote_ns = second % 5 * MS;
        noisy.suspended.at_sent_ns = second % 4 * MS;
        noisy.suspended.at_received_ns = second % 3 * MS;
        clock.take(&noisy).expect("plausible");
    }
    assert_eq!(clock.resets(), 0);
}

#[test]
fn a_suspend_of_the_station_during_an_exchange_discards_the_estimate() {
    let mut clock = clock_at_offset_0();
    let mut torn = exchange(10, 0);
    torn.suspended.at_received_ns = SECOND;
    assert_eq!(clock.take(&torn), Err(Rejected::SuspendedMeanwhile));
    assert_eq!(clock.estimate(torn.received), None);
    assert_eq!(clock.to_local(RemoteNs(5)), None);
    assert_eq!(clock.to_remote(MonotonicNs(5)), None);
    assert_eq!(clock.resets(), 1);

    let mut next = exchange(11, 1_000_000_000);
    next.suspended.at_sent_ns = SECOND;
    next.suspended.at_received_ns = SECOND;
    clock.take(&next).expect("plausible");
    assert_eq!(clock.resets(), 1);
}

#[test]
fn a_reply_to_a_request_from_before_a_jump_shows_the_next_suspend_of_the_robot() {
    let slept = |second, suspended_ns| {
        let mut exchange = exchange(second, 0);
        exchange.suspended.remote_ns = suspended_ns;
        exchange
    };
    let mut clock = clock_at_offset_0();
    let begun = slept(11, 5 * SECOND);
    clock.take(&begun).expect("plausible");
    assert_eq!(clock.resets(), 1);
    // What it answered before that suspend says nothing, and what it answered since then neither.
    for known_ns in [0, 5 * SECOND + 1] {
        let late = slept(10, known_ns);
        assert_eq!(clock.take(&late), Err(Rejected::Superseded));
        assert!(clock.estimate(begun.received).is_some());
    }
    let mut late = slept(10, 8 * SECOND);
    late.received.0 += 4 * SECOND;
    assert_eq!(clock.take(&late), Err(Rejected::Superseded));
    assert_eq!(clock.estimate(late.received), None);
    assert_eq!(clock.resets(), 2);
    clock.take(&slept(15, 8 * SECOND)).expect("plausible");
    assert_eq!(clock.resets(), 2);
}

#[test]
fn a_reset_discards_the_estimate_and_the_exchanges_under_way() {
    let mut clock = clock_at_offset_0();
    clock.reset(MonotonicNs(1011 * SECOND));
    assert_eq!(clock.estimate(MonotonicNs(1011 * SECOND)), None);
    assert_eq!(clock.resets(), 1);
    assert_eq!(clock.take(&exchange(10, 0)), Err(Rejected::Superseded));
    assert!(clock.take(&exchange(11, 7)).is_ok());
    assert_eq!(clock.resets(), 1);
}
