//! A recorder that is killed leaves a file that can be read, without a hole. How young the last message is, the program `endurance
//! records` measures; here a machine may stall.

use std::fs;

use ril_tests::process::Signal;

use super::feed::{Feed, TOPIC, check, missing, only_file, record, samples};
use crate::common::sandbox;

/// Moments of the kills: samples that are published before each.
const MOMENTS: [u32; 5] = [0, 3, 50, 300, 1000];

#[test]
fn a_killed_recorder_leaves_a_file_without_a_hole_which_can_be_made_whole() {
    for moment in MOMENTS {
        let rig = sandbox();
        let mut feed = Feed::new(&rig);
        let mut recorder = record(&rig, "");
        recorder.wait_for_text("recording file=");
        // One that is killed before that leaves an empty file, which nothing can be made of.
        let file = only_file(&rig);
        while fs::metadata(&file).unwrap().len() == 0 {
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
        // The name has parentheses, which a shell would not take.
        let next_step = format!("`ril log recover '{name}'`");
        assert!(said.contains(&next_step), "{said}");
        rig.run(&format!("log recover {name} --output whole.mcap"), 0);
        rig.run("log check whole.mcap", 0);
        assert_eq!(samples(&rig.folder().join("whole.mcap"), TOPIC), found);
        rig.run(&format!("log recover {name} --output whole.mcap"), 2);
    }
}
