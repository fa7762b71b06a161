//! Random paths, late waypoints, missed ones: where the point goes and how it moves.

use crate::random::Random;

use super::*;
use crate::helicopter::path::HORIZONTAL_ACCELERATION_MPS2;

const LIMITS: Limits = Limits {
    cruise_mps: 8.0,
    climb_mps: 4.0,
    acceptance_radius_m: 0.5,
};

/// Steps until the point rests and returns how near it came to each of `points`, and checks speed and acceleration on
/// the way. Waypoints count as reached when the point has passed on to the next line.
fn fly(guidance: &mut Guidance, path: &mut PathBuffer, points: &[Vector]) -> Vec<f64> {
    let mut nearest_m = vec![f64::INFINITY; points.len()];
    let (mut before_m, mut velocity_before) = (guidance.position_m(), None);
    for _ in 0..200_000 {
        guidance.step(path, &LIMITS);
        let position_m = guidance.position_m();
        let velocity = (position_m - before_m) * (1.0 / STEP_S);
        assert!(velocity.horizontal_norm() <= LIMITS.cruise_mps * 1.001);
        assert!(velocity.z.abs() <= LIMITS.climb_mps * 1.001, "{velocity:?}");
        if let Some(velocity_before) = velocity_before {
            let change = velocity - velocity_before;
            // Where the point comes to rest within a step, what was left of its speed goes at once.
            let bound = 1.1 * STEP_S * HORIZONTAL_ACCELERATION_MPS2 + 4.0 * CREEP_MPS;
            assert!(
                change.norm() <= bound * 1.3,
                "{change:?} {velocity:?} {guidance:?} at {position_m:?}"
            );
        }
        (before_m, velocity_before) = (position_m, Some(velocity));
        for (nearest_m, point) in nearest_m.iter_mut().zip(points) {
            *nearest_m = nearest_m.min((position_m - *point).norm());
        }
        while path
            .front()
            .is_some_and(|first| Some(first.number) < guidance.number())
        {
            path.pop_front();
        }
        if guidance.at_rest() && path.after(guidance.number().unwrap_or(0)).next().is_none() {
            return nearest_m;
        }
    }
    panic!("the point never rests: {guidance:?}");
}

#[test]
fn random_paths_pass_every_waypoint_within_its_radius_and_stop_at_the_last() {
    for seed in 0..60 {
        let mut random = Random::new(seed, 0);
        let count = 1 + (random.next_u64() % 16) as usize;
        // Some paths have legs shorter than the corners would like.
        let spread_m = if seed % 2 == 0 { 60.0 } else { 2.0 };
        let points: Vec<Vector> = (0..count)
            .map(|_| {
                let mut along = || (random.uniform() - 0.5) * spread_m;
                Vector::new(along(), along(), 40.0 + along())
            })
            .collect();
        let mut path = PathBuffer::default();
        for point in &points {
            path.push(*point).unwrap();
        }
        let mut guidance = Guidance::at(Vector::new(0.0, 0.0, 40.0));
        let nearest_m = fly(&mut guidance, &mut path, &points);
        for (number, miss_m) in nearest_m.iter().enumerate() {
            assert!(
                *miss_m <= 0.25,
                "seed {seed}: {miss_m} m from waypoint {number}"
            );
        }
        assert_eq!(guidance.position_m(), points[count - 1], "seed {seed}");
    }
}

#[test]
fn a_waypoint_appended_at_any_moment_is_flown_without_a_jerk() {
    let points = [Vector::new(20.0, 0.0, 30.0), Vector::new(20.0, 15.0, 32.0)];
    for late_steps in (0..1_200).step_by(17) {
        let mut path = PathBuffer::default();
        path.push(points[0]).unwrap();
        let mut guidance = Guidance::at(Vector::new(0.0, 0.0, 30.0));
        for _ in 0..late_steps {
            guidance.step(&path, &LIMITS);
        }
        path.push(points[1]).unwrap();
        let nearest_m = fly(&mut guidance, &mut path, &points[1..]);
        assert_eq!(nearest_m, [0.0], "appended after {late_steps} steps");
    }
}

#[test]
fn a_missed_waypoint_is_flown_to_again() {
    let points = [Vector::new(10.0, 0.0, 30.0), Vector::new(10.0, 10.0, 30.0)];
    let mut path = PathBuffer::default();
    for point in points {
        path.push(point).unwrap();
    }
    // Nobody takes the first one out of the buffer, as if the helicopter had been blown past it.
    let mut guidance = Guidance::at(Vector::new(0.0, 0.0, 30.0));
    let (mut at_last, mut turned_back) = (false, false);
    for _ in 0..4_000 {
        guidance.step(&path, &LIMITS);
        let away_m = |point: Vector| (guidance.position_m() - point).norm();
        at_last |= away_m(points[1]) == 0.0;
        turned_back |= at_last && away_m(points[0]) < 0.25;
    }
    assert!(turned_back);
}

#[test]
fn braking_stops_straight_ahead_within_the_acceleration() {
    let mut path = PathBuffer::default();
    path.push(Vector::new(100.0, 0.0, 30.0)).unwrap();
    let mut guidance = Guidance::at(Vector::new(0.0, 0.0, 30.0));
    for _ in 0..800 {
        guidance.step(&path, &LIMITS);
    }
    let from_m = guidance.position_m().x;
    path.clear();
    guidance.brake();
    while !guidance.at_rest() {
        guidance.step(&path, &LIMITS);
    }
    let way_m = guidance.position_m().x - from_m;
    let expected_m = 8.0_f64.powi(2) / (2.0 * HORIZONTAL_ACCELERATION_MPS2);
    assert!((way_m - expected_m).abs() < 0.1, "{way_m}");
}

#[test]
fn a_landing_flares_and_goes_on_to_below_the_ground() {
    let mut guidance = Guidance::at(Vector::new(3.0, 4.0, 10.0));
    guidance.land();
    let path = PathBuffer::default();
    let mut before_m = 10.0;
    for _ in 0..2_000 {
        guidance.step(&path, &LIMITS);
        let position_m = guidance.position_m();
        let sink_mps = (before_m - position_m.z) / STEP_S;
        assert!(
            sink_mps <= LIMITS.climb_mps + 1e-6,
            "{sink_mps} at {position_m:?}"
        );
        if position_m.z < FLARE_HEIGHT_M {
            assert!(sink_mps <= TOUCH_DOWN_MPS + 0.05, "{sink_mps}");
        }
        assert_eq!((position_m.x, position_m.y), (3.0, 4.0));
        before_m = position_m.z;
    }
    assert_eq!(before_m, -LANDING_DEPTH_M);
}
