//! What the instruments measure, and that the values fit together.

use super::*;

#[test]
fn a_hover_holds_against_the_strongest_wind_and_feels_nothing_but_gravity() {
    let mut windy = model(5);
    windy.wind.speed_mps = 12.0;
    windy.wind.gust_mps = 1.0;
    let mut flight = Flight::hovering(windy, brisk());
    flight.seconds(5.0);
    let mut force = Vector::ZERO;
    const STEPS: u32 = 2_000;
    for _ in 0..STEPS {
        flight.step();
        let body = flight.helicopter.body();
        assert!((body.position_m - Vector::new(0.0, 0.0, 10.0)).norm() < 0.5);
        let felt = body.specific_force_mps2();
        force += Vector::new(felt.forward, felt.right, felt.down) * (1.0 / f64::from(STEPS));
    }
    // Leaning into the wind turns a part of gravity forward; its length stays.
    assert!((force.norm() - GRAVITY_MPS2).abs() < 0.1, "{force:?}");

    let mut flight = Flight::hovering(calm(), brisk());
    flight.seconds(5.0);
    let felt = flight.helicopter.sense().acceleration.unwrap();
    assert!(
        (felt.z_mps2 + 9.81).abs() < 0.01 && felt.x_mps2.abs() < 0.01,
        "{felt:?}"
    );
}

#[test]
fn what_the_instruments_say_belongs_together() {
    let mut flight = Flight::hovering(calm(), brisk());
    for (x, y) in [(25.0, 10.0), (-5.0, 30.0)] {
        flight.push(Vector::new(x, y, 14.0)).unwrap();
    }
    let first = flight.helicopter.body().clone();
    let (mut way_m, mut change_mps) = (Vector::ZERO, Vector::ZERO);
    while flight.helicopter.phase() != Phase::Hovering {
        let before = flight.helicopter.body().clone();
        flight.step();
        let status = flight.helicopter.sense();
        let after = flight.helicopter.body();

        // Velocity, from speed and course, integrates to the position.
        let velocity = status.gps_velocity.unwrap();
        let (sin, cos) = f64::from(velocity.heading_deg).to_radians().sin_cos();
        let speed_mps = f64::from(velocity.horizontal_speed_mps);
        way_m += Vector {
            x: speed_mps * sin,
            y: speed_mps * cos,
            z: velocity.vertical_speed_mps.into(),
        } * STEP_S;

        // The specific force, turned into the world and without gravity, integrates to the velocity.
        let force = status.acceleration.unwrap();
        let attitude = status.attitude.unwrap();
        let angles = body::Angles {
            roll: f64::from(attitude.roll_deg).to_radians(),
            pitch: f64::from(attitude.pitch_deg).to_radians(),
            yaw: f64::from(attitude.yaw_deg).to_radians(),
        };
        let [forward, right, down] = angles.axes();
        let felt = forward * force.x_mps2.into()
            + right * force.y_mps2.into()
            + down * force.z_mps2.into();
        change_mps += (felt - Vector::new(0.0, 0.0, GRAVITY_MPS2)) * STEP_S;

        // The angular rates are the changes of the attitude.
        let rates = status.angular_rate.unwrap();
        let change = before.angles.change(&body::BodyAxes {
            forward: rates.x_radps.into(),
            right: rates.y_radps.into(),
            down: rates.z_radps.into(),
        });
        let turned = geodesy::wrap_radians(after.angles.yaw - before.angles.yaw);
        assert!((change.roll * STEP_S - (after.angles.roll - before.angles.roll)).abs() < 1e-6);
        assert!((change.pitch * STEP_S - (after.angles.pitch - before.angles.pitch)).abs() < 1e-6);
        assert!((change.yaw * STEP_S - turned).abs() < 1e-6);
    }
    let body = flight.helicopter.body();
    assert!(
        (first.position_m + way_m - body.position_m).norm() < 0.2,
        "{way_m:?}"
    );
    assert!(
        (first.velocity_mps + change_mps - body.velocity_mps).norm() < 0.05,
        "{change_mps:?}"
    );
}

#[test]
fn the_helicopter_lowers_its_nose_to_speed_up_and_looks_where_it_flies() {
    let mut flight = Flight::hovering(calm(), brisk());
    flight.push(Vector::new(0.0, 60.0, 10.0)).unwrap();
    flight.seconds(1.0);
    assert!(
        flight.helicopter.body().angles.pitch < -0.2,
        "nose down to the north"
    );
    flight.until(Phase::Hovering);
    flight.push(Vector::new(60.0, 60.0, 10.0)).unwrap();
    flight.seconds(6.0);
    let yaw_deg = flight.helicopter.body().angles.yaw.to_degrees();
    assert!((yaw_deg - 90.0).abs() < 5.0, "{yaw_deg}");
    let course_deg = flight.helicopter.sense().gps_velocity.unwrap().heading_deg;
    assert!((course_deg - 90.0).abs() < 2.0, "{course_deg}");
}

