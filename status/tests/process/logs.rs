//! The logs of the process on disks that fill up, fail and vanish, and after a kill.

use std::fs;
use std::io::Write;
use std::ops::RangeInclusive;
use std::path::Path;
use std::process::Command;

use ipc_types::{Domain, TelemetryGroup, files};
use rustix::process::{Pid, Resource, Rlimit, Signal, getrlimit, prlimit};

use status::log::queue::QUEUE_SAMPLES;

use crate::fixture::{Ends, Process, config, folder, log_text, log_texts};

/// Samples of a test that loses none: no more than the queue has room for, whatever the pace of the test and the disk.
const SAMPLES: u32 = 900;
const _: () = assert!((SAMPLES as usize) < QUEUE_SAMPLES);

#[test]
fn a_kill_leaves_whole_rows_and_the_next_start_goes_on() {
    let folder = folder();
    let logs = folder.path().join("log");
    let file = folder.path().join("status.toml");
    fs::write(&file, config(&logs)).unwrap();
    let domain = Domain::isolated();
    let mut ends = Ends::join(&domain);
    let mut process = Process::start(&domain, &file);
    // Until rows have reached the file by themselves.
    let mut number = 0;
    while log_texts(&logs).iter().all(|text| text.lines().count() < 2) {
        number += 1;
        ends.through(number);
    }
    assert_eq!(process.end(Signal::KILL).0, None);
    let killed = fs::read_dir(&logs).unwrap().next().unwrap().unwrap().path();
    let mut text = fs::read_to_string(&killed).unwrap();
    // A kill in the middle of a write leaves a partial row. That moment is too short for a test to meet.
    text += "0\t12";
    fs::write(&killed, &text).unwrap();
    let whole = &text[..=text.rfind('\n').unwrap()];
    let cells = |row: &str| row.split('\t').count();
    assert!(whole.lines().all(|row| cells(row) == 6), "whole rows");

    let mut process = Process::start(&domain, &file);
    process.wait_for_message("the last run ended in the middle of a row");
    // The bridge and the consumer are still the same.
    ends.through(1);
    drop(ends);
    assert_eq!(process.end(Signal::TERM).0, Some(0));
    assert_eq!(fs::read_to_string(&killed).unwrap(), whole);
    // A file of its own, with the sample that was the latest at its start and the one after.
    let texts = log_texts(&logs);
    let mut lines: Vec<_> = texts.iter().map(|text| text.lines().count()).collect();
    lines.sort_unstable();
    assert_eq!(lines, [3, whole.lines().count()]);
    assert!(domain.residue().is_empty(), "{:?}", domain.residue());
}

/// The numbers of the samples in `rows`, which is their last cell.
fn numbers<'a>(rows: impl Iterator<Item = &'a str>) -> Vec<u32> {
    let last = |row: &str| row.rsplit('\t').next().unwrap().parse().unwrap();
    let mut numbers: Vec<_> = rows.map(last).collect();
    numbers.sort_unstable();
    numbers
}

