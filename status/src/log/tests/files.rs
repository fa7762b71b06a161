//! Which files there are, and what is in them: rows, rotation, the limit on the total.

use std::path::{Path, PathBuf};

use super::*;
use crate::log::clock::Utc;
use crate::log::config::FileNameFormat;
use crate::log::file_name::{FileKind, Series, file_name};
use crate::log::groups::LogGroups;
use crate::log::retention::MAX_FILES;
use crate::log::writer::SYNC_PERIOD;
use crate::log::writer::{BATCH_ROWS, FLUSH_PERIOD};
use crate::test_samples::full_sample;
use crate::test_store::{StoreAct, StoreFault};

#[test]
fn the_file_is_created_at_the_start_and_rows_follow_the_first_line() {
    let mut harness = Harness::begin(MemoryStore::default(), UNLIMITED);
    assert_eq!(harness.reported(), ["opened"]);
    assert_eq!(harness.disk.0.borrow().only_file(), header(&Group::ALL));
    assert_eq!(harness.log.deadline(), None, "nothing waits");
    harness.record(3);
    let written = harness.finish().written;
    assert_eq!((written.files, written.rows), (1, 3));
    assert_eq!(sequences(&harness.disk.0.borrow().only_file()), [1, 2, 3]);
    let path = harness.disk.0.borrow().created[0].clone();
    assert_eq!(path, Path::new("log/hero(1)_28_08_06-20_39_26.tsv"));
}

#[test]
fn several_logs_have_their_own_files_and_fields() {
    let disk = MemoryStore::default();
    let imu = [Group::Attitude, Group::AngularRate];
    for config in [config("", &[Group::Time]), config("imu", &imu)] {
        let robot = RobotId::DEFAULT;
        let mut log = LogWriter::new(&config, UNLIMITED, robot, disk.clone());
        log.start(START);
        log.record(&full_sample(), START);
        assert_eq!(log.finish(std::iter::empty(), START).rows, 1);
    }
    let disk = disk.0.borrow();
    let columns = |text: String| {
        let count = |line: &str| line.split('\t').count();
        text.lines().map(count).collect::<Vec<_>>()
    };
    let columns: Vec<_> = disk.texts().into_iter().map(columns).collect();
    assert_eq!(columns, [[4; 2], [9; 2]]);
    let expected = [
        "log/hero(1)_28_08_06-20_39_26.tsv",
        "log/hero(1)_28_08_06-20_39_26_imu.tsv",
    ];
    assert_eq!(disk.created, expected.map(PathBuf::from));
}

#[test]
fn missing_groups_are_reported_once_each() {
    let groups = [Group::Time, Group::Sonar, Group::Barometer];
    let config = config("", &groups);
    let store = MemoryStore::default();
    let mut log = LogWriter::new(&config, UNLIMITED, RobotId::DEFAULT, store);
    let mut reported = |valid: GroupSet| {
        let mut sample = full_sample();
        sample.valid_groups = valid.0;
        log.record(&sample, START);
        let events = log.take_events();
        events.iter().map(words).collect::<Vec<_>>()
    };
    let without = |groups: &[Group]| GroupSet::ALL.without(groups.iter().copied().collect());
    assert!(reported(GroupSet::ALL).is_empty());
    // A group that the log does not have is nothing to report.
    assert!(reported(without(&[Group::Xy])).is_empty());
    assert_eq!(reported(without(&[Group::Sonar])), ["missing sonar"]);
    assert!(reported(without(&[Group::Sonar])).is_empty());
    let both = [Group::Sonar, Group::Barometer];
    assert_eq!(reported(without(&both)), ["missing barometer"]);
    assert!(reported(GroupSet::ALL).is_empty());
    assert!(reported(without(&both)).is_empty());
}

