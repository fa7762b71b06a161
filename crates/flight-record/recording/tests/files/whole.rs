//! A recording that is finished: complete, and with all that belongs to it.

use std::time::Duration;

use ipc_types::MonotonicNs;
use recording::read::{RecordFile, RecordSource, check, messages, summary_of};
use recording::{Event, EventKind, FILE_METADATA, Settings};

use crate::session::{Session, UNIX_NS, info};
use crate::stock;

fn recorded() -> Session {
    let mut session = Session::new(Settings::default(), 3);
    for index in 0..500 {
        session.add(index % 2, 40 + index % 100);
        session.settle();
        session.pass(Duration::from_millis(7));
    }
    session
}

#[test]
fn a_finished_file_is_whole_for_every_reader() {
    let mut session = recorded();
    session.end();
    assert_eq!(session.disk.is_whole, [Some(true)]);
    let file = &session.disk.files[0];
    let stock = stock::all(file);
    assert_eq!(stock.len(), 500);
    assert_eq!(stock, stock::ours(file));

    let check = check(file);
    assert!(
        check.is_complete && check.errors.is_empty(),
        "{:?}",
        check.errors
    );
    assert_eq!((check.bytes_behind, check.events.len()), (0, 0));
    let topic = &check.topics["/robot7/topic0"];
    let counts = (topic.messages, topic.gaps, topic.missing, topic.restarts);
    assert_eq!(counts, (250, 0, 0, 0));
    assert_eq!(topic.first_ns, UNIX_NS + 1_000_000_000);
    assert_eq!(session.recorder.totals().synced, 500);
}

#[test]
fn the_summary_says_what_the_chunks_say() {
    let mut session = recorded();
    let unfinished = session.disk.files[0].clone();
    session.end();
    let file = &session.disk.files[0];
    let summary = summary_of(file).unwrap();
    let checked = check(file);
    assert!(summary.is_complete);
    assert_eq!(summary.attachments, info().attachments);
    assert_eq!(summary.metadata, checked.metadata);
    assert_eq!(summary.metadata[0], info().metadata[0]);
    let (name, own) = &summary.metadata[1];
    assert_eq!((&**name, &*own["index"]), (FILE_METADATA, "0"));
    assert_eq!(own["anchor_unix_ns"], (UNIX_NS + 1_000_000_000).to_string());
    assert_eq!(
        (summary.first_ns, summary.last_ns),
        (checked.first_ns, checked.last_ns)
    );
    for (topic, facts) in &checked.topics {
        assert_eq!(
            summary.topics[topic],
            (facts.schema_name.clone(), facts.messages)
        );
    }
    // Channels without a message are there too.
    assert_eq!(summary.topics["/robot7/topic2"].1, 0);

    let summary = summary_of(&unfinished).unwrap();
    assert!(!summary.is_complete);
    assert_eq!(summary.attachments, info().attachments);
    assert!(summary.topics["/robot7/topic0"].1 > 200);
}

#[test]
fn what_was_written_since_is_read_on_and_nothing_twice() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let mut session = recorded();
    std::fs::write(&path, &session.disk.files[0]).unwrap();
    let mut found = messages(RecordSource::File(RecordFile::open(&path).unwrap()));
    let mut sequences: Vec<_> = found
        .by_ref()
        .map(|found| found.unwrap().sequence)
        .collect();
    for ends in [false, false, true] {
        (0..50).for_each(|index| session.add(index % 2, 700 * index));
        session.pass(Duration::from_secs(1));
        if ends {
            session.end();
        }
        std::fs::write(&path, &session.disk.files[0]).unwrap();
        found.refresh().unwrap();
        sequences.extend(found.by_ref().map(|found| found.unwrap().sequence));
        let all = messages(&session.disk.files[0]);
        let all: Vec<_> = all.map(|found| found.unwrap().sequence).collect();
        assert_eq!(sequences, all);
    }
}

#[test]
fn channels_bring_their_schema_and_metadata() {
    let mut session = recorded();
    session.end();
    let file = &session.disk.files[0];
    let summary = mcap::Summary::read(file).unwrap().unwrap();
    let mut channels: Vec<_> = summary.channels.values().collect();
    channels.sort_by_key(|channel| channel.id);
    let topics: Vec<_> = channels.iter().map(|channel| &*channel.topic).collect();
    let expected = [
        "/robot7/recording/events",
        "/robot7/topic0",
        "/robot7/topic1",
        "/robot7/topic2",
    ];
    assert_eq!(topics, expected);
    let schema = channels[1].schema.as_ref().unwrap();
    assert_eq!(
        (&*schema.name, &*schema.encoding),
        ("test_msgs/msg/Topic0", "ros2msg")
    );
    assert_eq!(channels[1].message_encoding, "cdr");
    assert_eq!(channels[1].metadata["number"], "0");
}

