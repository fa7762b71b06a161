//! `ril plan check` and `show` without a robot, as they are seen in 80 columns, and their exit codes.

use crate::common::{json, sandbox, says};

/// A square that takes off and returns, with its home, in the form of Mission Planner.
pub const SQUARE: &str = "QGC WPL 110
0 1 0 16 0 0 0 0 37.411 -6.001 10 1
1 0 3 22 0 0 0 0 0 0 15 1
2 0 3 16 0 0 0 0 37.4113 -6.001 18 1
3 0 3 16 3 0 0 0 37.4113 -6.0014 18 1
4 0 3 206 25 0 0 0 0 0 0 1
5 0 2 20 0 0 0 0 0 0 0 1
";

const RULES: &str = "[fence]
ceiling_m = 27.0
[[fence.area]]
name = \"mast\"
kind = \"exclusion\"
centre = [37.4113, -6.0012]
radius_m = 10.0
[parameters]
cruise_speed_mps = 4.0
";

#[test]
fn a_check_names_item_leg_rule_and_metres() {
    let rig = sandbox();
    rig.write("square.waypoints", SQUARE);
    rig.write("rules.toml", RULES);
    rig.write(
        "ril.toml",
        "[plan]\nendurance_s = 90.0\nreserve_s = 60.0\nzero_above_sea_m = 0.0\n",
    );
    let finished = rig.run("plan check square.waypoints --bridge rules.toml", 8);
    insta::assert_snapshot!(finished.stdout.join("\n"), @r###"
    plan         square.waypoints: QGC WPL 110, 5 items
    home         37.4110000, -6.0010000, 10.0 m: as the plan has it
    rules        of the robot: rules.toml with 1 area; the plan's own fence has 0
                 areas
    flight       150 m, about 49s at 4.0 m/s; at most 18.0 m above take-off and 49 m
                 away from it

    FORBIDS      item 2, leg 1: fence-ceiling by 1.0 m
                 is reached above the ceiling of the robot's fence
                 next: change the plan, or `[fence]` of bridge.toml and `ril fence
                       reload`

    FORBIDS      item 3, leg 2: fence-ceiling by 1.0 m
                 is reached above the ceiling of the robot's fence
                 next: change the plan, or `[fence]` of bridge.toml and `ril fence
                       reload`

    FORBIDS      item 3, leg 2: fence-exclusion by 10.0 m
                 is reached through the exclusion area `mast` of the robot's fence
                 next: change the plan, or `[fence]` of bridge.toml and `ril fence
                       reload`

    FORBIDS      item 5, leg 3: fence-ceiling by 1.0 m
                 is reached above the ceiling of the robot's fence
                 next: change the plan, or `[fence]` of bridge.toml and `ril fence
                       reload`

    FORBIDS      item 5, leg 3: endurance by 66.6 m
                 is reached too late: the flight takes 49 s, battery and fuel last
                 90 s, of which 60 s are reserve
                 next: divide the plan, or correct `[plan]` of ril.toml

    warns        the plan: not-used
                 line 2, the first item, is taken for the planned home, as
                 ArduPilot's ground stations write it: it is not flown to

    warns        item 4: not-done
                 DO_SET_CAM_TRIGG_DIST (206) is not done

    warns        item 5: return
                 returns home in a straight line, as high as the item before it, and
                 lands

    5 findings forbid the flight, 3 warn, 0 not checked
    "###);
    assert!(
        says(
            &finished.stderr,
            "square.waypoints cannot be flown as it is: 5 findings forbid it"
        ),
        "{finished:#?}"
    );
    assert!(
        finished
            .stdout
            .iter()
            .all(|line| line.chars().count() <= 80)
    );

    let finished = rig.run("plan check square.waypoints --bridge rules.toml --json", 8);
    let lines: Vec<_> = finished.stdout.iter().map(|line| json(line)).collect();
    let breach = lines
        .iter()
        .find(|line| line["rule"] == "fence-exclusion")
        .unwrap();
    assert_eq!(breach["schema"], "ril.PlanFinding.v1");
    assert_eq!(
        (&breach["items"][0], &breach["leg"]),
        (&3.into(), &2.into())
    );
    assert!(
        (breach["amount_m"].as_f64().unwrap() - 10.0).abs() < 0.1,
        "{breach}"
    );
    // The failure comes behind it.
    let summary = &lines[lines.len() - 2];
    assert_eq!(summary["schema"], "ril.PlanSummary.v1");
    assert_eq!(
        (&summary["forbids"], &summary["home_source"]),
        (&5.into(), &"plan".into())
    );
}

#[test]
fn a_plan_in_order_is_checked_without_a_robot() {
    let rig = sandbox();
    rig.write("square.waypoints", SQUARE);
    rig.write("bridge.toml", "[parameters]\ncruise_speed_mps = 5.0\n");
    rig.write("ril.toml", "[plan]\nendurance_s = 600.0\n");
    let finished = rig.run("plan check square.waypoints --home 37.4110,-6.0010,10m", 0);
    for expected in [
        "home         37.4110000, -6.0010000, 10.0 m: as --home says",
        "rules        of the robot: bridge.toml with 0 areas; the plan's own fence has 0",
        "0 findings forbid the flight, 3 warn, 0 not checked",
    ] {
        finished.out_says(expected);
    }
    rig.domain.assert_empty();
}

#[test]
fn a_plan_is_shown_as_a_table_and_written_for_qgroundcontrol() {
    let rig = sandbox();
    rig.write("square.waypoints", SQUARE);
    rig.write("bridge.toml", "[parameters]\ncruise_speed_mps = 5.0\n");
    let finished = rig.run("plan show square.waypoints --to square.plan --offline", 0);
    insta::assert_snapshot!(finished.stdout.join("\n"), @r###"
    ITEM ACTION        LATITUDE    LONGITUDE  ALTITUDE  STEP_M  TOTAL_M      TIME
       1 take-off                                +15.0      15       15        8s
       2 waypoint    37.4113000   -6.0010000     +18.0      33       48       14s
       3 waypoint    37.4113000   -6.0014000     +18.0      35       84       24s
       4 (DO_SET_CAM_TRIGG_DIST (206))               -       -        -         -
       5 return                                      -      67      150       43s
    ALTITUDE: m above take-off (+), sea level (sea), terrain (gnd), unknown (?).
    Items in brackets are not flown.
    "###);
    assert!(
        finished
            .stdout
            .iter()
            .all(|line| line.chars().count() <= 80)
    );

    // What was written is the same plan.
    let of = |file: &str| rig.run(&format!("plan show {file} --json"), 0).stdout;
    let (list, plan) = (of("square.waypoints"), of("square.plan"));
    assert_eq!(list.len(), plan.len());
    for (list, plan) in list.iter().zip(&plan).take(5) {
        let (mut list, mut plan) = (json(list), json(plan));
        assert_eq!(list["schema"], "ril.PlanItem.v1");
        // Lines and items are counted in another way.
        list["origin"].take();
        plan["origin"].take();
        assert_eq!(list, plan);
    }
    let refused = rig.run("plan show square.waypoints --to square.plan", 2);
    refused.err_says("square.plan exists already");
    refused.err_says("name another file with --to");
    assert!(!says(&refused.stderr, "os error"), "{refused:#?}");
}

#[test]
fn what_is_no_plan_is_a_usage_error_with_its_place() {
    let rig = sandbox();
    rig.write("square.waypoints", SQUARE);
    rig.write("new.waypoints", "QGC WPL 120\n");
    rig.write(
        "broken.waypoints",
        &SQUARE.replace("37.4113 -6.0014", "97.4113 -6.0014"),
    );
    rig.write("notes.md", "hello");
    #[rustfmt::skip]
    let cases = [
        ("check absent.plan", "absent.plan: cannot be read"),
        ("check .", ".: cannot be read"),
        ("check notes.md", "notes.md: neither content nor name is that of a plan"),
        ("show new.waypoints", "new.waypoints: line 1: QGC WPL 120 keeps its home"),
        ("fly broken.waypoints", "broken.waypoints: line 5: the latitude 97.4113 is not from -90 to 90"),
        ("check square.waypoints --from 9", "has 5 items"),
        ("check square.waypoints --home 99,0", "the latitude 99 is out of range"),
        ("check square.waypoints --takeoff 0m", "greater than 0"),
        ("check square.waypoints --altitude-is moon", "[possible values: take-off, sea]"),
    ];
    for (args, expected) in cases {
        let finished = rig.run(&format!("plan {args}"), 2);
        finished.err_says(expected);
        assert!(finished.stdout.is_empty(), "{args}: {finished:#?}");
    }
    rig.write("wrong.toml", "[fence]\nfloor = 3\n");
    rig.run("plan check square.waypoints --bridge wrong.toml", 78)
        .err_says("wrong.toml:2: unknown field");
    rig.run("plan fly square.waypoints --robot 7 --timeout 1s", 3)
        .err_says("--robot 7");
    rig.domain.assert_empty();
}
