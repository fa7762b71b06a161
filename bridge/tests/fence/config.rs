//! `[fence]` of the configuration: its bounds, and every mistake with its line and the name of the area.

use bridge::safety::fence::{Fence, FenceRule, MAX_AREAS, MAX_VERTICES};
use dsp_protocol::Waypoint;

use super::parse;

fn polygon(name: &str, outline: &[[f64; 2]]) -> String {
    format!("[[area]]\nname = \"{name}\"\nkind = \"exclusion\"\npolygon = {outline:?}\n")
}

const CIRCLE: &str =
    "[[area]]\nname = \"circle\"\nkind = \"exclusion\"\ncentre = [37.0, -6.0]\nradius_m = 10\n";

#[test]
fn the_largest_fence_is_accepted_and_a_larger_one_refused() {
    let outline: Vec<_> = (0..MAX_VERTICES)
        .map(|vertex| {
            let angle = std::f64::consts::TAU * vertex as f64 / MAX_VERTICES as f64;
            [0.01 * angle.cos(), 0.01 * angle.sin()]
        })
        .collect();
    let areas = |count: usize| -> String {
        (0..count)
            .map(|number| polygon(&number.to_string(), &outline))
            .collect()
    };
    assert_eq!(parse(&areas(MAX_AREAS)).unwrap().areas(), MAX_AREAS);
    let error = parse(&areas(MAX_AREAS + 1)).unwrap_err();
    assert!(error.contains("65 areas; at most 64"), "{error}");
    let error = parse(&polygon("round", &[outline, vec![[-0.02, 0.0]]].concat()));
    let error = error.unwrap_err();
    assert!(
        error.contains("3 to 256 vertices, and this one has 257"),
        "{error}"
    );
}

#[test]
fn mistakes_are_named_with_line_area_and_reason() {
    let area = |rest: &str| {
        format!("floor_m = 0\n\n[[area]]\nname = \"tower\"\nkind = \"exclusion\"\n{rest}")
    };
    let shape = |outline: &str| area(&format!("polygon = {outline}"));
    #[rustfmt::skip]
    let table = [
        (area(""), "either `polygon`, or `centre` and `radius_m`"),
        (area("centre = [0, 0]"), "either `polygon`"),
        (area("radius_m = 5"), "either `polygon`"),
        (area("centre = [0, 0]\nradius_m = 5\npolygon = [[0, 0], [0, 1], [1, 1]]"), "either `polygon`"),
        (area("centre = [86, 0]\nradius_m = 5"), "[86, 0] is no [latitude, longitude]"),
        (area("centre = [0, 181]\nradius_m = 5"), "±85 and ±180"),
        (area("centre = [nan, 0]\nradius_m = 5"), "NaN"),
        (area("centre = [0, 0]\nradius_m = 0.5"), "from 1 to 50000"),
        (area("centre = [0, 0]\nradius_m = inf"), "out of range"),
        (area("centre = [0, 0]\nradius_m = nan"), "out of range"),
        (area("centre = [0, 0]\nradius_m = 5\nfloor_m = 9\nceiling_m = 9"), "its floor_m = 9 is not below"),
        (shape("[[0, 0], [0, 0.1]]"), "3 to 256 vertices, and this one has 2"),
        (shape("[[0, 0], [0, 0.1], [0, 0]]"), "this one has 2"),
        (shape("[]"), "this one has 0"),
        (shape("[[0, 0], [0, 0.1], [inf, 0.1]]"), "is no [latitude"),
        (shape("[[0, 0], [0, 0.1], [0.1, 0.1], [0.1, 0.1]]"), "vertex 4 of the polygon repeats"),
        // A bow tie, a spike, a line, an outline that passes through a vertex twice, one that touches an edge.
        (shape("[[0, 0], [0.1, 0.1], [0.1, 0], [0, 0.1]]"), "vertex 1 meets the one that begins at vertex 3"),
        (shape("[[0, 0], [0, 0.1], [0.1, 0.1], [0, 0.1]]"), "crosses or touches itself"),
        (shape("[[0, 0], [0, 0.1], [0, 0.2]]"), "crosses or touches itself"),
        (shape("[[0, 0], [0.1, 0.1], [0.2, 0], [0.2, 0.2], [0.1, 0.1], [0, 0.2]]"), "crosses or touches itself"),
        (shape("[[0, 0], [0, 0.2], [0.1, 0.2], [0, 0.1], [0.1, 0]]"), "crosses or touches itself"),
        (shape("[[0, 0], [0, 1], [0.1, 0.1]]"), "111319 m wide"),
        (shape("[[0, 0], [0, 179], [0.1, -179]]"), "m wide; at most 100000 m"),
    ];
    for (text, reason) in table {
        let error = parse(&text).unwrap_err();
        assert!(error.contains(reason), "{text}\n{error}");
        assert!(error.contains("area `tower`"), "{error}");
        assert!(error.starts_with("fence.toml:3: "), "{error}");
    }
}

