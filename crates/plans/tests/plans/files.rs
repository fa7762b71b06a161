//! What is read from the files in `tests/files`, which were written by hand.

use std::path::{Path, PathBuf};

use plans::model::{Action, FenceShape, StatedAltitudes};
use plans::{Plan, write};

/// The path of a file in `tests/files`.
pub fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/files")
        .join(name)
}

/// The bytes of a file in `tests/files`.
pub fn bytes(name: &str) -> Vec<u8> {
    std::fs::read(path(name)).expect("a file of the tests")
}

/// The plan of a file in `tests/files`.
pub fn plan(name: &str) -> Plan {
    plans::read(Path::new(name), &bytes(name)).expect("a plan")
}

/// A plan as lines.
pub fn describe(plan: &Plan) -> String {
    let mut lines = vec![format!("{}", plan.format)];
    if let Some(home) = plan.planned_home {
        let at = home.position;
        lines.push(format!(
            "home {} {}, {:?} m above sea",
            at.latitude_deg, at.longitude_deg, home.above_sea_m
        ));
    }
    for item in &plan.items {
        let mut line = format!("{} ({}) {}", item.number, item.origin, item.action.name());
        if !item.label.is_empty() {
            line += &format!(" `{}`", item.label);
        }
        if let Some(at) = item.action.position() {
            line += &format!(" at {} {}", at.latitude_deg, at.longitude_deg);
        }
        if let Some(altitude) = item.action.altitude() {
            line += &format!(", {altitude}");
        }
        match &item.action {
            Action::Waypoint { hold_s, .. } if *hold_s > 0.0 => {
                line += &format!(", hold {hold_s} s")
            }
            Action::Hold { duration_s, .. } => line += &format!(", for {duration_s:?} s"),
            Action::Speed { speed_mps } => line += &format!(" {speed_mps} m/s"),
            Action::Other { kind, .. } => line += &format!(", {kind:?}"),
            _ => {}
        }
        for ignored in &item.ignored {
            line += &format!("; not {}", ignored.text);
        }
        lines.push(line);
    }
    for area in &plan.fence {
        let kind = if area.is_inclusion {
            "inclusion"
        } else {
            "exclusion"
        };
        lines.push(match &area.shape {
            FenceShape::Polygon(vertices) => {
                format!("fence `{}`: {kind}, {} vertices", area.name, vertices.len())
            }
            FenceShape::Circle { centre, radius_m } => format!(
                "fence `{}`: {kind}, {radius_m} m round {} {}",
                area.name, centre.latitude_deg, centre.longitude_deg
            ),
        });
    }
    for part in &plan.left_out {
        lines.push(format!("left out ({:?}): {}", part.kind, part.what));
    }
    lines.join("\n")
}

