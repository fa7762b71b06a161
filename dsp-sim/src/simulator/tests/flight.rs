//! What a script does to the helicopter, as the status reports it.

use dsp_protocol::Status;
use dsp_protocol::downlink::{GpsVelocity, Supply, Xy};

use super::*;
use crate::faults::{Fault, Times};

fn second(count: u64) -> Duration {
    Duration::from_secs(count)
}

/// Without noise, so that two statuses can be compared.
fn quiet(faults: Vec<Fault>) -> Setup {
    let mut setup = Setup {
        faults: Some(Script { seed: 1, faults }),
        ..setup(115_200)
    };
    setup.model.noise_level = 0.0;
    setup
}

fn event(at: Duration, event: HelicopterEvent) -> Fault {
    Fault::Helicopter {
        times: Times::once(at),
        event,
    }
}

impl Pc {
    /// The first status at or after `at`.
    fn status_at(&mut self, at: Duration) -> Status {
        loop {
            let messages = self.jump();
            if self.simulator.now() < at {
                continue;
            }
            for message in messages {
                if let Downlink::Status(status) = message {
                    return status;
                }
            }
        }
    }

    fn supply(&mut self) -> Supply {
        let now = self.simulator.now();
        self.status_at(now).supply.unwrap()
    }

    /// A helicopter that flies to a waypoint 200 m away.
    fn on_its_way(setup: Setup) -> Pc {
        let mut pc = Pc::new(setup);
        pc.start_up();
        pc.write(port::TAKE_OFF, 1);
        while pc.simulator.is_taking_off() {
            pc.jump();
        }
        let home = Setup::default().model.home;
        pc.send(&bytes_of(Uplink::Waypoint(Waypoint {
            latitude_deg: home.latitude_deg + 1.8e-3,
            longitude_deg: home.longitude_deg,
            altitude_m: home.altitude_m + 10.0,
        })));
        let sent = pc.simulator.now();
        pc.status_at(sent + second(5));
        assert!(pc.speed_mps() > 3.0);
        pc
    }

    fn speed_mps(&self) -> f64 {
        self.simulator.helicopter().body().velocity_mps.norm()
    }

    /// The flow control messages of the next second.
    fn requests(&mut self) -> Vec<FlowControl> {
        let end = self.simulator.now() + second(1);
        let mut requests = Vec::new();
        while self.simulator.now() < end {
            for message in self.jump() {
                if let Downlink::FlowControl(request) = message {
                    requests.push(request);
                }
            }
        }
        requests
    }
}

#[test]
fn while_the_pilot_flies_the_helicopter_rests_and_the_path_stays() {
    let mut pc = Pc::on_its_way(quiet(vec![]));
    pc.simulator.set_pilot_switch(PilotSwitch::Manual);
    assert_eq!(pc.supply().auto_switch, 0);
    let taken_over = pc.simulator.now();
    pc.status_at(taken_over + second(10));
    assert!(pc.speed_mps() < 0.3, "{}", pc.speed_mps());
    assert_eq!(pc.simulator.held_waypoints(), 1);
    assert!(!pc.requests().contains(&FlowControl::Send));
    // The DSP does not begin a movement either.
    pc.write(port::LAND, 1);
    assert_eq!(pc.simulator.dsp().errors().len(), 1);
    assert!(!pc.simulator.is_landing());

    pc.simulator.set_pilot_switch(PilotSwitch::Auto);
    assert_eq!(pc.supply().auto_switch, 1);
    pc.until(Phase::Hovering);
    assert_eq!(
        pc.simulator.helicopter().arrived(),
        1,
        "the path is flown on"
    );
    assert!(pc.requests().contains(&FlowControl::Send));
}

