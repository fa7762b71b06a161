//! The thread of the disk and its worker on a real folder: what each action leaves there, and what the operator is
//! told.

use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::PathBuf;

use ipc_types::RobotId;
use recording::{DiskErrorKind, Part};
use ril_tests::sandbox::records_in;
use status::log::config::LogLimits;
use status::log::file_name::{Series, recognize};
use tempfile::TempDir;

use super::*;
use super::{ClosedFile, Note};

fn place(folder: &TempDir) -> RecordFolder {
    RecordFolder {
        folder: folder.path().join("a/b"),
        series: Series::of_records(RobotId::DEFAULT),
        limits: LogLimits {
            max_file_bytes: 4096,
            max_total_bytes: 8192,
            min_free_bytes: 0,
        },
        layout: ViewerLayout {
            name: "layout.json".to_owned(),
            text: "{}".to_owned(),
        },
    }
}

fn write(at: u64, bytes: &[u8]) -> FileAction {
    let bytes = bytes.to_vec();
    FileAction::Write {
        parts: vec![Part { at, bytes }],
    }
}

#[test]
fn actions_are_carried_out_and_files_are_named_in_the_order_of_time() {
    let folder = tempfile::tempdir().unwrap();
    let place = place(&folder);
    let mut worker = Worker::new(place.clone(), FileStore);
    let mut paths = Vec::new();
    for index in 0..3 {
        let outcome = worker.perform(FileAction::Open { index });
        assert_eq!(outcome.result, Ok(()));
        let Some(Note::Opened(path)) = outcome.notes.last() else {
            panic!("{:?}", outcome.notes)
        };
        paths.push(path.clone());
        for action in [
            write(0, b"abcdef"),
            write(3, b"DEFGHI"),
            FileAction::Truncate { len: 7 },
            FileAction::Sync,
        ] {
            assert_eq!(worker.perform(action).result, Ok(()));
        }
        assert_eq!(fs::read(path).unwrap(), b"abcDEFG");
        let closed = worker.perform(FileAction::Close {
            is_whole: true,
            messages: 5,
        });
        assert_eq!(
            closed.notes,
            [Note::Closed(ClosedFile {
                path: path.clone(),
                is_whole: true,
                messages: 5,
                bytes: 7
            })]
        );
    }
    // Two files of a block each are all that may be there. Within one second, the name of the one that was removed is
    // free again.
    let there = records_in(&place.folder);
    let mut expected = paths[1..].to_vec();
    expected.sort();
    assert_eq!(there, expected, "{paths:?}");
    let stamp = |path: &PathBuf| recognize(path.file_name()?.to_str()?).map(|(_, stamp)| stamp);
    let stamps: Vec<_> = paths[..2].iter().map(stamp).collect();
    assert!(stamps.is_sorted() && stamps[0].is_some(), "{paths:?}");
}

#[test]
fn the_layout_lies_beside_the_files_and_one_that_is_there_stays() {
    let folder = tempfile::tempdir().unwrap();
    let place = place(&folder);
    let layout = place.folder.join(&place.layout.name);
    let mut worker = Worker::new(place, FileStore);
    for (index, changed) in ["{}", "[]"].into_iter().enumerate() {
        let index = index as u32;
        assert_eq!(worker.perform(FileAction::Open { index }).result, Ok(()));
        assert_eq!(fs::read_to_string(&layout).unwrap(), changed);
        assert_eq!(fs::metadata(&layout).unwrap().mode() & 0o137, 0);
        fs::write(&layout, "[]").unwrap();
        let (is_whole, messages) = (true, 1);
        worker.perform(FileAction::Close { is_whole, messages });
    }
}

#[test]
fn a_file_without_a_message_goes() {
    let folder = tempfile::tempdir().unwrap();
    let place = place(&folder);
    let mut worker = Worker::new(place.clone(), FileStore);
    worker.perform(FileAction::Open { index: 0 });
    worker.perform(write(0, b"only the beginning"));
    let closed = worker.perform(FileAction::Close {
        is_whole: true,
        messages: 0,
    });
    assert!(matches!(&closed.notes[..], [Note::NothingCame(_)]));
    assert!(records_in(&place.folder).is_empty());
}

