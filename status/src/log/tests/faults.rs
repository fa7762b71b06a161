//! Every act on the disk fails once, for a moment or for long, in every way; and the room on the disk that is left to
//! other programs.

use std::ops::Range;

use super::*;
use crate::log::queue::QUEUE_SAMPLES;
use crate::log::writer::RETRY_PERIOD;
use crate::log::writer::SYNC_PERIOD;
use crate::test_store::{StoreAct, StoreFault};

fn on_faulty_disk(fault: Option<(Range<usize>, StoreFault)>) -> MemoryStore {
    let disk = MemoryStore::default();
    disk.0.borrow_mut().fault = fault;
    disk
}

/// How many reports begin with `word`.
fn count(reported: &[String], word: &str) -> usize {
    let matching = reported.iter().filter(|report| report.starts_with(word));
    matching.count()
}

/// The samples in the files, which must be whole rows behind a first line. Only a disk that broke in the middle of a
/// row, and could not truncate, may have kept a partial row at the end of a file.
fn checked_runs(disk: &MemoryStore, fault: StoreFault) -> Vec<(u64, u64)> {
    let mut all = Vec::new();
    for text in disk.0.borrow().texts() {
        let mut text = text.as_str();
        if fault == StoreFault::BreaksHalfway {
            text = &text[..text.rfind('\n').map_or(0, |end| end + 1)];
        }
        if fault.is_full_disk() || !text.is_empty() {
            all.extend(sequences(text));
        }
    }
    runs(&all)
}

#[test]
fn a_short_fault_at_any_act_loses_nothing() {
    /// A minute at 50 samples a second; in the last quarter nothing fails.
    const SAMPLES: u64 = 3000;
    /// So that there are several files, and old ones are removed.
    const LIMITS: LogLimits = LogLimits {
        max_file_bytes: 12_288,
        max_total_bytes: 3 * 12_288,
        min_free_bytes: 0,
    };
    let acts = {
        let mut calm = Harness::short(MemoryStore::default(), LIMITS);
        calm.record(SAMPLES * 3 / 4);
        calm.disk.0.borrow().acts.clone()
    };
    for act in [
        StoreAct::List,
        StoreAct::Remove,
        StoreAct::Create,
        StoreAct::Write,
        StoreAct::Sync,
    ] {
        assert!(acts.contains(&act), "{act:?} is not put to the test");
    }

    for index in 0..acts.len() {
        for fault in StoreFault::ALL {
            // The write after one that took a half fails, and then perhaps the truncation.
            let disk = on_faulty_disk(Some((index..index + 3, fault)));
            let mut harness = Harness::short(disk, LIMITS);
            harness.record(SAMPLES);
            let outcome = harness.finish();
            let reported = harness.reported();
            let context = format!("{fault:?} at {:?}: {outcome:?} {reported:?}", &acts[index]);
            assert_eq!(
                (outcome.written.rows, outcome.lost),
                (SAMPLES, 0),
                "{context}"
            );
            let trouble = count(&reported, "full") + count(&reported, "failed");
            assert!(trouble <= 1, "{context}");
            assert_eq!(count(&reported, "resumed"), trouble, "{context}");
            // Old files were removed. Of what is left nothing is missing, unless the oldest could not be removed.
            let runs = checked_runs(&harness.disk, fault);
            let mut during = acts[index..].iter().take(3);
            let stays = !fault.is_full_disk() && during.any(|act| *act == StoreAct::Remove);
            let most_runs = if stays { 2 } else { 1 };
            assert!(runs.len() <= most_runs, "{context}: {runs:?}");
            assert_eq!(runs[runs.len() - 1].1, SAMPLES, "{context}");
        }
    }
}

#[test]
fn a_long_fault_from_any_act_on_loses_what_does_not_fit_into_memory_and_is_counted() {
    /// Samples of the test: as many as memory has room for, and about as many again.
    const SAMPLES: u64 = 2000;
    let acts = {
        let mut calm = Harness::begin(MemoryStore::default(), UNLIMITED);
        calm.record(300);
        calm.finish();
        calm.disk.0.borrow().acts.clone()
    };
    assert!(acts.contains(&StoreAct::Sync));
    for (index, act) in acts.iter().enumerate() {
        for fault in StoreFault::ALL {
            let disk = on_faulty_disk(Some((index..usize::MAX, fault)));
            let mut harness = Harness::begin(disk, UNLIMITED);
            harness.record(SAMPLES);
            let context = format!("{fault:?} from {index}, {act:?}");
            let reported = harness.reported();
            let trouble = count(&reported, "full") + count(&reported, "failed");
            assert_eq!(
                (trouble, count(&reported, "rows lost")),
                (1, 1),
                "{context}: {reported:?}"
            );

            // The disk works again.
            harness.disk.0.borrow_mut().fault = None;
            harness.record(RETRY_PERIOD.as_millis() as u64 / 20 + 1);
            let lost = harness.finish().lost;
            let reported = harness.reported();
            assert_eq!(count(&reported, "resumed"), 1, "{context}: {reported:?}");
            // Of what came in trouble the oldest rows were kept, and after it everything is there.
            let runs = checked_runs(&harness.disk, fault);
            let [(1, kept), (resumed, last)] = runs[..] else {
                panic!("{context}: {runs:?}");
            };
            assert_eq!(
                (resumed - kept - 1, last),
                (lost, harness.samples),
                "{context}"
            );
            assert!(kept >= QUEUE_SAMPLES as u64, "{context}: {kept}");
        }
    }
}

