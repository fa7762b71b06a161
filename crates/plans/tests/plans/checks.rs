//! The steps that plans become, and the findings about them.

use std::path::Path;

use bridge::BridgeConfig;
use dsp_protocol::{Uplink, Waypoint};
use plans::check::check;
use plans::finding::effect;
use plans::flight::{Flight, Step, quantised};
use plans::site::{Endurance, HomeSource, Site, Start};
use plans::timeline::timeline;
use runtime::finding::{Finding, Severity};

const HOME: Waypoint = Waypoint {
    latitude_deg: 37.411,
    longitude_deg: -6.001,
    altitude_m: 10.0,
};

fn site() -> Site {
    Site {
        home: HOME,
        is_home_altitude_known: true,
        home_source: HomeSource::Operator,
        start: Start::Ground(HOME),
        zero_above_sea_m: Some(0.0),
        take_off_m: None,
        from: 1,
        is_for_flight: true,
    }
}

const FAST: Endurance = Endurance {
    cruise_speed_mps: Some(5.0),
    climb_speed_mps: Some(2.0),
    endurance_s: Some(1200.0),
    reserve_s: 120.0,
};

/// A list of waypoints with these lines of frame, command, parameter 1, parameter 2, latitude, longitude, altitude.
fn list(lines: &[(u16, u16, f64, f64, f64, f64, f64)]) -> plans::Plan {
    let mut text = "QGC WPL 110\n".to_owned();
    for (index, (frame, command, p1, p2, latitude, longitude, altitude)) in lines.iter().enumerate()
    {
        let index = index + 1;
        text += &format!(
            "{index} 0 {frame} {command} {p1} {p2} 0 0 {latitude} {longitude} {altitude} 1\n"
        );
    }
    plans::read(Path::new("test.waypoints"), text.as_bytes()).expect("a plan")
}

/// A square that takes off and lands.
fn square() -> plans::Plan {
    list(&[
        (3, 22, 0.0, 0.0, 0.0, 0.0, 20.0),
        (3, 16, 0.0, 0.0, 37.412, -6.001, 25.0),
        (3, 16, 6.0, 0.0, 37.412, -6.002, 25.0),
        (3, 16, 0.0, 0.0, 37.411, -6.002, 30.0),
        (2, 20, 0.0, 0.0, 0.0, 0.0, 0.0),
    ])
}

fn findings(plan: &plans::Plan, site: &Site, rules: &str, endurance: &Endurance) -> Vec<Finding> {
    let rules: BridgeConfig =
        runtime::config::parse(rules, "bridge.toml").expect("a configuration");
    let flight = Flight::new(plan, site);
    check(plan, &flight, site, Some(&rules), endurance)
}

fn describe(findings: &[Finding]) -> String {
    let lines: Vec<String> = findings
        .iter()
        .map(|finding| {
            let leg = finding
                .leg
                .map_or(String::new(), |leg| format!(" leg {leg}"));
            let amount = finding
                .amount_m
                .map_or(String::new(), |metres| format!(" {metres:.1} m"));
            format!(
                "{} {} {:?}{leg}{amount}: {}",
                effect(finding),
                finding.id,
                finding.items,
                finding.text
            )
        })
        .collect();
    lines.join("\n")
}

#[test]
fn a_plan_becomes_steps_with_the_altitude_of_telemetry() {
    let flight = Flight::new(&square(), &site());
    let point = |item, latitude_deg, longitude_deg, altitude_m| plans::flight::PathPoint {
        item,
        waypoint: Waypoint {
            latitude_deg,
            longitude_deg,
            altitude_m,
        },
    };
    assert_eq!(
        flight.steps,
        [
            Step::TakeOff {
                item: Some(1),
                height_m: 20.0
            },
            Step::Path(vec![
                point(2, 37.412, -6.001, 35.0),
                point(3, 37.412, -6.002, 35.0)
            ]),
            Step::Wait {
                item: 3,
                duration_s: 6.0
            },
            Step::Path(vec![
                point(4, 37.411, -6.002, 40.0),
                point(5, 37.411, -6.001, 40.0)
            ]),
            Step::Land { item: 5 },
        ]
    );
    let marks = timeline(&flight, &FAST);
    let times: Vec<f64> = marks
        .iter()
        .map(|mark| mark.time_s.unwrap().round())
        .collect();
    // 10 s up; 111 m; 88 m; 6 s; 111 m; 88 m; 15 s down.
    assert_eq!(times, [10.0, 32.0, 50.0, 56.0, 78.0, 96.0, 111.0]);
}