#[test]
fn files_follow_each_other_and_the_oldest_go_when_the_total_is_reached() {
    const MIB: usize = 1024 * 1024;
    let folder = folder();
    let file = folder.path().join("status.toml");
    let logs = folder.path().join("log");
    let (oldest, foreign) = (
        logs.join("hero(1)_01_01_20-00_00_00.tsv"),
        logs.join("hero(2)_01_01_20-00_00_00.tsv"),
    );
    files::create_dir_all(&logs).unwrap();
    for earlier in [&oldest, &foreign] {
        fs::write(earlier, vec![b'x'; MIB]).unwrap();
    }
    let limits = "max_file_mib = 1\nmax_total_mib = 2\n";
    let configuration = config(&logs).replace("'xy'", "'geographic', 'xy'") + limits;
    fs::write(&file, configuration).unwrap();
    let domain = Domain::isolated();
    let mut ends = Ends::join(&domain);
    let mut process = Process::start(&domain, &file);
    for number in 1..=SAMPLES {
        ends.through_with(|dsp| {
            let groups = [
                TelemetryGroup::Sonar,
                TelemetryGroup::Geographic,
                TelemetryGroup::Xy,
            ];
            dsp.valid_groups = groups.iter().fold(0, |mask, group| mask | group.bit());
            dsp.sonar_adc = number;
            // More than 300 characters each, so that rows are long and a few of them fill a file.
            let long = -f64::MIN_POSITIVE;
            dsp.geographic.latitude_deg = long;
            dsp.geographic.longitude_deg = long;
            dsp.geographic.altitude_m = long;
            dsp.xy.x_m = long;
            dsp.xy.y_m = long;
        });
    }
    drop(ends);
    let (code, messages) = process.end(Signal::TERM);
    assert_eq!(code, Some(0));
    let last = messages.last().unwrap();
    let expected = format!(": {SAMPLES} rows in 2 files\"");
    assert!(last.contains(&expected), "{last}");
    let mut all = process.messages.iter().chain(&messages);
    assert!(
        all.any(|line| line.contains("old log removed")),
        "{messages:#?}"
    );
    assert!(!oldest.exists() && foreign.exists());

    fs::remove_file(foreign).unwrap();
    let texts = log_texts(&logs);
    let lengths: Vec<_> = texts.iter().map(String::len).collect();
    assert!(lengths.iter().all(|length| *length <= MIB), "{lengths:?}");
    let numbers = numbers(texts.iter().flat_map(|text| text.lines().skip(1)));
    assert!(
        numbers.into_iter().eq(1..=SAMPLES),
        "none twice and none missing"
    );
    assert!(domain.residue().is_empty(), "{:?}", domain.residue());
}

#[test]
fn a_directory_that_is_taken_away_and_given_back_costs_no_telemetry() {
    const THIRD: u32 = SAMPLES / 3;
    let folder = folder();
    let logs = folder.path().join("log");
    let file = folder.path().join("status.toml");
    fs::write(&file, config(&logs)).unwrap();
    let domain = Domain::isolated();
    let mut ends = Ends::join(&domain);
    let mut process = Process::start(&domain, &file);
    process.wait_for_message("log opened");
    fs::remove_dir_all(&logs).unwrap();
    // No directory can be made here.
    fs::write(&logs, "").unwrap();
    let mut through = |numbers: RangeInclusive<u32>| {
        for number in numbers {
            ends.through(number);
        }
    };
    through(1..=THIRD);
    process.wait_for_message("the log cannot be written");
    through(THIRD + 1..=2 * THIRD);
    fs::remove_file(&logs).unwrap();
    process.wait_for_message("the log is written again");
    through(2 * THIRD + 1..=SAMPLES);
    drop(ends);
    let (code, messages) = process.end(Signal::TERM);
    assert_eq!(code, Some(0));
    let last = messages.last().unwrap();
    let expected = [
        format!("published={SAMPLES}"),
        format!(": {SAMPLES} rows in 2 files"),
    ];
    assert!(expected.iter().all(|part| last.contains(part)), "{last}");
    // The removed file had taken the first rows, which are gone with it. How many is a matter of pace: it takes them
    // until it is next forced onto the disk.
    let before = last.split(" rows perhaps not on the disk").next().unwrap();
    let gone: u32 = before.rsplit(' ').next().unwrap().parse().expect(last);
    assert!(gone <= THIRD, "{last}");
    // The rows since then waited in memory.
    let text = log_text(&logs);
    let numbers = numbers(text.lines().skip(1));
    assert!(numbers.into_iter().eq(gone + 1..=SAMPLES));
}