#[test]
fn rows_are_flushed_by_a_deadline_after_the_oldest() {
    let mut harness = Harness::begin(MemoryStore::default(), UNLIMITED);
    harness.record(1);
    let first = harness.now;
    harness.wait(Duration::from_millis(400));
    harness.record(1);
    assert_eq!(harness.log.deadline(), Some(first + FLUSH_PERIOD));
    assert!(all_sequences(&harness.disk).is_empty());
    harness.wait(Duration::from_millis(80));
    assert_eq!(all_sequences(&harness.disk), [1, 2]);
    let syncing = first + FLUSH_PERIOD + SYNC_PERIOD;
    assert_eq!(harness.log.deadline(), Some(syncing));
    harness.record(1);
    assert_eq!(harness.log.deadline(), Some(harness.now + FLUSH_PERIOD));
}

#[test]
fn no_row_waits_longer_than_a_flush_period_and_none_is_unsynced_for_longer_than_a_sync_period() {
    let mut harness = Harness::short(MemoryStore::default(), UNLIMITED);
    let mut synced_at = START;
    let mut syncs = 0;
    for _ in 0..1500 {
        harness.record(1);
        let disk = harness.disk.0.borrow();
        let rows = disk.only_file().lines().count() as u64 - 1;
        let waiting = harness.samples - rows;
        assert!(waiting * 20 <= 500, "{waiting} rows wait");
        let count = disk
            .acts
            .iter()
            .filter(|act| **act == StoreAct::Sync)
            .count();
        if count > syncs {
            syncs = count;
            synced_at = harness.now;
        }
        let unsynced = harness.now.since(synced_at);
        assert!(unsynced <= SYNC_PERIOD + FLUSH_PERIOD + SAMPLE_PERIOD);
    }
    assert!(syncs <= 30 / 5, "{syncs} times in 30 s");
}

#[test]
fn fast_telemetry_is_written_in_batches() {
    let mut harness = Harness::begin(MemoryStore::default(), UNLIMITED);
    let mut written = 0;
    for number in 1..=3 * BATCH_ROWS as u64 {
        // All in one moment.
        harness.samples = number;
        harness.log.record(&sample(1, number), START);
        let sequences = sequences(&harness.disk.0.borrow().only_file());
        if sequences.len() as u64 > written {
            written += BATCH_ROWS as u64;
            assert_eq!(sequences.last(), Some(&number));
        }
        assert_eq!(sequences.len() as u64, written);
    }
    assert_eq!(written, 3 * BATCH_ROWS as u64);
}

#[test]
fn every_limit_on_a_file_is_kept_and_no_row_is_lost_or_repeated_at_its_end() {
    /// Half a second of samples, and the one that comes at its end.
    const BATCH: u64 = 26;
    let first_line = header(&[Group::Time]).len() as u64;
    let row = "1\t100\t10000000000\t12345\n".len() as u64;
    // From less than a batch to several, byte by byte, so that the limit falls on every place of a row and on its end.
    for max_file_bytes in first_line..=first_line + 3 * BATCH * row {
        let limits = LogLimits {
            max_file_bytes,
            ..UNLIMITED
        };
        let mut harness = Harness::short(MemoryStore::default(), limits);
        harness.record(200);
        let written = harness.finish().written;
        assert_eq!(runs(&all_sequences(&harness.disk)), [(1, 200)]);
        let texts = harness.disk.0.borrow().texts();
        assert_eq!(written.files, texts.len() as u64);
        for (index, text) in texts.iter().enumerate() {
            let rows = sequences(text).len() as u64;
            let bytes = text.len() as u64;
            // A limit that is too small for one batch is broken rather than stopping the log.
            assert!(bytes <= max_file_bytes || rows <= BATCH, "{rows}");
            let is_last = index == texts.len() - 1;
            assert!(bytes + BATCH * row > max_file_bytes || is_last, "{rows}");
        }
        // Each was forced onto the disk when it was closed.
        let acts = &harness.disk.0.borrow().acts;
        let syncs = acts.iter().filter(|act| **act == StoreAct::Sync).count();
        assert!(syncs >= texts.len());
    }
}

