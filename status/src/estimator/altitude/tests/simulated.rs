//! The simulated helicopter takes off, flies a path and lands; what its sensors say is what the estimator gets.

use std::time::Duration;

use dsp_sim::device::ports::Ports;
use dsp_sim::helicopter::vector::Vector;
use dsp_sim::helicopter::{Helicopter, Phase};
use dsp_sim::simulator::Setup;

use super::*;

/// What the sensors say of the helicopter, as the bridge publishes it.
fn sense(helicopter: &mut Helicopter, index: u32) -> DspTelemetry {
    let seen = helicopter.sense();
    let mut raw = sample(index);
    raw.flying = u8::from(seen.flying);
    raw.gps_quality = seen.gps_quality.unwrap();
    let position = seen.geographic.unwrap();
    raw.geographic = DspGeographic {
        latitude_deg: position.latitude_deg,
        longitude_deg: position.longitude_deg,
        altitude_m: position.altitude_m,
    };
    let velocity = seen.gps_velocity.unwrap();
    raw.gps_velocity = DspGpsVelocity {
        horizontal_speed_mps: velocity.horizontal_speed_mps,
        vertical_speed_mps: velocity.vertical_speed_mps,
        heading_deg: velocity.heading_deg,
    };
    raw.sonar_adc = seen.sonar_adc.unwrap().into();
    raw.barometer_adc = seen.barometer_adc.unwrap().into();
    raw
}

#[test]
fn over_a_simulated_mission_the_estimate_is_nearer_to_the_truth_than_the_gps() {
    let (mut estimate_m2, mut gps_m2, mut samples, mut inside) = (0.0, 0.0, 0_u32, 0_u32);
    for seed in 0..4 {
        let mut model = Setup::default().model;
        model.seed = seed;
        let mut helicopter = Helicopter::new(model, Ports::default().settings());
        let mut estimator = estimator();
        helicopter.take_off().unwrap();
        let mut legs = [(20.0, 0.0, 30.0), (20.0, 25.0, 6.0), (0.0, 0.0, 15.0)].iter();
        for index in 0.. {
            assert!(index < 60_000, "it never lands");
            helicopter.advance(Duration::from_millis(20) * index);
            let raw = sense(&mut helicopter, index);
            let estimate = feed(&mut estimator, &raw);
            let truth_m = helicopter.position().altitude_m;
            if estimate.valid == 1 {
                let error_m2 = (estimate.altitude_m - truth_m).powi(2);
                samples += 1;
                inside += u32::from(error_m2 <= 9.0 * estimate.altitude_variance_m2);
                estimate_m2 += error_m2;
                gps_m2 += (raw.geographic.altitude_m - truth_m).powi(2);
            }
            if helicopter.phase() == Phase::Hovering {
                match legs.next() {
                    Some(&(x, y, z)) => {
                        let waypoint = helicopter.world().to_geographic(Vector::new(x, y, z));
                        helicopter.push_waypoint(waypoint).unwrap();
                    }
                    None => helicopter.land().unwrap(),
                }
            } else if helicopter.phase() == Phase::OnGround && legs.len() == 0 {
                break;
            }
        }
    }
    let rms_m = |sum_m2: f64| (sum_m2 / f64::from(samples)).sqrt();
    let (estimate_m, gps_m) = (rms_m(estimate_m2), rms_m(gps_m2));
    let inside = f64::from(inside) / f64::from(samples);
    println!(
        "estimate {estimate_m:.4} m, GPS {gps_m:.4} m, inside 3 sigma {inside:.5}, {samples} samples"
    );
    assert!(estimate_m < 0.7 * gps_m, "{estimate_m} m, GPS {gps_m} m");
    assert!(inside > 0.99, "{inside} inside 3 sigma");
}
