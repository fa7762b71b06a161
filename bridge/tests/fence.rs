//! The geofence: each rule at its edges, and a comparison with an independent judge.
//!
//! Distances are metres round 37° N, 6° W, unless a test says otherwise.

mod chance;
mod config;
mod oracle;

use bridge::safety::fence::{
    Breach, Fence, FenceRule, MAX_LATITUDE_DEG, Speeds, TOUCH_M, Velocity,
};
use dsp_protocol::Waypoint;

const ORIGIN_DEG: [f64; 2] = [37.0, -6.0];

/// Which answer a case expects.
type Expected = Option<(FenceRule, f64)>;

const ALLOWED: Expected = None;

fn excluded(amount_m: f64) -> Expected {
    Some((FenceRule::Exclusion, amount_m))
}

fn outside(amount_m: f64) -> Expected {
    Some((FenceRule::Inclusion, amount_m))
}

/// Degrees of the point so many metres east and north of the origin.
fn degrees([east_m, north_m]: [f64; 2]) -> [f64; 2] {
    let [north, east] = oracle::metres_per_degree(ORIGIN_DEG[0]);
    [
        ORIGIN_DEG[0] + north_m / north,
        ORIGIN_DEG[1] + east_m / east,
    ]
}

/// East, north, up.
fn at([east_m, north_m, altitude_m]: [f64; 3]) -> Waypoint {
    let [latitude_deg, longitude_deg] = degrees([east_m, north_m]);
    Waypoint {
        latitude_deg,
        longitude_deg,
        altitude_m,
    }
}

fn waypoint(latitude_deg: f64, longitude_deg: f64, altitude_m: f64) -> Waypoint {
    Waypoint {
        latitude_deg,
        longitude_deg,
        altitude_m,
    }
}

fn parse(text: &str) -> Result<Fence, String> {
    runtime::config::parse(text, "fence.toml").map_err(|error| error.to_string())
}

/// The text of a polygon of metres.
fn polygon(name: &str, kind: &str, outline: &[[f64; 2]]) -> String {
    let outline: Vec<_> = outline.iter().copied().map(degrees).collect();
    format!("[[area]]\nname = \"{name}\"\nkind = \"{kind}\"\npolygon = {outline:?}\n")
}

/// The text of a circle round the origin.
fn circle(kind: &str, radius_m: f64) -> String {
    format!(
        "[[area]]\nname = \"circle\"\nkind = \"{kind}\"\ncentre = {ORIGIN_DEG:?}\nradius_m = {radius_m:?}\n"
    )
}

const SQUARE: [[f64; 2]; 4] = [[0.0, 0.0], [100.0, 0.0], [100.0, 100.0], [0.0, 100.0]];

/// A square of 100 m from whose upper side a notch reaches down to 20 m.
const NOTCHED: [[f64; 2]; 8] = [
    [0.0, 0.0],
    [100.0, 0.0],
    [100.0, 100.0],
    [60.0, 100.0],
    [60.0, 20.0],
    [40.0, 20.0],
    [40.0, 100.0],
    [0.0, 100.0],
];

/// A leg on the ground, and what is expected of it.
type Leg = ([f64; 2], [f64; 2], Expected);

/// Each leg at an altitude of 50 m.
fn level(fence: &str, legs: &[Leg]) {
    for ([x, y], [to_x, to_y], expected) in legs {
        check(fence, [*x, *y, 50.0], [*to_x, *to_y, 50.0], *expected);
    }
}