/// The cells of a column of all rows in all files.
fn column(disk: &MemoryStore, name: &str) -> Vec<String> {
    let cells = |text: String| {
        let mut lines = text.lines().map(|line| line.split('\t').map(str::to_owned));
        let index = lines.next().unwrap().position(|cell| cell == name).unwrap();
        lines
            .map(|mut cells| cells.nth(index).unwrap())
            .collect::<Vec<_>>()
    };
    disk.0
        .borrow()
        .texts()
        .into_iter()
        .flat_map(cells)
        .collect()
}

#[test]
fn times_in_utc_keep_their_order_when_the_wall_clock_is_set() {
    let disk = MemoryStore::default();
    let config = LogConfig {
        utc: true,
        ..config("", &[Group::Time])
    };
    let limits = LogLimits {
        max_file_bytes: 3000,
        ..UNLIMITED
    };
    let mut harness = Harness::with(&config, disk.clone(), limits);
    harness.record(26);
    // An hour back.
    disk.0.borrow_mut().unix_s -= 3600;
    harness.record(24);
    harness.wait(FLUSH_PERIOD);
    let times = column(&disk, "utc");
    assert_eq!(times[0], "2006-08-28T20:39:26.020000Z");
    assert_eq!(times[49], "2006-08-28T20:39:27.000000Z");
    assert!(times.is_sorted(), "{times:?}");

    // The next file has the new time.
    harness.record(100);
    harness.finish();
    let created = disk.0.borrow().created.clone();
    assert!(created.len() > 1, "{created:?}");
    assert_eq!(created[1], Path::new("log/hero(1)_28_08_06-19_39_26.tsv"));
    let last = column(&disk, "utc").pop().unwrap();
    assert!(last.starts_with("2006-08-28T19:39:2"), "{last}");
}

#[test]
fn the_dsp_s_errors_are_a_group_of_their_own() {
    let disk = MemoryStore::default();
    let config = LogConfig {
        groups: LogGroups {
            dsp_errors: true,
            ..LogGroups::default()
        },
        ..LogConfig::default()
    };
    let robot = RobotId::DEFAULT;
    let mut log = LogWriter::new(&config, UNLIMITED, robot, disk.clone());
    log.start(START);
    let mut sample = full_sample();
    for (errors, code) in [(0, 0), (1, 777), (2, 30)] {
        (sample.dsp_errors, sample.last_dsp_error_code) = (errors, code);
        log.record(&sample, START);
    }
    log.finish(std::iter::empty(), START);
    assert_eq!(column(&disk, "dsp_errors"), ["0", "1", "2"]);
    assert_eq!(column(&disk, "last_dsp_error_code"), ["", "777", "30"]);
}

#[test]
fn old_files_in_both_formats_are_of_the_log() {
    let disk = MemoryStore::default();
    let own = [
        "log/hero(1)_01_01_05-00_00_00.tsv",
        "log/hero1_2005-01-02T00-00-00Z.tsv",
        "log/hero(1)_03_01_05-00_00_00.tsv",
    ];
    for path in own {
        let content = vec![b'x'; 8192];
        disk.0.borrow_mut().files.insert(path.into(), content);
    }
    let config = LogConfig {
        file_name: FileNameFormat::Sortable,
        ..config("", &[Group::Time])
    };
    let mut harness = Harness::with(&config, disk.clone(), limits_of(2));
    assert_eq!(harness.reported(), ["removed", "removed", "opened"]);
    let left = disk.0.borrow().files.keys().cloned().collect::<Vec<_>>();
    let expected = [
        "log/hero(1)_03_01_05-00_00_00.tsv",
        "log/hero1_2006-08-28T20-39-26Z.tsv",
    ];
    assert_eq!(left, expected.map(PathBuf::from));
}

/// LogLimits of `files` files of 8 KiB.
fn limits_of(files: u64) -> LogLimits {
    LogLimits {
        max_file_bytes: 8192,
        max_total_bytes: files * 8192,
        min_free_bytes: 0,
    }
}

