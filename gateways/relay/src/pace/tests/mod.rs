//! What the pace decides, by itself and with a station at the other end of a narrow link.

mod station;

use super::*;

const fn at(ms: u64) -> MonotonicNs {
    MonotonicNs(ms * 1_000_000)
}

/// A link that carries so many bytes a second, in the order in which they were sent, and keeps what waits up to a
/// bound.
struct Narrow {
    bytes_per_s: u64,
    keeps: Duration,
    free: MonotonicNs,
}

impl Narrow {
    fn new(bytes_per_s: u64) -> Narrow {
        Narrow {
            bytes_per_s,
            keeps: Duration::MAX,
            free: at(0),
        }
    }

    /// By how much later something arrives that is sent now, ms.
    fn late_ms(&self, now: MonotonicNs) -> u32 {
        self.free.since(now).as_millis() as u32
    }
}

/// Sends a sample of `len` bytes every `period` ms over the link for four minutes. `way_ms` says by how much longer its
/// way is at each ms than at its shortest one of the last minute. Returns the bytes that went out in each second, and
/// all delays that a station told, ms, from the first one on.
fn fly(
    mut link: Narrow,
    len: usize,
    period: u64,
    mut way_ms: impl FnMut(u64) -> u32,
) -> (Vec<u64>, Vec<u32>) {
    let (mut pace, mut passed, mut delays) = (Pace::default(), vec![0; 240], Vec::new());
    for ms in 0..240_000 {
        let now = at(ms);
        if ms % 500 == 0 {
            let late_ms = link.late_ms(now) + way_ms(ms);
            pace.note_exchange(7, Some(late_ms), now);
            delays.push(late_ms);
        }
        if ms % period > 0 {
            continue;
        }
        if !pace.is_open(now) {
            pace.hold();
        } else {
            pace.spend(len, now);
            let bytes = len as u64 + OVERHEAD;
            let takes = Duration::from_nanos(bytes * 1_000_000_000 / link.bytes_per_s);
            passed[ms as usize / 1000] += bytes;
            if link.free.since(now) < link.keeps {
                link.free = link.free.max(now) + takes;
            }
        }
    }
    (passed, delays)
}

/// Sends a sample of `len` bytes every 2 ms over the link. Returns what passed in the second minute, bytes a second,
/// and the delays that a station told in two minutes, ms.
fn flood(bytes_per_s: u64, len: usize) -> (u64, Vec<u32>) {
    let (passed, delays) = fly(Narrow::new(bytes_per_s), len, 2, |_| 0);
    (mean(&passed[60..120]), delays[..240].to_vec())
}

fn mean(of: &[u64]) -> u64 {
    of.iter().sum::<u64>() / of.len() as u64
}

/// Bytes a second of a robot's topics.
const ALL: u64 = 34_000;

#[test]
fn a_way_that_becomes_longer_for_good_costs_telemetry_for_seconds_there_and_back() {
    for longer_ms in [150, 310, 400, 500, 990, 1200, 3000] {
        for jitter_ms in [0, 20, 60, 200] {
            let mut random = fastrand::Rng::with_seed(longer_ms.into());
            // There at 30 s, back at 100 s, and there again.
            let way_ms = |ms| {
                let is_long = (30_000..100_000).contains(&ms) || ms >= 170_000;
                u32::from(is_long) * longer_ms + random.u32(0..=jitter_ms)
            };
            // 680 bytes in 20 ms.
            let len = 680 - OVERHEAD as usize;
            let (passed, _) = fly(Narrow::new(10_000_000), len, 20, way_ms);
            let case = format!("{longer_ms} ms, jitter {jitter_ms} ms");
            let after_s = 8 + 4 * u64::from(longer_ms) / 1000;
            for step_s in [30, 100, 170] {
                let from = step_s + after_s as usize;
                let after = &passed[from..step_s + 60];
                let least = if jitter_ms < PROMPT_MS {
                    ALL
                } else {
                    ALL * 9 / 10
                };
                assert!(mean(after) >= least, "{case}, at {step_s} s: {passed:?}");
            }
        }
    }
}

#[test]
fn a_narrow_link_whose_way_becomes_longer_is_filled_as_before() {
    for bytes_per_s in [8_000, 32_000] {
        for longer_ms in [310, 1200] {
            let way_ms = |ms| if ms >= 60_000 { longer_ms } else { 0 };
            let (passed, delays) = fly(Narrow::new(bytes_per_s), 300, 2, way_ms);
            let case = format!("{bytes_per_s}, {longer_ms} ms: {passed:?} {delays:?}");
            assert!(mean(&passed[90..]) > bytes_per_s / 2, "{case}");
            let mut delays = delays[180..].to_vec();
            delays.sort_unstable();
            let waited_ms = delays[delays.len() / 2] - longer_ms;
            assert!(waited_ms < 400, "{case}");
        }
    }
}

