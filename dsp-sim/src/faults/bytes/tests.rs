//! For each damage: what goes in, what comes out, and when.

use super::*;

fn ms(count: u64) -> Duration {
    Duration::from_millis(count)
}

fn stage(faults: &[(Window, Damage)]) -> ByteStage {
    let mut stage = ByteStage::default();
    for (number, (window, damage)) in faults.iter().enumerate() {
        stage.add(*window, *damage, Random::new(7, number as u64));
    }
    stage
}

fn one(window: Window, damage: Damage) -> ByteStage {
    stage(&[(window, damage)])
}

/// Sends one byte each millisecond from zero on; gives all that comes out, with the times in microseconds.
fn pass(stage: &mut ByteStage, bytes: impl IntoIterator<Item = u8>) -> Vec<(u128, u8)> {
    for (number, byte) in bytes.into_iter().enumerate() {
        stage.enter(ms(number as u64), byte);
    }
    std::iter::from_fn(|| stage.leave(Duration::MAX))
        .map(|(due, byte)| (due.as_micros(), byte))
        .collect()
}

/// As [`pass`], without the times.
fn bytes_after(stage: &mut ByteStage, bytes: impl IntoIterator<Item = u8>) -> Vec<u8> {
    let passed = pass(stage, bytes);
    passed.into_iter().map(|(_, byte)| byte).collect()
}

fn repeated(byte: u8, count: usize) -> impl Iterator<Item = u8> {
    std::iter::repeat_n(byte, count)
}

#[test]
fn without_faults_every_byte_leaves_as_it_comes() {
    let mut stage = ByteStage::default();
    let expected: Vec<(u128, u8)> = (0..=255)
        .map(|byte| (u128::from(byte) * 1_000, byte))
        .collect();
    assert_eq!(pass(&mut stage, 0..=255), expected);
    assert_eq!(stage.counters(), ByteCounters::default());
}

#[test]
fn a_byte_leaves_no_earlier_than_it_is_due() {
    let delay = Damage::Delay {
        delay: ms(5),
        jitter: Duration::ZERO,
    };
    let mut stage = one(Window::ALWAYS, delay);
    stage.enter(ms(10), 1);
    assert_eq!(stage.next_deadline(), Some(ms(15)));
    assert_eq!(stage.leave(ms(14)), None);
    assert_eq!(stage.waiting(), 1);
    assert_eq!(stage.leave(ms(15)), Some((ms(15), 1)));
    assert_eq!((stage.next_deadline(), stage.waiting()), (None, 0));
}

#[test]
fn bits_are_flipped_at_their_rate_and_within_the_window() {
    let window = Window::between(ms(1_000), ms(11_000));
    let flips = Damage::FlipBits {
        bit_error_rate: 0.01,
    };
    let mut stage = one(window, flips);
    let after = bytes_after(&mut stage, repeated(0x55, 12_000));
    assert_eq!(after.len(), 12_000);
    let flipped = |range: std::ops::Range<usize>| -> u32 {
        after[range]
            .iter()
            .map(|byte| (byte ^ 0x55).count_ones())
            .sum()
    };
    assert_eq!((flipped(0..1_000), flipped(11_000..12_000)), (0, 0));
    let count = flipped(1_000..11_000);
    assert_eq!(stage.counters().flipped_bits, u64::from(count));
    // 80 000 bits: 800, and a standard deviation of 28.
    assert!((660..940).contains(&count), "{count}");

    let all = Damage::FlipBits {
        bit_error_rate: 1.0,
    };
    assert_eq!(bytes_after(&mut one(Window::ALWAYS, all), [0x0F]), [0xF0]);
}

#[test]
fn bytes_are_dropped_at_their_rate() {
    let mut stage = one(Window::ALWAYS, Damage::Drop { rate: 0.1 });
    let after = bytes_after(&mut stage, repeated(1, 10_000));
    let dropped = stage.counters().dropped;
    assert_eq!(after.len() as u64 + dropped, 10_000);
    assert!((850..1_150).contains(&dropped), "{dropped}");
    for (rate, left) in [(0.0, 100), (1.0, 0)] {
        let mut stage = one(Window::ALWAYS, Damage::Drop { rate });
        assert_eq!(bytes_after(&mut stage, repeated(1, 100)).len(), left);
    }
}