#[test]
fn mistakes_outside_a_shape_are_named_with_their_line() {
    #[rustfmt::skip]
    let table = [
        ("floor_m = 50\nceiling_m = 40".to_owned(), "the fence's floor_m = 50 is not below its ceiling_m = 40"),
        ("ceiling_m = nan".to_owned(), "out of range"),
        ("ceiling_m = 1e6".to_owned(), "-1000.0 to 20000.0"),
        ("ceiling = 50".to_owned(), "unknown field `ceiling`"),
        (CIRCLE.to_owned() + "width_m = 3", "fence.toml:6: unknown field `width_m`"),
        (CIRCLE.to_owned() + "floor_m = -2000", "fence.toml:6: -2000 is out of range"),
        (CIRCLE.replace("exclusion", "keep out"), "fence.toml:3: unknown variant `keep out`"),
        (CIRCLE.replace("name = \"circle\"\n", ""), "missing field `name`"),
        (CIRCLE.replace("\"circle\"", "\"\""), "1 to 64 printable characters"),
        (CIRCLE.replace("\"circle\"", "\"a\\nb\""), "1 to 64 printable characters"),
        (CIRCLE.to_owned() + CIRCLE, "two areas are called `circle`"),
    ];
    for (text, reason) in table {
        let error = parse(&text).unwrap_err();
        assert!(error.contains(reason), "{text}\n{error}");
    }
}

/// What `bridge.toml` contains of the fence.
#[derive(Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    fence: Fence,
}

#[test]
fn the_example_of_the_documentation_is_a_fence_of_two_areas() {
    let blocks = include_str!("../../../docs/safety.md").split("```");
    let example = blocks
        .filter_map(|block| block.strip_prefix("toml bridge.toml\n"))
        .find(|block| block.contains("[fence]"))
        .unwrap();
    let fence = runtime::config::parse::<File>(example, "bridge.toml")
        .unwrap()
        .fence;
    assert_eq!(fence.areas(), 2);
    assert_eq!(
        [0, 1].map(|area| fence.area_name(area)),
        [Some("field"), Some("mast")]
    );
    let at = |latitude_deg, longitude_deg, altitude_m| Waypoint {
        latitude_deg,
        longitude_deg,
        altitude_m,
    };
    let judge = |from, to| fence.check_leg(&from, &to).map(|breach| breach.rule);
    let (west, east) = ((37.4115, -6.0025), (37.4115, -5.9995));
    let level = |altitude_m| {
        judge(
            at(west.0, west.1, altitude_m),
            at(east.0, east.1, altitude_m),
        )
    };
    assert_eq!(level(70.0), None);
    assert_eq!(level(60.0), Some(FenceRule::Exclusion));
    assert_eq!(level(130.0), Some(FenceRule::Ceiling));
    assert_eq!(
        judge(at(37.412, -6.0, 70.0), at(37.415, -6.0, 70.0)),
        Some(FenceRule::Inclusion)
    );

    let broken = example.replace("radius_m = 40.0", "radius_m = 0.04");
    let error = runtime::config::parse::<File>(&broken, "bridge.toml").unwrap_err();
    let line = broken
        .lines()
        .position(|line| line.contains("# stay away"))
        .unwrap()
        + 1;
    let start = format!("bridge.toml:{line}: area `mast`: radius_m = 0.04 is out of range");
    assert!(error.to_string().starts_with(&start), "{error}");
}
