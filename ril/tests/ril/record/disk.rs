//! A disk that does not take the record: the robot flies on, and the record says what it lacks.

use std::path::Path;
use std::time::Duration;

use ipc_types::{MonotonicNs, RobotId};
use recording::{Anchor, Channel, EventKind, FlightInfo, Recorder, Settings};
use ril_tests::Process;
use ril_tests::process::Signal;

use super::feed::{Feed, TOPIC, check, files, has, lines, record, record_by, samples, words};
use crate::common::{sandbox, says};

/// A file of the record may have so many blocks of 512 bytes.
const MAX_BLOCKS: u32 = 128;

#[test]
fn a_file_that_may_not_grow_is_followed_by_another_one_that_says_so() {
    let rig = sandbox();
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
    recorder.exits(0);
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
fn a_recording_ends_by_itself_after_its_duration() {
    let rig = sandbox();
    let mut feed = Feed::new(&rig);
    let mut recorder = record(&rig, "--duration 300ms");
    let published = feed.publish();
    assert_eq!(recorder.wait_exit().code(), Some(0));
    assert!(files(&rig).iter().any(|file| has(file, published)));
}

/// A record of 100 MiB.
fn large(path: &Path) {
    let mut now = MonotonicNs(1_000_000_000);
    let unix_ns = 1_700_000_000_000_000_000;
    let anchor = Anchor {
        monotonic: now,
        unix_ns,
    };
    let (robot, metadata, attachments) = (RobotId::DEFAULT, vec![], vec![]);
    let info = FlightInfo {
        robot,
        metadata,
        attachments,
    };
    let mut recorder = Recorder::new(Settings::default(), info, anchor);
    let channel = Channel {
        topic: "/robot1/a/b".to_owned(),
        schema_name: "a_msgs/msg/B".to_owned(),
        schema_text: "uint8[] data\n".to_owned(),
        metadata: [].into(),
    };
    let channel = recorder.channel(channel).unwrap();
    let mut bytes = Vec::new();
    for sequence in 1..=100 {
        now = now + Duration::from_secs(1);
        recorder.add(now, channel, now, sequence, &vec![7; 1 << 20]);
        recorder.wake(now + Duration::from_millis(500), anchor);
        if sequence == 100 {
            recorder.end(now);
        }
        while let Some(action) = recorder.next() {
            action.apply_to(&mut bytes);
            recorder.done(now, Ok(()));
        }
    }
    std::fs::write(path, bytes).unwrap();
}

#[test]
fn a_record_that_is_longer_than_the_memory_is_read_piece_by_piece() {
    let rig = sandbox();
    large(&rig.folder().join("large.mcap"));
    for verb in ["check", "summary", "recover", "csv", "report", "export"] {
        // As many kilobytes of data, heap and stacks may a process have.
        let shell = format!("ulimit -d 65536; exec \"$0\" log {verb} large.mcap");
        let finished = Process::spawn(&rig.domain, rig.shell(&shell)).wait_exit();
        assert_eq!(finished.code(), Some(0), "{verb}: {finished:#?}");
    }
}

#[test]
fn options_that_do_not_fit_together_are_refused() {
    let rig = sandbox();
    rig.run("record --size 100 --max-total 199", 2)
        .err_says("less than twice --size");
    rig.run("record --bridge absent.toml", 78);
    rig.write("file", "");
    for folder in ["file", "file/log", "/proc/absent"] {
        let finished = rig.run(&format!("record --output {folder}"), 2);
        assert!(says(&finished.stderr, "cannot be written"), "{finished:#?}");
    }
    rig.write("empty.mcap", "");
    for verb in ["check", "recover"] {
        rig.run(&format!("log {verb} empty.mcap"), 2)
            .err_says("it is empty");
    }
}
