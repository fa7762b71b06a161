//! The table of `docs/plans.md`: each format and altitude reference with its rule, row by row.

use std::path::Path;

use dsp_protocol::Waypoint;
use plans::flight::{Flight, Step};
use plans::site::{HomeSource, Site, Start};

const HOME: Waypoint = Waypoint {
    latitude_deg: 37.411,
    longitude_deg: -6.001,
    altitude_m: 12.0,
};

/// The number in every file.
const NUMBER_M: f64 = 620.0;

const ABOVE_TAKE_OFF: &str = "height above take-off";
const ABOVE_SEA: &str = "above sea";
const NO_PLAN: &str = "no plan: exit code 2";

/// A row of the table with the files that it is about.
struct Row {
    format: &'static str,
    in_the_file: &'static str,
    /// The last column: one of the constants, or the rule that refuses the item.
    rule: &'static str,
    files: Vec<(&'static str, String)>,
}

fn row(
    format: &'static str,
    in_the_file: &'static str,
    rule: &'static str,
    name: &'static str,
    files: impl IntoIterator<Item = String>,
) -> Row {
    Row {
        format,
        in_the_file,
        rule,
        files: files.into_iter().map(|text| (name, text)).collect(),
    }
}

fn qgc(frame: u16, altitude: &str, more: &str) -> String {
    format!(
        r#"{{"fileType":"Plan","version":1,"mission":{{"version":2,"items":[{{"type":"SimpleItem","frame":{frame},"command":16,
        "params":[0,0,0,null,37.412,-6.001,{altitude}]{more}}}]}}}}"#
    )
}

fn list(frame: u16, altitude: &str) -> String {
    format!("QGC WPL 110\n1 0 {frame} 16 0 0 0 0 37.412 -6.001 {altitude} 1\n")
}

fn geojson(altitude: &str, reference: &str) -> String {
    format!(
        r#"{{"type":"Feature","properties":{{{reference}}},"geometry":{{"type":"Point","coordinates":[-6.001,37.412{altitude}]}}}}"#
    )
}

fn kml(mode: &str, altitude: &str, reference: &str) -> String {
    let reference = match reference {
        "" => String::new(),
        name => format!(
            r#"<ExtendedData><Data name="altitude_reference"><value>{name}</value></Data></ExtendedData>"#
        ),
    };
    format!(
        r#"<kml xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2"><Placemark>{reference}
        <Point>{mode}<coordinates>-6.001,37.412{altitude}</coordinates></Point></Placemark></kml>"#
    )
}

fn gpx(elevation: &str) -> String {
    format!(
        r#"<gpx version="1.1" creator="x" xmlns="http://www.topografix.com/GPX/1/1"><rte>
        <rtept lat="37.412" lon="-6.001">{elevation}</rtept></rte></gpx>"#
    )
}

