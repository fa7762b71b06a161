//! What did not come to the recorder is told by the record itself, exactly.

use ril_tests::Sandbox;
use std::iter;
use std::thread;
use std::time::{Duration, Instant};

use recording::EventKind;
use ril_tests::process::Signal;

use super::feed::{
    Feed, TOPIC, check, has, lines, missing, only_file, record, record_by, samples, told,
    until_recorded, words,
};
use super::starved::Starved;
use crate::common::{end, sandbox, says};

/// A recorder that does not read while this many samples are published: four times what a subscriber holds.
const STOPPED_FOR: u64 = 512;

/// The record of `feed` must tell of each sample that it lacks. Returns how many those are.
#[track_caller]
fn lost(rig: &Sandbox, last: u64) -> u64 {
    let file = only_file(rig);
    let samples = samples(&file, TOPIC);
    let missing = missing(&samples);
    let check = check(&file);
    assert!(check.is_complete, "{check:#?}");
    let told = told(&check, TOPIC);
    let [before, dropped] = [EventKind::Gap, EventKind::Loss].map(|kind| told.get(&kind));
    let lost = before.unwrap_or(&0) + dropped.unwrap_or(&0);
    assert_eq!(lost, missing, "{told:?}");
    assert_eq!(check.topics[TOPIC].missing, missing);
    assert_eq!(samples.last().unwrap().0, last, "the last one is there");
    rig.run(&format!("log check {}", file.display()), 0);
    missing
}

#[test]
fn a_stopped_recorder_tells_what_it_missed() {
    let rig = sandbox();
    let mut feed = Feed::new(&rig);
    let recorder = record(&rig, "");
    // What comes before the first sample of a record is not missing in it.
    until_recorded(&rig, feed.publish());
    recorder.signal(Signal::STOP);
    (0..STOPPED_FOR).for_each(|_| _ = feed.publish());
    recorder.signal(Signal::CONT);
    let last = feed.publish();
    end(recorder, Signal::TERM);
    assert!(lost(&rig, last) > 0);
}

#[test]
fn a_slowed_recorder_tells_what_it_missed() {
    let rig = sandbox();
    let mut feed = Feed::new(&rig);
    let recorder = record(&rig, "");
    let mut last = 0;
    for round in 0..40 {
        recorder.signal(Signal::STOP);
        (0..20 * (round % 10)).for_each(|_| _ = feed.publish());
        recorder.signal(Signal::CONT);
        last = feed.publish();
    }
    end(recorder, Signal::INT);
    lost(&rig, last);
}

/// Longest flood. A recorder whose disk takes nothing has its queue full in a few seconds.
const FLOOD: Duration = Duration::from_secs(20);

/// Samples that a recorder with a processor and a disk would follow, and that one without cannot.
const PACE: Duration = Duration::from_millis(1);

#[test]
fn a_starved_recorder_tells_what_it_missed() {
    let rig = sandbox();
    let mut feed = Feed::new(&rig);
    let recorder = record(&rig, "");
    until_recorded(&rig, feed.publish());
    let starved = Starved::threads_of(&recorder, None);
    for _ in 0..2000 {
        feed.publish();
        // The pace is what is tried here, not something that is waited for.
        thread::sleep(PACE);
    }
    drop(starved);
    let last = feed.publish();
    end(recorder, Signal::TERM);
    lost(&rig, last);
}

#[test]
fn a_recorder_whose_disk_is_slow_tells_what_it_dropped() {
    let rig = sandbox();
    let mut feed = Feed::new(&rig);
    let mut recorder = record(&rig, "");
    until_recorded(&rig, feed.publish());
    let starved = Starved::threads_of(&recorder, Some("disk"));
    let begun = Instant::now();
    // More than the queue has room for, unless the machine has no time for this test either.
    while !says(&lines(&mut recorder), "messages are lost") && begun.elapsed() < FLOOD {
        (0..10_000).for_each(|_| _ = feed.publish());
    }
    drop(starved);
    // What is dropped last shows when a later sample is recorded.
    let file = only_file(&rig);
    let last = iter::repeat_with(|| feed.publish())
        .find(|number| (0..10).any(|_| has(&file, *number)))
        .unwrap();
    recorder.signal(Signal::TERM);
    let finished = recorder.wait_exit();
    lost(&rig, last);
    // What was dropped shows in the exit code, too.
    let has_dropped = told(&check(&file), TOPIC).contains_key(&EventKind::Loss);
    let expected = if has_dropped { 8 } else { 0 };
    assert_eq!(finished.code(), Some(expected), "{finished:#?}");
}

#[test]
fn a_flooded_recorder_tells_what_it_missed() {
    let rig = sandbox();
    let mut feed = Feed::new(&rig);
    let recorder = record(&rig, "");
    // As fast as this process can, which is faster than any robot.
    let last = (0..100_000).map(|_| feed.publish()).last().unwrap();
    end(recorder, Signal::TERM);
    lost(&rig, last);
}

#[test]
fn what_was_sent_before_the_recorder_had_joined_is_told() {
    let rig = sandbox();
    let mut recorder = rig.start(&words(""));
    recorder.wait_for_text("recording file=");
    recorder.signal(Signal::STOP);
    let mut feed = Feed::new(&rig);
    (0..STOPPED_FOR).for_each(|_| _ = feed.publish());
    recorder.signal(Signal::CONT);
    let recorder = record_by(&rig, recorder);
    until_recorded(&rig, feed.publish());
    end(recorder, Signal::TERM);
    let file = only_file(&rig);
    let first = samples(&file, TOPIC)[0].0;
    assert!(first > 1, "it cannot have come before it was continued");
    let told = told(&check(&file), TOPIC);
    assert_eq!(told.get(&EventKind::Late), Some(&(first - 1)), "{told:?}");
    rig.run(&format!("log check {}", file.display()), 0);
}
