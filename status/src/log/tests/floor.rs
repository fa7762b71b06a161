//! The room on the disk that is left to other programs.

use super::*;

const FLOOR: u64 = 8000;

fn harness(free_bytes: u64) -> Harness {
    let disk = MemoryStore::default();
    disk.0.borrow_mut().free_bytes = free_bytes;
    let limits = Limits {
        min_free_bytes: FLOOR,
        ..UNLIMITED
    };
    Harness::begin(disk, limits)
}

fn set_free(harness: &Harness, bytes: u64) {
    harness.disk.0.borrow_mut().free_bytes = bytes;
}

#[test]
fn below_the_floor_the_log_pauses_with_one_warning_and_goes_on_above_it() {
    let mut harness = harness(FLOOR);
    harness.record(100);
    assert_eq!(harness.reported(), ["opened"], "the floor itself is enough");
    let before = harness.disk.0.borrow().total_bytes();

    set_free(&harness, FLOOR - 1);
    harness.record(50 * 120);
    assert_eq!(harness.reported(), ["paused", "rows lost", "rows lost"]);
    let paused = harness.disk.0.borrow().total_bytes();
    assert!(paused - before < 10_000, "only what was on its way");

    // At the floor it would stop again at once.
    set_free(&harness, FLOOR + FLOOR / 8 - 1);
    harness.record(50 * 20);
    assert!(
        !harness
            .reported()
            .iter()
            .any(|word| word.contains("resumed"))
    );

    set_free(&harness, FLOOR + FLOOR / 8);
    harness.record(50 * 20);
    let reported = harness.reported();
    let lost = harness.finish().lost;
    assert!(reported.contains(&"resumed".to_owned()));
    assert!(
        !reported.contains(&"opened".to_owned()),
        "the same file goes on"
    );
    let runs = runs(&all_sequences(&harness.disk));
    let [(1, kept), (resumed, last)] = runs[..] else {
        panic!("{runs:?}");
    };
    assert_eq!((resumed - kept - 1, last), (lost, harness.samples));
}

#[test]
fn a_short_want_of_room_loses_nothing() {
    let mut harness = harness(u64::MAX);
    harness.record(100);
    set_free(&harness, 0);
    harness.record(50 * 5);
    set_free(&harness, u64::MAX);
    harness.record(50 * 5);
    assert_eq!(harness.reported(), ["opened", "paused", "resumed"]);
    let Outcome { written, lost } = harness.finish();
    assert_eq!((written.files, lost), (1, 0));
}

#[test]
fn nothing_is_created_below_the_floor() {
    let mut harness = harness(FLOOR - 1);
    harness.record(100);
    assert_eq!(harness.reported(), ["paused"]);
    assert!(harness.disk.0.borrow().files.is_empty());
    let Outcome { written, lost } = harness.finish();
    assert_eq!((written.files, lost), (0, 100));
    assert!(harness.disk.0.borrow().files.is_empty());
}