#[test]
fn a_plan_in_order_has_no_finding_but_what_the_operator_must_know() {
    let found = findings(&square(), &site(), "", &FAST);
    assert_eq!(
        describe(&found),
        "warns return [5]: returns home in a straight line, as high as the item before it, and lands"
    );
}

#[test]
fn each_finding_names_item_leg_rule_and_metres() {
    let rules = "
[fence]
ceiling_m = 38.0
[[fence.area]]
name = \"mast\"
kind = \"exclusion\"
centre = [37.412, -6.0015]
radius_m = 20.0
[movement]
max_distance_m = 120.0
max_altitude_m = 39.0
";
    let slow = Endurance {
        endurance_s: Some(100.0),
        reserve_s: 20.0,
        ..FAST
    };
    insta::assert_snapshot!(describe(&findings(&square(), &site(), rules, &slow)), @r###"
    forbids max-distance [3] leg 2 22.0 m: is 142 m from where its path begins; the limit is 120 m
    forbids altitude-range [4] leg 3 1.0 m: leads to 40.0 m; `[movement]` of bridge.toml allows -1000 to 39 m
    forbids altitude-range [5] leg 4 1.0 m: leads to 40.0 m; `[movement]` of bridge.toml allows -1000 to 39 m
    forbids max-distance [5] leg 4 22.0 m: is 142 m from where its path begins; the limit is 120 m
    forbids fence-exclusion [3] leg 2 20.0 m: is reached through the exclusion area `mast` of the robot's fence
    forbids fence-ceiling [4] leg 3 2.0 m: is reached above the ceiling of the robot's fence
    forbids fence-ceiling [5] leg 4 2.0 m: is reached above the ceiling of the robot's fence
    forbids endurance [5] leg 4 118.3 m: is reached too late: the flight takes 111 s, battery and fuel last 100 s, of which 20 s are reserve
    warns return [5]: returns home in a straight line, as high as the item before it, and lands
    "###);
}

/// Most often such a height is one above sea level.
#[test]
fn a_take_off_that_is_too_high_names_the_limit_and_the_heights_of_the_plan() {
    let plan = list(&[
        (3, 22, 0.0, 0.0, 0.0, 0.0, 620.0),
        (2, 20, 0.0, 0.0, 0.0, 0.0, 0.0),
    ]);
    let found = findings(&plan, &site(), "", &FAST);
    let high = found.iter().find(|one| one.id == "take-off-altitude");
    let high = high.unwrap_or_else(|| panic!("{}", describe(&found)));
    assert!(
        high.text.contains("0.5 to 200 m above take-off"),
        "{high:?}"
    );
    let next_step = high.next_step.as_deref().unwrap_or_default();
    assert!(next_step.contains("set `zero_above_sea_m`"), "{high:?}");
}

#[test]
fn a_waypoint_below_the_ground_of_the_take_off_is_found_unless_the_robot_allows_it() {
    let valley = list(&[
        (3, 22, 0.0, 0.0, 0.0, 0.0, 20.0),
        (3, 16, 0.0, 0.0, 37.412, -6.001, -2.5),
    ]);
    let found = findings(&valley, &site(), "", &FAST);
    assert_eq!(
        describe(&found),
        "forbids below-take-off [2] leg 1 2.5 m: is reached below the ground of the take-off"
    );
    let found = findings(&valley, &site(), "[safety]\nbelow_take_off = true\n", &FAST);
    assert!(found.is_empty(), "{found:?}");
}

#[test]
fn the_plan_s_own_fence_is_judged_as_the_bridge_would() {
    let mut plan = super::files::plan("mission.plan");
    if let plans::model::FenceShape::Circle { radius_m, .. } = &mut plan.fence[1].shape {
        *radius_m = 110.0;
    }
    let found = findings(&plan, &site(), "", &FAST);
    insta::assert_snapshot!(describe(&found), @r###"
    forbids not-possible [8]: the helicopter cannot do a complex item `StructureScan` without simple items
    forbids above-terrain [10]: has an altitude above terrain, which the helicopter does not know
    forbids not-possible [11]: the helicopter cannot do an item of the type `HologramItem`
    forbids plan-fence-exclusion [4] leg 2 6.2 m: is reached through the exclusion area `exclusion 2` of the plan's own fence
    forbids plan-fence-exclusion [5] leg 3 5.5 m: is reached through the exclusion area `exclusion 2` of the plan's own fence
    forbids plan-fence-exclusion [9] leg 5 19.6 m: is reached through the exclusion area `exclusion 2` of the plan's own fence
    forbids plan-fence-exclusion [12] leg 6 10.6 m: is reached through the exclusion area `exclusion 2` of the plan's own fence
    warns not-used []: line 84: 2 rally points are not used
    warns not-done [6]: DO_SET_CAM_TRIGG_DIST (206) is not done
    warns not-done [9]: asks for an acceptance radius of 2 m, which is not done
    warns not-done [9]: asks for the heading 90 degrees, which is not done
    warns return [12]: returns home in a straight line, as high as the item before it, and lands
    "###);
}

#[test]
fn items_that_cannot_be_done_are_named() {
    let plan = super::files::plan("mission.waypoints");
    insta::assert_snapshot!(describe(&findings(&plan, &site(), "", &FAST)), @r###"
    forbids above-terrain [4]: has an altitude above terrain, which the helicopter does not know
    forbids not-possible [5]: the helicopter cannot do NAV_LOITER_TURNS (18)
    forbids not-possible [8]: the helicopter cannot do DO_JUMP (177)
    warns not-used []: line 2, the first item, is taken for the planned home, as ArduPilot's ground stations write it: it is not flown to
    warns not-done [6]: DO_SET_SERVO (183) is not done
    warns not-done [9]: asks for a stop after the item (autocontinue is off), which is not done
    "###);
}

#[test]
fn what_is_not_known_is_not_checked_and_says_so() {
    let site = Site {
        home_source: HomeSource::Assumed,
        is_for_flight: false,
        ..site()
    };
    let flight = Flight::new(&square(), &site);
    let found = check(&square(), &flight, &site, None, &Endurance::default());
    let not_checked: Vec<&str> = found
        .iter()
        .filter(|finding| !finding.is_checked)
        .map(|finding| finding.id)
        .collect();
    assert_eq!(not_checked, ["home-unknown", "robot-rules", "endurance"]);
}

#[test]
fn what_flies_must_have_taken_off() {
    let path = list(&[
        (3, 16, 0.0, 0.0, 37.412, -6.001, 25.0),
        (3, 16, 0.0, 0.0, 37.412, -6.002, 25.0),
        (3, 21, 0.0, 0.0, 0.0, 0.0, 0.0),
        (3, 16, 0.0, 0.0, 37.412, -6.002, 25.0),
    ]);
    let rules = |site: &Site| -> Vec<(Severity, &'static str, Vec<u32>)> {
        let found = findings(&path, site, "", &FAST);
        found
            .into_iter()
            .map(|finding| (finding.severity, finding.id, finding.items))
            .collect()
    };
    let lands = (Severity::Error, "not-flying", vec![4]);
    assert_eq!(
        rules(&site()),
        [(Severity::Error, "not-flying", vec![1]), lands.clone()]
    );
    let check = Site {
        is_for_flight: false,
        ..site()
    };
    assert_eq!(
        rules(&check),
        [lands.clone(), (Severity::Warning, "not-flying", vec![1])]
    );
    let asked = Site {
        take_off_m: Some(15.0),
        ..site()
    };
    assert_eq!(rules(&asked), std::slice::from_ref(&lands));
    let flying = Site {
        start: Start::Flying(Waypoint {
            altitude_m: 30.0,
            ..HOME
        }),
        ..site()
    };
    assert_eq!(rules(&flying), [lands]);
    let steps = Flight::new(&path, &asked).steps;
    assert_eq!(
        steps[0],
        Step::TakeOff {
            item: None,
            height_m: 15.0
        }
    );
}

#[test]
fn a_plan_that_is_resumed_begins_with_the_item_and_its_speed() {
    let plan = list(&[
        (3, 22, 0.0, 0.0, 0.0, 0.0, 20.0),
        (2, 178, 1.0, 3.0, 0.0, 0.0, 0.0),
        (3, 16, 0.0, 0.0, 37.412, -6.001, 25.0),
        (3, 16, 0.0, 0.0, 37.412, -6.002, 25.0),
    ]);
    let at = Waypoint {
        latitude_deg: 37.4119,
        altitude_m: 34.0,
        ..HOME
    };
    let site = Site {
        start: Start::Flying(at),
        from: 4,
        ..site()
    };
    let flight = Flight::new(&plan, &site);
    assert_eq!(
        flight.steps[0],
        Step::Speed {
            item: 2,
            speed_mps: 3.0
        }
    );
    assert_eq!(
        (flight.legs.len(), flight.legs[0].item, flight.legs[0].from),
        (1, 4, at)
    );
    // From the beginning, its take-off is impossible.
    let again = Site { from: 1, ..site };
    let found = findings(&plan, &again, "", &FAST);
    assert_eq!(
        (found[0].id, found[0].next_step.as_deref()),
        (
            "already-flying",
            Some("begin with the next item: `--from 2`")
        )
    );
}

#[test]
fn a_path_that_is_too_long_is_divided() {
    let lines: Vec<_> = (0..1500)
        .map(|index| {
            (
                3,
                16,
                0.0,
                0.0,
                37.411 + f64::from(index) * 1e-5,
                -6.001,
                25.0,
            )
        })
        .collect();
    let site = Site {
        take_off_m: Some(20.0),
        ..site()
    };
    let flight = Flight::new(&list(&lines), &site);
    let lengths: Vec<usize> = flight
        .steps
        .iter()
        .filter_map(|step| match step {
            Step::Path(path) => Some(path.len()),
            _ => None,
        })
        .collect();
    assert_eq!(lengths, [1024, 476]);
}

#[test]
fn waypoints_are_judged_as_the_dsp_gets_them() {
    let waypoint = Waypoint {
        latitude_deg: 37.411_000_04,
        longitude_deg: -6.000_999_96,
        altitude_m: 20.000_4,
    };
    let sent = Uplink::Waypoint(waypoint).encode();
    let mut decoder = dsp_protocol::Decoder::<Uplink>::new();
    let (_, decoded) = decoder.decode(sent.as_bytes());
    assert_eq!(
        decoded,
        dsp_protocol::Decoded::Message(Uplink::Waypoint(quantised(waypoint)))
    );
}

/// Nobody flies there, with or without a hold in between.
#[test]
fn a_plan_for_another_site_is_asked_about_and_not_divided() {
    for (latitude_deg, expected) in [
        (37.6, "put a hold in between"),
        (-6.001, "are latitude and longitude swapped?"),
    ] {
        let plan = list(&[
            (3, 22, 0.0, 0.0, 0.0, 0.0, 10.0),
            (3, 16, 0.0, 0.0, latitude_deg, -6.001, 10.0),
        ]);
        let found = findings(&plan, &site(), "", &FAST);
        let far = found.iter().find(|one| one.id == "max-distance");
        let far = far.unwrap_or_else(|| panic!("{}", describe(&found)));
        let next_step = far.next_step.as_deref().unwrap_or_default();
        assert!(next_step.to_lowercase().contains(expected), "{far:?}");
    }
}