/// Both directions of a leg break the same rule by the same amount.
fn check(fence: &str, from: [f64; 3], to: [f64; 3], expected: Expected) {
    let fence = parse(fence).unwrap();
    for (from, to) in [(from, to), (to, from)] {
        let breach = fence.check_leg(&at(from), &at(to));
        assert_eq!(
            breach.map(|breach| breach.rule),
            expected.map(|(rule, _)| rule),
            "{from:?} to {to:?}: {breach:?}"
        );
        let all = fence.breaches_of_leg(&at(from), &at(to));
        assert_eq!(all.first().copied(), breach, "the first of {all:?}");
        if let (Some(breach), Some((_, amount_m))) = (breach, expected) {
            // Maps of different middles differ by 10⁻⁵.
            let error_m = (breach.amount_m - amount_m).abs();
            assert!(
                error_m < 0.005 + 1e-5 * amount_m,
                "{from:?} to {to:?}: {breach:?}"
            );
        }
    }
}

#[test]
fn the_default_allows_everything() {
    let fence = Fence::default();
    assert!(fence.is_empty());
    assert_eq!(fence.areas(), 0);
    assert_eq!(parse("").unwrap(), fence);
    let nowhere = waypoint(f64::NAN, f64::INFINITY, f64::NAN);
    assert_eq!(fence.check_leg(&nowhere, &waypoint(0.0, 0.0, 0.0)), None);
    assert_eq!(fence.check_path(&nowhere, &[nowhere; 3]), None);
}

#[test]
fn of_several_breaches_the_first_on_the_way_is_reported() {
    let text = format!(
        "ceiling_m = 100\n{}{}",
        polygon("first", "exclusion", &SQUARE),
        polygon("second", "exclusion", &SQUARE.map(|[x, y]| [x + 200.0, y]))
    );
    let fence = parse(&text).unwrap();
    let name = |from, to| {
        let breach = fence.check_leg(&at(from), &at(to)).unwrap();
        (
            breach.rule,
            breach.area.and_then(|area| fence.area_name(area)),
        )
    };
    let (west, east) = ([-50.0, 50.0, 50.0], [350.0, 50.0, 50.0]);
    assert_eq!(name(west, east), (FenceRule::Exclusion, Some("first")));
    assert_eq!(name(east, west), (FenceRule::Exclusion, Some("second")));
    let high = [350.0, 50.0, 500.0];
    assert_eq!(name(high, west), (FenceRule::Ceiling, None));
    let steep = [-50.0, 50.0, 99.0];
    assert_eq!(name(steep, high), (FenceRule::Ceiling, None));
    assert_eq!(fence.areas(), 2);
    assert_eq!(fence.area_name(2), None);
}

#[test]
fn a_leg_whose_ends_are_both_outside_an_exclusion_is_refused_when_it_cuts_it() {
    let fence = polygon("square", "exclusion", &SQUARE);
    let legs = [
        ([-50.0, 50.0], [150.0, 50.0], excluded(50.0)),
        ([-50.0, 30.0], [150.0, 30.0], excluded(30.0)),
        // A corner is cut.
        ([-10.0, 20.0], [20.0, -10.0], excluded(5.0)),
        // Ends inside.
        ([-50.0, 50.0], [10.0, 50.0], excluded(10.0)),
        ([10.0, 40.0], [20.0, 50.0], excluded(20.0)),
        // Far away, also on the lines of its edges.
        ([-50.0, 200.0], [150.0, 150.0], ALLOWED),
        ([200.0, 0.0], [300.0, 0.0], ALLOWED),
        ([-50.0, 140.0], [140.0, 140.0], ALLOWED),
        ([-60.0, 50.0], [50.0, 170.0], ALLOWED),
    ];
    level(&fence, &legs);
}

