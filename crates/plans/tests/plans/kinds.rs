//! Kinds of statements that other programs make: what is legal is read, and what is not done is refused or named, never
//! left out.

use std::path::Path;

use dsp_protocol::Waypoint;
use plans::check::check;
use plans::finding::effect;
use plans::flight::{Flight, Step};
use plans::site::{Endurance, HomeSource, Site, Start};

const HOME: Waypoint = Waypoint {
    latitude_deg: 37.411,
    longitude_deg: -6.001,
    altitude_m: 10.0,
};

/// What became of a file.
#[derive(Debug, PartialEq)]
pub struct Outcome {
    /// Items and areas, without names and places in the file.
    pub flight: Vec<String>,
    /// Effect, rule and text of each finding but those that say only that there is no take-off.
    pub findings: Vec<String>,
}

/// Reads, plans and checks a file; in the air, with the bridge's default rules.
pub fn outcome(name: &str, bytes: &[u8]) -> Result<Outcome, String> {
    let plan = plans::read(Path::new(name), bytes).map_err(|error| error.to_string())?;
    let site = Site {
        home: HOME,
        is_home_altitude_known: true,
        home_source: HomeSource::Operator,
        start: Start::Ground(HOME),
        zero_above_sea_m: Some(0.0),
        take_off_m: None,
        from: 1,
        is_for_flight: false,
    };
    let flight = Flight::new(&plan, &site);
    let endurance = Endurance {
        cruise_speed_mps: Some(5.0),
        endurance_s: Some(1e6),
        ..Endurance::default()
    };
    let steps = flight.steps.iter().map(|step| match step {
        Step::TakeOff { height_m, .. } => format!("take-off {height_m}"),
        Step::Path(points) => format!(
            "path {:?}",
            points
                .iter()
                .map(|point| point.waypoint)
                .collect::<Vec<_>>()
        ),
        Step::Speed { speed_mps, .. } => format!("speed {speed_mps}"),
        Step::Wait { duration_s, .. } => format!("wait {duration_s}"),
        Step::Land { .. } => "land".to_owned(),
    });
    let areas = plan
        .fence
        .iter()
        .map(|area| format!("{} {:?}", area.is_inclusion, area.shape));
    let rules = bridge::BridgeConfig::default();
    let findings = check(&plan, &flight, &site, Some(&rules), &endurance);
    let findings = findings.iter().filter(|one| one.id != "not-flying");
    Ok(Outcome {
        flight: steps.chain(areas).collect(),
        findings: findings
            .map(|one| format!("{} {}: {}", effect(one), one.id, one.text))
            .collect(),
    })
}

fn item(more: &str, frame: &str, altitude: &str) -> String {
    format!(
        r#"{{"type":"SimpleItem","command":16,"frame":{frame},"autoContinue":true,"doJumpId":2,{more}
        "params":[0,0,0,null,37.4112,-6.0010,{altitude}]}}"#
    )
}

fn qgc(items: &str, more: &str) -> String {
    format!(
        "{{\"fileType\":\"Plan\",\"version\":1,\"groundStation\":\"x\",\n\"mission\":{{\"version\":2,\"items\":[\n{items}]}}{more}}}"
    )
}

fn kml(inside: &str) -> String {
    format!(
        r#"<kml xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2"><Document>
{inside}</Document></kml>"#
    )
}

/// A placemark with this in front of and in its point.
fn kml_point(data: &str, point: &str) -> String {
    kml(&format!(
        "<Placemark>{data}<Point><altitudeMode>absolute</altitudeMode>{point}</Point></Placemark>"
    ))
}

const AT: &str = "<coordinates>-6.0010,37.4112,60</coordinates>";

fn gpx(version: &str, inside: &str) -> String {
    format!(
        r#"<gpx version="{version}" creator="x" xmlns:gpxx="http://www.garmin.com/xmlschemas/GpxExtensions/v3">
{inside}</gpx>"#
    )
}

fn rte(inside: &str) -> String {
    gpx(
        "1.1",
        &format!("<rte><rtept lat=\"37.4112\" lon=\"-6.0010\">{inside}</rtept></rte>"),
    )
}

