//! A disk that does not take the record: the robot flies on, and the record says what it lacks.

use recording::EventKind;
use ril_tests::Process;
use ril_tests::process::Signal;

use super::feed::{Feed, TOPIC, check, files, has, lines, record, record_by, samples, words};
use crate::common::{Rig, says};

/// A file of the record may have so many blocks of 512 bytes.
const MAX_BLOCKS: u32 = 128;

#[test]
fn a_file_that_may_not_grow_is_followed_by_another_one_that_says_so() {
    let rig = Rig::new();
    let mut feed = Feed::new(&rig);
    let shell = format!("ulimit -f {MAX_BLOCKS}; exec \"$0\" {}", words(""));
    let mut recorder = record_by(&rig, Process::spawn(&rig.domain, rig.shell(&shell)));
    recorder.wait_for_text("recording file=");
    // Little by little, so that the file takes some of it.
    let mut published = 0;
    while !says(&lines(&mut recorder), "the recording cannot be written") {
        (0..10).for_each(|_| published = feed.publish());
        while !files(&rig).iter().any(|file| has(file, published))
            && !says(&lines(&mut recorder), "the recording cannot be written")
        {
            std::thread::yield_now();
        }
    }
    // The next file, with what the first one lacks.
    recorder.wait_for_text("recording file=");
    recorder.signal(Signal::TERM);
    let finished = recorder.wait_exit();
    assert_eq!(
        finished.code(),
        Some(8),
        "one file has no end: {finished:#?}"
    );
    let files = files(&rig);
    assert!(files.len() >= 2, "{files:?}");
    let events: Vec<_> = files.iter().flat_map(|file| check(file).events).collect();
    assert!(
        events.iter().any(|event| event.kind == EventKind::Disk),
        "{events:#?}"
    );
    let all = files.iter().flat_map(|file| samples(file, TOPIC));
    let all: Vec<u64> = all.map(|(number, _)| number).collect();
    assert_eq!(all, (all[0]..=published).collect::<Vec<_>>());
}

#[test]
fn a_disk_that_is_nearly_full_is_left_alone() {
    let rig = Rig::new();
    let mut feed = Feed::new(&rig);
    let mut recorder = record(&rig, "--min-free 1048576");
    recorder.wait_for_text("the disk is nearly full");
    (0..10).for_each(|_| _ = feed.publish());
    recorder.signal(Signal::TERM);
    let finished = recorder.wait_exit();
    assert_eq!(finished.code(), Some(8), "{finished:#?}");
    assert!(says(&finished.stderr, "the disk did not take everything"));
    assert!(files(&rig).is_empty());
}

#[test]
fn options_that_do_not_fit_together_are_refused() {
    let rig = Rig::new();
    let finished = rig.run("record --size 100 --max-total 199", 2);
    assert!(says(&finished.stderr, "less than twice --size"));
    rig.run("record --bridge absent.toml", 78);
    rig.write("empty.mcap", "");
    for verb in ["check", "recover"] {
        let finished = rig.run(&format!("log {verb} empty.mcap"), 2);
        assert!(says(&finished.stderr, "it is empty"), "{finished:#?}");
    }
}

#[test]
fn without_a_message_no_file_is_left() {
    let rig = Rig::new();
    let mut recorder = rig.start(&words(""));
    recorder.wait_for_text("recording file=");
    recorder.signal(Signal::INT);
    assert_eq!(recorder.wait_exit().code(), Some(0));
    assert!(files(&rig).is_empty());
}
