//! What depends on what the helicopter does: movements, waypoints, reboot.

use super::*;

#[test]
fn the_take_off_goes_to_the_altitude_of_its_port() {
    let mut harness = Harness::started();
    harness.command(write_32(port::TAKE_OFF_ALTITUDE_M, 3.0));
    harness.command(write_16(port::TAKE_OFF, 1));
    // Too late for the take-off that is under way.
    harness.command(write_32(port::TAKE_OFF_ALTITUDE_M, 50.0));
    harness.fly_until(Phase::Hovering);
    assert!((harness.helicopter.body().position_m.z - 3.0).abs() < 0.3);
}

#[test]
fn waypoints_that_cannot_be_flown_are_error_30() {
    let mut harness = Harness::started();
    harness.waypoint((5.0, 0.0, 10.0));
    assert_eq!(harness.errors(), [30], "on the ground");
    harness.command(write_16(port::TAKE_OFF, 1));
    harness.waypoint((5.0, 0.0, 10.0));
    assert_eq!(harness.errors(), [30], "during take-off");
    harness.finish_take_off();
    for (latitude_deg, longitude_deg, altitude_m) in [
        (90.1, 0.0, 50.0),
        (37.0, -180.1, 50.0),
        (37.0, -6.0, 20_001.0),
        (37.0, -6.0, -1_001.0),
        (37.4, -6.0, 10.2),
    ] {
        let waypoint = Waypoint {
            latitude_deg,
            longitude_deg,
            altitude_m,
        };
        harness.bytes(Uplink::Waypoint(waypoint).encode().as_bytes());
        assert_eq!(harness.errors(), [30], "{waypoint:?}");
    }
    harness.waypoint((30.0, 0.0, 10.0));
    harness.command(Command::Following { on: false });
    assert_eq!(
        harness.helicopter.free_places(),
        16,
        "following off forgets the path"
    );
    harness.waypoint((5.0, 0.0, 10.0));
    assert_eq!(harness.errors(), [30], "with following off");
    harness.command(Command::Following { on: true });
    harness.command(write_16(port::LAND, 1));
    harness.waypoint((5.0, 0.0, 10.0));
    assert_eq!(harness.errors(), [30], "during landing");
    assert_eq!(harness.dsp.counters().waypoints, 1);
}

#[test]
fn invalidating_the_path_during_a_take_off_or_landing_lets_it_go_on() {
    let mut harness = Harness::started();
    harness.command(write_16(port::TAKE_OFF, 1));
    harness.fly_until(Phase::TakingOff);
    harness.command(Command::InvalidatePath);
    harness.finish_take_off();
    assert!((harness.helicopter.body().position_m.z - 10.0).abs() < 0.3);
    harness.command(write_16(port::LAND, 1));
    harness.command(Command::InvalidatePath);
    harness.fly_until(Phase::OnGround);
    assert_eq!(harness.errors(), [0_u16; 0]);
}

#[test]
fn a_reboot_forgets_all_but_the_flight() {
    let mut harness = Harness::with_boot_errors(&[40]);
    harness.command(Command::Following { on: true });
    harness.command(write_32(port::CRUISE_SPEED_MPS, 12.0));
    harness.command(write_16(port::TAKE_OFF, 1));
    harness.finish_take_off();
    harness.command(write_16(port::STATUS_MASK, 1));
    harness.command(Command::ActivateStatus);
    harness.waypoint((60.0, 0.0, 12.0));
    harness.wait(ms(2_000));
    let booted = harness.now;
    harness.dsp.reboot(booted, &mut harness.helicopter);

    assert_eq!(harness.dsp.next_deadline(), None, "silent");
    assert_eq!(harness.drain(), []);
    assert_eq!(*harness.dsp.ports(), Ports::default());
    assert_eq!(*harness.dsp.counters(), Counters::default());
    assert_eq!(harness.helicopter.free_places(), 16);
    assert!(harness.helicopter.is_flying());

    harness.command(write_16(port::STATUS_MASK, 1));
    harness.command(Command::ActivateStatus);
    let messages = harness.wait(ms(20));
    let statuses = Harness::statuses(&messages);
    assert_eq!(statuses[0].1.time_ms, Some(20), "its clock starts at zero");
    assert!(statuses[0].1.flying);
    assert_eq!(messages[1].1, Downlink::Error(DspErrorCode(40)));
}
