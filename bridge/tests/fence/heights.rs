//! Floors, ceilings, and amounts in three dimensions.

use super::*;

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
    check(&inclusion, [50.0, 50.0, 50.0], [50.0, 50.0, 50.0], ALLOWED);
    check(
        &inclusion,
        [103.0, 104.0, 50.0],
        [103.0, 104.0, 50.0],
        outside(5.0),
    );
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
    check(
        &fence,
        [-20.0, 110.0, 50.0],
        [80.0, 60.0, 50.0],
        excluded(20.0),
    );
    // Grazes a corner of a small area on the way into the depth of a large one is two areas: the first one is reported.
    let wide = SQUARE.map(|[x, y]| [x * 10.0, y * 10.0 + 500.0]);
    let fence =
        parse(&(polygon("small", "exclusion", &SQUARE) + &polygon("wide", "exclusion", &wide)));
    let breach = fence
        .unwrap()
        .check_leg(&at([95.0, -10.0, 50.0]), &at([105.0, 900.0, 50.0]));
    assert_eq!(breach.unwrap().area, Some(0));
}