#[test]
fn the_sensors_have_the_scales_that_the_status_module_knows() {
    let mut flight = Flight::hovering(calm(), brisk());
    flight.push(Vector::new(3.0, 4.0, 8.0)).unwrap();
    flight.until(Phase::Hovering);
    flight.seconds(3.0);
    let status = flight.helicopter.sense();
    let sonar_m = f64::from(status.sonar_adc.unwrap()) * 0.0025;
    assert!((sonar_m - 8.0).abs() < 0.05, "{sonar_m}");
    let barometer_m = (f64::from(status.barometer_adc.unwrap()) - 500.0) * 0.25;
    assert!((barometer_m - 18.0).abs() < 0.2, "{barometer_m}");
    let tilt_rad = (f64::from(status.pan_tilt.unwrap().tilt_adc) - 2048.0)
        * std::f64::consts::FRAC_PI_2
        / 2048.0;
    assert!((tilt_rad + 0.2).abs() < 0.01, "{tilt_rad}");
    let geographic = status.geographic.unwrap();
    assert!((geographic.altitude_m - 18.0).abs() < 0.05);
    let references = status.references.unwrap();
    assert!((references.altitude_m - 18.0).abs() < 0.05);
    assert_eq!(status.rotor_rpm, Some(1_500));
    let actuation = status.actuation.unwrap();
    assert!(
        actuation.collective_us.abs_diff(1_500) < 20,
        "{actuation:?}"
    );
    assert_eq!(actuation.throttle_us, 1_500);
    assert_eq!(status.pilot_pwm.unwrap().tail_us, 1_500);
    let supply = status.supply.unwrap();
    assert!(supply.battery_mv < 25_000 && supply.fuel_percent >= 98 && supply.auto_switch == 1);
    assert!(status.flying);

    // The first fix was read here: the flat origin.
    let xy = status.xy.unwrap();
    assert_eq!((xy.x_m, xy.y_m), (0.0, 0.0));
    flight.push(Vector::new(13.0, 4.0, 15.0)).unwrap();
    flight.until(Phase::Hovering);
    flight.seconds(3.0);
    let status = flight.helicopter.sense();
    let xy = status.xy.unwrap();
    assert!(
        (xy.x_m - 10.0).abs() < 0.05 && xy.y_m.abs() < 0.05,
        "{xy:?}"
    );
    assert_eq!(status.sonar_adc, Some(4_095), "beyond 10.24 m it saturates");
}

#[test]
fn trims_move_the_servos_and_not_the_helicopter() {
    let mut settings = brisk();
    settings.trims.tail_us = -120;
    let mut flight = Flight::hovering(calm(), settings);
    flight.seconds(3.0);
    let actuation = flight.helicopter.sense().actuation.unwrap();
    assert!(actuation.tail_us.abs_diff(1_380) <= 2, "{actuation:?}");
    assert!(flight.helicopter.body().angles.yaw.abs() < 1e-3);
}

#[test]
fn without_a_fix_the_gps_says_so_and_the_first_fix_is_the_origin() {
    let mut model = model(1);
    model.gps_fix_after = Duration::from_secs(4);
    let mut helicopter = Helicopter::new(model, brisk());
    helicopter.advance(Duration::from_millis(3_990));
    let status = helicopter.sense();
    assert_eq!(status.gps_quality, Some(0));
    assert_eq!(
        status.geographic.map(|position| position.latitude_deg),
        Some(0.0)
    );
    helicopter.advance(Duration::from_secs(4));
    let status = helicopter.sense();
    assert_eq!(status.gps_quality, Some(4));
    let xy = status.xy.unwrap();
    assert!(xy.x_m == 0.0 && xy.y_m == 0.0);
    assert!((status.geographic.unwrap().latitude_deg - 37.411).abs() < 1e-5);
}

#[test]
fn the_same_seed_gives_the_same_flight_and_another_one_does_not() {
    let flown = |seed: u64| {
        let mut flight = Flight::hovering(model(seed), brisk());
        flight.push(Vector::new(10.0, 5.0, 12.0)).unwrap();
        flight.until(Phase::Hovering);
        (
            flight.helicopter.now(),
            flight.helicopter.body().position_m,
            flight.helicopter.sense(),
        )
    };
    assert_eq!(flown(3), flown(3));
    assert_ne!(flown(3), flown(4));
}
