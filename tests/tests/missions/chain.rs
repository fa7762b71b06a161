//! The whole chain: what status makes of each sample, compared with what the helicopter truly does.

use dsp_sim::helicopter::Helicopter;
use dsp_sim::helicopter::geodesy::{wrap_degrees, wrap_radians};
use ipc_types::payload::{DspTelemetry, HeroTelemetry, StatusJournal};
use ipc_types::{MonotonicNs, TelemetryGroup};
use status::config::Config;
use status::core::{Input, InputCounts, Output, Status};
use status::estimator::config::{EstimatorConfig, EstimatorKind};
use status::journal::Journaled;
use status::log::Logs;

use crate::missions::recording::{Recording, writer};

/// Below this speed a GPS receiver keeps the course that it had, m/s.
const COURSE_SPEED_MPS: f64 = 0.25;
/// Height above which the sonar's converter stays at its greatest value, m.
const SONAR_RANGE_M: f64 = 10.0;

impl Drop for Chain {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            self.recording.process_gone(self.status.writer());
        }
    }
}

/// Status' core behind the bridge, with an estimator.
pub struct Chain {
    status: Journaled,
    recording: Recording<StatusJournal>,
    counts: InputCounts,
    pub latest: Option<HeroTelemetry>,
    /// Samples that were compared.
    pub compared: u64,
}

impl Chain {
    pub fn new(is_recorded: bool) -> Chain {
        let config = Config {
            estimator: EstimatorConfig {
                kind: EstimatorKind::Altitude,
                ..EstimatorConfig::default()
            },
            ..Config::default()
        };
        let calibration = config.calibration.clone();
        let mut status = Status::new(calibration, Logs::default(), MonotonicNs(1));
        if let Some(estimator) = config.estimator.build() {
            status = status.with_estimator(estimator);
        }
        Chain {
            status: Journaled::new(status, &config, writer::<StatusJournal>(is_recorded)),
            recording: Recording::default(),
            counts: InputCounts::default(),
            latest: None,
            compared: 0,
        }
    }

    /// Where its journal goes.
    pub fn recording(&mut self) -> &mut Recording<StatusJournal> {
        &mut self.recording
    }

    /// Verifies what is left of the journal.
    pub fn finish(&mut self) {
        self.recording.process_gone(self.status.writer());
    }

    /// Translates the next sample.
    pub fn take(&mut self, sample: &DspTelemetry, now: MonotonicNs) {
        let Some(Output::Telemetry(hero)) = self.status.apply(now, Input::Sample(*sample)) else {
            panic!("a sample without a translation");
        };
        self.status.apply(now, Input::Published(Ok(())));
        self.counts.received += 1;
        self.status.apply(now, Input::Step(self.counts));
        self.status.apply(now, Input::State { always: false });
        self.status.take_events();
        self.recording.take(self.status.writer(), now);
        assert_eq!(hero.source_sequence, sample.sequence);
        for group in TelemetryGroup::ALL {
            assert_eq!(hero.valid(group), sample.valid(group), "{group:?}");
        }
        assert_eq!(hero.received(), sample.received());
        if let Some(last) = &self.latest {
            assert_eq!(hero.source_sequence, last.source_sequence + 1);
        }
        self.latest = Some(hero);
    }