#[test]
fn attempts_go_on_for_ever_and_leave_no_files() {
    // After the first file's creation and first line.
    let mut harness = Harness::short(MemoryStore::default(), UNLIMITED);
    harness.record(100);
    let begun = harness.disk.0.borrow().acts.len();
    harness.disk.0.borrow_mut().fault = Some((begun..usize::MAX, StoreFault::HalfFull));
    harness.record(50 * 3600);
    let acts = harness.disk.0.borrow().acts[begun..].to_vec();
    // An hour has 720 pauses. Each attempt can create a file: the disk is full when it writes.
    let attempts = acts.iter().filter(|act| **act == StoreAct::Prepare).count();
    assert!((715..=720).contains(&attempts), "{attempts}");
    assert_eq!(harness.disk.0.borrow().files.len(), 1);
    // The first loss, then one report a minute.
    let reported = harness.reported();
    let losses = count(&reported, "rows lost");
    assert!((50..=60).contains(&losses), "{losses}");
    assert_eq!(reported.len(), losses + 2, "opened and full: {reported:?}");
}

#[test]
fn a_fault_that_comes_and_goes_is_reported_and_starts_files_no_more_often_than_the_log_retries() {
    let mut harness = Harness::short(MemoryStore::default(), UNLIMITED);
    for _ in 0..600 {
        harness.record(50);
        let next = harness.disk.0.borrow().acts.len();
        harness.disk.0.borrow_mut().fault = Some((next..next + 1, StoreFault::NoSpace));
    }
    let Outcome { written, lost } = harness.finish();
    assert!(written.files <= 600 / 5 + 1, "{written:?}");
    assert_eq!(lost, 0, "the queue is longer than the pauses");
}

#[test]
fn what_cannot_be_forced_onto_the_disk_is_reported_and_followed_by_a_new_file() {
    let mut harness = Harness::begin(MemoryStore::default(), UNLIMITED);
    // One row after another: the first sync is due five seconds after the first flush.
    harness.record(100);
    let acts = harness.disk.0.borrow().acts.len();
    assert!(!harness.disk.0.borrow().acts.contains(&StoreAct::Sync));
    harness.disk.0.borrow_mut().fault = Some((acts..usize::MAX, StoreFault::Broken));
    harness.wait(SYNC_PERIOD);
    harness.disk.0.borrow_mut().fault = None;
    harness.record(1000);
    let Outcome { written, lost } = harness.finish();
    assert_eq!((written.rows, lost), (1100, 0));
    let unsynced = written.unsynced;
    assert!(unsynced > 0 && unsynced <= 100, "{written:?}");
    assert_eq!(written.files, 2);
    assert_eq!(runs(&all_sequences(&harness.disk)), [(1, 1100)]);
}

#[test]
fn a_log_that_never_worked_costs_every_row_and_nothing_else() {
    let disk = on_faulty_disk(Some((0..usize::MAX, StoreFault::Broken)));
    let mut harness = Harness::begin(disk, UNLIMITED);
    harness.record(2000);
    let expected = Outcome {
        written: Written::default(),
        lost: 2000,
    };
    assert_eq!(harness.finish(), expected);
    assert!(harness.disk.0.borrow().files.is_empty());
}

#[test]
fn at_the_end_it_is_tried_once_more() {
    let disk = on_faulty_disk(Some((0..usize::MAX, StoreFault::NoSpace)));
    let mut harness = Harness::begin(disk, UNLIMITED);
    harness.record(400);
    harness.disk.0.borrow_mut().fault = None;
    assert_eq!(harness.reported(), ["full"]);
    let Outcome { written, lost } = harness.finish();
    assert_eq!((written.rows, lost), (400, 0));
    assert_eq!(runs(&all_sequences(&harness.disk)), [(1, 400)]);
}

#[test]
fn a_disk_that_fails_at_the_very_end_leaves_rows_unsynced() {
    let mut harness = Harness::begin(MemoryStore::default(), UNLIMITED);
    harness.record(100);
    harness.wait(Duration::from_secs(1));
    let acts = harness.disk.0.borrow().acts.len();
    harness.disk.0.borrow_mut().fault = Some((acts..usize::MAX, StoreFault::Broken));
    let Outcome { written, lost } = harness.finish();
    assert_eq!((written.rows, written.unsynced, lost), (100, 100, 0));
    assert_eq!(harness.reported(), ["opened", "failed"]);
}

// The room that is left to other programs.

const FLOOR: u64 = 8000;

fn with_free_room(free_bytes: u64) -> Harness {
    let disk = MemoryStore::default();
    disk.0.borrow_mut().free_bytes = free_bytes;
    let limits = LogLimits {
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
    let mut harness = with_free_room(FLOOR);
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
    let mut harness = with_free_room(u64::MAX);
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
    let mut harness = with_free_room(FLOOR - 1);
    harness.record(100);
    assert_eq!(harness.reported(), ["paused"]);
    assert!(harness.disk.0.borrow().files.is_empty());
    let Outcome { written, lost } = harness.finish();
    assert_eq!((written.files, lost), (0, 100));
    assert!(harness.disk.0.borrow().files.is_empty());
}