#[test]
fn duplicates_follow_their_byte_at_once() {
    let window = Window::between(ms(1), ms(2));
    let mut stage = one(window, Damage::Duplicate { rate: 1.0 });
    let after = pass(&mut stage, [10, 20, 30]);
    assert_eq!(after, [(0, 10), (1_000, 20), (1_000, 20), (2_000, 30)]);
    assert_eq!(stage.counters().duplicated, 1);
}

#[test]
fn inserted_bytes_come_before_their_byte() {
    let mut stage = one(Window::ALWAYS, Damage::Insert { rate: 0.5 });
    let after = bytes_after(&mut stage, 0..100);
    let inserted = stage.counters().inserted;
    assert_eq!(after.len() as u64, 100 + inserted);
    assert!((25..75).contains(&inserted), "{inserted}");
    // What was sent is still there, in its order.
    let mut left = after.iter();
    assert!((0..100).all(|byte| left.any(|other| *other == byte)));
}

#[test]
fn what_becomes_of_one_byte_is_bounded() {
    let many = [(Window::ALWAYS, Damage::Duplicate { rate: 1.0 }); 40];
    let mut stage = stage(&many);
    assert_eq!(bytes_after(&mut stage, [7]), [7; MAX_FROM_ONE]);
    assert_eq!(stage.counters().duplicated, MAX_FROM_ONE as u64 - 1);
}

#[test]
fn delays_keep_the_order_and_lie_between_their_bounds() {
    let delay = Damage::Delay {
        delay: ms(20),
        jitter: ms(10),
    };
    let mut stage = one(Window::between(ms(100), ms(200)), delay);
    let after = pass(&mut stage, 0..=255);
    let mut previous_us = 0;
    for (number, (left_us, byte)) in after.iter().enumerate() {
        let entered_us = number as u128 * 1_000;
        assert_eq!(usize::from(*byte), number, "the order");
        assert!(*left_us >= previous_us);
        let late_us = left_us - entered_us;
        match number {
            100..200 => assert!((20_000..30_000).contains(&late_us), "{number}: {late_us}"),
            // Those right after the window wait for those before them.
            200..230 => assert!(late_us < 30_000),
            _ => assert_eq!(late_us, 0, "{number}"),
        }
        previous_us = *left_us;
    }
    assert_eq!(stage.counters().delayed, 100);
    let distinct: std::collections::BTreeSet<_> = after[100..200].iter().collect();
    assert!(distinct.len() > 50, "they jitter");
}

#[test]
fn delays_add_up() {
    let delay = |count| Damage::Delay {
        delay: ms(count),
        jitter: Duration::ZERO,
    };
    let mut stage = stage(&[(Window::ALWAYS, delay(3)), (Window::ALWAYS, delay(4))]);
    assert_eq!(pass(&mut stage, [1]), [(7_000, 1)]);
}

#[test]
fn pieces_are_no_longer_than_they_may_be_and_apart_by_the_pause() {
    let split = Damage::Split {
        chunk_bytes: 5,
        gap: ms(3),
    };
    let mut stage = one(Window::ALWAYS, split);
    for byte in 0..=255 {
        stage.enter(ms(100), byte);
    }
    let mut pieces: Vec<(Duration, usize)> = Vec::new();
    let mut expected = 0..=255;
    while let Some((due, byte)) = stage.leave(Duration::MAX) {
        assert_eq!(Some(byte), expected.next());
        match pieces.last_mut() {
            Some((last, length)) if *last == due => *length += 1,
            _ => pieces.push((due, 1)),
        }
    }
    assert_eq!(expected.next(), None);
    assert_eq!(stage.counters().pieces, pieces.len() as u64);
    let lengths: std::collections::BTreeSet<usize> =
        pieces.iter().map(|(_, length)| *length).collect();
    // The last piece may be cut short; all lengths occur anyway.
    assert_eq!(lengths, (1..=5).collect());
    for pair in pieces.windows(2) {
        assert_eq!(pair[1].0 - pair[0].0, ms(3));
    }
}

