//! Mistakes in files: each is refused with its place and its reason.

use std::path::Path;

use plans::error::{MAX_ELEMENT_DEPTH, MAX_FILE_BYTES, MAX_ITEMS, MAX_NODES};

fn error(name: &str, text: &[u8]) -> String {
    match plans::read(Path::new(name), text) {
        Ok(plan) => panic!("{name} was read: {plan:#?}"),
        Err(error) => error.to_string(),
    }
}

/// A `.plan` with these items and this fence.
fn qgc(items: &str, fence: &str) -> String {
    format!(
        r#"{{"fileType":"Plan","version":1,"mission":{{"version":2,"plannedHomePosition":[37,-6,1],"items":[{items}]}},"geoFence":{{{fence}}}}}"#
    )
}

const RIGHT: &str = r#"{"type":"SimpleItem","command":16,"frame":3,"autoContinue":true,"params":[0,0,0,null,37,-6,9]}"#;

#[test]
fn of_qgroundcontrol_plans() {
    let item = |item: &str| qgc(&format!("{RIGHT},{item}"), "");
    #[rustfmt::skip]
    let cases = [
        ("{\n\"fileType\":\"Plan\",\n\"version\" 1}".to_owned(), "line 3: expected `:`"),
        ("{\"fileType\":\"Plan\",\"version\":2,\"mission\":{}}".to_owned(), "the file: its version is 2; read are [1]"),
        ("{\"fileType\":\"Plan\",\"version\":1}".to_owned(), "the file: there is no `mission`"),
        (
            "{\"fileType\":\"Plan\",\"version\":1,\"mission\":{\"version\":3,\"items\":[]}}"
                .to_owned(),
            "mission: its version is 3; read are [1, 2]",
        ),
        (item("7"), "line 1: item 2: it is no JSON object"),
        (item("{}"), "line 1: item 2: there is no `type`"),
        (item(r#"{"type":"ComplexItem"}"#), "line 1: item 2: there is no `complexItemType`"),
        (item(&RIGHT.replace("37", "97")), "line 1: item 2: the latitude 97 is not from -90 to 90 degrees"),
        (item(&RIGHT.replace("-6", "-186")), "line 1: item 2: the longitude -186 is not from -180 to 180 degrees"),
        (item(&RIGHT.replace("-6", "null")), "line 1: item 2: the longitude NaN"),
        (item(&RIGHT.replace(",9]", "]")), "line 1: item 2: 6 parameters; an item has 7"),
        (item(&RIGHT.replace(",9]", ",\"9\"]")), "line 1: item 2: an entry of a list is not a number"),
        (item(&RIGHT.replace(":16", ":-16")), "line 1: item 2: `command` is no whole number up to 65535"),
        (item(&RIGHT.replace("\"frame\":3,", "")), "line 1: item 2: `frame` is no whole number"),
        (item(&RIGHT.replace("true", "1")), "line 1: item 2: `autoContinue` is not true or false"),
        (
            item(&format!(
                r#"{{"type":"ComplexItem","complexItemType":"survey","TransectStyleComplexItem":{{"Items":[{RIGHT},{{}}]}}}}"#
            )),
            "line 1: item 2 (survey), part 2: there is no `params` and no `param1`",
        ),
        (qgc("", r#""polygons":[{"polygon":[[37,-6]]}]"#), "line 1: fence polygon 1: `inclusion` is not true or false"),
        (qgc("", r#""polygons":[{"polygon":[[37]],"inclusion":true}]"#), "line 1: fence polygon 1: a point needs"),
        (qgc("", r#""circles":[{"circle":{"center":[37,-6]},"inclusion":true}]"#), "line 1: fence circle 1: there is no `radius`"),
    ];
    for (text, expected) in cases {
        let found = error("a.plan", text.as_bytes());
        assert!(
            found.starts_with(expected),
            "{text}\n  {found}\n  {expected}"
        );
    }
}

#[test]
fn of_waypoint_lists() {
    const HOME: &str = "0\t1\t0\t16\t0\t0\t0\t0\t37\t-6\t10\t1";
    const NEXT: &str = "1\t0\t3\t16\t0\t0\t0\t0\t37\t-6\t10\t1";
    #[rustfmt::skip]
    let cases = [
        ("QGC WPL 120", NEXT, "line 1: QGC WPL 120 keeps its home"),
        ("QGC WPL 100", NEXT, "line 1: version `100` of QGC WPL; 110 is read"),
        ("QGC WPL", NEXT, "line 1: version `` of QGC WPL"),
        ("QGC WPL 110", "1\t0\t3", "line 4: 3 columns; an item has 12"),
        ("QGC WPL 110", "2\t0\t3\t16\t0\t0\t0\t0\t37\t-6\t10\t1", "line 4: index 2, but 1 follows 0"),
        ("QGC WPL 110", "1\t0\t3\t16\tx\t0\t0\t0\t37\t-6\t10\t1", "line 4: a parameter `x` is no such number"),
        ("QGC WPL 110", "1\t0\t-3\t16\t0\t0\t0\t0\t37\t-6\t10\t1", "line 4: the frame `-3` is no such number"),
        ("QGC WPL 110", "1\t0\t3\t16\t0\t0\t0\t0\t370\t-6\t10\t1", "line 4: the latitude 370"),
        ("QGC WPL 110", "1\t0\t3\t16\t0\t0\t0\t0\t37\t-6\t10\t\u{1b}[2J", "line 4: autocontinue `[2J` is neither 0 nor 1"),
    ];
    for (header, line, expected) in cases {
        let text = format!("{header}\n{HOME}\n\n{line}\n");
        let found = error("a.waypoints", text.as_bytes());
        assert!(found.starts_with(expected), "{found}\n  {expected}");
    }
    assert_eq!(
        error("a.waypoints", b""),
        "the file: there is no header `QGC WPL 110`"
    );
    assert!(error("a.txt", b"37,-6,20").starts_with("line 1: the header is not"));
}

#[test]
fn of_geojson() {
    let feature = |properties: &str, geometry: &str| {
        format!(r#"{{"type":"Feature","properties":{properties},"geometry":{geometry}}}"#)
    };
    const POINT: &str = r#"{"type":"Point","coordinates":[-6,37,9]}"#;
    #[rustfmt::skip]
    let cases = [
        ("\n".to_owned(), "line 2: the file is empty"),
        ("{\"type\":\"Feature\",\n".to_owned(), "line 2: the file ends in the middle of a list or object: it is cut off"),
        (feature(r#"{"action":"jump"}"#, POINT), "line 1: `action` is `jump`; it can be waypoint"),
        (feature(r#"{"kind":"forest"}"#, POINT), "line 1: `kind` is `forest`; it can be inclusion or exclusion"),
        (feature(r#"{"kind":"exclusion"}"#, POINT), "feature 1, line 1: a point with a `kind` needs a `radius_m`"),
        (feature(r#"{"hold_s":-1}"#, POINT), "line 1: `hold_s` is `-1`; it can be a number from 0 up"),
        (feature(r#"{"altitude_reference":"moon"}"#, POINT), "line 1: `altitude_reference` is `moon`; it can be take-off"),
        (feature("null", r#"{"type":"Point","coordinates":[-6,97,9]}"#), "feature 1, line 1: the latitude 97"),
    ];
    for (text, expected) in cases {
        let found = error("a.geojson", text.as_bytes());
        assert!(
            found.starts_with(expected),
            "{text}\n  {found}\n  {expected}"
        );
    }
}

#[test]
fn of_xml() {
    #[rustfmt::skip]
    let cases = [
        ("a.kml", "<kml>\n<Document>\n</Folder></kml>", "line 3: not valid XML"),
        ("a.kml", "<kml>\n<Document>", "line 2: not valid XML: it ends within an element"),
        ("a.kml", "", "the file: not valid XML: there is no element"),
        (
            "a.kml",
            "<kml><Placemark><Point><coordinates>-6,97,1</coordinates></Point></Placemark></kml>",
            "placemark 1, line 1: the latitude 97",
        ),
        ("a.kml", "<kml><Placemark><Point><coordinates>x,37,1</coordinates></Point></Placemark></kml>", "line 1: placemark 1: point 1 is `x,37,1`, not longitude"),
        ("a.gpx", "<!DOCTYPE gpx>\n<gpx/>", "line 1: a document type is not read"),
        ("a.gpx", "<gpx version='1.1' creator='x'><rte><rtept lat='37' lon='-186'/></rte></gpx>", "route 1, point 1, line 1: the longitude -186"),
    ];
    for (name, text, expected) in cases {
        let found = error(name, text.as_bytes());
        assert!(
            found.starts_with(expected),
            "{text}\n  {found}\n  {expected}"
        );
    }
}

#[test]
fn of_files_that_are_no_plans_or_too_large() {
    assert!(error("readme.md", b"hello").starts_with("neither content nor name is that of a plan"));
    assert!(error("a.kmz", b"PK\x03\x04").contains("unpack it"));
    assert_eq!(
        error("a.plan", b"{\n\"fileType\":\"\xff\"}"),
        "line 2: the bytes are not UTF-8 text"
    );
    let long = vec![b' '; MAX_FILE_BYTES + 1];
    assert!(error("a.plan", &long).contains("bytes; at most"));

    let mut list = "QGC WPL 110\n".to_owned();
    for index in 1..=MAX_ITEMS + 1 {
        list += &format!("{index}\t0\t3\t16\t0\t0\t0\t0\t37\t-6\t10\t1\n");
    }
    assert!(error("a.waypoints", list.as_bytes()).starts_with("more than 8192 items"));
    let deep = "<kml>".to_owned() + &"<Folder>".repeat(MAX_ELEMENT_DEPTH);
    assert!(error("a.kml", deep.as_bytes()).contains("deep in each other"));
    let many = "<gpx>".to_owned() + &"<a/>".repeat(MAX_NODES) + "</gpx>";
    assert!(error("a.gpx", many.as_bytes()).contains("XML nodes"));
    let nested = "{\"type\":\"GeometryCollection\",\"geometries\":[".repeat(100_000);
    assert!(
        error("a.geojson", nested.as_bytes()).contains("recursion limit"),
        "no stack overflow"
    );
}
