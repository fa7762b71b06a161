//! What the pace decides, by itself and with a station at the other end of a narrow link.

mod station;

use super::*;

const fn at(ms: u64) -> MonotonicNs {
    MonotonicNs(ms * 1_000_000)
}

/// A link that carries so many bytes a second, in the order in which they were sent, and keeps all that waits.
struct Narrow {
    bytes_per_s: u64,
    free: MonotonicNs,
}

impl Narrow {
    /// By how much later something arrives that is sent now, ms.
    fn late_ms(&self, now: MonotonicNs) -> u32 {
        self.free.since(now).as_millis() as u32
    }
}

/// Sends a sample of `len` bytes every 2 ms over the link for two minutes. Returns what passed in the second minute,
/// bytes a second, and all delays that a station told, ms, from the first one on.
fn flood(bytes_per_s: u64, len: usize) -> (u64, Vec<u32>) {
    let mut link = Narrow {
        bytes_per_s,
        free: at(0),
    };
    let (mut pace, mut passed, mut delays) = (Pace::default(), 0, Vec::new());
    for ms in (0..120_000).step_by(2) {
        let now = at(ms);
        if ms % 500 == 0 {
            let late_ms = link.late_ms(now);
            pace.note_exchange(7, Some(late_ms), now);
            delays.push(late_ms);
        }
        if !pace.is_open(now) {
            pace.hold();
        } else {
            pace.spend(len, now);
            let bytes = len as u64 + OVERHEAD;
            let takes = Duration::from_nanos(bytes * 1_000_000_000 / link.bytes_per_s);
            link.free = link.free.max(now) + takes;
            passed += if ms >= 60_000 { bytes } else { 0 };
        }
    }
    (passed / 60, delays)
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
    for second in 0..9 {
        pace.note_exchange(1, Some(1000), at(second * 1000));
    }
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
    for second in 0..20 {
        pace.spend(30_000, at(second * 1000));
        pace.note_exchange(1, Some(1000), at(second * 1000));
    }
    assert_eq!(pace.rate(at(19_000)), Some(LEAST));
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
