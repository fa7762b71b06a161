//! A disk that is slow, full or broken: what is missing in the files is what they say is missing.

use std::collections::BTreeMap;
use std::time::Duration;

use proptest::prelude::*;
use recording::read::check;
use recording::{DiskErrorKind, EventKind, Settings};

use crate::session::Session;
use crate::stock;

fn settings() -> Settings {
    Settings {
        queue_bytes: 20_000,
        ..Settings::default()
    }
}

/// Losses by topic, as the events of all files say, and as the gaps in the sequences over all files say.
fn losses(session: &Session) -> (BTreeMap<String, u64>, BTreeMap<String, u64>) {
    let mut by_events = BTreeMap::new();
    let mut by_gaps = BTreeMap::new();
    let mut sequences: BTreeMap<String, u32> = BTreeMap::new();
    for file in &session.disk.files {
        for event in check(file).events {
            if event.kind == EventKind::Loss {
                *by_events.entry(event.topic).or_insert(0) += event.count;
            }
        }
        for (topic, sequence, ..) in stock::of_topics(stock::until_error(file).0) {
            let last = sequences.insert(topic.clone(), sequence).unwrap_or(0);
            assert!(sequence > last, "{topic}: {sequence} after {last}");
            let missing = u64::from(sequence - last - 1);
            if missing > 0 {
                *by_gaps.entry(topic).or_insert(0) += missing;
            }
        }
    }
    (by_events, by_gaps)
}

fn assert_accounted(session: &Session) {
    let (by_events, by_gaps) = losses(session);
    assert_eq!(by_events, by_gaps);
    let dropped = session.recorder.totals().dropped;
    assert_eq!(by_events.values().sum::<u64>(), dropped);
}

#[test]
fn a_slow_disk_loses_what_the_file_says() {
    let mut session = Session::new(settings(), 2);
    session.settle();
    for index in 0..2000 {
        session.add(index % 2, 50);
        if session.outstanding.is_none() {
            session.outstanding = session.recorder.next();
        }
        // One action in 0.4 s, while twice as much comes as fits into the queue.
        if index % 400 == 0 {
            session.answer();
        }
        session.now = session.now + Duration::from_millis(1);
        session.wake();
    }
    session.settle();
    session.add(0, 1);
    session.add(1, 1);
    session.end();
    assert!(session.recorder.totals().dropped > 500);
    assert_accounted(&session);
    // Few long gaps, not one for each message.
    let events = check(&session.disk.files[0]).events.len();
    assert!(events < 20, "{events}");
}

#[test]
fn a_full_disk_begins_another_file_when_it_has_room_again() {
    let mut session = Session::new(Settings::default(), 1);
    session.add(0, 10);
    session.settle();
    session.pass(Duration::from_secs(1));
    session.disk.failure = Some(DiskErrorKind::Failed);
    session.add(0, 10);
    session.pass(Duration::from_secs(7));
    session.add(0, 10);
    session.pass(Duration::from_secs(1));
    assert_eq!(session.disk.files.len(), 1);
    session.disk.failure = None;
    session.pass(Duration::from_secs(6));
    session.end();
    let files = &session.disk.files;
    let counts: Vec<_> = files
        .iter()
        .map(|file| stock::of_topics(stock::until_error(file).0).len())
        .collect();
    assert_eq!(counts, [1, 2]);
    assert_accounted(&session);
    let events = check(&files[1]).events;
    let texts: Vec<_> = events
        .iter()
        .map(|event| (event.kind, &*event.text))
        .collect();
    let [(EventKind::Disk, begin), (EventKind::Disk, end)] = &texts[..] else {
        panic!("{texts:?}");
    };
    assert!(
        begin.contains("the simulated disk fails; of the messages before, 1 may"),
        "{begin}"
    );
    assert!(
        end.contains("the disk takes messages again, after 1"),
        "{end}"
    );
}

#[test]
fn a_disk_with_little_space_goes_on_in_the_same_file() {
    let mut session = Session::new(Settings::default(), 1);
    session.settle();
    session.disk.failure = Some(DiskErrorKind::LowSpace);
    session.add(0, 10);
    session.pass(Duration::from_secs(12));
    session.disk.failure = None;
    session.pass(Duration::from_secs(6));
    session.end();
    assert_eq!(session.disk.is_whole, [Some(true)]);
    assert_eq!(
        stock::of_topics(stock::all(&session.disk.files[0])).len(),
        1
    );
    assert_eq!(check(&session.disk.files[0]).events.len(), 2);
}

#[test]
fn a_disk_that_fails_at_the_end_ends_the_recording() {
    for failure in [DiskErrorKind::Failed, DiskErrorKind::LowSpace] {
        for begins in [false, true] {
            let mut session = Session::new(Settings::default(), 1);
            if begins {
                session.settle();
            }
            session.add(0, 10);
            session.disk.failure = Some(failure);
            session.end();
            assert_eq!(session.recorder.totals().dropped, 1);
            assert_eq!(session.recorder.deadline(), None);
            assert_eq!(session.recorder.next(), None);
        }
    }
}

#[test]
fn a_message_that_is_larger_than_the_queue_is_lost_alone() {
    let mut session = Session::new(settings(), 1);
    session.settle();
    for len in [10, 30_000, 10, 10] {
        session.add(0, len);
    }
    session.end();
    assert_eq!(session.recorder.totals().dropped, 1);
    assert_accounted(&session);
}

/// What a disk does for a while.
#[derive(Clone, Copy, Debug)]
enum Phase {
    Works,
    Hangs,
    Fails(DiskErrorKind),
}

fn phase() -> impl Strategy<Value = Phase> {
    prop_oneof![
        Just(Phase::Works),
        Just(Phase::Hangs),
        Just(Phase::Fails(DiskErrorKind::Failed)),
        Just(Phase::Fails(DiskErrorKind::LowSpace)),
    ]
}

proptest! {
    #[test]
    fn losses_are_those_that_the_files_have(
        phases in prop::collection::vec((phase(), 1..9_u64, 1..120_usize), 1..10),
    ) {
        let mut session = Session::new(settings(), 3);
        for (phase, seconds, messages) in phases {
            session.disk.failure = match phase {
                Phase::Fails(kind) => Some(kind),
                _ => None,
            };
            for index in 0..messages {
                session.add(index % 3, 10 + index);
                let pause = Duration::from_millis(seconds * 1000 / messages as u64);
                if matches!(phase, Phase::Hangs) {
                    session.outstanding = session.outstanding.take().or_else(|| session.recorder.next());
                    session.now = session.now + pause;
                    session.wake();
                } else {
                    session.settle();
                    session.pass(pause);
                }
            }
        }
        session.disk.failure = None;
        session.settle();
        session.pass(Duration::from_secs(6));
        for channel in 0..3 {
            session.add(channel, 1);
        }
        session.end();
        assert_accounted(&session);
        let last = session.disk.is_whole.last();
        prop_assert_eq!(last, Some(&Some(true)));
    }
}
