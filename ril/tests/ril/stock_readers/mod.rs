//! Recordings through readers that others wrote: `mcap` with `mcap-ros2-support` and `rosbags` from PyPI, `@mcap/core`
//! with `@lichtblick/rosmsg2-serialization` from npm; and through the Python package of this workspace. Each finds
//! every field of every message as it was recorded, in finished files and in those that a kill has ended.
//!
//! The packages are installed into a folder of their own: [`ril_tests::readers`]. What is missing is said, and then
//! nothing is tested.

mod consumer;
mod documents;
mod kills;
mod made;
mod recorded;

use made::made;
use ril_tests::readers::readers_or_skip;
use ril_tests::readers::sums::Sums;

#[test]
fn a_finished_file_is_read_by_all_as_it_was_recorded() {
    let readers = readers_or_skip("a finished recording");
    if readers.is_empty() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let made = made();
    let path = folder.path().join("finished.mcap");
    std::fs::write(&path, made.finished()).unwrap();
    for reader in readers {
        let [read] = &reader.read(&[&path])[..] else {
            panic!("{reader}: one file was given");
        };
        assert_eq!(read.error, None, "{reader}");
        made.expected.assert_all_in(read, &reader.to_string());
    }
}

#[test]
fn a_file_that_a_kill_has_ended_is_read_by_all_up_to_the_last_half_second() {
    let readers = readers_or_skip("recordings of a killed recorder");
    if readers.is_empty() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let made = made();
    let mut kills = kills::kills(&made);
    kills.extend(kills::recovered(&kills));
    let paths: Vec<_> = (0..kills.len())
        .map(|number| folder.path().join(format!("kill-{number}.mcap")))
        .collect();
    for (kill, path) in kills.iter().zip(&paths) {
        std::fs::write(path, &kill.bytes).unwrap();
    }
    let paths: Vec<_> = paths.iter().map(|path| path.as_path()).collect();
    for reader in readers.iter().filter(|reader| reader.reads_unfinished()) {
        for (kill, read) in kills.iter().zip(reader.read(&paths)) {
            kill.assert_read(&made, &read, reader);
        }
    }
}

#[test]
fn sums_of_readers_agree() {
    let readers = readers_or_skip("sums");
    let folder = tempfile::tempdir().unwrap();
    let made = made();
    let path = folder.path().join("finished.mcap");
    std::fs::write(&path, made.finished()).unwrap();
    let ours = Sums::of(&made.finished());
    let recorded: usize = made.expected.0.values().map(Vec::len).sum();
    assert_eq!(ours.messages(), recorded as u64);
    for reader in readers.iter().filter(|reader| reader.is_of_others()) {
        assert_eq!(
            reader.sums(&[&path]),
            std::slice::from_ref(&ours),
            "{reader}"
        );
    }
}