#[test]
fn touching_an_exclusion_is_a_breach_of_zero_metres() {
    let fence = polygon("square", "exclusion", &SQUARE);
    let [near, far] = [0.008, 0.012].map(|metres| -metres * f64::sqrt(2.0));
    let legs = [
        // A corner in passing, and as an end.
        ([-50.0, 50.0], [50.0, -50.0], excluded(0.0)),
        ([-50.0, -50.0], [0.0, 0.0], excluded(0.0)),
        // An edge: all of it, part of it, beyond both ends, up to its begin.
        ([0.0, 0.0], [100.0, 0.0], excluded(0.0)),
        ([20.0, 0.0], [40.0, 0.0], excluded(0.0)),
        ([-50.0, 100.0], [150.0, 100.0], excluded(0.0)),
        ([-50.0, 100.0], [0.0, 100.0], excluded(0.0)),
        // An edge's middle as an end.
        ([50.0, -40.0], [50.0, 0.0], excluded(0.0)),
        // Nearer than what counts as touching, and just not.
        ([-50.0, -0.008], [150.0, -0.008], excluded(0.0)),
        ([-50.0, -0.012], [150.0, -0.012], ALLOWED),
        // Past a corner at 45°.
        ([-50.0, 50.0 + near], [50.0, -50.0 + near], excluded(0.0)),
        ([-50.0, 50.0 + far], [50.0, -50.0 + far], ALLOWED),
    ];
    level(&fence, &legs);
}

#[test]
fn a_leg_exactly_through_two_vertices_is_inside_between_them() {
    let fence = polygon("square", "exclusion", &SQUARE);
    let legs = [([-50.0, -50.0], [150.0, 150.0], excluded(50.0))];
    level(&fence, &legs);
    let fence = polygon("square", "inclusion", &SQUARE);
    let legs = [(
        [-50.0, -50.0],
        [150.0, 150.0],
        outside(50.0 * f64::sqrt(2.0)),
    )];
    level(&fence, &legs);
    // A vertex in the middle of a straight side is nothing special.
    let mut outline = SQUARE.to_vec();
    outline.insert(1, [50.0, 0.0]);
    let fence = polygon("square", "exclusion", &outline);
    let legs = [
        ([50.0, -30.0], [50.0, 130.0], excluded(50.0)),
        ([50.0, -30.0], [50.0, 0.0], excluded(0.0)),
    ];
    level(&fence, &legs);
}

#[test]
fn a_notch_of_a_concave_polygon_is_outside_it() {
    let exclusion = polygon("notched", "exclusion", &NOTCHED);
    let legs = [
        ([50.0, 150.0], [50.0, 30.0], ALLOWED),
        ([50.0, 150.0], [50.0, 15.0], excluded(5.0)),
        ([-50.0, 60.0], [150.0, 60.0], excluded(20.0)),
    ];
    level(&exclusion, &legs);
    let inclusion = polygon("notched", "inclusion", &NOTCHED);
    // Leaves and enters again; the other way round stays inside.
    let legs = [
        ([20.0, 60.0], [80.0, 60.0], outside(10.0)),
        ([20.0, 10.0], [80.0, 10.0], ALLOWED),
        ([20.0, 20.0], [80.0, 20.0], outside(0.0)),
    ];
    level(&inclusion, &legs);
}

#[test]
fn an_inclusion_must_contain_every_point_of_a_leg() {
    let fence = polygon("field", "inclusion", &SQUARE);
    let legs = [
        ([10.0, 10.0], [90.0, 90.0], ALLOWED),
        ([10.0, 10.0], [130.0, 10.0], outside(30.0)),
        ([110.0, 120.0], [130.0, 140.0], outside(50.0)),
        // Touching the boundary from inside.
        ([10.0, 10.0], [100.0, 50.0], outside(0.0)),
        ([10.0, 0.0], [90.0, 0.0], outside(0.0)),
        ([10.0, 0.008], [90.0, 0.008], outside(0.0)),
        ([10.0, 0.012], [90.0, 0.012], ALLOWED),
    ];
    level(&fence, &legs);
}

