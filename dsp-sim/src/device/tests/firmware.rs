//! What protects the helicopter from a PC that is gone or does not know of a reboot, and firmware that lacks it.

use super::*;

const FAR: (f64, f64, f64) = (200.0, 0.0, 15.0);

fn odd(firmware: Firmware) -> Harness {
    Harness::with_firmware(Profile::Classic, &[], firmware)
}

/// A helicopter that flies to a waypoint far away, and a DSP with a PC time-out of a second.
fn watched(profile: Profile) -> Harness {
    let mut harness = Harness::in_profile(profile, &[]).start_up().take_off();
    harness.command(write_16(port::PC_TIMEOUT_MS, 1_000));
    harness.waypoint(FAR);
    harness
}

#[test]
fn a_pc_that_is_silent_for_the_time_of_port_10004_leaves_an_empty_path() {
    let mut harness = watched(Profile::Classic);
    assert_eq!(harness.read_16(port::PC_TIMEOUT_MS), 1_000);
    harness.wait(ms(999));
    assert_eq!(harness.helicopter.held_waypoints(), 1);
    harness.wait(ms(1));
    assert_eq!(harness.helicopter.held_waypoints(), 0);
    assert_eq!(harness.dsp.counters().pc_timeouts, 1);
    assert_eq!(harness.errors(), [0_u16; 0], "nothing is reported");
    harness.fly_until(Phase::Hovering);
    assert!(
        harness.helicopter.body().position_m.x < 100.0,
        "on the spot"
    );
    assert!(harness.dsp.is_following(), "the rest stays as it is");
    // Then there is nothing left to stop.
    assert_eq!(harness.dsp.counters().pc_timeouts, 1);
    harness.waypoint(FAR);
    assert_eq!(harness.helicopter.held_waypoints(), 1);
}

#[test]
fn any_valid_message_restarts_the_time_of_the_pc_and_noise_does_not() {
    let mut harness = watched(Profile::Classic);
    for command in [
        Command::Read16 { port: 9 },
        Command::ClearErrors,
        Command::ActivateStatus,
    ] {
        harness.wait(ms(900));
        harness.command(command);
    }
    harness.wait(ms(900));
    // A copy of the newest waypoint is a message too.
    harness.waypoint(FAR);
    harness.wait(ms(900));
    assert_eq!(harness.helicopter.held_waypoints(), 1);
    let mut damaged = Uplink::Command(Command::ClearErrors)
        .encode()
        .as_bytes()
        .to_vec();
    damaged[2] ^= 1;
    harness.bytes(&damaged);
    harness.wait(ms(100));
    assert_eq!(harness.helicopter.held_waypoints(), 0);
}

#[test]
fn a_faster_simulated_clock_gives_the_pc_the_time_of_its_own_clock() {
    let mut harness = watched(Profile::Classic);
    harness.dsp.set_speed(10.0);
    harness.command(Command::ClearErrors);
    harness.wait(ms(9_999));
    assert_eq!(harness.helicopter.held_waypoints(), 1);
    harness.wait(ms(1));
    assert_eq!(harness.helicopter.held_waypoints(), 0);
    // A reboot changes nothing of that.
    let now = harness.now;
    harness.dsp.reboot(now, &mut harness.helicopter);
    let mut harness = harness.start_up();
    harness.command(write_16(port::PC_TIMEOUT_MS, 1_000));
    harness.waypoint(FAR);
    harness.wait(ms(9_999));
    assert_eq!(harness.helicopter.held_waypoints(), 1);
}

#[test]
fn without_a_pc_timeout_the_path_is_flown_to_its_end() {
    for timeout_ms in [None, Some(0)] {
        let mut harness = watched(Profile::Classic);
        match timeout_ms {
            Some(value) => drop(harness.command(write_16(port::PC_TIMEOUT_MS, value))),
            None => harness = Harness::hovering(),
        }
        harness.waypoint(FAR);
        harness.wait(ms(100_000));
        assert_eq!(harness.helicopter.arrived(), 1);
        assert_eq!(harness.dsp.counters().pc_timeouts, 0);
    }
}

