//! Far from 37° N, 6° W: the antimeridian, high latitudes, and what cannot be judged.

use super::*;

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
    // The other side of the Earth.
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
    let over = waypoint(37.5, -6.0, 50.0);
    assert_eq!(fence.check_leg(&waypoint(37.8, -6.0, 50.0), &over), None);
    for altitude_m in [1.1e5, -1.1e5, f64::MAX] {
        let point = waypoint(37.5, -6.0, altitude_m);
        assert_eq!(fence.check_leg(&over, &point), unjudgeable);
        assert_eq!(floor.check_leg(&over, &point), unjudgeable);
    }
}

#[test]
fn touching_is_wider_than_the_steps_of_the_wire() {
    // Half a step of 10⁻⁷ ° to the north and to the east.
    let [north, east] = oracle::metres_per_degree(0.0);
    assert!((north * 0.5e-7).hypot(east * 0.5e-7) < TOUCH_M);
}
