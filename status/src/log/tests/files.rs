//! Which files there are, and what is in them: rows, rotation, the limit on the total.

use std::path::{Path, PathBuf};

use super::*;
use crate::log::file_name::{Series, Utc, file_name};
use crate::log::open_file::SYNC_PERIOD;
use crate::log::retention::MAX_FILES;
use crate::log::writer::{BLOCK_BYTES, FLUSH_PERIOD};
use crate::test_samples::full_sample;
use crate::test_store::{Act, Fault};

#[test]
fn the_file_is_created_at_the_start_and_rows_follow_the_first_line() {
    let mut flight = Flight::begin(MemoryStore::default(), UNLIMITED);
    assert_eq!(flight.told(), ["opened"]);
    assert_eq!(flight.disk.0.borrow().only_file(), header(&Group::ALL));
    assert_eq!(flight.log.deadline(), None, "nothing waits");
    flight.fly(3);
    let written = flight.land();
    assert_eq!((written.files, written.rows), (1, 3));
    assert_eq!(sequences(&flight.disk.0.borrow().only_file()), [1, 2, 3]);
    let path = flight.disk.0.borrow().created[0].clone();
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
        assert_eq!(log.finish(START).rows, 1);
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
fn missing_groups_are_told_once_each() {
    let groups = [Group::Time, Group::Sonar, Group::Barometer];
    let config = config("", &groups);
    let store = MemoryStore::default();
    let mut log = LogWriter::new(&config, UNLIMITED, RobotId::DEFAULT, store);
    let mut told = |valid: GroupSet| {
        let mut sample = full_sample();
        sample.valid_groups = valid.0;
        log.record(&sample, START);
        let events = log.take_events();
        events.iter().map(words).collect::<Vec<_>>()
    };
    let without = |groups: &[Group]| GroupSet::ALL.without(groups.iter().copied().collect());
    assert!(told(GroupSet::ALL).is_empty());
    // A group that the log does not have is nothing to tell.
    assert!(told(without(&[Group::Xy])).is_empty());
    assert_eq!(told(without(&[Group::Sonar])), ["missing sonar"]);
    assert!(told(without(&[Group::Sonar])).is_empty());
    let both = [Group::Sonar, Group::Barometer];
    assert_eq!(told(without(&both)), ["missing barometer"]);
    assert!(told(GroupSet::ALL).is_empty());
    assert!(told(without(&both)).is_empty());
}

#[test]
fn rows_are_flushed_by_a_deadline_after_the_oldest() {
    let mut flight = Flight::begin(MemoryStore::default(), UNLIMITED);
    flight.fly(1);
    let first = flight.now;
    flight.wait(Duration::from_millis(400));
    flight.fly(1);
    assert_eq!(flight.log.deadline(), Some(first + FLUSH_PERIOD));
    assert_eq!(all_sequences(&flight.disk), []);
    flight.wait(Duration::from_millis(80));
    assert_eq!(all_sequences(&flight.disk), [1, 2]);
    let syncing = first + FLUSH_PERIOD + SYNC_PERIOD;
    assert_eq!(flight.log.deadline(), Some(syncing));
    flight.fly(1);
    assert_eq!(flight.log.deadline(), Some(flight.now + FLUSH_PERIOD));
}

#[test]
fn no_row_waits_longer_than_a_flush_period_and_none_is_unsure_for_longer_than_a_sync_period() {
    let mut flight = Flight::short(MemoryStore::default(), UNLIMITED);
    let mut synced_at = START;
    let mut syncs = 0;
    for _ in 0..1500 {
        flight.fly(1);
        let disk = flight.disk.0.borrow();
        let rows = disk.only_file().lines().count() as u64 - 1;
        let waiting = flight.samples - rows;
        assert!(waiting * 20 <= 500, "{waiting} rows wait");
        let count = disk.acts.iter().filter(|act| **act == Act::Sync).count();
        if count > syncs {
            syncs = count;
            synced_at = flight.now;
        }
        let unsure = flight.now.since(synced_at);
        assert!(unsure <= SYNC_PERIOD + FLUSH_PERIOD + SAMPLE_PERIOD);
    }
    assert!(syncs <= 30 / 5, "{syncs} times in 30 s");
}

#[test]
fn fast_telemetry_is_written_in_blocks_of_whole_rows() {
    let mut flight = Flight::begin(MemoryStore::default(), UNLIMITED);
    let mut length = header(&Group::ALL).len();
    let mut blocks = 0;
    while blocks < 3 {
        // All in one moment.
        flight.samples += 1;
        flight.log.record(&sample(1, flight.samples), START);
        let text = flight.disk.0.borrow().only_file();
        if text.len() > length {
            assert!(text.len() - length >= BLOCK_BYTES);
            assert_eq!(sequences(&text).last(), Some(&flight.samples));
            length = text.len();
            blocks += 1;
        }
    }
}

#[test]
fn every_limit_on_a_file_is_kept_and_no_row_is_lost_or_repeated_at_its_end() {
    let first_line = header(&[Group::Time]).len() as u64;
    // With the number of a sample in two digits; with one it is a byte less.
    let row = "1\t10\t5000000000\t12345\n".len() as u64;
    // From no row to several, byte by byte, so that the limit falls on every place of a row and on its end.
    for max_file_bytes in first_line..=first_line + 4 * row {
        let limits = Limits {
            max_file_bytes,
            ..UNLIMITED
        };
        let mut flight = Flight::short(MemoryStore::default(), limits);
        flight.fly(60);
        let written = flight.land();
        assert_eq!(runs(&all_sequences(&flight.disk)), [(1, 60)]);
        let texts = flight.disk.0.borrow().texts();
        assert_eq!(written.files, texts.len() as u64);
        // A limit that is too small for one row is broken rather than stopping the log.
        let most_rows = ((max_file_bytes - first_line) / (row - 1)).max(1);
        let least_rows = ((max_file_bytes - first_line) / row).max(1);
        for (index, text) in texts.iter().enumerate() {
            let rows = sequences(text).len() as u64;
            let is_last = index == texts.len() - 1;
            assert!(
                rows <= most_rows && (rows >= least_rows || is_last),
                "{rows}"
            );
            assert!(text.len() as u64 <= max_file_bytes || rows == 1);
        }
        // Each was forced onto the disk when it was closed.
        let acts = &flight.disk.0.borrow().acts;
        let syncs = acts.iter().filter(|act| **act == Act::Sync).count();
        assert!(syncs >= texts.len());
    }
}

/// Limits of `files` files of 8 KiB.
fn limits_of(files: u64) -> Limits {
    Limits {
        max_file_bytes: 8192,
        max_total_bytes: files * 8192,
        min_free_bytes: 0,
    }
}

#[test]
fn the_total_is_kept_by_removing_the_oldest() {
    let mut flight = Flight::begin(MemoryStore::default(), limits_of(4));
    let mut sizes = Vec::new();
    for _ in 0..2000 {
        flight.fly(1);
        flight.pass_seconds(1);
        sizes.push(flight.disk.0.borrow().total_bytes());
    }
    let written = flight.land();
    assert!(written.files > 50);
    assert!(sizes.iter().all(|size| *size <= 4 * 8192));
    assert_eq!(flight.disk.0.borrow().files.len(), 4);
    let runs = runs(&all_sequences(&flight.disk));
    assert!(
        matches!(runs[..], [(1000.., 2000)]),
        "the newest stay: {runs:?}"
    );
    let removed = flight
        .told()
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
    let mut flight = Flight::begin(disk.clone(), limits_of(5));
    assert_eq!(flight.told(), ["removed", "removed", "opened"]);
    for gone in 2..=own.len() {
        let left: Vec<_> = own.iter().map(|path| is_there(path)).collect();
        let expected: Vec<_> = (0..own.len()).map(|index| index >= gone).collect();
        assert_eq!(left, expected);
        while !flight.told().contains(&"removed".to_owned()) {
            flight.fly(1);
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
    let mut flight = Flight::begin(disk.clone(), limits_of(3));
    let first = disk.0.borrow().created[0].clone();
    while !flight.told().contains(&"removed".to_owned()) {
        flight.fly(1);
    }
    assert!(!disk.0.borrow().files.contains_key(&old));
    assert!(disk.0.borrow().files.contains_key(&first));
    // Among its own files the order of creation counts, wherever the clock jumps.
    for unix_s in [1_000_000_000, 5, 2_000_000_000, 0] {
        disk.0.borrow_mut().unix_s = unix_s;
        flight.fly(50);
    }
    let samples = flight.samples;
    flight.land();
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
    let mut flight = Flight::begin(disk.clone(), limits_of(4));
    flight.fly(400);
    let written = flight.land();
    assert_eq!(written.lost, 0);
    assert!(disk.0.borrow().files.contains_key(&stubborn));
    assert!(disk.0.borrow().total_bytes() <= 4 * 8192);
    assert!(!flight.told().contains(&"failed".to_owned()));
}

#[test]
fn a_total_that_cannot_be_kept_stops_the_log_until_it_can() {
    let disk = MemoryStore::default();
    let stubborn = PathBuf::from("log/hero(1)_01_01_01-00_00_00.tsv");
    disk.0.borrow_mut().stubborn.insert(stubborn.clone());
    let content = vec![b'x'; 30_000];
    disk.0.borrow_mut().files.insert(stubborn, content);
    let mut flight = Flight::begin(disk.clone(), limits_of(4));
    assert_eq!(flight.told(), ["failed"]);
    flight.fly(100);
    assert_eq!(disk.0.borrow().created.len(), 0);
    disk.0.borrow_mut().stubborn.clear();
    flight.fly(600);
    let told = flight.told();
    assert_eq!(told[..2], ["removed", "opened"]);
    assert!(told.contains(&"resumed, 0 lost".to_owned()), "{told:?}");
    assert_eq!(flight.land().lost, 0);
}

#[test]
fn the_piece_of_a_row_that_a_kill_left_is_cut_off_at_the_next_start() {
    let older = "log/hero(1)_01_01_05-00_00_00.tsv";
    let newer = "log/hero(1)_02_01_05-00_00_00.tsv";
    let foreign = "log/hero(1)_03_01_05-00_00_00_imu.tsv";
    for broken in [false, true] {
        let disk = MemoryStore::default();
        for path in [older, newer, foreign] {
            let content = b"names\nrow\npie".to_vec();
            disk.0.borrow_mut().files.insert(path.into(), content);
        }
        // The first act is to look for the file, the second to mend it.
        let fault = (1..2, Fault::Broken);
        disk.0.borrow_mut().fault = broken.then_some(fault);
        let mut flight = Flight::begin(disk.clone(), UNLIMITED);
        let expected: &[_] = match broken {
            true => &["opened"],
            false => &["mended 3", "opened"],
        };
        assert_eq!(flight.told(), expected);
        assert_eq!(disk.0.borrow().acts[1], Act::Mend);
        flight.fly(100);
        assert_eq!(flight.land().rows, 100);
        let length = |path: &str| disk.0.borrow().files[Path::new(path)].len();
        let lengths = [older, newer, foreign].map(length);
        assert_eq!(lengths, [13, if broken { 13 } else { 10 }, 13]);
    }
}

#[test]
fn the_number_of_files_is_bounded_however_short_they_are() {
    let disk = MemoryStore::default();
    let series = Series::new(RobotId::DEFAULT, "".parse().unwrap());
    for second in 0..MAX_FILES as u64 + 5 {
        let stem = series.stem(Utc::from_unix(second));
        let path = Path::new("log").join(file_name(&stem, 1));
        disk.0.borrow_mut().files.insert(path, Vec::new());
    }
    let mut flight = Flight::begin(disk.clone(), UNLIMITED);
    assert_eq!(disk.0.borrow().files.len(), MAX_FILES);
    let told = flight.told();
    assert!(told[..6].iter().all(|word| word == "removed"), "{told:?}");
    assert_eq!(told[6..], ["opened"]);
}