#[test]
fn inclusions_are_one_area_where_they_overlap_and_not_where_they_touch() {
    let with_neighbour_at = |east_m: f64| {
        let neighbour = SQUARE.map(|[x, y]| [x + east_m, y]);
        polygon("west", "inclusion", &SQUARE) + &polygon("east", "inclusion", &neighbour)
    };
    let (from, to) = ([50.0, 50.0, 50.0], [150.0, 50.0, 50.0]);
    check(&with_neighbour_at(90.0), from, to, ALLOWED);
    check(&with_neighbour_at(99.9), from, to, ALLOWED);
    check(&with_neighbour_at(100.0), from, to, outside(0.0));
    check(&with_neighbour_at(100.01), from, to, outside(0.005));
    check(&with_neighbour_at(110.0), from, to, outside(5.0));
    // An area that stands alone does not help.
    let far = polygon("far", "inclusion", &SQUARE.map(|[x, y]| [x + 1000.0, y]));
    check(&(far.clone() + &with_neighbour_at(90.0)), from, to, ALLOWED);
    check(&far, from, to, outside(950.0));
}

#[test]
fn an_exclusion_inside_an_inclusion_stays_excluded() {
    let hole = SQUARE.map(|[x, y]| [x * 0.2 + 40.0, y * 0.2 + 40.0]);
    let fence = polygon("field", "inclusion", &SQUARE) + &polygon("hole", "exclusion", &hole);
    let legs = [
        ([10.0, 50.0], [90.0, 50.0], excluded(10.0)),
        ([10.0, 30.0], [90.0, 30.0], ALLOWED),
    ];
    level(&fence, &legs);
}

#[test]
fn circles_are_cut_touched_and_left() {
    let leg = |kind, from: [f64; 2], to: [f64; 2], expected| {
        let (from, to) = ([from[0], from[1], 50.0], [to[0], to[1], 50.0]);
        check(&circle(kind, 100.0), from, to, expected);
    };
    leg("exclusion", [-200.0, 0.0], [200.0, 0.0], excluded(100.0));
    leg("exclusion", [-200.0, 60.0], [200.0, 60.0], excluded(40.0));
    // Tangents.
    leg("exclusion", [-200.0, 100.0], [200.0, 100.0], excluded(0.0));
    leg(
        "exclusion",
        [-200.0, 100.008],
        [200.0, 100.008],
        excluded(0.0),
    );
    leg("exclusion", [-200.0, 100.012], [200.0, 100.012], ALLOWED);
    leg("exclusion", [200.0, 0.0], [100.0, 0.0], excluded(0.0));
    leg("exclusion", [300.0, 0.0], [200.0, 0.0], ALLOWED);
    leg("inclusion", [-90.0, 0.0], [90.0, 0.0], ALLOWED);
    leg("inclusion", [-90.0, 0.0], [100.0, 0.0], outside(0.0));
    leg("inclusion", [-90.0, 0.0], [130.0, 0.0], outside(30.0));
    leg("inclusion", [200.0, 0.0], [300.0, 0.0], outside(200.0));
}

#[test]
fn either_direction_and_a_repeated_first_vertex_are_accepted() {
    let mut outline = SQUARE.to_vec();
    outline.push(SQUARE[0]);
    outline.reverse();
    let fence = polygon("square", "exclusion", &outline);
    let legs = [([-50.0, 50.0], [150.0, 50.0], excluded(50.0))];
    level(&fence, &legs);
}

#[test]
fn a_path_is_judged_leg_by_leg_from_its_start() {
    let fence = parse(&polygon("square", "exclusion", &SQUARE)).unwrap();
    let points = [
        [-50.0, -50.0, 50.0],
        [150.0, -50.0, 50.0],
        [150.0, 50.0, 50.0],
    ]
    .map(at);
    let start = at([-50.0, 50.0, 50.0]);
    assert_eq!(fence.check_path(&start, &points), None);
    assert_eq!(fence.check_path(&start, &[]), None);
    let (leg, breach) = fence
        .check_path(&start, points[..1].iter().chain(&points[2..]))
        .unwrap();
    assert_eq!((leg, breach.rule), (2, FenceRule::Exclusion));
    let (leg, _) = fence.check_path(&points[2], &[start]).unwrap();
    assert_eq!(leg, 1);
    let closed = points.iter().chain([&start]);
    assert_eq!(fence.check_path(&start, closed).unwrap().0, 4);
}