#[test]
fn the_total_is_kept_by_removing_the_oldest() {
    let mut harness = Harness::begin(MemoryStore::default(), limits_of(4));
    let mut sizes = Vec::new();
    for _ in 0..2000 {
        harness.record(1);
        harness.pass_seconds(1);
        sizes.push(harness.disk.0.borrow().total_bytes());
    }
    let written = harness.finish().written;
    assert!(written.files > 50);
    assert!(sizes.iter().all(|size| *size <= 4 * 8192));
    assert_eq!(harness.disk.0.borrow().files.len(), 4);
    let runs = runs(&all_sequences(&harness.disk));
    assert!(
        matches!(runs[..], [(1000.., 2000)]),
        "the newest stay: {runs:?}"
    );
    let removed = harness
        .reported()
        .iter()
        .filter(|word| *word == "removed")
        .count();
    assert_eq!(removed as u64, written.files - 4);
}

#[test]
fn only_own_files_are_removed_and_the_oldest_first() {
    let disk = MemoryStore::default();
    let foreign = [
        "log/hero(2)_01_01_01-00_00_00.tsv",
        "log/hero(11)_01_01_01-00_00_00.tsv",
        "log/hero(1)_01_01_01-00_00_00_imu.tsv",
        "log/hero(1)_01_01_01-00_00_00.csv",
        "log/hero(1)_99_01_01-00_00_00.tsv",
        "log/notes.tsv",
        "elsewhere/hero(1)_01_01_01-00_00_00.tsv",
    ];
    let own = [
        "log/hero(1)_31_12_99-23_59_59.tsv",
        "log/hero(1)_01_01_05-00_00_00.tsv",
        "log/hero(1)_01_01_05-00_00_00.2.tsv",
        "log/hero(1)_01_01_05-00_00_00.10.tsv",
        "log/hero(1)_02_01_05-00_00_00.tsv",
        "log/hero(1)_01_02_05-00_00_00.tsv",
    ];
    for path in foreign.iter().chain(&own) {
        let content = vec![b'x'; 8192];
        disk.0.borrow_mut().files.insert(path.into(), content);
    }
    let is_there = |path: &str| disk.0.borrow().files.contains_key(Path::new(path));
    let mut harness = Harness::begin(disk.clone(), limits_of(5));
    assert_eq!(harness.reported(), ["removed", "removed", "opened"]);
    for gone in 2..=own.len() {
        let left: Vec<_> = own.iter().map(|path| is_there(path)).collect();
        let expected: Vec<_> = (0..own.len()).map(|index| index >= gone).collect();
        assert_eq!(left, expected);
        while !harness.reported().contains(&"removed".to_owned()) {
            harness.record(1);
        }
    }
    assert!(foreign.iter().all(|path| is_there(path)));
}

#[test]
fn files_of_this_flight_outlive_older_ones_though_the_clock_was_set_back() {
    let disk = MemoryStore::default();
    let old = PathBuf::from("log/hero(1)_28_08_06-20_00_00.tsv");
    let content = vec![b'x'; 8192];
    disk.0.borrow_mut().files.insert(old.clone(), content);
    disk.0.borrow_mut().unix_s = 0;
    let mut harness = Harness::begin(disk.clone(), limits_of(3));
    let first = disk.0.borrow().created[0].clone();
    while !harness.reported().contains(&"removed".to_owned()) {
        harness.record(1);
    }
    assert!(!disk.0.borrow().files.contains_key(&old));
    assert!(disk.0.borrow().files.contains_key(&first));
    // Among its own files the order of creation counts, wherever the clock jumps.
    for unix_s in [1_000_000_000, 5, 2_000_000_000, 0] {
        disk.0.borrow_mut().unix_s = unix_s;
        harness.record(50);
    }
    let samples = harness.samples;
    harness.finish();
    let runs = runs(&all_sequences(&disk));
    assert_eq!((runs.len(), runs[0].1), (1, samples), "{runs:?}");
}