#[test]
fn a_burst_replaces_a_run_of_its_length() {
    let burst = Damage::Burst {
        rate: 1.0,
        length_bytes: 40,
    };
    // It begins with the first byte of the window and goes on for its length, as long as the window lasts.
    let mut stage = one(Window::between(ms(10), ms(60)), burst);
    let after = bytes_after(&mut stage, repeated(0, 100));
    assert_eq!(after.len(), 100);
    let counters = stage.counters();
    assert_eq!((counters.bursts, counters.burst_bytes), (2, 50));
    assert!(
        after[..10]
            .iter()
            .chain(&after[60..])
            .all(|byte| *byte == 0)
    );
    assert!(after[10..60].iter().filter(|byte| **byte != 0).count() > 40);

    let rare = Damage::Burst {
        rate: 0.01,
        length_bytes: 10,
    };
    let mut stage = one(Window::ALWAYS, rare);
    bytes_after(&mut stage, repeated(0, 10_000));
    let counters = stage.counters();
    // One starts after 100 sound bytes on average and lasts 10.
    assert!((60..125).contains(&counters.bursts), "{counters:?}");
    assert!(counters.burst_bytes.abs_diff(10 * counters.bursts) < 10);
}

#[test]
fn a_stall_holds_bytes_up_and_lets_them_pass_at_its_end() {
    let stall = |then| {
        (
            Window::between(ms(2), ms(5)).every(ms(10)),
            Damage::Stall { then },
        )
    };
    let mut passing = stage(&[stall(AfterStall::Pass)]);
    let times: Vec<u128> = pass(&mut passing, 0..15)
        .into_iter()
        .map(|(left_us, _)| left_us / 1_000)
        .collect();
    assert_eq!(times, [0, 1, 5, 5, 5, 5, 6, 7, 8, 9, 10, 11, 15, 15, 15]);
    assert_eq!(passing.counters().stalled, 6);

    let mut dropping = stage(&[stall(AfterStall::Drop)]);
    let after = bytes_after(&mut dropping, 0..15);
    assert_eq!(after, [0, 1, 5, 6, 7, 8, 9, 10, 11]);
    assert_eq!(dropping.counters().stall_dropped, 6);
}

#[test]
fn a_stall_also_holds_up_what_entered_before_it() {
    let delay = Damage::Delay {
        delay: ms(10),
        jitter: Duration::ZERO,
    };
    let stall = Damage::Stall {
        then: AfterStall::Pass,
    };
    let mut stage = stage(&[
        (Window::between(ms(0), ms(1)), delay),
        (Window::between(ms(5), ms(20)), stall),
    ]);
    assert_eq!(pass(&mut stage, [1, 2]), [(20_000, 1), (20_000, 2)]);
}

#[test]
fn stalls_follow_each_other_in_the_order_of_the_script() {
    let stall = |from, until| {
        let then = AfterStall::Pass;
        (Window::between(ms(from), ms(until)), Damage::Stall { then })
    };
    let mut stage = stage(&[stall(0, 10), stall(10, 15)]);
    assert_eq!(pass(&mut stage, [1]), [(15_000, 1)]);
}

#[test]
fn an_outage_loses_everything() {
    let mut stage = one(Window::between(ms(3), ms(7)), Damage::Outage);
    assert_eq!(bytes_after(&mut stage, 0..10), [0, 1, 2, 7, 8, 9]);
    assert_eq!(stage.counters().outage_dropped, 4);
    let mut for_ever = one(Window::since(ms(3)), Damage::Outage);
    assert_eq!(bytes_after(&mut for_ever, 0..10), [0, 1, 2]);
}

#[test]
fn the_queue_is_bounded_and_the_newest_are_lost() {
    let stall = Damage::Stall {
        then: AfterStall::Pass,
    };
    let end = Duration::from_secs(1_000);
    let mut stage = one(Window::between(Duration::ZERO, end), stall);
    for number in 0..QUEUE_PLACES + 100 {
        stage.enter(Duration::from_micros(number as u64), (number % 251) as u8);
    }
    assert_eq!(stage.waiting(), QUEUE_PLACES);
    assert_eq!(stage.counters().overflowed, 100);
    assert_eq!(stage.leave(end), Some((end, 0)), "the oldest is kept");
    stage.enter(end, 9);
    assert_eq!(stage.waiting(), QUEUE_PLACES, "and there is room again");
}