/// Lets the room for logs in `directory` run out while telemetry flows, and gives it back: nothing is lost, because it
/// was not for long, and a message with `text` was logged.
fn room_runs_out_and_comes_back(
    directory: &Path,
    configuration: &str,
    text: &str,
    run_out: impl FnOnce(Pid),
    give_back: impl FnOnce(Pid),
) {
    // More than a page of a file, without which a full file system takes them all the same.
    const UNTIL_TOLD: u32 = 600;
    const UNTIL_ROOM: u32 = 750;
    let folder = folder();
    let file = folder.path().join("status.toml");
    fs::write(&file, configuration).unwrap();
    let domain = Domain::isolated();
    let mut ends = Ends::join(&domain);
    let mut process = Process::start(&domain, &file);
    process.wait_for_message("log opened");
    ends.through(1);
    run_out(process.id());
    for number in 2..=UNTIL_TOLD {
        ends.through(number);
    }
    process.wait_for_message(text);
    for number in UNTIL_TOLD + 1..=UNTIL_ROOM {
        ends.through(number);
    }
    give_back(process.id());
    process.wait_for_message("the log is written again");
    for number in UNTIL_ROOM + 1..=SAMPLES {
        ends.through(number);
    }
    drop(ends);
    let (code, messages) = process.end(Signal::TERM);
    assert_eq!(code, Some(0));
    let last = messages.last().unwrap();
    let (all, rows) = (
        format!("published={SAMPLES}"),
        format!(": {SAMPLES} rows in"),
    );
    assert!(last.contains(&all) && last.contains(&rows), "{last}");
    assert!(!last.contains("rows lost"), "{last}");

    let mut numbers = Vec::new();
    for text in log_texts(directory) {
        assert!(text.starts_with("flying\t") && text.ends_with('\n'));
        for row in text.lines().skip(1) {
            let cells: Vec<_> = row.split('\t').collect();
            assert_eq!(cells.len(), 6, "{row:?}");
            numbers.push(cells[1].parse::<u32>().unwrap());
        }
    }
    numbers.sort_unstable();
    assert!(
        numbers.into_iter().eq(1..=SAMPLES),
        "none twice and none missing"
    );
}

#[test]
fn writes_that_the_kernel_refuses_cost_no_telemetry_and_no_row() {
    let folder = folder();
    let limit_files = |process: Pid, current: Option<u64>| {
        // What a process inherits it has in common with this one.
        let maximum = getrlimit(Resource::Fsize).maximum;
        let limits = Rlimit { current, maximum };
        prlimit(Some(process), Resource::Fsize, limits).unwrap();
    };
    room_runs_out_and_comes_back(
        folder.path(),
        &config(folder.path()),
        "the log cannot be written",
        // In the middle of a row. Its signal would end the process.
        |process| limit_files(process, Some(5_001)),
        |process| limit_files(process, None),
    );
}

/// A file system of its own in memory, of some size; gone when it is dropped.
struct SmallDisk {
    mount_point: tempfile::TempDir,
}

impl SmallDisk {
    /// `None` if this user may not have one; the test is skipped with a message.
    fn mount(size: &str) -> Option<SmallDisk> {
        let mount_point = folder();
        let mount = Command::new("mount")
            .args(["-t", "tmpfs", "-o"])
            .arg(format!("size={size}"))
            .arg("status-test")
            .arg(mount_point.path())
            .output();
        match mount {
            Ok(output) if output.status.success() => Some(SmallDisk { mount_point }),
            refused => {
                eprintln!("SKIPPED: this user cannot mount a small file system: {refused:?}");
                None
            }
        }
    }

    fn path(&self) -> &Path {
        self.mount_point.path()
    }

    /// Takes `bytes`, or all that there are.
    fn fill(&self, bytes: usize) {
        let mut file = fs::File::create(self.path().join("filler")).unwrap();
        // That it is full is what is wanted.
        let _ = file.write_all(&vec![0; bytes]);
    }

    fn empty(&self) {
        fs::remove_file(self.path().join("filler")).unwrap();
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        // Lazily: a process that a failed test has left may still have a file open.
        let _ = Command::new("umount").arg("-l").arg(self.path()).status();
    }
}

#[test]
fn a_full_file_system_costs_no_telemetry_and_no_row() {
    let Some(disk) = SmallDisk::mount("256k") else {
        return;
    };
    room_runs_out_and_comes_back(
        disk.path(),
        &config(disk.path()),
        "the log cannot be written",
        |_| disk.fill(1 << 20),
        |_| disk.empty(),
    );
}

#[test]
fn a_file_system_that_is_nearly_full_is_left_alone() {
    let Some(disk) = SmallDisk::mount("16m") else {
        return;
    };
    let configuration = config(disk.path()).replace("min_free_mib = 0", "min_free_mib = 8");
    room_runs_out_and_comes_back(
        disk.path(),
        &configuration,
        "the disk is nearly full",
        |_| disk.fill(9 << 20),
        |_| disk.empty(),
    );
}