#[test]
fn floor_and_ceiling_are_breached_by_touching_and_measured_at_the_worse_end() {
    let fence = "floor_m = 10\nceiling_m = 100";
    let (floor, ceiling) = (FenceRule::Floor, FenceRule::Ceiling);
    let level = |altitude_m| ([0.0, 0.0, altitude_m], [500.0, 0.0, altitude_m]);
    for (altitude_m, expected) in [
        (50.0, ALLOWED),
        (10.011, ALLOWED),
        (10.009, Some((floor, 0.0))),
        (10.0, Some((floor, 0.0))),
        (9.0, Some((floor, 1.0))),
        (99.989, ALLOWED),
        (100.0, Some((ceiling, 0.0))),
        (120.0, Some((ceiling, 20.0))),
    ] {
        let (from, to) = level(altitude_m);
        check(fence, from, to, expected);
    }
    check(
        fence,
        [0.0, 0.0, 50.0],
        [9.0, 0.0, 107.0],
        Some((ceiling, 7.0)),
    );
    check(fence, [0.0, 0.0, 50.0], [0.0, 0.0, 3.0], Some((floor, 7.0)));
}

#[test]
fn an_area_is_bounded_by_its_own_floor_and_ceiling() {
    let limits = "floor_m = 20\nceiling_m = 60\n";
    let leg = |kind: &str, from_m, to_m, expected| {
        for area in [
            polygon("area", kind, &SQUARE.map(|[x, y]| [x - 50.0, y - 50.0])),
            circle(kind, 50.0),
        ] {
            let (from, to) = ([-80.0, 0.0, from_m], [80.0, 0.0, to_m]);
            let inner = ([-40.0, 0.0, from_m], [40.0, 0.0, to_m]);
            let (from, to) = if kind == "exclusion" {
                (from, to)
            } else {
                inner
            };
            check(&(area + limits), from, to, expected);
        }
    };
    // Above, below, on the limits, between them.
    leg("exclusion", 80.0, 80.0, ALLOWED);
    leg("exclusion", 60.012, 60.012, ALLOWED);
    leg("exclusion", 60.0, 60.0, excluded(0.0));
    leg("exclusion", 20.0, 20.0, excluded(0.0));
    leg("exclusion", 10.0, 10.0, ALLOWED);
    leg("exclusion", 55.0, 55.0, excluded(5.0));
    leg("exclusion", 40.0, 40.0, excluded(20.0));
    // It climbs through the area's altitudes: beside it, or over it.
    leg("exclusion", 55.0, 135.0, ALLOWED);
    leg("exclusion", 0.0, 160.0, excluded(15.0));
    leg("inclusion", 40.0, 40.0, ALLOWED);
    leg("inclusion", 59.0, 21.0, ALLOWED);
    leg("inclusion", 60.0, 40.0, outside(0.0));
    leg("inclusion", 40.0, 67.0, outside(7.0));
    leg("inclusion", 40.0, 15.0, outside(5.0));
}

#[test]
fn areas_above_each_other_carry_a_climb() {
    let stacked = |ceiling_m: f64| {
        format!(
            "{}ceiling_m = {ceiling_m:?}\n{}floor_m = 50\n",
            polygon("low", "inclusion", &SQUARE),
            polygon("high", "inclusion", &SQUARE)
        )
    };
    let (from, to) = ([20.0, 20.0, 10.0], [20.0, 20.0, 90.0]);
    check(&stacked(55.0), from, to, ALLOWED);
    check(&stacked(50.0), from, to, outside(0.0));
    check(&stacked(48.0), from, to, outside(1.0));
}