#[test]
fn a_path_that_is_invalidated_while_the_pilot_flies_is_gone_afterwards() {
    let mut pc = Pc::on_its_way(quiet(vec![]));
    pc.simulator
        .apply_to_helicopter(HelicopterEvent::PilotTakesOver(second(5)));
    pc.order(Command::InvalidatePath);
    assert_eq!(pc.simulator.held_waypoints(), 0);
    let invalidated = pc.simulator.now();
    pc.status_at(invalidated + second(20));
    assert_eq!(pc.supply().auto_switch, 1, "the pilot gave it back");
    assert_eq!(pc.simulator.helicopter().phase(), Phase::Hovering);
    assert_eq!(pc.simulator.helicopter().arrived(), 0);
}

#[test]
fn a_take_off_goes_on_when_the_pilot_takes_over_and_none_begins_in_his_hands() {
    let mut pc = Pc::new(quiet(vec![
        event(second(2), HelicopterEvent::PilotTakesOver(second(60))),
        event(second(90), HelicopterEvent::PilotTakesOver(second(60))),
    ]));
    pc.start_up();
    pc.write(port::TAKE_OFF, 1);
    pc.until(Phase::Hovering);
    assert!(pc.simulator.now() < second(60));
    assert!(pc.simulator.is_taking_off(), "flow control does not say 1");
    pc.status_at(second(63));
    assert!(!pc.simulator.is_taking_off());
    pc.write(port::LAND, 1);
    pc.until(Phase::OnGround);
    assert!(pc.simulator.now() < second(90));
    pc.status_at(second(91));
    pc.write(port::TAKE_OFF, 1);
    assert_eq!(pc.simulator.dsp().errors().len(), 1);
    pc.status_at(second(151));
    assert_eq!(pc.supply().auto_switch, 1, "on the ground as well");
    pc.write(port::TAKE_OFF, 1);
    assert!(pc.simulator.is_taking_off());
}

#[test]
fn battery_and_fuel_fall_to_what_the_script_says() {
    let mut pc = Pc::new(quiet(vec![
        event(second(2), HelicopterEvent::BatteryLow { volts: 20.5 }),
        event(second(3), HelicopterEvent::FuelLow { percent: 7.0 }),
    ]));
    pc.start_up();
    let mut supply = |at| {
        let supply = pc.status_at(second(at)).supply.unwrap();
        (supply.battery_mv, supply.fuel_percent)
    };
    assert_eq!(supply(1), (25_200, 100));
    assert_eq!(supply(2), (20_500, 100));
    assert_eq!(supply(4), (20_500, 7));
}

#[test]
fn the_altitude_of_the_gps_drifts_and_the_helicopter_flies_as_before() {
    let drift = HelicopterEvent::GpsAltitudeDrift {
        rate_mps: 0.5,
        length: second(4),
    };
    let fly = |faults| {
        let mut pc = Pc::new(quiet(faults));
        pc.start_up();
        pc.write(port::TAKE_OFF, 1);
        let at = [1, 3, 20].map(|at| pc.status_at(second(at)).geographic.unwrap().altitude_m);
        (at, pc.simulator.helicopter().body().position_m)
    };
    let (without, with) = (fly(vec![]), fly(vec![event(second(1), drift)]));
    assert_eq!(without.1, with.1);
    let errors: Vec<i32> = std::iter::zip(with.0, without.0)
        .map(|(with, without)| (100.0 * (with - without)).round() as i32)
        .collect();
    // The first status of the second may come up to a period after its beginning.
    assert!((0..=1).contains(&errors[0]), "{errors:?}");
    assert!((99..=102).contains(&errors[1]), "{errors:?}");
    assert_eq!(errors[2], 200);
}

#[test]
fn the_fix_is_lost_for_a_time() {
    let mut pc = Pc::new(quiet(vec![event(
        second(2),
        HelicopterEvent::LoseFix(second(3)),
    )]));
    pc.start_up();
    assert_eq!(pc.status_at(second(1)).gps_quality, Some(4));
    let lost = pc.status_at(second(3));
    assert_eq!(lost.gps_quality, Some(0));
    assert_eq!(lost.xy, Some(Xy::default()));
    assert_eq!(lost.gps_velocity, Some(GpsVelocity::default()));
    assert_eq!(pc.status_at(second(5)).gps_quality, Some(4));
}
