//! What depends on what the helicopter does: movements, waypoints, flow control, reboot.

use super::*;

#[test]
fn reading_a_port_never_consumes_it() {
    let mut harness = Harness::hovering();
    harness.command(write_16(port::LAND, 1));
    for _ in 0..3 {
        for (port, value) in [(port::LAND, 1), (port::TAKE_OFF, 0), (port::STATUS_MASK, 1)] {
            let answer = harness.command(Command::Read16 { port });
            assert_eq!(answer, [Downlink::Ack16 { command: 0, value }]);
        }
        let port = port::TAKE_OFF_ALTITUDE_M;
        let answer = harness.command(Command::Read32 { port });
        assert_eq!(
            answer,
            [Downlink::Ack32 {
                command: 2,
                value: 10.0
            }]
        );
    }
}

#[test]
fn take_off_and_landing_read_1_while_they_last() {
    let mut harness = Harness::started();
    let read =
        |harness: &mut Harness| [port::TAKE_OFF, port::LAND].map(|port| harness.read_16(port));
    assert_eq!(read(&mut harness), [0, 0]);
    harness.command(write_16(port::TAKE_OFF, 1));
    for phase in [Phase::SpinningUp, Phase::TakingOff] {
        harness.fly_until(phase);
        assert_eq!(read(&mut harness), [1, 0], "{phase:?}");
    }
    harness.finish_take_off();
    assert_eq!(read(&mut harness), [0, 0]);
    harness.command(write_16(port::LAND, 1));
    for phase in [Phase::Landing, Phase::SpinningDown] {
        harness.fly_until(phase);
        assert_eq!(read(&mut harness), [0, 1], "{phase:?}");
    }
    harness.fly_until(Phase::OnGround);
    assert_eq!(read(&mut harness), [0, 0]);
    assert_eq!(harness.errors(), [0_u16; 0]);
}

#[test]
fn movements_that_contradict_each_other_are_error_30_and_change_nothing() {
    let (take_off, land) = (write_16(port::TAKE_OFF, 1), write_16(port::LAND, 1));
    let mut harness = Harness::started();
    harness.command(take_off);
    harness.command(land);
    assert_eq!(harness.errors(), [30], "landing during take-off");
    harness.finish_take_off();
    harness.command(take_off);
    assert_eq!(harness.errors(), [30], "take-off in flight");
    harness.command(land);
    harness.command(take_off);
    assert_eq!(harness.errors(), [30], "take-off during landing");
    harness.fly_until(Phase::OnGround);
    harness.command(land);
    assert_eq!(harness.errors(), [30], "landing on the ground");
}

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
fn flow_control_comes_while_following_is_on_and_asks_while_two_places_are_free() {
    let mut harness = Harness::hovering();
    // On the spot of the first one the helicopter would reach it at once.
    let point = |number: u32| (50.0, 10.0 * f64::from(number), 20.0);
    for number in 0..16_usize {
        let expected = if number <= 14 {
            FlowControl::Send
        } else {
            FlowControl::Stop
        };
        let asked = Harness::flow(&harness.wait(ms(100)));
        assert_eq!(asked, [expected], "with {number} waypoints");
        harness.waypoint(point(number as u32));
    }
    assert_eq!(Harness::flow(&harness.wait(ms(100))), [FlowControl::Stop]);
    harness.waypoint(point(16));
    assert_eq!(harness.errors(), [15]);
    assert_eq!(harness.dsp.counters().waypoints, 16);
    assert_eq!(harness.dsp.counters().waypoints_discarded, 1);

    // The first two that are reached make room again.
    while harness.helicopter.arrived() < 1 {
        harness.wait(ms(100));
    }
    assert_eq!(Harness::flow(&harness.wait(ms(100))), [FlowControl::Stop]);
    while harness.helicopter.arrived() < 2 {
        harness.wait(ms(100));
    }
    assert_eq!(Harness::flow(&harness.wait(ms(100))), [FlowControl::Send]);

    harness.command(Command::InvalidatePath);
    assert_eq!(harness.helicopter.free_places(), 16);
    harness.command(write_16(port::FLOW_CONTROL_PERIOD_MS, 10));
    assert_eq!(Harness::flow(&harness.wait(ms(100))).len(), 10);
    harness.command(Command::Following { on: false });
    assert_eq!(Harness::flow(&harness.wait(ms(500))), []);
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

#[test]
fn waypoints_are_counted_and_a_copy_of_the_newest_is_not_taken() {
    let mut harness = Harness::hovering();
    let count = |harness: &mut Harness| harness.read_16(port::WAYPOINT_COUNT);
    assert_eq!(count(&mut harness), 0x8000);
    let (here, there) = ((10.0, 0.0, 10.0), (10.0, 10.0, 10.0));
    for (point, expected) in [
        (here, 0x8001),
        (here, 0x8001),
        (there, 0x8002),
        (here, 0x8003),
    ] {
        harness.waypoint(point);
        assert_eq!(count(&mut harness), expected, "{point:?}");
    }
    assert_eq!(harness.dsp.counters().waypoint_copies, 1);
    harness.command(write_16(port::WAYPOINT_COUNT, 0));
    assert_eq!(harness.errors(), [30], "it cannot be written");
    assert_eq!(count(&mut harness), 0x8003);
}