fn qgc_rows() -> Vec<Row> {
    const FORMAT: &str = "QGroundControl `.plan`";
    let frames = |frames: &[u16]| -> Vec<String> {
        frames
            .iter()
            .map(|frame| qgc(*frame, "620", ""))
            .collect::<Vec<_>>()
    };
    let calculated = r#","AltitudeMode":3,"Altitude":20"#;
    let computed = format!(r#"{calculated},"AMSLAltAboveTerrain":620"#);
    vec![
        row(
            FORMAT,
            "frame 3, 6 (*relative*)",
            ABOVE_TAKE_OFF,
            "x.plan",
            frames(&[3, 6]),
        ),
        row(
            FORMAT,
            "frame 0, 5 (*absolute*, *AMSL*)",
            ABOVE_SEA,
            "x.plan",
            frames(&[0, 5]),
        ),
        row(
            FORMAT,
            "frame 10, 11 (*terrain*)",
            "above-terrain",
            "x.plan",
            frames(&[10, 11]),
        ),
        row(
            FORMAT,
            "`AltitudeMode` 3 (*calculated above terrain*)",
            ABOVE_SEA,
            "x.plan",
            [qgc(0, "620", &computed)],
        ),
        row(
            FORMAT,
            "the same without `AMSLAltAboveTerrain`",
            "above-terrain",
            "x.plan",
            [qgc(0, "620", calculated)],
        ),
        row(
            FORMAT,
            "any other frame",
            "not-possible",
            "x.plan",
            frames(&[1, 4, 7, 21]),
        ),
        row(
            FORMAT,
            "`null` as altitude",
            "altitude-missing",
            "x.plan",
            [qgc(3, "null", ""), qgc(0, "null", "")],
        ),
    ]
}

fn list_rows() -> Vec<Row> {
    const FORMAT: &str = "`QGC WPL 110`";
    const NAME: &str = "x.waypoints";
    let frames = |frames: &[u16]| -> Vec<String> {
        frames.iter().map(|frame| list(*frame, "620")).collect()
    };
    vec![
        row(FORMAT, "frame 3, 6", ABOVE_TAKE_OFF, NAME, frames(&[3, 6])),
        row(FORMAT, "frame 0, 5", ABOVE_SEA, NAME, frames(&[0, 5])),
        row(
            FORMAT,
            "frame 10, 11",
            "above-terrain",
            NAME,
            frames(&[10, 11]),
        ),
        row(
            FORMAT,
            "any other frame",
            "not-possible",
            NAME,
            frames(&[1, 4, 7, 21]),
        ),
        row(
            FORMAT,
            "`nan` as altitude",
            "altitude-missing",
            NAME,
            [list(3, "nan"), list(0, "nan")],
        ),
    ]
}

fn geojson_rows() -> Vec<Row> {
    const FORMAT: &str = "GeoJSON";
    const NAME: &str = "x.geojson";
    let of = |reference: &str| {
        [geojson(
            ",620",
            &format!(r#""altitude_reference":"{reference}""#),
        )]
    };
    vec![
        row(
            FORMAT,
            "a number, `altitude_reference` `take-off`",
            ABOVE_TAKE_OFF,
            NAME,
            of("take-off"),
        ),
        row(
            FORMAT,
            "a number, `altitude_reference` `sea`",
            ABOVE_SEA,
            NAME,
            of("sea"),
        ),
        row(
            FORMAT,
            "a number, `altitude_reference` `terrain`",
            "above-terrain",
            NAME,
            of("terrain"),
        ),
        row(
            FORMAT,
            "a number alone",
            "altitude-reference",
            NAME,
            [geojson(",620", "")],
        ),
        row(
            FORMAT,
            "no number",
            "altitude-missing",
            NAME,
            [geojson("", "")],
        ),
    ]
}

fn kml_rows() -> Vec<Row> {
    const FORMAT: &str = "KML";
    const NAME: &str = "x.kml";
    const ABSOLUTE: &str = "<altitudeMode>absolute</altitudeMode>";
    const GROUND: &str = "<altitudeMode>relativeToGround</altitudeMode>";
    const CLAMPED: &str = "<altitudeMode>clampToGround</altitudeMode>";
    const SEA_FLOOR: &str = "<gx:altitudeMode>relativeToSeaFloor</gx:altitudeMode>";
    let any = |reference| [ABSOLUTE, GROUND, CLAMPED, ""].map(|mode| kml(mode, ",620", reference));
    vec![
        row(
            FORMAT,
            "`absolute`",
            ABOVE_SEA,
            NAME,
            [kml(ABSOLUTE, ",620", "")],
        ),
        row(
            FORMAT,
            "`relativeToGround`",
            "above-terrain",
            NAME,
            [kml(GROUND, ",620", "")],
        ),
        row(
            FORMAT,
            "any of these modes or none, `altitude_reference` `take-off`",
            ABOVE_TAKE_OFF,
            NAME,
            any("take-off"),
        ),
        row(
            FORMAT,
            "any of these modes or none, `altitude_reference` `sea`",
            ABOVE_SEA,
            NAME,
            any("sea"),
        ),
        row(
            FORMAT,
            "any of these modes or none, `altitude_reference` `terrain`",
            "above-terrain",
            NAME,
            any("terrain"),
        ),
        row(
            FORMAT,
            "`clampToGround` or no mode alone, no number",
            "altitude-missing",
            NAME,
            [
                kml(CLAMPED, ",620", ""),
                kml("", ",620", ""),
                kml("", "", ""),
            ],
        ),
        row(
            FORMAT,
            "a mode of `gx:`",
            NO_PLAN,
            NAME,
            [kml(SEA_FLOOR, ",620", "")],
        ),
    ]
}

fn gpx_rows() -> Vec<Row> {
    vec![
        row("GPX", "`ele`", ABOVE_SEA, "x.gpx", [gpx("<ele>620</ele>")]),
        row("GPX", "no `ele`", "altitude-missing", "x.gpx", [gpx("")]),
    ]
}

fn rows() -> Vec<Row> {
    [
        qgc_rows(),
        list_rows(),
        geojson_rows(),
        kml_rows(),
        gpx_rows(),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// The telemetry altitude that is flown to, or the rules of what forbids the flight.
fn flown(name: &str, text: &str, zero_above_sea_m: Option<f64>) -> Result<f64, Vec<&'static str>> {
    let plan = plans::read(Path::new(name), text.as_bytes()).map_err(|_| vec![NO_PLAN])?;
    let site = Site {
        home: HOME,
        is_home_altitude_known: true,
        home_source: HomeSource::Operator,
        start: Start::Flying(HOME),
        zero_above_sea_m,
        take_off_m: None,
        from: 1,
        is_for_flight: true,
    };
    let flight = Flight::new(&plan, &site);
    let findings = flight.findings.clone().sorted();
    let forbidding = findings.iter().filter(|one| one.has_failed());
    let rules: Vec<&str> = forbidding.map(|one| one.id).collect();
    match flight.steps.as_slice() {
        [Step::Path(points)] if rules.is_empty() => Ok(points[0].waypoint.altitude_m),
        [] => Err(rules),
        steps => panic!("{name}: {steps:?} {rules:?}\n{text}"),
    }
}

#[test]
fn each_format_and_reference_has_the_rule_of_the_table_in_the_documents() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/plans.md");
    let document = std::fs::read_to_string(root).unwrap();
    let mut expected = Vec::new();
    for Row {
        format,
        in_the_file,
        rule,
        files,
    } in rows()
    {
        let last = match rule {
            ABOVE_TAKE_OFF | ABOVE_SEA | NO_PLAN => rule.to_owned(),
            rule => format!("refused: `{rule}`"),
        };
        expected.push(format!("| {format} | {in_the_file} | {last} |"));
        for (name, text) in files {
            let [unknown, known] =
                [None, Some(600.0)].map(|zero_above_sea_m| flown(name, &text, zero_above_sea_m));
            let results = match rule {
                ABOVE_TAKE_OFF => [
                    Ok(HOME.altitude_m + NUMBER_M),
                    Ok(HOME.altitude_m + NUMBER_M),
                ],
                ABOVE_SEA => [Err(vec!["sea-level"]), Ok(NUMBER_M - 600.0)],
                rule => [Err(vec![rule]), Err(vec![rule])],
            };
            assert_eq!([unknown, known], results, "{format}, {in_the_file}\n{text}");
        }
    }
    let table = document
        .lines()
        .skip_while(|line| !line.starts_with("| format | in the file | rule |"))
        .skip(2)
        .take_while(|line| line.starts_with('|'));
    assert_eq!(table.collect::<Vec<_>>(), expected);
}
