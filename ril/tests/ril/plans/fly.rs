//! `ril plan fly` with a simulated robot.

use std::fs;

use ipc_types::code::Functionality;
use ril_tests::process::{Finished, Signal};
use ril_tests::sandbox::Robot;
use ril_tests::{Process, Sandbox};

use super::check::SQUARE;
use crate::common::{FOR_SLOW_MACHINES, json, sandbox, says, shown_state, start_robot};

/// Simulator, bridge and status; the module is started.
fn start(rig: &Sandbox) -> Robot {
    if !rig.path("bridge.toml").exists() {
        rig.write("bridge.toml", FOR_SLOW_MACHINES);
    }
    let robot = start_robot(rig, 10);
    rig.run("start", 0);
    robot
}

/// The lines of `finished` that contain `text`, as one.
fn lines_with(finished: &Finished, text: &str) -> String {
    let lines = finished.stdout.iter().filter(|line| line.contains(text));
    lines.map(String::as_str).collect::<Vec<_>>().join("\n")
}

fn cruise_speed(rig: &Sandbox) -> String {
    rig.run("param get cruise_speed_mps", 0).stdout.join("")
}

#[test]
fn a_plan_is_flown_to_its_end_and_leaves_the_speed_as_it_was() {
    let rig = sandbox();
    let robot = start(&rig);
    let plan = SQUARE.replace("4 0 3 206 25", "4 0 2 178 1 8 -1 0 0 0 0 1\n5 0 3 206 25");
    rig.write("square.waypoints", &plan.replace("5 0 2 20", "6 0 2 20"));
    let finished = rig.run("plan fly square.waypoints --home 37.411,-6.001,10", 0);
    let expected = [
        "plan: take-off to ",
        "m above take-off",
        "plan: path of 2 waypoints, items 2 to 3",
        "plan: item 2 reached",
        "plan: item 3 reached",
        "plan: hover for 3s, item 3",
        "plan: cruise at 8 m/s, item 4",
        "plan: path to item 6",
        "plan: item 6 reached",
        "plan: landing, item 6",
        "plan: done; the helicopter has landed",
    ];
    assert_eq!(finished.stdout.len(), expected.len(), "{finished:#?}");
    for (line, expected) in finished.stdout.iter().zip(expected) {
        assert!(line.contains(expected), "{expected}: {finished:#?}");
    }
    // Over a home of 10 m; the noise of the GPS says how high the ground is.
    let height_m = finished.stdout[0].strip_prefix("plan: take-off to ");
    let height_m = height_m.and_then(|height| height.strip_suffix(" m")?.parse::<f64>().ok());
    assert!(
        height_m.is_some_and(|height| (height - 15.0).abs() < 0.2),
        "{finished:#?}"
    );
    // What the helicopter does not do is told before.
    finished.err_says("DO_SET_CAM_TRIGG_DIST (206) is not done");
    assert_eq!(cruise_speed(&rig), "cruise_speed_mps = 5");
    let state = shown_state(&rig, 1);
    assert_eq!(state["link"]["waypoints_sent"], 3);
    robot.end();
}

#[test]
fn a_plan_whose_output_is_closed_says_that_it_ended_early() {
    let rig = sandbox();
    let robot = start(&rig);
    rig.write("square.waypoints", SQUARE);
    let line = "{ \"$0\" plan fly square.waypoints; echo \"code $?\" >&2; } | head -n 1";
    let finished = Process::spawn(&rig.domain, rig.shell(line)).wait_exit();
    finished.err_says("code 7");
    finished.err_says("standard output was closed");
    assert!(
        says(
            &finished.stderr,
            "go on with `ril plan fly square.waypoints --from"
        ),
        "{finished:#?}"
    );
    robot.end();
}