fn feature(properties: &str, geometry: &str, more: &str) -> String {
    format!(
        "{{\"type\":\"FeatureCollection\",{more}\n\"features\":[{{\"type\":\"Feature\",\"properties\":{{{properties}}},\n\
         \"geometry\":{{{geometry}}}}}]}}"
    )
}

const POINT: &str = r#""type":"Point","coordinates":[-6.0010,37.4112,60]"#;
const LINE: &str =
    r#""type":"LineString","coordinates":[[-6.001,37.4112,60],[-6.0012,37.4112,60]]"#;
const MANY: &str =
    r#""type":"MultiPoint","coordinates":[[-6.001,37.4112,60],[-6.0012,37.4112,60]]"#;
const AREA: &str = r#""type":"Polygon","coordinates":[[[-6.0050,37.4111],[-6.0050,37.4113],[-6.0048,37.4113],[-6.0050,37.4111]]]"#;
const CORNERS: &str = r#""polygon":[[37.3,-6.1],[37.5,-6.1],[37.5,-5.9]]"#;
const SEA: &str = r#""altitude_reference":"sea""#;

/// The path to the one point of most files.
fn one_point() -> Vec<String> {
    outcome("x.geojson", feature(SEA, POINT, "").as_bytes())
        .unwrap()
        .flight
}

