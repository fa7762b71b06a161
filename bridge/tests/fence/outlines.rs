//! Outlines on the ground: exclusions, inclusions, polygons and circles.

use super::*;

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
    let leg = |from: [f64; 2], to: [f64; 2], expected| {
        check(
            &fence,
            [from[0], from[1], 50.0],
            [to[0], to[1], 50.0],
            expected,
        );
    };
    leg([-50.0, 50.0], [150.0, 50.0], excluded(50.0));
    leg([-50.0, 30.0], [150.0, 30.0], excluded(30.0));
    // A corner is cut.
    leg([-10.0, 20.0], [20.0, -10.0], excluded(5.0));
    // Ends inside.
    leg([-50.0, 50.0], [10.0, 50.0], excluded(10.0));
    leg([10.0, 40.0], [20.0, 50.0], excluded(20.0));
    // Far away, also on the lines of its edges.
    leg([-50.0, 200.0], [150.0, 150.0], ALLOWED);
    leg([200.0, 0.0], [300.0, 0.0], ALLOWED);
    leg([-50.0, 140.0], [140.0, 140.0], ALLOWED);
    leg([-60.0, 50.0], [50.0, 170.0], ALLOWED);
}

#[test]
fn touching_an_exclusion_is_a_breach_of_zero_metres() {
    let fence = polygon("square", "exclusion", &SQUARE);
    let leg = |from: [f64; 2], to: [f64; 2], expected| {
        check(
            &fence,
            [from[0], from[1], 50.0],
            [to[0], to[1], 50.0],
            expected,
        );
    };
    // A corner in passing, and as an end.
    leg([-50.0, 50.0], [50.0, -50.0], excluded(0.0));
    leg([-50.0, -50.0], [0.0, 0.0], excluded(0.0));
    // An edge: all of it, part of it, beyond both ends, up to its begin.
    leg([0.0, 0.0], [100.0, 0.0], excluded(0.0));
    leg([20.0, 0.0], [40.0, 0.0], excluded(0.0));
    leg([-50.0, 100.0], [150.0, 100.0], excluded(0.0));
    leg([-50.0, 100.0], [0.0, 100.0], excluded(0.0));
    // An edge's middle as an end.
    leg([50.0, -40.0], [50.0, 0.0], excluded(0.0));
    // Nearer than what counts as touching, and just not.
    leg([-50.0, -0.008], [150.0, -0.008], excluded(0.0));
    leg([-50.0, -0.012], [150.0, -0.012], ALLOWED);
    // Past a corner at 45°.
    let [near, far] = [0.008, 0.012].map(|metres| -metres * f64::sqrt(2.0));
    leg([-50.0, 50.0 + near], [50.0, -50.0 + near], excluded(0.0));
    leg([-50.0, 50.0 + far], [50.0, -50.0 + far], ALLOWED);
}

#[test]
fn a_leg_exactly_through_two_vertices_is_inside_between_them() {
    let fence = polygon("square", "exclusion", &SQUARE);
    check(
        &fence,
        [-50.0, -50.0, 50.0],
        [150.0, 150.0, 50.0],
        excluded(50.0),
    );
    let fence = polygon("square", "inclusion", &SQUARE);
    check(
        &fence,
        [-50.0, -50.0, 50.0],
        [150.0, 150.0, 50.0],
        outside(50.0 * f64::sqrt(2.0)),
    );
    // A vertex in the middle of a straight side is nothing special.
    let mut outline = SQUARE.to_vec();
    outline.insert(1, [50.0, 0.0]);
    let fence = polygon("square", "exclusion", &outline);
    check(
        &fence,
        [50.0, -30.0, 50.0],
        [50.0, 130.0, 50.0],
        excluded(50.0),
    );
    check(
        &fence,
        [50.0, -30.0, 50.0],
        [50.0, 0.0, 50.0],
        excluded(0.0),
    );
}

#[test]
fn a_notch_of_a_concave_polygon_is_outside_it() {
    let exclusion = polygon("notched", "exclusion", &NOTCHED);
    check(&exclusion, [50.0, 150.0, 50.0], [50.0, 30.0, 50.0], ALLOWED);
    check(
        &exclusion,
        [50.0, 150.0, 50.0],
        [50.0, 15.0, 50.0],
        excluded(5.0),
    );
    check(
        &exclusion,
        [-50.0, 60.0, 50.0],
        [150.0, 60.0, 50.0],
        excluded(20.0),
    );
    let inclusion = polygon("notched", "inclusion", &NOTCHED);
    // Leaves and enters again; the other way round stays inside.
    check(
        &inclusion,
        [20.0, 60.0, 50.0],
        [80.0, 60.0, 50.0],
        outside(10.0),
    );
    check(&inclusion, [20.0, 10.0, 50.0], [80.0, 10.0, 50.0], ALLOWED);
    check(
        &inclusion,
        [20.0, 20.0, 50.0],
        [80.0, 20.0, 50.0],
        outside(0.0),
    );
}

#[test]
fn an_inclusion_must_contain_every_point_of_a_leg() {
    let fence = polygon("field", "inclusion", &SQUARE);
    check(&fence, [10.0, 10.0, 50.0], [90.0, 90.0, 50.0], ALLOWED);
    check(
        &fence,
        [10.0, 10.0, 50.0],
        [130.0, 10.0, 50.0],
        outside(30.0),
    );
    check(
        &fence,
        [110.0, 120.0, 50.0],
        [130.0, 140.0, 50.0],
        outside(50.0),
    );
    // Touching the boundary from inside.
    check(
        &fence,
        [10.0, 10.0, 50.0],
        [100.0, 50.0, 50.0],
        outside(0.0),
    );
    check(&fence, [10.0, 0.0, 50.0], [90.0, 0.0, 50.0], outside(0.0));
    check(
        &fence,
        [10.0, 0.008, 50.0],
        [90.0, 0.008, 50.0],
        outside(0.0),
    );
    check(&fence, [10.0, 0.012, 50.0], [90.0, 0.012, 50.0], ALLOWED);
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
    check(
        &fence,
        [10.0, 50.0, 50.0],
        [90.0, 50.0, 50.0],
        excluded(10.0),
    );
    check(&fence, [10.0, 30.0, 50.0], [90.0, 30.0, 50.0], ALLOWED);
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
    check(
        &fence,
        [-50.0, 50.0, 50.0],
        [150.0, 50.0, 50.0],
        excluded(50.0),
    );
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