#[test]
fn a_plan_that_breaks_a_rule_is_not_flown() {
    let rig = sandbox();
    rig.write(
        "bridge.toml",
        &format!("{FOR_SLOW_MACHINES}[fence]\nceiling_m = 26.0\n"),
    );
    let robot = start(&rig);
    rig.write("square.waypoints", SQUARE);
    let finished = rig.run("plan fly square.waypoints", 8);
    assert!(finished.stdout.is_empty(), "{finished:#?}");
    finished.err_says("item 2, leg 1: fence-ceiling by ");
    // It stands on the ground, and the plan does not take off.
    rig.write(
        "path.waypoints",
        // With room to stop below the ceiling, however the GPS strays.
        "QGC WPL 110\n1 0 3 16 0 0 0 0 37.4111 -6.001 9 1\n",
    );
    let finished = rig.run("plan fly path.waypoints --json", 8);
    let finding = json(&finished.stdout[0]);
    assert_eq!(
        (&finding["rule"], &finding["items"][0]),
        (&"not-flying".into(), &1.into())
    );
    assert_eq!(
        finding["next_step"],
        "let it take off first: `--takeoff 20m`"
    );
    let state = shown_state(&rig, 1);
    assert_eq!(state["link"]["waypoints_sent"], 0);
    assert_eq!(
        state["module"]["functionality"],
        Functionality::AtRest.name()
    );

    let finished = rig.run("plan fly path.waypoints --takeoff 5m --json", 0);
    let events: Vec<_> = finished.stdout.iter().map(|line| json(line)).collect();
    let last = events.last().unwrap();
    assert_eq!(
        (&last["schema"], &last["event"]),
        (&"ril.PlanProgress.v1".into(), &"done".into())
    );
    assert!(
        events
            .iter()
            .any(|event| event["schema"] == "hero.RequestReport.v3" || event["request"] == "goto")
    );
    // In the air home is where it took off, unless the operator says another one.
    rig.run("plan fly path.waypoints", 0);
    rig.run("plan fly path.waypoints --home 37.411,-6.001,10", 0);
    robot.end();
}

#[test]
fn altitudes_above_sea_are_flown_only_when_it_is_known_how_high_telemetry_s_zero_lies() {
    let rig = sandbox();
    let robot = start(&rig);
    rig.write(
        "mountain.gpx",
        r#"<gpx version="1.1" creator="x" xmlns="http://www.topografix.com/GPX/1/1"><rte>
        <rtept lat="37.4111" lon="-6.001"><ele>620</ele></rtept></rte></gpx>"#,
    );
    let finished = rig.run("plan fly mountain.gpx --takeoff 5m", 8);
    for expected in [
        "item 1: sea-level",
        "zero_above_sea_m",
        "heights above take-off",
    ] {
        finished.err_says(expected);
    }
    let state = shown_state(&rig, 1);
    assert_eq!(
        state["module"]["functionality"],
        Functionality::AtRest.name()
    );
    // The two ways to go on.
    rig.write("ril.toml", "[plan]\nzero_above_sea_m = 600.0\n");
    rig.run("plan fly mountain.gpx --takeoff 5m", 0);
    let at = &shown_state(&rig, 1)["flight"]["altitude_m"];
    assert!((at.as_f64().unwrap() - 20.0).abs() < 1.5, "{at}");
    rig.write("ril.toml", "");
    rig.write(
        "field.waypoints",
        "QGC WPL 110\n1 0 3 16 0 0 0 0 37.4112 -6.001 12 1\n",
    );
    // How high the take-off was is known in the air, too, and may be said.
    rig.run("plan fly field.waypoints --home 37.411,-6.001", 0);
    rig.run("plan fly field.waypoints --home 37.411,-6.001,10", 0);
    robot.end();
}

