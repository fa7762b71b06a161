//! `ril topic …`: topics are listed, described, printed and measured by their schemas.

use std::fs;
use std::time::{Duration, Instant};

use crate::common::{FOR_SLOW_MACHINES, end, end_all, json, sandbox, says};
use ipc_types::MonotonicNs;
use ipc_types::payload::{HeroTelemetry, ModuleState};
use ril_tests::process::Signal;
use ril_tests::{StandInBridge, StandInStatus};

#[test]
fn topics_that_are_there_are_listed() {
    let rig = sandbox();
    assert!(rig.run("topic list", 0).stdout.is_empty());
    let _status = StandInStatus::start(&rig.domain);
    let _bridge = StandInBridge::start(&rig.domain);
    let listed = rig.run("topic list", 0).stdout;
    assert!(
        listed
            .iter()
            .any(|line| line.starts_with("hero_telemetry") && line.ends_with("320 B")),
        "{listed:#?}"
    );
    let listed = rig.run("topic list --json", 0).stdout;
    let keys: Vec<_> = listed
        .iter()
        .map(|line| json(line)["key"].clone())
        .collect();
    for key in ["hero_telemetry", "module_state"] {
        assert!(keys.iter().any(|there| there == key), "{listed:#?}");
    }
    let first = json(&listed[0]);
    assert_eq!(
        (&first["schema"], &first["live"]),
        (&"ril.Topic.v1".into(), &true.into())
    );
}

#[test]
fn a_topic_is_described() {
    let rig = sandbox();
    let said = rig.run("topic info hero_telemetry", 0).stdout;
    for expected in [
        "hero_telemetry, which no process has open",
        "hero.HeroTelemetry.v3 (hero_msgs/msg/HeroTelemetry in ROS 2)",
        "geodetic.altitude_m",
    ] {
        assert!(says(&said, expected), "{expected}: {said:#?}");
    }
    let said = json(&rig.run("topic info state --json", 0).stdout[0]);
    assert_eq!(
        (&said["key"], &said["bytes"]),
        (&"module_state".into(), &528.into())
    );
    let fields = said["fields"].as_array().unwrap();
    let field = fields
        .iter()
        .find(|field| field["name"] == "movement.distance_to_go_m");
    assert_eq!(field.unwrap()["unit"], "m");
}

#[test]
fn samples_are_printed_and_measured_as_by_the_short_forms() {
    let rig = sandbox();
    let status = StandInStatus::start(&rig.domain);
    status.publish(&HeroTelemetry::default());
    let fields = "--json --field geodetic.altitude_m --field published_ns --field velocity";
    let mut short = rig.start(&format!("echo hero --count 2 {fields}"));
    let mut long = rig.start(&format!("topic echo hero_telemetry --count 2 {fields}"));
    for echo in [&mut short, &mut long] {
        echo.wait_for_text("hero.HeroTelemetry.v3");
    }
    status.publish(&HeroTelemetry {
        published_ns: 5,
        ..HeroTelemetry::default()
    });
    let (short, long) = (short.wait_exit(), long.wait_exit());
    assert_eq!(short.stdout, long.stdout);
    let last = json(&long.stdout[1]);
    assert_eq!(last["published_ns"], 5);
    assert!(
        last["geodetic"]["altitude_m"].is_null(),
        "no group was valid"
    );
    long.err_says("2 samples");

    let mut hz = rig.start("topic hz hero_telemetry --count 3 --json -v");
    hz.wait_for_text("subscribed");
    let now = MonotonicNs::now();
    for index in 0..3 {
        status.publish(&HeroTelemetry {
            published_ns: now.0 + index * 20_000_000,
            ..HeroTelemetry::default()
        });
    }
    let report = json(&hz.wait_exit().stdout[0]);
    assert_eq!(
        (&report["service"], &report["lost"]),
        (&"hero_telemetry".into(), &0.into())
    );
    assert_eq!(report["published_hz"], 50.0);
}