#[test]
fn a_pc_that_is_silent_during_take_off_or_landing_ends_neither() {
    let mut harness = Harness::started();
    harness.command(write_16(port::PC_TIMEOUT_MS, 100));
    harness.command(write_16(port::TAKE_OFF, 1));
    harness.finish_take_off();
    harness.command(write_16(port::LAND, 1));
    harness.fly_until(Phase::OnGround);
    assert_eq!(harness.dsp.counters().pc_timeouts, 0);
}

#[test]
fn a_take_off_is_refused_until_following_was_switched_on() {
    let mut harness = Harness::new();
    harness.command(write_16(port::TAKE_OFF, 1));
    assert_eq!(harness.dsp.errors().len(), 1);
    assert_eq!(harness.read_16(port::TAKE_OFF), 0);
    assert!(!harness.dsp.was_started_up());
    harness.command(Command::Following { on: true });
    harness.command(Command::Following { on: false });
    assert!(harness.dsp.was_started_up());
    harness.command(write_16(port::TAKE_OFF, 1));
    assert_eq!(harness.read_16(port::TAKE_OFF), 1);

    // A reboot on the ground forgets it, with the altitude that the PC wrote.
    let mut harness = Harness::started();
    harness.command(write_32(port::TAKE_OFF_ALTITUDE_M, 2.0));
    let now = harness.now;
    harness.dsp.reboot(now, &mut harness.helicopter);
    harness.command(write_16(port::TAKE_OFF, 1));
    assert_eq!(harness.helicopter.phase(), Phase::OnGround);

    let mut classic = odd(Firmware {
        refuses_take_off_before_start_up: false,
        ..Firmware::default()
    });
    classic.command(write_16(port::TAKE_OFF, 1));
    assert_eq!(classic.read_16(port::TAKE_OFF), 1);
}

#[test]
fn a_take_off_lasts_until_the_first_flow_control_that_asks_for_a_waypoint() {
    let mut harness = Harness::started();
    harness.command(write_16(port::FLOW_CONTROL_PERIOD_MS, 1_000));
    harness.command(write_16(port::TAKE_OFF, 1));
    assert_eq!(harness.read_16(port::TAKE_OFF), 1, "at once");
    harness.fly_until(Phase::Hovering);
    assert_eq!(harness.read_16(port::TAKE_OFF), 1, "it hovers");
    // Until then it is a take-off in everything else too.
    harness.waypoint(FAR);
    harness.command(write_16(port::LAND, 1));
    assert_eq!(harness.dsp.errors().len(), 2);
    harness.command(write_16(port::TAKE_OFF, 1));
    assert_eq!(
        harness.dsp.errors().len(),
        2,
        "a repetition changes nothing"
    );
    while !Harness::flow(&harness.wait(ms(10))).contains(&FlowControl::Send) {
        assert_eq!(harness.read_16(port::TAKE_OFF), 1);
    }
    assert_eq!(harness.read_16(port::TAKE_OFF), 0);
    harness.command(write_16(port::TAKE_OFF, 1));
    assert_eq!(harness.errors(), [30], "now it is a take-off in flight");
}

#[test]
fn a_take_off_without_following_lasts_until_it_hovers() {
    let mut harness = Harness::started();
    harness.command(write_16(port::TAKE_OFF, 1));
    harness.command(Command::Following { on: false });
    harness.fly_until(Phase::Hovering);
    assert_eq!(harness.read_16(port::TAKE_OFF), 0);
    harness.command(Command::Following { on: true });
    assert_eq!(harness.read_16(port::TAKE_OFF), 0);
}

#[test]
fn a_firmware_may_begin_a_take_off_late_and_a_reboot_forgets_it() {
    let late = Firmware {
        take_off_delay: ms(50),
        ..Firmware::default()
    };
    let mut harness = odd(late).start_up();
    assert_eq!(
        harness.command(write_16(port::TAKE_OFF, 1)),
        [Downlink::Ack { command: 1 }]
    );
    harness.wait(ms(49));
    harness.command(write_16(port::TAKE_OFF, 1));
    assert_eq!(harness.read_16(port::TAKE_OFF), 0);
    harness.wait(ms(1));
    assert_eq!(harness.read_16(port::TAKE_OFF), 1);
    harness.finish_take_off();
    harness.command(write_16(port::TAKE_OFF, 1));
    assert_eq!(harness.errors(), [30], "in flight, at once");

    let mut harness = odd(late).start_up();
    harness.command(write_16(port::TAKE_OFF, 1));
    let now = harness.now;
    harness.dsp.reboot(now, &mut harness.helicopter);
    harness.wait(ms(1_000));
    assert_eq!(harness.helicopter.phase(), Phase::OnGround);
}