#[test]
fn a_plan_that_was_stopped_goes_on_at_the_next_item() {
    let rig = sandbox();
    let robot = start(&rig);
    // 500 m between the last two, 10 s of the test's time.
    rig.write(
        "far.waypoints",
        "QGC WPL 110
0 1 0 16 0 0 0 0 37.411 -6.001 10 1
1 0 3 22 0 0 0 0 0 0 12 1
2 0 3 16 0 0 0 0 37.4111 -6.001 12 1
3 0 3 16 0 0 0 0 37.4156 -6.001 12 1
4 0 3 16 0 0 0 0 37.4157 -6.001 12 1
",
    );
    let mut flight = rig.start("plan fly far.waypoints");
    flight.wait_for_text("plan: item 2 reached");
    rig.run("hold", 0);
    let finished = flight.exits(5);
    assert!(
        says(
            &finished.stderr,
            "the plan ended early, before the end of item 3"
        ),
        "{finished:#?}"
    );
    finished.err_says("replaced");
    let command = finished
        .stderr
        .iter()
        .find_map(|line| Some(line.split_once("`ril ")?.1.split_once('`')?.0.to_owned()))
        .expect("a command that goes on");
    assert!(command.contains("--from 3 --home 37.41"), "{command}");
    let finished = rig.run(&command, 0);
    assert_eq!(
        lines_with(&finished, "plan: path"),
        "plan: path of 2 waypoints, items 3 to 4"
    );
    assert_eq!(
        finished.stdout.last().unwrap(),
        "plan: done; the helicopter hovers"
    );

    // A signal ends the command and not the path.
    rig.write(
        "back.waypoints",
        "QGC WPL 110\n1 0 3 16 0 0 0 0 37.411 -6.001 15 1\n2 0 0 21 0 0 0 0 0 0 0 1\n",
    );
    let mut flight = rig.start("plan fly back.waypoints --home 37.411,-6.001,10");
    flight.wait_for_text("plan: path to item 1");
    rig.watch(1).until("the path is flown", |state| {
        state.movement.waypoints_sent == 1
            && state.functionality() == Some(Functionality::FollowingPath)
    });
    flight.signal(Signal::INT);
    flight.exits(7).err_says("--from 1");
    robot.end();
}

#[test]
fn the_plan_s_fence_comes_into_force_only_when_asked_for_and_only_where_the_bridge_reads_it() {
    let rig = sandbox();
    let rules = format!("# ours\n{FOR_SLOW_MACHINES}");
    let file = rig.write("bridge.toml", &rules);
    let robot = start(&rig);
    let plan = r#"{"fileType":"Plan","version":1,"mission":{"version":2,"plannedHomePosition":[37.411,-6.001,10],"items":[
        {"type":"SimpleItem","command":22,"frame":3,"autoContinue":true,"params":[0,0,0,null,0,0,12]},
        {"type":"SimpleItem","command":16,"frame":3,"autoContinue":true,"params":[0,0,0,null,37.4111,-6.001,12]},
        {"type":"SimpleItem","command":21,"frame":3,"autoContinue":true,"params":[0,0,0,null,0,0,0]}]},
        "geoFence":{"version":2,"circles":[],"polygons":[
        {"inclusion":true,"version":1,"polygon":[[37.41,-6.003],[37.41,-5.999],[37.412,-5.999],[37.412,-6.003]]}]}}"#;
    rig.write("fenced.plan", plan);
    let areas = |rig: &Sandbox| shown_state(rig, 1)["safety"]["fence_areas"].clone();

    // Another file than the bridge's: both stay as they are.
    let other = rig.write("other.toml", &rules);
    rig.run(
        "plan fly fenced.plan --fence --bridge other.toml --timeout 5s",
        5,
    )
    .err_says("it does not read other.toml");
    assert_eq!(fs::read_to_string(&other).unwrap(), rules);

    rig.run("plan fly fenced.plan", 0);
    assert_eq!(areas(&rig), 0);
    rig.run("plan fly fenced.plan --fence", 0)
        .out_says("fence reload: done");
    assert_eq!(areas(&rig), 1);
    let text = fs::read_to_string(&file).unwrap();
    assert!(
        text.starts_with(&rules) && text.contains("plan: inclusion 1"),
        "{text}"
    );
    // It is the bridge's own now.
    rig.run("takeoff 5m", 0);
    rig.run("goto 37.4125,-6.001,20m", 5)
        .err_says("fence-inclusion, area `plan: inclusion 1`, leg 1");
    rig.run("land", 0);
    robot.end();
}
