//! A recorder that is killed leaves a file that can be read, without a hole. How young the last message is, the program
//! `endurance records` measures; here a machine may stall.

use std::collections::BTreeMap;
use std::fs;

use ipc_types::payload::{DspTelemetry, SharedStruct};
use ril_tests::process::Signal;

use super::feed::{
    Feed, TOPIC, check, missing, only_file, record, samples, until_publishers, words,
};
use crate::common::{end, sandbox};

/// Moments of the kills: samples that are published before each.
const MOMENTS: [u32; 5] = [0, 3, 50, 300, 1000];

/// The last bytes of a file that is whole.
const MAGIC: &[u8] = b"\x89MCAP0\r\n";

#[test]
fn a_killed_recorder_leaves_a_file_without_a_hole_which_can_be_made_whole() {
    for moment in MOMENTS {
        let rig = sandbox();
        let mut feed = Feed::new(&rig);
        let mut recorder = record(&rig, "");
        recorder.wait_for_text("recording file=");
        // One that is killed before its first write is whole leaves a file without a message, or without anything.
        let file = only_file(&rig);
        while !fs::read(&file).unwrap().ends_with(MAGIC) {
            std::thread::yield_now();
        }
        for _ in 0..moment {
            feed.publish();
            // A pace that the recorder follows, without a clock.
            std::thread::yield_now();
        }
        recorder.signal(Signal::KILL);
        recorder.wait_exit();
        let before = check(&file);
        let told = before.topics.get(TOPIC).map_or(0, |topic| topic.missing);
        let found = samples(&file, TOPIC);
        assert_eq!(missing(&found), told);
        let name = file.display();
        let said = rig.run(&format!("log check {name}"), 8).stderr.join("\n");
        if before.topics.is_empty() {
            rig.run(&format!("log recover {name} --output whole.mcap"), 8);
            continue;
        }
        let next_step = format!("`ril log recover {name}`");
        assert!(said.contains(&next_step), "{said}");
        rig.run(&format!("log recover {name} --output whole.mcap"), 0);
        rig.run("log check whole.mcap", 0);
        assert_eq!(samples(&rig.folder().join("whole.mcap"), TOPIC), found);
        rig.run(&format!("log recover {name} --output whole.mcap"), 2)
            .err_says("whole.mcap exists already")
            .err_says("name another file with --output");
    }
}

#[test]
fn the_last_records_of_a_bridge_that_was_killed_are_in_the_file() {
    let rig = sandbox();
    let mut recorder = rig.start(&words(""));
    recorder.wait_for_text("recording file=");
    let sim = rig.sim(1, "--speed 5");
    let status = rig.status(1);
    // Before the journal of the next bridge, and at the end of the recording.
    for publishers in [1, 2] {
        let mut bridge = rig.bridge(1);
        rig.watch(1).until_ready();
        for topic in ["/robot1/bridge/journal", "/robot1/dsp/telemetry"] {
            until_publishers(&rig, topic, publishers);
        }
        bridge.signal(Signal::KILL);
        bridge.wait_exit();
    }
    end(status, Signal::TERM);
    end(sim, Signal::TERM);
    end(recorder, Signal::TERM);
    let file = only_file(&rig);
    let by_publisher = |topic: &str| {
        let mut all: BTreeMap<u64, Vec<_>> = BTreeMap::new();
        for (sequence, sample) in samples(&file, topic) {
            let of_publisher = all.entry(word(&sample, 8)).or_default();
            of_publisher.push((sequence, sample));
        }
        all.into_values().collect::<Vec<_>>()
    };
    let journals = by_publisher("/robot1/bridge/journal");
    let telemetry = by_publisher("/robot1/dsp/telemetry");
    assert_eq!((journals.len(), telemetry.len()), (2, 2));
    for (pieces, telemetry) in journals.iter().zip(&telemetry) {
        assert_eq!(missing(pieces), 0);
        let last = DspTelemetry::from_bytes(&telemetry.last().unwrap().1).unwrap();
        let published = word(&pieces.last().unwrap().1, 16);
        // A piece says when it was sent, or when its last record was written. Published in time it would be up to 200
        // ms older than the last sample; the bridge may have been killed in the round in which it published that one.
        let round_ns = 50_000_000;
        assert!(
            published + round_ns >= last.received_ns,
            "{published} {last:?}"
        );
    }
    rig.run(&format!("log check {}", file.display()), 0);
    rig.run(&format!("replay {} --verify", file.display()), 0);
}

fn word(sample: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(sample[at..at + 8].try_into().unwrap())
}