#[test]
fn messages_lie_in_the_order_of_their_times() {
    let mut session = Session::new(Settings::default(), 2);
    session.settle();
    let at = |ms: u64| MonotonicNs(1_000_000_000 + ms * 1_000_000);
    session.now = at(100);
    for (channel, ms) in [(0, 10), (0, 20), (0, 40), (1, 15), (1, 30)] {
        session.add_at(channel, at(ms), 1);
    }
    session.pass(Duration::from_millis(300));
    // Late by a flush, and from the future.
    session.add_at(1, at(35), 1);
    session.add_at(0, at(1_000_000), 1);
    session.add_at(1, at(390), 1);
    session.end();
    let file = &session.disk.files[0];
    let found = messages(file).map(Result::unwrap);
    let ms = |unix_ns: u64| (unix_ns - UNIX_NS - 1_000_000_000) / 1_000_000;
    let found: Vec<_> = found
        .map(|message| {
            (
                ms(message.log_time_ns),
                ms(message.publish_time_ns),
                message.sequence,
            )
        })
        .collect();
    let expected = [
        (10, 10, 1),
        (15, 15, 1),
        (20, 20, 2),
        (30, 30, 2),
        (40, 40, 3),
        (40, 35, 3),
        (390, 390, 4),
        (400, 400, 4),
    ];
    assert_eq!(found, expected);
}

#[test]
fn what_was_published_before_the_recording_is_logged_when_it_began() {
    let mut session = Session::new(Settings::default(), 1);
    let begun = session.now;
    session.settle();
    session.now = MonotonicNs(begun.0 + 3_000_000_000);
    // The latest sample of a topic that publishes seldom.
    session.add_at(0, MonotonicNs(begun.0 - 900_000_000), 1);
    session.end();
    let found = messages(&session.disk.files[0]).map(Result::unwrap).next();
    let found = found.map(|message| (message.log_time_ns, message.publish_time_ns));
    assert_eq!(
        found,
        Some((UNIX_NS + begun.0, UNIX_NS + begun.0 - 900_000_000))
    );
}

#[test]
fn an_event_comes_back_as_it_was() {
    let mut session = Session::new(Settings::default(), 1);
    let event = Event {
        at: session.now,
        kind: EventKind::Gap,
        topic: "/robot7/topic0".to_owned(),
        count: 12,
        first: MonotonicNs(400_000_000),
        last: MonotonicNs(900_000_000),
        text: "twelve are missing".to_owned(),
    };
    session.recorder.event(session.now, &event);
    session.end();
    let check = check(&session.disk.files[0]);
    let [found] = &check.events[..] else {
        panic!("{:?}", check.events);
    };
    assert_eq!(
        (found.kind, found.count, &*found.topic),
        (EventKind::Gap, 12, "/robot7/topic0")
    );
    assert_eq!(found.log_time_ns, UNIX_NS + 1_000_000_000);
    assert_eq!(
        (found.first_ns, found.last_ns),
        (UNIX_NS + 400_000_000, UNIX_NS + 900_000_000)
    );
}

#[test]
fn a_recording_without_a_message_is_a_whole_file() {
    let mut session = Session::new(Settings::default(), 0);
    session.end();
    assert_eq!(session.disk.is_whole, [Some(true)]);
    assert!(check(&session.disk.files[0]).is_complete);
    assert_eq!(stock::all(&session.disk.files[0]), []);
}

#[test]
fn a_step_of_the_wall_clock_is_an_event_and_moves_no_message() {
    let mut session = Session::new(Settings::default(), 1);
    session.settle();
    for step_s in [0_u64, 3600, 10] {
        session.unix_offset_ns = UNIX_NS + step_s * 1_000_000_000;
        session.add(0, 4);
        session.wake();
        session.pass(Duration::from_secs(1));
    }
    session.end();
    let file = &session.disk.files[0];
    let times: Vec<_> = stock::of_topics(stock::all(file))
        .into_iter()
        .map(|facts| facts.2)
        .collect();
    let second = |count: u64| UNIX_NS + count * 1_000_000_000;
    assert_eq!(times, [second(1), second(2), second(3)]);
    let events = check(file).events;
    let texts: Vec<_> = events.iter().map(|event| &*event.text).collect();
    assert_eq!(texts.len(), 2, "{texts:?}");
    assert!(texts[0].contains("forward by 3600.000 s"), "{texts:?}");
    assert!(texts[1].contains("back by 3590.000 s"), "{texts:?}");
}