#[test]
fn round_trips_that_waver_and_some_that_are_repeated_after_a_second_cost_little() {
    let mut random = fastrand::Rng::with_seed(1);
    let len = 680 - OVERHEAD as usize;
    for wavers_ms in [200, 400, 600, 800] {
        let (passed, _) = fly(Narrow::new(10_000_000), len, 20, |_| {
            random.u32(0..=wavers_ms)
        });
        assert!(
            mean(&passed[40..]) > ALL * 9 / 10,
            "{wavers_ms} ms: {passed:?}"
        );
    }
    for lost_percent in [2, 5, 10] {
        let way_ms = |_| u32::from(random.u32(0..100) < lost_percent) * 1000;
        let (passed, _) = fly(Narrow::new(10_000_000), len, 20, way_ms);
        assert!(
            mean(&passed[40..]) > ALL * 3 / 4,
            "{lost_percent} %: {passed:?}"
        );
    }
}

#[test]
fn what_waits_in_a_full_buffer_is_not_taken_for_the_way() {
    for bytes_per_s in [8_000, 32_000] {
        for keeps_ms in [350, 700, 1500] {
            let mut link = Narrow::new(bytes_per_s);
            link.keeps = Duration::from_millis(keeps_ms);
            let (_, mut delays) = fly(link, 300, 2, |_| 0);
            let late = delays.split_off(120);
            let many = late.iter().filter(|late_ms| **late_ms >= LATE_MS).count();
            assert!(
                many < late.len() / 3,
                "{bytes_per_s}, {keeps_ms} ms: {late:?}"
            );
        }
    }
}

#[test]
fn a_link_that_is_too_slow_is_filled_and_hardly_anything_waits_on_it() {
    for bytes_per_s in [8_000, 32_000, 125_000] {
        let (passed, delays) = flood(bytes_per_s, 300);
        let mut delays = delays[120..].to_vec();
        delays.sort_unstable();
        let median = delays[delays.len() / 2];
        assert!(median < LATE_MS, "{bytes_per_s}: {median} ms");
        assert!(passed > bytes_per_s / 2, "{bytes_per_s}: {passed}");
    }
}

#[test]
fn a_link_that_takes_everything_is_not_paced() {
    let (passed, delays) = flood(10_000_000, 300);
    assert_eq!(passed, 420 * 500);
    assert!(delays.iter().all(|late_ms| *late_ms == 0));
}

#[test]
fn a_link_begins_with_little_and_what_it_does_not_carry_waits_for_less_than_a_second() {
    for bytes_per_s in [8_000, 32_000, 125_000] {
        let (_, delays) = flood(bytes_per_s, 300);
        let longest = delays[..20].iter().max().unwrap();
        assert!(*longest < 1000, "{bytes_per_s}: {delays:?}");
    }
    // 34 kB a second, which a good link carries: twice as much each half second from 3 kB/s on.
    let mut pace = Pace::default();
    pace.note_exchange(1, Some(0), at(0));
    assert_eq!((pace.rate(at(0)), pace.shown(at(0))), (Some(FIRST), 3000));
    let mut ms = 0;
    while pace.rate(at(ms)).is_some() {
        ms += 20;
        match pace.is_open(at(ms)) {
            true => pace.spend(680 - OVERHEAD as usize, at(ms)),
            false => pace.hold(),
        }
        if ms % 500 == 0 {
            pace.note_exchange(1, Some(0), at(ms));
        }
    }
    assert_eq!((ms, pace.shown(at(ms))), (3000, 0));
}

#[test]
fn without_a_station_all_goes_out_and_the_next_one_begins_anew() {
    let mut pace = Pace::default();
    pace.spend(1_000_000, at(0));
    assert!(pace.is_open(at(0)));
    slowed_down(&mut pace, 0);
    pace.spend(100_000, at(8000));
    assert_eq!((pace.rate(at(8000)), pace.opens()), (Some(LEAST), at(9980)));
    let alone = 8000 + SILENT.as_millis() as u64;
    assert_eq!(
        (pace.rate(at(alone)), pace.is_open(at(alone))),
        (None, true)
    );
    pace.note_exchange(2, Some(0), at(alone));
    assert_eq!(pace.rate(at(alone)), Some(FIRST));
}

