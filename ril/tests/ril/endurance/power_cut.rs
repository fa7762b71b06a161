//! Power cuts: some hundred of all states in which one leaves records, logs and what is kept; and what the judge finds
//! of a program that forces nothing onto the disk.

use std::path::Path;

use endurance::power_cut;
use endurance::power_cut::disk::Disk;
use endurance::power_cut::trace::Step;

use super::{counts, rows};

#[test]
fn what_was_forced_onto_the_disk_survives_a_power_cut_at_any_moment() {
    for row in rows("power cuts", 300, power_cut::run, "--count 600") {
        counts(
            &row,
            &[
                "of records",
                "of logs",
                "of replaced files",
                "messages forced",
                "rows forced",
            ],
        );
        for replaced in [
            "bridge.toml",
            "hero1_layout.json",
            "robot-1.timestamp",
            "view.key",
        ] {
            assert!(row.to_string().contains(replaced), "{replaced}: {row}");
        }
    }
}

/// How many states of the file there are after each step, and in how many it is neither the old one nor the new one.
fn wrong_states(steps: &[Step]) -> (usize, usize) {
    let path = Path::new("/kept/state");
    let mut disk = Disk::with([(path.to_owned(), 1, b"old".to_vec())]);
    let (mut states, mut wrong) = (0, 0);
    for step in steps {
        let Some(index) = disk.perform(step) else {
            continue;
        };
        for state in disk.states(index) {
            let content = disk.content(path, index, state);
            states += 1;
            wrong += usize::from(disk.judge_replaced(path, content.as_deref()).is_err());
        }
    }
    (states, wrong)
}

#[test]
fn a_file_that_is_renamed_before_it_is_forced_onto_the_disk_is_found() {
    let new = Path::new("/kept/.state.new").to_owned();
    let [created, wrote, synced, renamed, folder] = [
        Step::Created {
            path: new.clone(),
            inode: 2,
        },
        Step::Wrote {
            inode: 2,
            at: 0,
            bytes: vec![7; 10_000],
        },
        Step::Synced { inode: 2 },
        Step::Renamed {
            from: new,
            to: "/kept/state".into(),
        },
        Step::SyncedFolder,
    ];
    let right = [&created, &wrote, &synced, &renamed, &folder].map(Step::clone);
    let (states, wrong) = wrong_states(&right);
    assert!(states > 20 && wrong == 0, "{wrong} of {states}");
    for unforced in [
        [&created, &wrote, &renamed, &synced, &folder].map(Step::clone),
        [&created, &wrote, &renamed, &folder, &synced].map(Step::clone),
    ] {
        let (states, wrong) = wrong_states(&unforced);
        assert!(wrong > 0, "{wrong} of {states}");
    }
    // Written in its place: half of it can be there.
    let in_place = [Step::Wrote {
        inode: 1,
        at: 0,
        bytes: vec![7; 10_000],
    }];
    assert!(wrong_states(&in_place).1 > 0);
}