    /// Compares the latest sample to the truth. Each tolerance is a little more than half a step on the wire.
    pub fn compare(&mut self, helicopter: &Helicopter) {
        let Some(hero) = &self.latest else {
            return;
        };
        self.compared += 1;
        let mut differences = Vec::new();
        let mut check = |group, tolerance: f64, values: &[(&str, f64, f64)]| {
            for (what, seen, truth) in values.iter().filter(|_| hero.valid(group)) {
                if seen.is_nan() || (seen - truth).abs() > tolerance {
                    differences.push(format!("{what}: {seen} instead of {truth}"));
                }
            }
        };
        use TelemetryGroup as G;
        let (body, position) = (helicopter.body(), helicopter.position());
        let height_m = body.position_m.z;
        let east_of =
            wrap_degrees(hero.geodetic.longitude_rad.to_degrees() - position.longitude_deg);
        let latitude = position.latitude_deg.to_radians();
        let angles = [
            ("latitude", hero.geodetic.latitude_rad, latitude),
            ("longitude off by", east_of.to_radians(), 0.0),
        ];
        check(G::Geographic, 1e-9, &angles);
        let altitude = ("altitude", hero.geodetic.altitude_m, position.altitude_m);
        check(G::Geographic, 6e-4, &[altitude]);
        // Its origin is the first fix, which without noise is the home.
        let flat = [
            ("east", hero.local.east_m, body.position_m.x),
            ("north", hero.local.north_m, body.position_m.y),
        ];
        check(G::Xy, 1e-3, &flat);

        let (velocity, truth) = (&hero.velocity, body.velocity_mps);
        let ground_speed = truth.horizontal_norm();
        let speeds = [
            ("up", velocity.up_mps.into(), truth.z),
            (
                "ground speed",
                velocity.ground_speed_mps.into(),
                ground_speed,
            ),
        ];
        check(G::GpsVelocity, 6e-3, &speeds);
        if ground_speed > COURSE_SPEED_MPS {
            let course = wrap_radians(f64::from(velocity.course_rad) - truth.x.atan2(truth.y));
            check(G::GpsVelocity, 1e-4, &[("course off by", course, 0.0)]);
            let horizontal = [
                ("velocity east", velocity.east_mps.into(), truth.x),
                ("velocity north", velocity.north_mps.into(), truth.y),
            ];
            check(G::GpsVelocity, 1e-2, &horizontal);
        }

        let (attitude, truth) = (&hero.attitude, &body.angles);
        let yaw_off = wrap_radians(f64::from(attitude.yaw_rad) - truth.yaw);
        let angles = [
            ("roll", attitude.roll_rad.into(), truth.roll),
            ("pitch", attitude.pitch_rad.into(), truth.pitch),
            ("yaw off by", yaw_off, 0.0),
        ];
        check(G::Attitude, 1e-4, &angles);
        let (rate, truth) = (&hero.angular_rate, &body.rates_radps);
        let rates = [
            ("rolling", rate.forward_radps.into(), truth.forward),
            ("pitching", rate.right_radps.into(), truth.right),
            ("yawing", rate.down_radps.into(), truth.down),
        ];
        check(G::AngularRate, 6e-4, &rates);
        let (force, truth) = (&hero.acceleration, body.specific_force_mps2());
        let forces = [
            ("force forward", force.forward_mps2.into(), truth.forward),
            ("force right", force.right_mps2.into(), truth.right),
            ("force down", force.down_mps2.into(), truth.down),
        ];
        check(G::Acceleration, 6e-3, &forces);

        if height_m < SONAR_RANGE_M {
            let sonar = ("sonar", hero.sonar_height_m.into(), height_m);
            check(G::Sonar, 1.3e-3, &[sonar]);
        }
        let altitude = hero.barometer_altitude_m.into();
        check(
            G::Barometer,
            0.126,
            &[("barometer", altitude, position.altitude_m)],
        );
        let speed_radps = body.rotor_rpm * std::f64::consts::TAU / 60.0;
        check(
            G::RotorSpeed,
            0.06,
            &[("rotor", hero.rotor_radps.into(), speed_radps)],
        );
        // On the ground nothing is aimed at.
        if helicopter.is_flying() {
            let above = f64::from(hero.references.altitude_m) - position.altitude_m;
            let reference = helicopter.reference().position_m.z - height_m;
            check(
                G::References,
                2e-3,
                &[("reference altitude", above, reference)],
            );
        }
        let supply = &hero.supply;
        check(
            G::Supply,
            0.0,
            &[("switch", supply.auto_switch.into(), 1.0)],
        );
        check(
            G::Supply,
            0.5,
            &[("fuel", supply.fuel_fraction.into(), 0.5)],
        );
        let flying = u32::from(helicopter.is_flying());
        assert_eq!(hero.flying, flying);
        assert!(differences.is_empty(), "{differences:#?} in {hero:?}");
    }
}