#[test]
fn until_a_station_has_all_descriptions_next_to_nothing_goes_out_unless_there_is_another_one() {
    let mut pace = Pace::default();
    pace.note_newcomer(at(0));
    assert_eq!(pace.rate(at(0)), Some(DESCRIBING));
    pace.note_describing(1, at(500));
    pace.note_describing(1, at(1000));
    assert_eq!(pace.rate(at(1000)), Some(DESCRIBING));
    pace.note_exchange(1, None, at(1500));
    assert_eq!(pace.rate(at(1500)), Some(FIRST));
    pace.note_describing(2, at(1600));
    assert_eq!(pace.rate(at(1600)), Some(FIRST));
    // The one that had all is gone.
    for half in 4..10 {
        pace.note_describing(2, at(half * 500));
    }
    assert_eq!(pace.rate(at(4600)), Some(DESCRIBING));
    // Who never speaks reads all.
    let mut pace = Pace::default();
    pace.note_newcomer(at(0));
    assert_eq!(pace.rate(at(3000)), None);
}

/// A station says for eight seconds from `second` on that ever more waits.
fn slowed_down(pace: &mut Pace, second: u64) {
    for second in second..second + 9 {
        pace.note_exchange(1, Some(1000 + 500 * second as u32), at(second * 1000));
    }
}

/// A pace of which a station has said in its first seconds that its link carries all.
fn free() -> Pace {
    let mut pace = Pace::default();
    for half in 0..5 {
        pace.note_exchange(1, Some(0), at(half * 500));
    }
    assert_eq!(pace.rate(at(2000)), None);
    pace
}

#[test]
fn one_late_exchange_and_a_station_on_a_bad_link_beside_a_good_one_change_nothing() {
    let mut pace = free();
    for second in 3..60 {
        let late_ms = if second == 30 { 2000 } else { 0 };
        pace.spend(30_000, at(second * 1000));
        pace.note_exchange(1, Some(late_ms), at(second * 1000));
        assert_eq!(pace.rate(at(second * 1000)), None);
    }
    for second in 60..120 {
        pace.spend(30_000, at(second * 1000));
        pace.note_exchange(1, Some(5000), at(second * 1000));
        pace.note_exchange(2, Some(10), at(second * 1000));
        assert_eq!(pace.rate(at(second * 1000)), None);
    }
    // The good one goes, and the bad one decides.
    for second in 120..130 {
        pace.spend(30_000, at(second * 1000));
        pace.note_exchange(1, Some(5000), at(second * 1000));
    }
    assert!(pace.rate(at(129_000)).is_some());
}

#[test]
fn a_station_that_says_the_latest_that_there_is_slows_its_own_way_down() {
    let mut pace = free();
    for second in 3..60 {
        pace.spend(30_000, at(second * 1000));
        pace.note_exchange(1, Some(u32::MAX), at(second * 1000));
    }
    assert!(pace.rate(at(60_000)).is_some());
}

#[test]
fn unknown_stations_that_report_delays_slow_no_other_one_down() {
    let mut pace = free();
    for second in 3..60 {
        let now = at(second * 1000);
        pace.spend(30_000, now);
        for station in 100..200 {
            pace.note_exchange(station, Some(u32::MAX), now);
        }
        pace.note_exchange(1, Some(10), now);
        assert_eq!(pace.rate(now), None);
    }
}

#[test]
fn when_the_link_is_good_again_all_goes_out_again() {
    let mut pace = Pace::default();
    slowed_down(&mut pace, 0);
    slowed_down(&mut pace, 9);
    pace.note_exchange(1, Some(0), at(19_000));
    pace.note_exchange(1, Some(0), at(19_500));
    // Two topics that are published together.
    let mut free_ms = 20_000;
    while pace.rate(at(free_ms)).is_some() {
        for _ in 0..2 {
            match pace.is_open(at(free_ms)) {
                true => pace.spend(300, at(free_ms)),
                false => pace.hold(),
            }
        }
        free_ms += 20;
        if free_ms % 500 == 0 {
            pace.note_exchange(1, Some(0), at(free_ms));
        }
    }
    // An eighth more twice a second, from 1.5 kB/s to the 42 kB/s that come, less of it near what was too much, and ten
    // seconds without a sample that was held back.
    assert!((20_000..52_000).contains(&free_ms), "{free_ms}");
}