#[test]
fn a_topic_that_is_not_there_is_told_with_those_that_are() {
    let rig = sandbox();
    for command in ["echo", "hz", "delay", "bw", "info"] {
        let finished = rig.run(&format!("topic {command} battery_watch/voltages"), 3);
        let expected = "robot 1 has no topic battery_watch/voltages; it has none now";
        finished.err_says(expected);
    }
    rig.run("hz gps", 3).err_says("no topic gps");
    rig.run("echo her --timeout 50ms", 3)
        .err_says("did you mean `hero`?");
    rig.run("topic echo hero --timeout 50ms", 3)
        .err_says("start `ril run status --robot 1`");
    let bridge = StandInBridge::start(&rig.domain);
    bridge.publish_state(&ModuleState::default());
    rig.run("topic echo battery_watch/voltages", 3)
        .err_says("module_state");
}

/// Status is killed, and its last consumer takes the generation away that `current` names: nothing publishes, whatever
/// is asked, and who waits gets what the next status publishes.
#[test]
fn a_publisher_of_which_only_its_announcement_is_left_is_none_and_is_waited_for() {
    let rig = sandbox();
    let robot = rig.start_robot(1, 1);
    let mut consumer = rig.start("echo hero --timeout 24h --json");
    consumer.wait_for_text("hero.HeroTelemetry");
    rig.kill(robot.status);
    end(consumer, Signal::TERM);
    let service = rig.domain.root().join("1/hero_telemetry");
    let mut left = fs::read_dir(&service).unwrap().flatten();
    assert!(service.join("current").exists() && left.all(|entry| entry.path().is_file()));
    let patience = Duration::from_millis(300);
    for command in ["echo", "hz", "delay", "bw"] {
        for verb in [command.to_owned(), format!("topic {command}")] {
            let began = Instant::now();
            let finished = rig.run(&format!("{verb} hero_telemetry --timeout 300ms"), 3);
            assert!(began.elapsed() >= patience, "{finished:#?}");
            finished.err_says("start `ril run status --robot 1`");
        }
    }
    rig.run("topic info hero_telemetry", 0)
        .out_says("which no process has open");
    let mut waiting = ["echo", "delay", "bw", "hz"]
        .map(|command| rig.start(&format!("{command} hero --count 3 -v")));
    // An echo does not say when it has subscribed.
    for measurement in &mut waiting[1..] {
        measurement.wait_for_text("subscribed");
    }
    let status = rig.status(1);
    for mut command in waiting {
        command.exits(0);
    }
    end_all([status, robot.bridge, robot.sim]);
}

#[test]
fn what_the_bridge_holds_comes_whole_to_everyone_who_comes() {
    let rig = sandbox();
    let fence = |radius_m: f64| {
        format!(
            "{FOR_SLOW_MACHINES}[fence]\nceiling_m = 90.0\n\
             [[fence.area]]\nname = \"field\"\nkind = \"inclusion\"\ncentre = [37.411, -6.001]\nradius_m = {radius_m}\n"
        )
    };
    rig.write("bridge.toml", &fence(400.0));
    let robot = rig.start_robot(1, 1);
    // Kind and number of each piece; who comes later has the last one of before first, as on every topic.
    let said = |pieces: usize| -> Vec<(String, u64)> {
        let echo = format!("echo bridge/outline --json --count {pieces} --timeout 600s");
        let finished = rig.run(&echo, 0);
        let lines = finished.stdout.iter().map(|line| json(line));
        let piece = |piece: serde_json::Value| {
            assert_eq!(piece["schema"], "hero.BridgeOutline.v1");
            let kind = piece["kind"].as_str().unwrap().to_owned();
            (kind, piece["number"].as_u64().unwrap())
        };
        lines.map(piece).collect()
    };
    let held = || {
        let state = rig.run("echo state --json --count 1 --timeout 600s", 0);
        json(&state.stdout[0])["outline"].as_u64().unwrap()
    };
    let whole = |number| [("fence".to_owned(), number), ("area".to_owned(), number)];
    let first = held();
    assert_eq!(said(2), whole(first));
    assert_eq!(said(3)[1..], whole(first));
    rig.run("fence reload", 0);
    assert_eq!(held(), first, "the same fence");
    rig.write("bridge.toml", &fence(300.0));
    rig.run("fence reload", 0);
    let second = held();
    assert_ne!(second, first);
    assert_eq!(said(3)[1..], whole(second));
    robot.end();
}