#[test]
fn the_file_that_was_just_finished_stays_though_it_is_a_little_too_long() {
    let folder = tempfile::tempdir().unwrap();
    let mut worker = Worker::new(place(&folder), FileStore);
    let mut opened = |index| {
        let notes = worker.perform(FileAction::Open { index }).notes;
        let Some(Note::Opened(path)) = notes.last() else {
            panic!("{notes:?}")
        };
        // The last chunk and the summary come on top of the size at which another file is begun.
        worker.perform(write(0, &[1; 4097]));
        let (is_whole, messages) = (true, 1);
        worker.perform(FileAction::Close { is_whole, messages });
        path.clone()
    };
    let [_, before, last] = [0, 1, 2].map(&mut opened);
    assert_eq!(records_in(&folder.path().join("a/b")).len(), 2);
    assert!(before.exists() && last.exists());
}

#[test]
fn a_file_is_never_for_everybody_whatever_the_umask() {
    let folder = tempfile::tempdir().unwrap();
    let mut worker = Worker::new(place(&folder), FileStore);
    let before = rustix::process::umask(rustix::fs::Mode::empty());
    let notes = worker.perform(FileAction::Open { index: 0 }).notes;
    rustix::process::umask(before);
    let Some(Note::Opened(path)) = notes.last() else {
        panic!("{notes:?}")
    };
    assert_eq!(fs::metadata(path).unwrap().mode() & 0o777, 0o640);
}

#[test]
fn a_file_that_another_program_has_cut_is_of_no_more_use() {
    let folder = tempfile::tempdir().unwrap();
    let mut worker = Worker::new(place(&folder), FileStore);
    let notes = worker.perform(FileAction::Open { index: 0 }).notes;
    let Some(Note::Opened(path)) = notes.last() else {
        panic!("{notes:?}")
    };
    assert_eq!(worker.perform(write(0, b"abcdef")).result, Ok(()));
    fs::OpenOptions::new()
        .write(true)
        .open(path)
        .unwrap()
        .set_len(2)
        .unwrap();
    let error = worker.perform(write(6, b"ghi")).result.unwrap_err();
    assert_eq!(error.kind, DiskErrorKind::Failed);
    assert!(error.text.contains("cut"), "{error}");
}

#[test]
fn a_disk_that_is_nearly_full_is_left_alone_and_one_that_fails_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let mut low = place(&folder);
    low.limits.min_free_bytes = u64::MAX;
    let outcome = Worker::new(low, FileStore).perform(FileAction::Open { index: 0 });
    assert_eq!(outcome.result.unwrap_err().kind, DiskErrorKind::LowSpace);
    assert_eq!(outcome.notes, []);

    let mut blocked = place(&folder);
    fs::write(folder.path().join("file"), "").unwrap();
    blocked.folder = folder.path().join("file/log");
    let outcome = Worker::new(blocked, FileStore).perform(FileAction::Open { index: 0 });
    let error = outcome.result.unwrap_err();
    assert_eq!(error.kind, DiskErrorKind::Failed);
    assert!(error.text.contains("file/log"), "{error}");
}

#[test]
fn a_file_that_was_removed_is_an_error_at_the_next_sync() {
    let folder = tempfile::tempdir().unwrap();
    let mut worker = Worker::new(place(&folder), FileStore);
    worker.perform(FileAction::Open { index: 0 });
    fs::remove_dir_all(folder.path().join("a")).unwrap();
    assert_eq!(worker.perform(write(0, b"x")).result, Ok(()));
    let error = worker.perform(FileAction::Sync).result.unwrap_err();
    assert_eq!(error.kind, DiskErrorKind::Failed);
    assert!(error.text.contains("removed"), "{error}");
}

#[test]
fn the_thread_answers_and_wakes() {
    let folder = tempfile::tempdir().unwrap();
    let mut disk = Disk::start(place(&folder)).unwrap();
    assert!(disk.outcome().unwrap().is_none());
    disk.perform(FileAction::Open { index: 0 }).unwrap();
    assert!(disk.is_busy());
    let mut ready = [rustix::event::PollFd::new(
        &disk,
        rustix::event::PollFlags::IN,
    )];
    rustix::event::poll(&mut ready, None).unwrap();
    let outcome = disk.outcome().unwrap().unwrap();
    assert_eq!(outcome.result, Ok(()));
    assert!(!disk.is_busy());
    let mut ready = [rustix::event::PollFd::new(
        &disk,
        rustix::event::PollFlags::IN,
    )];
    let at_once = rustix::event::Timespec {
        tv_sec: 0,
        tv_nsec: 0,
    };
    let count = rustix::event::poll(&mut ready, Some(&at_once)).unwrap();
    assert_eq!(count, 0, "it is not awake for ever");
}
