//! `ril robots`.

use std::fs;
use std::io::Write;
use std::os::unix::fs::chown;

use ril_tests::process::Signal;
use serde_json::Value;

use super::station::on_terminal;
use crate::common::{Rig, end, json, says};

fn robots(rig: &Rig) -> Vec<Value> {
    let finished = rig.run("robots --json", 0);
    finished.stdout.iter().map(|line| json(line)).collect()
}

/// The robots, as soon as `is_right`: what is shown as the present may be old on a machine that stalls.
#[track_caller]
fn robots_until(rig: &Rig, is_right: impl Fn(&[Value]) -> bool) -> Vec<Value> {
    for _ in 0..100 {
        let found = robots(rig);
        if is_right(&found) {
            return found;
        }
    }
    panic!("never right: {:#?}", robots(rig));
}

#[test]
fn without_a_robot_the_list_is_empty_and_says_what_to_start() {
    let rig = Rig::new();
    let finished = rig.run("robots", 0);
    assert!(finished.stdout.is_empty(), "{finished:#?}");
    assert!(
        says(&finished.stderr, "no robot: `ril run bridge`"),
        "{finished:#?}"
    );
    assert!(robots(&rig).is_empty());
    rig.domain.assert_empty();
}

#[test]
fn two_robots_are_told_apart_by_processes_link_and_phase() {
    let rig = Rig::new();
    let sim = rig.sim(1, "");
    let bridge = rig.bridge(1);
    let status = rig.status(1);
    // Robot 2 has no DSP.
    let other = rig.bridge(2);
    rig.watch(1).until_ready();
    let found = robots_until(&rig, |found| {
        found[0]["link"] == "up" && found[1]["link"] == "gone"
    });
    assert_eq!(found.len(), 2);
    let [one, two] = [&found[0], &found[1]];
    for robot in [one, two] {
        assert_eq!(robot["schema"], "ril.Robot.v1");
        assert_eq!(
            (&robot["live"], &robot["relayed"]),
            (&true.into(), &false.into())
        );
    }
    assert_eq!(one["processes"], serde_json::json!(["bridge", "status"]));
    assert_eq!(two["processes"], serde_json::json!(["bridge"]));
    assert_eq!((&one["robot"], &two["robot"]), (&1.into(), &2.into()));
    assert_eq!(two["flying"], Value::Null);
    let lines = on_terminal(&rig, "robots", 0);
    assert!(lines[0].starts_with("ROBOT  LIVE"), "{lines:#?}");
    assert!(lines[1].starts_with("1      yes"), "{lines:#?}");
    assert_eq!(lines.len(), 3);

    // A link that dies is seen.
    end(sim, Signal::INT);
    robots_until(&rig, |found| found[0]["link"] == "gone");
    for process in [status, bridge, other] {
        end(process, Signal::INT);
    }
}

/// Another user's domain may be that of a robot in flight. It is named, and nothing is said that would end its flight.
#[test]
fn the_domain_of_another_user_is_named_and_never_to_be_removed() {
    const OTHER_USER: u32 = 65_534;
    if !rustix::process::geteuid().is_root() {
        // Past the capture of the test's output.
        let _ = writeln!(
            std::io::stderr(),
            "SKIPPED: another user's domain: only root makes one"
        );
        return;
    }
    let rig = Rig::new();
    let root = rig.domain.root().to_owned();
    fs::create_dir(&root).unwrap();
    chown(&root, Some(OTHER_USER), None).unwrap();
    for (args, code) in [("robots", 1), ("status", 1), ("land", 1), ("doctor", 8)] {
        let finished = rig.run(args, code);
        let said: Vec<String> = [finished.stdout.clone(), finished.stderr.clone()].concat();
        assert!(says(&said, "belongs to user 65534"), "{args}: {said:#?}");
        assert!(says(&said, "run as that user"), "{args}: {said:#?}");
        for wrong in ["remove it", "not safe", "no robot", "chmod"] {
            assert!(!says(&said, wrong), "{args}: {said:#?}");
        }
    }
    fs::remove_dir(&root).unwrap();
}

#[test]
fn a_robot_whose_processes_were_killed_is_listed_as_dead() {
    let rig = Rig::new();
    let bridge = rig.bridge(3);
    // Killed.
    drop(bridge);
    let found = robots(&rig);
    assert_eq!(found.len(), 1, "{found:#?}");
    assert_eq!(
        (&found[0]["robot"], &found[0]["live"]),
        (&3.into(), &false.into())
    );
    assert_eq!(found[0]["phase"], Value::Null);
    rig.run("doctor --repair", 0);
    assert!(robots(&rig).is_empty());
    rig.domain.sweep();
}