#[test]
fn legs_straight_up_and_legs_of_no_length_are_judged() {
    let exclusion = polygon("square", "exclusion", &SQUARE) + "ceiling_m = 60\n";
    check(&exclusion, [50.0, 50.0, 100.0], [50.0, 50.0, 70.0], ALLOWED);
    check(
        &exclusion,
        [50.0, 50.0, 100.0],
        [50.0, 50.0, 50.0],
        excluded(10.0),
    );
    check(
        &exclusion,
        [50.0, 50.0, 100.0],
        [50.0, 50.0, 60.0],
        excluded(0.0),
    );
    check(&exclusion, [-1.0, 50.0, 100.0], [-1.0, 50.0, 0.0], ALLOWED);
    check(
        &exclusion,
        [0.0, 50.0, 100.0],
        [0.0, 50.0, 0.0],
        excluded(0.0),
    );
    for (point, expected) in [
        ([50.0, 50.0, 50.0], Some(FenceRule::Exclusion)),
        ([0.0, 0.0, 50.0], Some(FenceRule::Exclusion)),
        ([100.0, 30.0, 60.0], Some(FenceRule::Exclusion)),
        ([50.0, 50.0, 60.1], None),
        ([100.1, 30.0, 50.0], None),
    ] {
        let fence = parse(&exclusion).unwrap();
        let breach = fence.check_point(&at(point));
        assert_eq!(breach.map(|breach| breach.rule), expected, "{point:?}");
        assert_eq!(fence.check_leg(&at(point), &at(point)), breach);
    }
    let inclusion = polygon("field", "inclusion", &SQUARE);
    check(&inclusion, [50.0, 50.0, 0.0], [50.0, 50.0, 500.0], ALLOWED);
    let legs = [
        ([50.0, 50.0], [50.0, 50.0], ALLOWED),
        ([103.0, 104.0], [103.0, 104.0], outside(5.0)),
    ];
    level(&inclusion, &legs);
}

#[test]
fn an_amount_outside_an_inclusion_is_measured_in_three_dimensions() {
    let fence = polygon("field", "inclusion", &SQUARE) + "ceiling_m = 60\n";
    check(
        &fence,
        [50.0, 50.0, 50.0],
        [103.0, 50.0, 64.0],
        outside(5.0),
    );
}

#[test]
fn the_worst_of_several_places_in_breach_is_measured() {
    let fence = polygon("notched", "exclusion", &NOTCHED);
    // Through one arm near its top, and deep into the other one.
    let legs = [([-20.0, 110.0], [80.0, 60.0], excluded(20.0))];
    level(&fence, &legs);
    // Grazes a corner of a small area on the way into the depth of a large one is two areas: the first one is reported.
    let wide = SQUARE.map(|[x, y]| [x * 10.0, y * 10.0 + 500.0]);
    let fence =
        parse(&(polygon("small", "exclusion", &SQUARE) + &polygon("wide", "exclusion", &wide)));
    let breach = fence
        .unwrap()
        .check_leg(&at([95.0, -10.0, 50.0]), &at([105.0, 900.0, 50.0]));
    assert_eq!(breach.unwrap().area, Some(0));
}