#[test]
fn a_plan_of_qgroundcontrol() {
    insta::assert_snapshot!(describe(&plan("mission.plan")), @r###"
    QGroundControl plan
    home 37.411 -6.001, Some(10.0) m above sea
    1 (item 1) take-off at 37.411 -6.001, 20.0 m above take-off
    2 (item 2) speed 4 m/s
    3 (item 3) waypoint at 37.4115 -6.001, 25.0 m above take-off
    4 (item 4) hold at 37.412 -6.0015, 40.0 m above sea, for Some(5.0) s
    5 (item 5 (survey), part 1) waypoint at 37.4121 -6.0019, 30.0 m above take-off
    6 (item 5 (survey), part 2) DO_SET_CAM_TRIGG_DIST (206), Payload
    7 (item 5 (survey), part 3) waypoint at 37.4129 -6.0019, 30.0 m above take-off
    8 (item 6) a complex item `StructureScan` without simple items, Flight
    9 (item 7) waypoint at 37.4118 -6.0012, 58.5 m above sea; not an acceptance radius of 2 m; not the heading 90 degrees
    10 (item 8) waypoint at 37.4117 -6.0011, 12.0 m above terrain
    11 (item 9) an item of the type `HologramItem`, Flight
    12 (item 10) return
    fence `inclusion 1`: inclusion, 4 vertices
    fence `exclusion 2`: exclusion, 30 m round 37.4125 -6.0005
    left out (Payload): line 84: 2 rally points are not used
    "###);
}

#[test]
fn a_plan_of_an_older_qgroundcontrol() {
    insta::assert_snapshot!(describe(&plan("version1.plan")), @r###"
    QGroundControl plan
    home 37.411 -6.001, Some(10.0) m above sea
    1 (item 1) take-off at 37.411 -6.001, 12.0 m above take-off
    2 (item 2) waypoint at 37.4114 -6.001, 14.0 m above take-off, hold 2 s
    3 (item 3) land at 37.411 -6.0012
    left out (Flight): line 26: the fence of version 1 does not say whether it is to be left or entered
    "###);
}

#[test]
fn a_list_of_waypoints() {
    insta::assert_snapshot!(describe(&plan("mission.waypoints")), @r###"
    QGC WPL 110
    home 37.411 -6.001, Some(10.0) m above sea
    1 (line 4) take-off at 37.4112 -6.001, 20.0 m above take-off
    2 (line 5) waypoint at 37.4115 -6.001, 25.0 m above take-off, hold 3.5 s
    3 (line 7) waypoint at 37.4115 -6.0015, 35.0 m above sea
    4 (line 8) waypoint at 37.4115 -6.0016, 9.0 m above terrain
    5 (line 9) NAV_LOITER_TURNS (18), Flight
    6 (line 10) DO_SET_SERVO (183), Payload
    7 (line 11) hold, 25.0 m above take-off, for Some(12.0) s
    8 (line 12) DO_JUMP (177), Flight
    9 (line 13) land at 37.411 -6.0012; not a stop after the item (autocontinue is off)
    left out (Payload): line 2, the first item, is taken for the planned home, as ArduPilot's ground stations write it: it is not flown to
    "###);
}

#[test]
fn geojson() {
    insta::assert_snapshot!(describe(&plan("field.geojson")), @r###"
    GeoJSON
    1 (feature 1, line 4) take-off `pad` at 37.411 -6.001, 15.0 m above take-off
    2 (feature 2, line 9) speed `strip` 3 m/s
    3 (feature 2, line 9) waypoint `strip` at 37.4114 -6.001, 30.0 m above sea
    4 (feature 2, line 9) waypoint `strip` at 37.4114 -6.0014, 31.5 m above sea
    5 (feature 2, line 9) waypoint `strip` at 37.4116 -6.0014, no altitude
    6 (feature 3, line 14) hold at 37.4116 -6.0016, 32.0 m above an unknown zero, for Some(8.0) s
    7 (feature 8, line 38) land at 37.411 -6.0012
    fence `mast`: exclusion, 25 m round 37.4125 -6.0005
    fence `field`: inclusion, 4 vertices
    left out (Flight): line 9: it says what its altitude is above, and has none
    left out (Flight): line 32: feature 6 `pond`: polygon without the property `kind`, `inclusion` or `exclusion`
    left out (Flight): line 37: feature 7: feature without a geometry
    "###);
}

#[test]
fn kml() {
    insta::assert_snapshot!(describe(&plan("field.kml")), @r###"
    KML
    1 (placemark 1, line 7) take-off `pad` at 37.411 -6.001, 15.0 m above take-off
    2 (placemark 2, line 15) waypoint `strip` at 37.4114 -6.001, 30.0 m above sea
    3 (placemark 2, line 15) waypoint `strip` at 37.4114 -6.0014, 31.5 m above sea
    4 (placemark 3, line 25) waypoint `clamped` at 37.4116 -6.0015, no altitude
    5 (placemark 4, line 29) waypoint `hill` at 37.4116 -6.0016, 12.0 m above terrain
    fence `field`: inclusion, 4 vertices
    left out (Payload): line 25: the altitude 99 m is not used: no `altitudeMode` says what it is above
    left out (Flight): line 41: placemark 6 `flown last year`: placemark without a geometry
    left out (Flight): line 43: `gx:Track` in `Placemark` is not read
    "###);
}

#[test]
fn gpx() {
    insta::assert_snapshot!(describe(&plan("route.gpx")), @r###"
    GPX
    1 (route 1, point 1, line 6) waypoint `north` at 37.4114 -6.001, 30.0 m above sea
    2 (route 1, point 2, line 7) waypoint at 37.4114 -6.0014, 31.2 m above sea
    3 (route 1, point 3, line 8) waypoint at 37.4111 -6.0014, no altitude
    left out (Payload): line 11: track 1 (2 points) stands beside route 1, which is flown
    left out (Payload): line 3: waypoints (1 points) stands beside route 1, which is flown
    "###);
}

#[test]
fn the_operator_says_what_the_file_leaves_open_and_nothing_else() {
    use plans::model::{Altitude, Reference};
    let mut plan = plan("field.geojson");
    let altitudes = |plan: &Plan| -> Vec<Altitude> {
        plan.items
            .iter()
            .filter_map(|item| item.action.altitude())
            .collect()
    };
    assert_eq!(
        altitudes(&plan)[3..],
        [Altitude::Unstated(None), Altitude::Unstated(Some(32.0))]
    );
    plan.state_altitudes(&StatedAltitudes {
        reference: Some(Reference::Sea),
        missing: Some(Altitude::AboveTakeOff(12.0)),
    });
    assert_eq!(
        altitudes(&plan),
        [
            Altitude::AboveTakeOff(15.0),
            Altitude::AboveSea(30.0),
            Altitude::AboveSea(31.5),
            Altitude::AboveTakeOff(12.0),
            Altitude::AboveSea(32.0),
        ]
    );
}

#[test]
fn a_plan_that_is_written_and_read_again_is_the_same() {
    for (name, is_mavlink) in [
        ("mission.waypoints", true),
        ("version1.plan", true),
        ("field.geojson", false),
    ] {
        let mut plan = plan(name);
        plan.state_altitudes(&StatedAltitudes {
            reference: Some(plans::model::Reference::Sea),
            missing: Some(plans::model::Altitude::AboveTakeOff(12.0)),
        });
        let text = write::to_qgc_plan(&plan).expect("a plan that can be written");
        let again = plans::read(Path::new("x.plan"), text.as_bytes()).expect("a plan");
        let actions = |plan: &Plan| -> Vec<Action> {
            plan.items.iter().map(|item| item.action.clone()).collect()
        };
        assert_eq!(actions(&again), actions(&plan), "{name}");
        let mavlink =
            |plan: &Plan| -> Vec<_> { plan.items.iter().map(|item| item.mavlink).collect() };
        if is_mavlink {
            assert_eq!(mavlink(&again), mavlink(&plan), "{name}");
        }
        let outlines = |plan: &Plan| -> Vec<_> {
            // The format has no names, and circles after polygons.
            let mut outlines: Vec<String> = plan
                .fence
                .iter()
                .map(|area| format!("{} {:?}", area.is_inclusion, area.shape))
                .collect();
            outlines.sort();
            outlines
        };
        assert_eq!(outlines(&again), outlines(&plan), "{name}");
    }
}

#[test]
fn what_cannot_be_written_is_named() {
    let error = write::to_qgc_plan(&plan("mission.plan")).unwrap_err();
    assert_eq!(error.number, 8);
    let error = write::to_qgc_plan(&plan("field.kml")).unwrap_err();
    assert!(
        error
            .to_string()
            .starts_with("item 4: its altitude is not stated"),
        "{error}"
    );
}