#[test]
fn what_is_legal_is_read() {
    let crlf = rte("<ele>60</ele>").replace('\n', "\r\n");
    let utf16 = |text: &str| -> Vec<u8> {
        let units = std::iter::once(0xfeff).chain(text.encode_utf16());
        units.flat_map(u16::to_le_bytes).collect()
    };
    let declared = |encoding: &str| {
        format!(
            "<?xml version=\"1.0\" encoding='{encoding}'?>\n{}",
            rte("<ele>60</ele><name>caf\u{e9}</name>")
        )
    };
    let latin: Vec<u8> = declared("ISO-8859-1")
        .chars()
        .map(|letter| letter as u8)
        .collect();
    #[rustfmt::skip]
    let cases: Vec<(&str, Vec<u8>)> = vec![
        ("x.kml", kml_point("<ExtendedData><Data name='action'><value><![CDATA[waypoint]]></value></Data></ExtendedData>", AT).into()),
        ("x.kml", kml_point("", "<coordinates>-6.0010,37.4112,<!-- gate -->60 <?x y?></coordinates>").into()),
        ("x.kml", kml_point("", "<coordinates><![CDATA[ -6.0010,37.4112,60 ]]></coordinates>").into()),
        ("x.kml", kml_point("<ExtendedData><Data name='altitude_reference'><value>sea</value></Data></ExtendedData>", AT).replace("<altitudeMode>absolute</altitudeMode>", "").into()),
        ("x.kml", kml_point("<visibility>1</visibility><Style><IconStyle/></Style><description><b>x</b></description>", AT).into()),
        ("x.geojson", feature(&format!("{SEA},\"action\":null,\"kind\":null,\"hold_s\":null,\"name\":\"A\""), POINT, "").into()),
        ("x.geojson", feature(&format!(r#"{SEA},"altitudeMode":null,"elevation":"","fileType":"","name":"""#), POINT, r#""xy_coordinate_resolution":1e-9,"#).into()),
        ("x.kml", kml_point("<visibility/><ExtendedData><Data name='height'><value/></Data></ExtendedData>", AT).into()),
        ("x.kml", kml_point("", AT).replace(" xmlns=\"http://www.opengis.net/kml/2.2\"", "").replace("<Document>", "<Document xmlns='http://www.opengis.net/kml/2.2'>").into()),
        ("x.gpx", rte("<ele>60</ele><extensions><gpxx:ElevationMode>Standard</gpxx:ElevationMode></extensions>").into()),
        ("x.geojson", feature(SEA, POINT, r#""crs":{"type":"name","properties":{"name":"urn:ogc:def:crs:OGC:1.3:CRS84"}},"#).into()),
        ("x.plan", qgc(&item("", "0", "60"), ",\"geoFence\":null,\"rallyPoints\":null").into()),
        ("x.plan", qgc(&item("", "0.0", "60"), "").into()),
        ("x.plan", qgc(&item("\"Altitude\":60,\"AltitudeMode\":2,\"AMSLAltAboveTerrain\":null,", "0", "60"), "").into()),
        ("x.plan", format!("\u{feff}{}", qgc(&item("", "0", "60"), "")).replace('\n', "\r\n").into()),
        ("x.waypoints", "\u{feff}QGC WPL 110\r\n1\t0\t0\t16\t0\t0\t0\t0\t37.4112\t-6.001\t60\t1\r\n".into()),
        ("x.gpx", gpx("1.0", "<trk><trkseg><trkpt lat='37.4112' lon='-6.0010'><ele>60</ele><course>12</course></trkpt></trkseg></trk>").into()),
        ("x.gpx", rte("<ele>60</ele><magvar>1.5</magvar>").into()),
        ("x.gpx", rte("<ele> 60\n</ele>").replace("\"37.4112\"", "\" 37.4112 \"").into()),
        ("x.gpx", rte("<ele>60</ele><extensions><gpxx:RoutePointExtension><gpxx:Subclass>0</gpxx:Subclass></gpxx:RoutePointExtension></extensions>").into()),
        ("x.gpx", format!("\u{feff}{crlf}").into()),
        ("x.gpx", declared("utf-16").into()),
        ("x.gpx", utf16(&declared("utf-16"))),
        ("x.gpx", latin),
    ];
    let expected = Outcome {
        flight: one_point(),
        findings: vec![],
    };
    for (name, bytes) in cases {
        assert_eq!(
            outcome(name, &bytes).as_ref(),
            Ok(&expected),
            "{}",
            String::from_utf8_lossy(&bytes)
        );
    }
    // Both forms of extended data, and what is named beside the flight.
    let data = "<ExtendedData><SchemaData schemaUrl='#a'><SimpleData name='action'>land</SimpleData><SimpleData name='hold_s'>30</SimpleData>\
        <SimpleData name='altitude_reference'>take-off</SimpleData></SchemaData></ExtendedData>";
    let landing = outcome("x.kml", kml_point(data, AT).as_bytes()).unwrap();
    let above_take_off = one_point()[0].replace("altitude_m: 60.0", "altitude_m: 70.0");
    assert_eq!(landing.flight, [&above_take_off, "wait 30", "land"]);
    let speed = outcome("x.gpx", rte("<ele>60</ele><speed>3</speed>").as_bytes()).unwrap();
    assert_eq!(
        speed.findings,
        ["warns not-used: line 2: `speed` in `rtept` is not read"]
    );
}

#[test]
fn what_is_not_read_as_it_says_forbids_the_flight_or_is_no_plan() {
    let schema = |name: &str, value: &str| {
        format!(
            "<ExtendedData><SchemaData><SimpleData name='{name}'>{value}</SimpleData></SchemaData></ExtendedData>"
        )
    };
    let alt = |more: &str, frame: &str, altitude: &str| qgc(&item(more, frame, altitude), "");
    let track = |inside: &str| {
        format!("<Placemark><gx:Track><gx:coord>{inside}</gx:coord></gx:Track></Placemark>")
    };
    let ring = "<outerBoundaryIs><LinearRing><coordinates>-6,37,0 -6,38,0 -5,37,0 -6,37,0</coordinates></LinearRing></outerBoundaryIs>";
    #[rustfmt::skip]
    let cases: Vec<(&str, String, &str)> = vec![
        // Numbers are read whole or not at all.
        ("x.kml", kml_point("", "<coordinates>-6.0,37.4,60,-6.1,37.4,60</coordinates>"), "line 2: placemark 1: point 1 is"),
        ("x.kml", kml_point("", "<coordinates>-6.0,37.4,6O</coordinates>"), "line 2: placemark 1: point 1 is"),
        ("x.kml", kml_point("", "<coordinates>-6.0, 37.4, 60</coordinates>"), "line 2: placemark 1: point 1 is"),
        ("x.kml", kml_point("", "<coordinates/>"), "placemark 1, line 2: a `Point` with 0 points"),
        ("x.kml", kml_point("", ""), "line 2: `Point` without `coordinates`"),
        ("x.kml", kml_point(&schema("hold_s", "30 s"), AT), "line 2: `hold_s` is `30 s`"),
        ("x.gpx", rte("<ele>60m</ele>"), "route 1, point 1, line 2: `ele` is no number"),
        ("x.gpx", rte("<ele>nan</ele>"), "route 1, point 1, line 2: `ele` is no number"),
        ("x.gpx", rte("<ele/>"), "route 1, point 1, line 2: `ele` is no number"),
        ("x.waypoints", "QGC WPL 110\n1 0 3 16 inf 0 0 0 37.4112 -6.001 60 1\n".into(), "line 2: a parameter `inf` has no end"),
        ("x.geojson", feature(SEA, r#""type":"Point","coordinates":[-6.001,37.4112,60,1]"#, ""), "line 3: feature 1: a point needs"),
        ("x.geojson", feature(SEA, r#""type":"Point","coordinates":[-6.001,null,60]"#, ""), "line 3: feature 1: a point needs"),
        // Two statements that contradict each other.
        ("x.geojson", feature(&format!("{SEA},{SEA}"), POINT, ""), "line 2: the member `altitude_reference` stands twice"),
        ("x.kml", kml_point(&(schema("hold_s", "3") + &schema("hold_s", "4")), AT), "forbids not-possible: line 2: `SchemaData` in `ExtendedData`"),
        ("x.kml", kml_point("", &format!("<altitudeMode>clampToGround</altitudeMode>{AT}")), "forbids not-possible: line 2: `altitudeMode` in `Point`"),
        ("x.gpx", rte("<ele>60</ele><ele>70</ele>"), "forbids not-possible: line 2: `ele` in `rtept`"),
        ("x.plan", alt("\"Altitude\":80,", "3", "30"), "forbids not-possible: line 3: item 1: `Altitude` is 80 m"),
        ("x.plan", alt("\"AltitudeMode\":2,", "3", "30"), "forbids not-possible: line 3: item 1: `AltitudeMode` 2 and `frame` 3"),
        ("x.plan", alt("\"AltitudeMode\":1,", "0", "30"), "forbids not-possible: line 3: item 1: `AltitudeMode` 1 and `frame` 0"),
        ("x.plan", alt("\"AltitudeMode\":3,\"AMSLAltAboveTerrain\":90,", "0", "30"), "forbids not-possible: line 3: item 1: `AMSLAltAboveTerrain` is 90 m"),
        ("x.plan", alt("\"AltitudeMode\":9,", "3", "30"), "forbids not-possible: line 3: item 1: `AltitudeMode` 9"),
        // A property that its geometry cannot have.
        ("x.geojson", feature(r#""kind":"exclusion","radius_m":50"#, MANY, ""), "forbids not-possible: line 2: `kind` cannot belong to a line"),
        ("x.geojson", feature(r#""kind":"exclusion""#, LINE, ""), "forbids not-possible: line 2: `kind` cannot belong to a line"),
        ("x.geojson", feature(r#""action":"land""#, LINE, ""), "forbids not-possible: line 2: `action` cannot belong to a line"),
        ("x.geojson", feature(r#""hold_s":4"#, LINE, ""), "forbids not-possible: line 2: `hold_s` cannot belong to a line"),
        ("x.geojson", feature(r#""kind":"exclusion","action":"land""#, AREA, ""), "forbids not-possible: line 2: `action` cannot belong to a polygon"),
        ("x.geojson", feature(r#""kind":"exclusion","ceiling_m":50"#, AREA, ""), "forbids not-possible: line 2: the property `ceiling_m`"),
        ("x.geojson", feature(r#""action":"return","hold_s":5"#, POINT, ""), "forbids not-possible: line 2: `hold_s` cannot belong to such a point"),
        ("x.geojson", feature(r#""radius_m":5"#, POINT, ""), "forbids not-possible: line 2: `radius_m` cannot belong to such a point"),
        ("x.kml", kml_point(&schema("kind", "exclusion"), AT), "placemark 1, line 2: a point with a `kind` needs a `radius_m`"),
        // Another system of coordinates.
        ("x.geojson", feature(SEA, POINT, r#""crs":{"type":"name","properties":{"name":"urn:ogc:def:crs:EPSG::4230"}},"#), "forbids not-possible: line 1: the coordinate reference system `urn:ogc:def:crs:EPSG::4230`"),
        ("x.geojson", feature(SEA, POINT, r#""crs":{"type":"link","properties":{"href":"x"}},"#), "forbids not-possible: line 1: the coordinate reference system `unknown`"),
        ("x.geojson", feature(SEA, POINT, r#""crs":null,"#), "forbids not-possible: line 1: the coordinate reference system"),
        // What the reader does not know, where it could change the flight.
        ("x.kml", kml_point("", &format!("<gx:altitudeOffset>50</gx:altitudeOffset>{AT}")), "forbids not-possible: line 2: `gx:altitudeOffset` in `Point`"),
        ("x.kml", kml(&format!("<NetworkLink><Link><href>x</href></Link></NetworkLink>{}", track("1 2 3"))), "forbids not-possible: line 2: `NetworkLink` in `Document`"),
        ("x.kml", kml("<gx:Tour><gx:Playlist/></gx:Tour>"), "forbids not-possible: line 2: `gx:Tour` in `Document`"),
        ("x.kml", kml(&track("-6 37 9")), "forbids not-possible: line 2: `gx:Track` in `Placemark`"),
        ("x.kml", kml_point("<visibility>0</visibility>", AT), "forbids not-possible: line 2: `visibility` of a `Placemark` is 0"),
        ("x.kml", kml("<Folder><visibility>0</visibility></Folder>"), "forbids not-possible: line 2: `visibility` of a `Folder` is 0"),
        ("x.kml", kml_point("", AT).replace("</Point>", "</Point><LineString/>"), "forbids not-possible: line 2: `LineString` in `Placemark`"),
        ("x.kml", kml_point(&schema("kind", "exclusion"), AT).replace("Point>", "Model>"), "forbids not-possible: line 2: `Model` in `Placemark`"),
        ("x.kml", kml(&format!("<Placemark>{}<MultiGeometry><gx:Track/><Polygon>{ring}<innerBoundaryIs/></Polygon></MultiGeometry></Placemark>", schema("kind", "exclusion"))), "forbids not-possible: line 2: `gx:Track` in `MultiGeometry`"),
        ("x.kml", kml(&format!("<Placemark>{}<Polygon><x/>{ring}<innerBoundaryIs/></Polygon></Placemark>", schema("kind", "exclusion"))), "forbids not-possible: line 2: placemark 1: polygon with holes"),
        ("x.kml", kml_point("", &format!("-6,37,9{AT}")), "forbids not-possible: line 2: the text in `Point`"),
        ("x.gpx", rte("<ele>60</ele><extensions><gpxx:RoutePointExtension><gpxx:rpt lat='37.4' lon='-6'/></gpxx:RoutePointExtension></extensions>"), "forbids not-possible: line 2: `gpxx:rpt` in `gpxx:RoutePointExtension`"),
        ("x.gpx", rte("<ele>60</ele><extensions><gpxx:minAltitude>90</gpxx:minAltitude></extensions>"), "forbids not-possible: line 2: `gpxx:minAltitude` in `extensions`"),
        ("x.gpx", gpx("1.1", "<trk><trkseg><trkpt lat='37.4112' lon='-6'/></trkseg>\n<trkseg><trkpt lat='37.4113' lon='-6'/></trkseg></trk>"), "forbids not-possible: line 3: track 1 has a gap"),
        ("x.gpx", gpx("1.2", ""), "line 1: version `1.2` of GPX"),
        ("x.plan", qgc(&item("\"Height\":3,", "3", "30"), ""), "forbids not-possible: line 3: `Height` in `items` is not read"),
        ("x.plan", qgc(&item("", "3", "30"), ",\"geofence\":{\"polygons\":[]}"), "forbids not-possible: line 4: `polygons` in `geofence`"),
        ("x.plan", qgc(&item("", "3", "30"), ",\"geoFence\":{\"squares\":[]}"), "forbids not-possible: line 4: `squares` in `geoFence`"),
        ("x.plan", qgc(&item("", "3", "30").replace("[0,0", "[1e300,0"), ""), "forbids hold: hovers for longer than 86400 s"),
        // Members that QGroundControl does not write, and a hole in an area.
        ("x.plan", qgc(&item("\"disabled\":true,", "3", "30"), ""), "forbids not-possible: line 3: `disabled` in `items`"),
        ("x.plan", qgc(&item("\"camera\":{\"x\":1},", "3", "30"), ""), "forbids not-possible: line 3: `camera` in `items`"),
        ("x.plan", qgc(&item("", "3", "30"), &format!(",\"geoFence\":{{\"version\":2,\"polygons\":[{{\"inclusion\":true,\"version\":1,\n{CORNERS},\"holes\":[]}}]}}")), "forbids not-possible: line 5: `holes` in `polygons`"),
        ("x.plan", qgc(&item("", "3", "30"), &format!(",\"geoFence\":{{\"version\":2,\"circles\":[{{\"inclusion\":true,\"version\":1,\n{CORNERS},\"circle\":{{\"center\":[37.4,-6.0],\"radius\":500}}}}]}}")), "forbids not-possible: line 5: `polygon` in `circles`"),
        ("x.plan", qgc(&item("", "3", "30"), ",\"groundStation\":{\"fence\":[]}").replace("\"groundStation\":\"x\",", ""), "forbids not-possible: line 4: `fence` in `groundStation`"),
        // A shape without points.
        ("x.geojson", feature(r#""kind":"exclusion""#, r#""type":"MultiPolygon","coordinates":[]"#, ""), "forbids not-possible: line 2: feature 1: `MultiPolygon` without `coordinates`"),
        ("x.geojson", feature(r#""kind":"exclusion""#, r#""type":"GeometryCollection","geometries":[]"#, ""), "forbids not-possible: line 2: feature 1: `GeometryCollection` without `geometries`"),
        ("x.geojson", feature(r#""speed_mps":3"#, r#""type":"LineString","coordinates":[]"#, ""), "forbids not-possible: line 2: feature 1: `LineString` without `coordinates`"),
        ("x.geojson", feature("", r#""type":"MultiLineString","coordinates":[[],[]]"#, ""), "feature 1, line 2: a `LineString` with 0 points"),
        ("x.geojson", feature("", r#""type":"LineString","coordinates":[[-6.0,37.4,60]]"#, ""), "feature 1, line 2: a `LineString` with 1 points"),
        ("x.kml", kml(&format!("<Placemark>{}<MultiGeometry/></Placemark>", schema("kind", "exclusion"))), "forbids not-possible: line 2: placemark 1: `MultiGeometry` without a geometry"),
        ("x.gpx", gpx("1.1", "<rte/><trk><trkseg><trkpt lat='37.4112' lon='-6'/></trkseg></trk>"), "forbids not-possible: line 1: route 1 has no points"),
        // Names of other programs and languages, and what lies in a harmless one.
        ("x.geojson", feature(SEA, POINT, r#""spatialReference":{"wkid":4230},"#), "forbids not-possible: line 1: `spatialReference`"),
        ("x.geojson", feature(SEA, POINT, r#""srid":4230,"#), "forbids not-possible: line 1: `srid`"),
        ("x.geojson", feature(&format!(r#"{SEA},"skip":true"#), POINT, ""), "forbids not-possible: line 2: the property `skip`"),
        ("x.geojson", feature(&format!(r#"{SEA},"maxaltitude":5"#), POINT, ""), "forbids not-possible: line 2: the property `maxaltitude`"),
        ("x.geojson", feature(&format!(r#"{SEA},"altura":5"#), POINT, ""), "forbids not-possible: line 2: the property `altura`"),
        ("x.geojson", feature(&format!(r#"{SEA},"more":{{"crs":"x"}}"#), POINT, ""), "forbids not-possible: line 2: the property `more`"),
        ("x.geojson", feature(&format!(r#"{SEA},"time":{{"hold_s":5}}"#), POINT, ""), "forbids not-possible: line 2: the property `time`"),
        ("x.geojson", feature(&format!(r#"{SEA},"visibility":0"#), POINT, ""), "forbids not-possible: line 2: `visibility` is `0`"),
        ("x.geojson", feature(SEA, POINT, r#""description":{"speed":5},"#), "forbids not-possible: line 1: `speed` in `description`"),
        ("x.geojson", feature(r#""action":"return""#, POINT, ""), "warns not-used: line 2: the place of a return is not used"),
        ("x.gpx", gpx("1.1", "<metadata><extensions><maxSpeed>3</maxSpeed></extensions></metadata><wpt lat='37.4112' lon='-6'/>"), "forbids not-possible: line 2: `maxSpeed` in `extensions`"),
        ("x.kml", kml_point("", "<altitudeMode>clampToGround</altitudeMode>").replace("<altitudeMode>absolute</altitudeMode>", AT), "warns not-used: line 2: the altitude 60 m is not used"),
        ("x.kml", kml_point("", AT).replace("http://www.opengis.net/kml/2.2", "http://x.org/2"), "line 1: `kml` of the namespace `http://x.org/2`"),
        ("x.waypoints", "QGC WPL 110\r1 1 3 22 0 0 0 0 0 0 20 1\r2 1 3 16 0 0 0 0 37.4112 -6.001 20 1\r".into(), "warns not-used: line 3 is marked as the current item"),
        // An altitude reference without an altitude, and an area's altitude that no mode explains.
        ("x.geojson", feature(SEA, r#""type":"Point","coordinates":[-6.0010,37.4112]"#, ""), "forbids not-possible: line 2: it says what its altitude is above"),
        ("x.kml", kml_point("", "<coordinates>-6.0010,37.4112</coordinates>"), "forbids not-possible: line 2: it says what its altitude is above"),
        ("x.kml", kml(&format!("<Placemark>{}<Polygon><outerBoundaryIs><LinearRing><coordinates>-6,37,5 -6,38,5 -5,37,5 -6,37,5</coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark>", schema("kind", "inclusion"))), "forbids not-possible: line 2: the altitudes of a fence area"),
        // What lies in elements that are harmless by themselves; members in other places than QGroundControl has them.
        ("x.gpx", rte("<ele>60</ele><desc><hold_s>5</hold_s></desc>"), "forbids not-possible: line 2: `hold_s` in `desc`"),
        ("x.kml", kml_point("<description><skip>1</skip></description>", AT), "forbids not-possible: line 2: `skip` in `description`"),
        ("x.plan", qgc(&item("\"cruiseSpeed\":1,", "3", "30"), ""), "forbids not-possible: line 3: `cruiseSpeed` in `items`"),
        ("x.geojson", feature(SEA, POINT, r#""crs":{"type":"link","properties":{"name":"EPSG:4326","href":"x"}},"#), "forbids not-possible: line 1: the coordinate reference system"),
        ("x.geojson", feature(SEA, POINT, "").replace(&format!("{{{SEA}}}"), "5"), "feature 1, line 2: its `properties` are no object"),
        ("x.geojson", feature(&format!(r#"{SEA},"way_point":1"#), POINT, ""), "forbids not-possible: line 2: the property `way_point`"),
        ("x.geojson", feature(&format!(r#"{SEA},"elevación":1"#), POINT, ""), "forbids not-possible: line 2: the property `elevación`"),
        // To ArduPilot, height 0 means as high as before.
        ("x.waypoints", "QGC WPL 110\n1 0 3 22 0 0 0 0 0 0 20 1\n2 0 3 16 0 0 0 0 37.4112 -6.001 0 1\n".into(), "forbids below-take-off: is reached less than"),
    ];
    let mut wrong = Vec::new();
    for (name, text, expected) in cases {
        let found = match outcome(name, text.as_bytes()) {
            Ok(outcome) => outcome.findings,
            Err(error) => vec![error],
        };
        if !found.iter().any(|one| one.starts_with(expected)) {
            wrong.push(format!("{text}\n  {expected}\n  {found:#?}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
}

#[test]
fn a_landing_ends_on_the_ground() {
    let list = "QGC WPL 110\n1 0 3 22 0 0 0 0 0 0 1 1\n2 0 3 21 0 0 0 0 37.4112 -6.001 0 1\n";
    assert_eq!(
        outcome("x.waypoints", list.as_bytes()).unwrap().findings,
        [""; 0]
    );
}