#[test]
fn a_fence_across_the_antimeridian_is_one_fence() {
    let text = |kind| {
        format!(
            "[[area]]\nname = \"date line\"\nkind = \"{kind}\"\npolygon = [[-17, 179.99], [-17, -179.99], [-16.98, -179.99], [-16.98, 179.99]]"
        )
    };
    let rule = |kind, from, to| {
        let fence = parse(&text(kind)).unwrap();
        let there = fence.check_leg(&from, &to);
        assert_eq!(
            there.map(|b| b.rule),
            fence.check_leg(&to, &from).map(|b| b.rule)
        );
        there.map(|breach| breach.rule)
    };
    let [west, east] = [179.995, -179.995].map(|lon| waypoint(-16.99, lon, 50.0));
    let [far_west, far_east] = [179.98, -179.98].map(|lon| waypoint(-16.99, lon, 50.0));
    assert_eq!(rule("inclusion", west, east), None);
    assert_eq!(
        rule("inclusion", west, far_east),
        Some(FenceRule::Inclusion)
    );
    assert_eq!(
        rule("exclusion", far_west, far_east),
        Some(FenceRule::Exclusion)
    );
    assert_eq!(
        rule("exclusion", far_west, waypoint(-16.97, 179.98, 50.0)),
        None
    );
    let on_the_line = [180.0, -180.0].map(|lon| waypoint(-16.99, lon, 50.0));
    assert_eq!(rule("inclusion", on_the_line[0], on_the_line[1]), None);
    // On the opposite side of the Earth.
    assert_eq!(
        rule(
            "exclusion",
            waypoint(-16.99, -0.01, 50.0),
            waypoint(-16.99, 0.01, 50.0)
        ),
        None
    );
}

#[test]
fn a_circle_at_a_high_latitude_is_round_on_the_ground() {
    let fence = parse(
        "[[area]]\nname = \"north\"\nkind = \"exclusion\"\ncentre = [84.0, 20.0]\nradius_m = 1000",
    )
    .unwrap();
    let [north, east] = oracle::metres_per_degree(84.0);
    let rule = |east_m: f64, north_m: f64| {
        let point = waypoint(84.0 + north_m / north, 20.0 + east_m / east, 50.0);
        fence.check_point(&point).map(|breach| breach.rule)
    };
    for (east_m, north_m) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0), (0.6, 0.8)] {
        assert_eq!(rule(1001.0 * east_m, 1001.0 * north_m), None);
        assert_eq!(
            rule(999.0 * east_m, 999.0 * north_m),
            Some(FenceRule::Exclusion)
        );
    }
}

#[test]
fn what_cannot_be_judged_is_refused() {
    let unjudgeable = Some(Breach {
        rule: FenceRule::Unjudgeable,
        amount_m: 0.0,
        area: None,
    });
    let good = waypoint(37.0, -6.0, 50.0);
    for text in ["floor_m = 0".to_owned(), circle("exclusion", 10.0)] {
        let fence = parse(&text).unwrap();
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300] {
            for point in [
                waypoint(bad, -6.0, 50.0),
                waypoint(37.0, bad, 50.0),
                waypoint(37.0, -6.0, if bad == 1e300 { f64::NAN } else { bad }),
            ] {
                assert_eq!(fence.check_leg(&good, &point), unjudgeable, "{point:?}");
                assert_eq!(fence.check_leg(&point, &good), unjudgeable, "{point:?}");
                assert_eq!(fence.check_point(&point), unjudgeable, "{point:?}");
                let all = fence.breaches_of_leg(&good, &point);
                assert_eq!(all, Vec::from_iter(unjudgeable), "{point:?}");
            }
        }
    }
    // Too far and too near to a pole for a map; a floor needs none.
    let fence = parse(&circle("exclusion", 10.0)).unwrap();
    let floor = parse("floor_m = 0").unwrap();
    for point in [
        waypoint(37.95, -6.0, 50.0),
        waypoint(37.0, -4.8, 50.0),
        waypoint(85.1, -6.0, 50.0),
    ] {
        assert_eq!(fence.check_leg(&good, &point), unjudgeable, "{point:?}");
        assert_eq!(floor.check_leg(&good, &point), None);
    }
    // To the limits of what has a place: a map ends earlier.
    for sign in [1.0, -1.0] {
        let last = waypoint(sign * 90.0, sign * 180.0, 1e5);
        assert_eq!(floor.check_point(&last), None);
        let on_map = waypoint(sign * MAX_LATITUDE_DEG, -6.0, 50.0);
        assert_eq!(fence.check_point(&on_map), None);
    }
    let still = Velocity {
        ground_mps: 0.0,
        course_deg: 0.0,
        up_mps: 0.0,
    };
    let beyond = waypoint(86.0, -6.0, 50.0);
    let inclusion = parse(&circle("inclusion", 10.0)).unwrap();
    assert_eq!(inclusion.check_ahead(&beyond, &still), None);
    assert_eq!(inclusion.check_point(&beyond), unjudgeable);
    // 94 km, and one end beyond the map.
    let east = waypoint(45.0, -4.8, 50.0);
    let west = waypoint(45.0, -6.0, 50.0);
    assert_eq!(fence.check_leg(&west, &east), None);
    assert_eq!(
        fence.check_leg(&waypoint(84.99, -6.0, 50.0), &waypoint(85.01, -6.0, 50.0)),
        unjudgeable
    );
    let over = waypoint(37.5, -6.0, 50.0);
    assert_eq!(fence.check_leg(&waypoint(37.8, -6.0, 50.0), &over), None);
    for altitude_m in [1.1e5, -1.1e5, f64::MAX] {
        let point = waypoint(37.5, -6.0, altitude_m);
        assert_eq!(fence.check_leg(&over, &point), unjudgeable);
        assert_eq!(floor.check_leg(&over, &point), unjudgeable);
    }
}

