//! `ril robots`.

use ril_tests::Sandbox;

use ril_tests::process::Signal;
use serde_json::Value;

use super::station::on_terminal;
use crate::common::{end, json, sandbox};

fn robots(rig: &Sandbox) -> Vec<Value> {
    let finished = rig.run("robots --json", 0);
    finished.stdout.iter().map(|line| json(line)).collect()
}

/// The robots, as soon as `is_right`: what is shown as the present may be old on a machine that stalls.
#[track_caller]
fn robots_until(rig: &Sandbox, is_right: impl Fn(&[Value]) -> bool) -> Vec<Value> {
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
    let rig = sandbox();
    let finished = rig.run("robots", 0);
    assert!(finished.stdout.is_empty(), "{finished:#?}");
    finished.err_says("no robot: `ril run bridge`");
    assert!(robots(&rig).is_empty());
    rig.domain.assert_empty();
}

#[test]
fn two_robots_are_told_apart_by_processes_link_and_phase() {
    let rig = sandbox();
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

#[test]
fn a_robot_whose_processes_were_killed_is_listed_as_dead() {
    let rig = sandbox();
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