#[test]
fn the_clock_begins_where_it_is_reported_wraps_after_32_bits_and_a_reboot_sets_it_to_zero() {
    let mut harness = odd(Firmware {
        clock_start_ms: u32::MAX - 29,
        ..Firmware::default()
    })
    .start_up();
    let times = |harness: &mut Harness| -> Vec<Option<u32>> {
        let statuses = Harness::statuses(&harness.wait(ms(60)));
        statuses.iter().map(|(_, status)| status.time_ms).collect()
    };
    assert_eq!(
        times(&mut harness),
        [Some(u32::MAX - 9), Some(10), Some(30)]
    );
    let now = harness.now;
    harness.dsp.reboot(now, &mut harness.helicopter);
    let mut harness = harness.start_up();
    assert_eq!(times(&mut harness), [Some(20), Some(40), Some(60)]);
}

#[test]
fn a_port_that_the_firmware_lacks_is_an_unknown_port() {
    let mut harness = odd(Firmware {
        has_pc_timeout: false,
        has_waypoint_count: false,
        ..Firmware::default()
    });
    assert_eq!(harness.read_16(port::WAYPOINT_COUNT), 0);
    assert_eq!(harness.read_16(port::PC_TIMEOUT_MS), 0);
    harness.command(write_16(port::PC_TIMEOUT_MS, 1_000));
    assert_eq!(harness.read_16(port::PC_TIMEOUT_MS), 0);
    assert_eq!(harness.dsp.errors().len(), 4);
    let mut harness = harness.start_up().take_off();
    harness.waypoint(FAR);
    harness.wait(ms(5_000));
    assert_eq!(harness.helicopter.held_waypoints(), 1);
}

#[test]
fn a_status_may_lack_the_time_and_carry_more_than_was_asked() {
    let asked = StatusMask::NONE.with(Group::Time).with(Group::Supply);
    let barometer = StatusMask::NONE.with(Group::Barometer);
    let mut harness = odd(Firmware {
        has_time: false,
        extra_groups: barometer,
        ..Firmware::default()
    });
    harness.command(write_16(port::STATUS_MASK, asked.0));
    harness.command(Command::ActivateStatus);
    let statuses = Harness::statuses(&harness.wait(ms(20)));
    let sent = StatusMask::NONE.with(Group::Supply).with(Group::Barometer);
    assert_eq!(statuses[0].1.mask(), sent);
    assert_eq!(harness.read_16(port::STATUS_MASK), asked.0);
}

#[test]
fn a_mask_may_change_by_itself_and_the_clock_goes_on() {
    let mut harness = Harness::started();
    harness.wait(ms(20));
    harness.dsp.change_mask(StatusMask(0x0401));
    let statuses = Harness::statuses(&harness.wait(ms(20)));
    assert_eq!(statuses[0].1.mask(), StatusMask(0x0401));
    assert_eq!(statuses[0].1.time_ms, Some(40));
    assert_eq!(harness.read_16(port::STATUS_MASK), 0x0401);
}

#[test]
fn the_path_buffer_holds_what_is_not_yet_reached() {
    let mut harness = Harness::hovering();
    assert_eq!(harness.helicopter.held_waypoints(), 0);
    for (count, point) in [(1, (5.0, 0.0, 12.0)), (2, (10.0, 0.0, 12.0))] {
        harness.waypoint(point);
        assert_eq!(harness.helicopter.held_waypoints(), count);
    }
    while harness.helicopter.arrived() < 1 {
        harness.wait(ms(10));
        harness.helicopter.advance(harness.now);
    }
    assert_eq!(harness.helicopter.held_waypoints(), 1);
    harness.fly_until(Phase::Hovering);
    assert_eq!(
        harness.helicopter.held_waypoints(),
        0,
        "it hovers at the last"
    );
}