/// Which way a helicopter needs behind a leg of so many metres, from the speed with which it begins.
#[test]
fn a_short_leg_is_not_flown_faster_than_the_helicopter_can_become() {
    for (margin_m, begin_mps, leg_m, way_m) in [
        (2.0, 0.0, 5.0, 12.8),
        (2.0, 3.0, 5.0, 15.0),
        (2.0, 0.0, 1.0, 1.0),
        (2.0, 0.0, 1000.0, 93.0),
        (2.0, f64::INFINITY, 5.0, 93.0),
        (6.0, 0.0, 5.0, 9.7),
    ] {
        let text = format!("margin_m = {margin_m:.1}\n{}", circle("exclusion", 100.0));
        let fence = parse(&text).unwrap();
        let speeds = Speeds {
            cruise_mps: 20.0,
            climb_mps: 3.0,
            begin_mps,
        };
        for (more_m, is_taken) in [(0.3, true), (-0.3, false)] {
            let end = 100.0 + f64::max(way_m, margin_m) + more_m;
            let [from, to] = [end + leg_m, end].map(|east_m| at([east_m, 0.0, 50.0]));
            let breach = fence.check_flight(&from, &to, &speeds);
            assert_eq!(
                breach.is_none(),
                is_taken,
                "{begin_mps} {leg_m}: {breach:?}"
            );
        }
    }
}

/// 1 m into the margin of 2 m, on every side that a fence has.
#[test]
fn what_is_missing_of_the_margin_is_measured_at_every_boundary() {
    let speeds = Speeds {
        cruise_mps: 1e-3,
        climb_mps: 1e-3,
        begin_mps: 0.0,
    };
    let table = [
        ("floor_m = 10.0".to_owned(), [0.0, 0.0, 11.0]),
        ("ceiling_m = 100.0".to_owned(), [0.0, 0.0, 99.0]),
        (circle("exclusion", 50.0), [51.0, 0.0, 50.0]),
        (circle("inclusion", 50.0), [49.0, 0.0, 50.0]),
    ];
    for (text, point) in table {
        let breach = parse(&text).unwrap();
        let breach = breach.check_flight(&at(point), &at(point), &speeds);
        let breach = breach.expect(&text);
        assert_eq!(breach.rule, FenceRule::Ahead, "{text}");
        assert!((breach.amount_m - 1.0).abs() < 0.01, "{text}: {breach:?}");
    }
}

#[test]
fn touching_is_wider_than_the_steps_of_the_wire() {
    // Half a step of 10⁻⁷ ° to the north and to the east.
    let [north, east] = oracle::metres_per_degree(0.0);
    assert!((north * 0.5e-7).hypot(east * 0.5e-7) < TOUCH_M);
}
