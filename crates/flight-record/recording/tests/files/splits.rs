//! A recording in several files: each says all that belongs to the flight, and no message is between them.

use std::collections::BTreeSet;
use std::time::Duration;

use recording::read::{check, summary_of};
use recording::{Attachment, EventKind, Settings};

use crate::session::{Session, UNIX_NS, info};
use crate::stock;

fn record(settings: Settings, splits: bool) -> Session {
    let mut session = Session::new(settings, 2);
    session.settle();
    for index in 0..1000_u64 {
        session.add(index as usize % 2, 100);
        session.settle();
        session.pass(Duration::from_millis(10));
        if splits && index == 500 {
            session.unix_offset_ns = UNIX_NS + 5_000_000_000;
            session.split();
            session.settle();
        }
    }
    session.end();
    session
}

fn assert_complete(session: &Session, files: usize) {
    assert_eq!(session.disk.is_whole, vec![Some(true); files]);
    let mut messages = BTreeSet::new();
    for (index, file) in session.disk.files.iter().enumerate() {
        let summary = summary_of(file).unwrap();
        assert_eq!(summary.attachments, info().attachments);
        assert_eq!(summary.metadata[0], info().metadata[0]);
        assert_eq!(summary.metadata[1].1["index"], index.to_string());
        assert_eq!(summary.topics.len(), 3);
        for (topic, sequence, ..) in stock::of_topics(stock::all(file)) {
            assert!(messages.insert((topic, sequence)));
        }
        let splits = check(file)
            .events
            .iter()
            .filter(|event| event.kind == EventKind::Split)
            .count();
        assert_eq!(splits, usize::from(index + 1 < files));
    }
    assert_eq!(messages.len(), 1000);
}

#[test]
fn files_are_split_by_duration() {
    let settings = Settings {
        split_duration: Some(Duration::from_secs(3)),
        ..Settings::default()
    };
    assert_complete(&record(settings, false), 4);
}

#[test]
fn files_are_split_by_size() {
    let settings = Settings {
        split_bytes: Some(50_000),
        ..Settings::default()
    };
    let session = record(settings, false);
    assert_complete(&session, session.disk.files.len());
    assert!(session.disk.files.len() > 2);
    for file in &session.disk.files {
        assert!(file.len() < 75_000, "{}", file.len());
    }
}

#[test]
fn files_are_split_on_request_with_the_clock_of_that_moment() {
    let session = record(Settings::default(), true);
    assert_complete(&session, 2);
    let times = session
        .disk
        .files
        .iter()
        .map(|file| check(file).first_ns.unwrap());
    let times: Vec<_> = times.collect();
    // The wall clock was set forward by 5 s.
    assert_eq!((times[1] - times[0]) / 1_000_000_000, 10);
}

#[test]
fn what_comes_after_a_split_lies_in_the_next_file() {
    let mut session = Session::new(Settings::default(), 1);
    session.settle();
    // The disk is still busy with what came before.
    session.add(0, 1);
    session.split();
    session.add(0, 1);
    session.add(0, 1);
    session.end();
    let files = session.disk.files.iter();
    let sequences = files.map(|file| {
        let messages = stock::of_topics(stock::all(file)).into_iter();
        messages.map(|facts| facts.1).collect::<Vec<_>>()
    });
    assert_eq!(sequences.collect::<Vec<_>>(), [vec![1], vec![2, 3]]);
}

#[test]
fn what_becomes_known_later_is_said_in_the_open_file_and_at_the_start_of_the_next_one() {
    let mut session = Session::new(Settings::default(), 1);
    let add = |session: &mut Session| {
        session.add(0, 100);
        session.pass(Duration::from_secs(1));
        session.settle();
    };
    add(&mut session);
    let mut later = info();
    later.metadata[0].1.insert("pid".to_owned(), "7".to_owned());
    later.attachments.push(Attachment {
        name: "status.toml".to_owned(),
        ..info().attachments[0].clone()
    });
    session.recorder.describe(later.clone());
    add(&mut session);
    add(&mut session);
    let unfinished = session.disk.files[0].clone();
    session.split();
    session.settle();
    add(&mut session);
    session.end();

    let first = summary_of(&session.disk.files[0]).unwrap();
    for summary in [summary_of(&unfinished).unwrap(), first] {
        let flights = summary
            .metadata
            .iter()
            .filter(|(name, _)| name == "ril.flight");
        let flights: Vec<_> = flights.collect();
        assert_eq!(flights, [&info().metadata[0], &later.metadata[0]]);
        let attachments = summary.attachments;
        assert_eq!(attachments, later.attachments, "each once");
    }
    let second = summary_of(&session.disk.files[1]).unwrap();
    assert_eq!(second.metadata[0], later.metadata[0]);
    assert_eq!(second.attachments, later.attachments);
    for file in &session.disk.files {
        assert_eq!(stock::all(file), stock::ours(file));
        assert!(check(file).errors.is_empty());
    }
}