#[test]
fn a_file_that_cannot_be_removed_is_passed_over() {
    let disk = MemoryStore::default();
    let stubborn = PathBuf::from("log/hero(1)_01_01_01-00_00_00.tsv");
    disk.0.borrow_mut().stubborn.insert(stubborn.clone());
    let content = vec![b'x'; 8192];
    disk.0.borrow_mut().files.insert(stubborn.clone(), content);
    let mut harness = Harness::begin(disk.clone(), limits_of(4));
    harness.record(400);
    assert_eq!(harness.finish().lost, 0);
    assert!(disk.0.borrow().files.contains_key(&stubborn));
    assert!(disk.0.borrow().total_bytes() <= 4 * 8192);
    assert!(!harness.reported().contains(&"failed".to_owned()));
}

#[test]
fn a_total_that_cannot_be_kept_stops_the_log_until_it_can() {
    let disk = MemoryStore::default();
    let stubborn = PathBuf::from("log/hero(1)_01_01_01-00_00_00.tsv");
    disk.0.borrow_mut().stubborn.insert(stubborn.clone());
    let content = vec![b'x'; 30_000];
    disk.0.borrow_mut().files.insert(stubborn, content);
    // The newest stays in any case.
    let newest = PathBuf::from("log/hero(1)_02_01_01-00_00_00.tsv");
    disk.0.borrow_mut().files.insert(newest, b"x".to_vec());
    let mut harness = Harness::begin(disk.clone(), limits_of(4));
    assert_eq!(harness.reported(), ["failed"]);
    harness.record(100);
    assert_eq!(disk.0.borrow().created.len(), 0);
    disk.0.borrow_mut().stubborn.clear();
    harness.record(600);
    let reported = harness.reported();
    assert_eq!(reported[..2], ["removed", "opened"]);
    assert!(reported.contains(&"resumed".to_owned()), "{reported:?}");
    assert_eq!(harness.finish().lost, 0);
}

#[test]
fn a_partial_row_that_a_kill_left_is_truncated_at_the_next_start() {
    let older = "log/hero(1)_01_01_05-00_00_00.tsv";
    let newer = "log/hero(1)_02_01_05-00_00_00.tsv";
    let foreign = "log/hero(1)_03_01_05-00_00_00_imu.tsv";
    for broken in [false, true] {
        let disk = MemoryStore::default();
        for path in [older, newer, foreign] {
            let content = b"names\nrow\npie".to_vec();
            disk.0.borrow_mut().files.insert(path.into(), content);
        }
        // The first act is to look for the file, the second to truncate it.
        let fault = (1..2, StoreFault::Broken);
        disk.0.borrow_mut().fault = broken.then_some(fault);
        let mut harness = Harness::begin(disk.clone(), UNLIMITED);
        let expected: &[_] = match broken {
            true => &["opened"],
            false => &["truncated 3", "opened"],
        };
        assert_eq!(harness.reported(), expected);
        assert_eq!(disk.0.borrow().acts[1], StoreAct::TruncatePartialRow);
        harness.record(100);
        assert_eq!(harness.finish().written.rows, 100);
        let length = |path: &str| disk.0.borrow().files[Path::new(path)].len();
        let lengths = [older, newer, foreign].map(length);
        assert_eq!(lengths, [13, if broken { 13 } else { 10 }, 13]);
    }
}

#[test]
fn the_number_of_files_is_bounded_however_short_they_are() {
    let disk = MemoryStore::default();
    let series = Series::new(RobotId::DEFAULT, &LogConfig::default());
    for second in 0..MAX_FILES as u64 + 5 {
        let stem = series.stem(Utc::from_unix(second));
        let path = Path::new("log").join(file_name(&stem, 1, FileKind::Tsv));
        disk.0.borrow_mut().files.insert(path, Vec::new());
    }
    let mut harness = Harness::begin(disk.clone(), UNLIMITED);
    assert_eq!(disk.0.borrow().files.len(), MAX_FILES);
    let reported = harness.reported();
    assert!(
        reported[..6].iter().all(|word| word == "removed"),
        "{reported:?}"
    );
    assert_eq!(reported[6..], ["opened"]);
}
