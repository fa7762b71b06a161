//! What protects the helicopter from a PC that is gone or does not know of a reboot, and firmware that lacks it.

use super::*;

const FAR: (f64, f64, f64) = (200.0, 0.0, 15.0);

fn odd(firmware: Firmware) -> Desk {
    Desk::with_firmware(Profile::Classic, &[], firmware)
}

/// A helicopter that flies to a waypoint far away, and a DSP that was told a PC time-out of a second.
fn watched(profile: Profile) -> Desk {
    let mut desk = Desk::in_profile(profile, &[]).start_up().take_off();
    desk.command(write_16(port::PC_TIMEOUT_MS, 1_000));
    desk.waypoint(FAR);
    desk
}

#[test]
fn a_pc_that_is_silent_for_the_time_of_port_10004_leaves_an_empty_path() {
    let mut desk = watched(Profile::Classic);
    assert_eq!(desk.read_16(port::PC_TIMEOUT_MS), 1_000);
    desk.wait(ms(999));
    assert_eq!(desk.helicopter.held_waypoints(), 1);
    desk.wait(ms(1));
    assert_eq!(desk.helicopter.held_waypoints(), 0);
    assert_eq!(desk.dsp.counters().pc_timeouts, 1);
    assert_eq!(desk.errors(), [0_u16; 0], "nothing is reported");
    desk.fly_until(Phase::Hovering);
    assert!(desk.helicopter.body().position_m.x < 100.0, "on the spot");
    assert!(desk.dsp.is_following(), "the rest stays as it is");
    // Then there is nothing left to stop.
    assert_eq!(desk.dsp.counters().pc_timeouts, 1);
    desk.waypoint(FAR);
    assert_eq!(desk.helicopter.held_waypoints(), 1);
}

#[test]
fn any_valid_message_restarts_the_time_of_the_pc_and_noise_does_not() {
    let mut desk = watched(Profile::Classic);
    for command in [
        Command::Read16 { port: 9 },
        Command::ClearErrors,
        Command::ActivateStatus,
    ] {
        desk.wait(ms(900));
        desk.command(command);
    }
    desk.wait(ms(900));
    // A copy of the newest waypoint is a message too.
    desk.waypoint(FAR);
    desk.wait(ms(900));
    assert_eq!(desk.helicopter.held_waypoints(), 1);
    let mut damaged = Uplink::Command(Command::ClearErrors)
        .encode()
        .as_bytes()
        .to_vec();
    damaged[2] ^= 1;
    desk.bytes(&damaged);
    desk.wait(ms(100));
    assert_eq!(desk.helicopter.held_waypoints(), 0);
}

#[test]
fn the_pc_timeout_forgets_the_number_of_the_last_waypoint() {
    let mut desk = watched(Profile::Extended);
    desk.wait(ms(1_000));
    desk.numbered_waypoint(Sequence::FIRST, FAR);
    assert_eq!(desk.dsp.counters().waypoints, 2);
    assert_eq!(desk.dsp.counters().waypoint_copies, 0);
}

#[test]
fn without_a_pc_timeout_the_path_is_flown_to_its_end() {
    for timeout_ms in [None, Some(0)] {
        let mut desk = watched(Profile::Classic);
        match timeout_ms {
            Some(value) => drop(desk.command(write_16(port::PC_TIMEOUT_MS, value))),
            None => desk = Desk::hovering(),
        }
        desk.waypoint(FAR);
        desk.wait(ms(100_000));
        assert_eq!(desk.helicopter.arrived(), 1);
        assert_eq!(desk.dsp.counters().pc_timeouts, 0);
    }
}

#[test]
fn a_pc_that_is_silent_during_take_off_or_landing_ends_neither() {
    let mut desk = Desk::started();
    desk.command(write_16(port::PC_TIMEOUT_MS, 100));
    desk.command(write_16(port::TAKE_OFF, 1));
    desk.finish_take_off();
    desk.command(write_16(port::LAND, 1));
    desk.fly_until(Phase::OnGround);
    assert_eq!(desk.dsp.counters().pc_timeouts, 0);
}

#[test]
fn a_take_off_is_refused_until_following_was_switched_on() {
    let mut desk = Desk::new();
    desk.command(write_16(port::TAKE_OFF, 1));
    assert_eq!(desk.dsp.errors().len(), 1);
    assert_eq!(desk.read_16(port::TAKE_OFF), 0);
    assert!(!desk.dsp.was_started_up());
    desk.command(Command::Following { on: true });
    desk.command(Command::Following { on: false });
    assert!(desk.dsp.was_started_up());
    desk.command(write_16(port::TAKE_OFF, 1));
    assert_eq!(desk.read_16(port::TAKE_OFF), 1);

    // A reboot on the ground forgets it, with the altitude that the PC wrote.
    let mut desk = Desk::started();
    desk.command(write_32(port::TAKE_OFF_ALTITUDE_M, 2.0));
    let now = desk.now;
    desk.dsp.reboot(now, &mut desk.helicopter);
    desk.command(write_16(port::TAKE_OFF, 1));
    assert_eq!(desk.helicopter.phase(), Phase::OnGround);

    let mut classic = odd(Firmware {
        refuses_take_off_before_start_up: false,
        ..Firmware::default()
    });
    classic.command(write_16(port::TAKE_OFF, 1));
    assert_eq!(classic.read_16(port::TAKE_OFF), 1);
}

#[test]
fn a_take_off_lasts_until_the_first_flow_control_that_asks_for_a_waypoint() {
    let mut desk = Desk::started();
    desk.command(write_16(port::FLOW_CONTROL_PERIOD_MS, 1_000));
    desk.command(write_16(port::TAKE_OFF, 1));
    assert_eq!(desk.read_16(port::TAKE_OFF), 1, "at once");
    desk.fly_until(Phase::Hovering);
    assert_eq!(desk.read_16(port::TAKE_OFF), 1, "it hovers");
    // Until then it is a take-off in everything else too.
    desk.waypoint(FAR);
    desk.command(write_16(port::LAND, 1));
    assert_eq!(desk.dsp.errors().len(), 2);
    desk.command(write_16(port::TAKE_OFF, 1));
    assert_eq!(desk.dsp.errors().len(), 2, "a repetition changes nothing");
    while !Desk::flow(&desk.wait(ms(10))).contains(&FlowControl::Send) {
        assert_eq!(desk.read_16(port::TAKE_OFF), 1);
    }
    assert_eq!(desk.read_16(port::TAKE_OFF), 0);
    desk.command(write_16(port::TAKE_OFF, 1));
    assert_eq!(desk.errors(), [30], "now it is a take-off in flight");
}

#[test]
fn a_take_off_without_following_lasts_until_it_hovers() {
    let mut desk = Desk::started();
    desk.command(write_16(port::TAKE_OFF, 1));
    desk.command(Command::Following { on: false });
    desk.fly_until(Phase::Hovering);
    assert_eq!(desk.read_16(port::TAKE_OFF), 0);
    desk.command(Command::Following { on: true });
    assert_eq!(desk.read_16(port::TAKE_OFF), 0);
}

#[test]
fn a_firmware_may_begin_a_take_off_late_and_a_reboot_forgets_it() {
    let late = Firmware {
        take_off_delay: ms(50),
        ..Firmware::default()
    };
    let mut desk = odd(late).start_up();
    assert_eq!(
        desk.command(write_16(port::TAKE_OFF, 1)),
        [Downlink::Ack { command: 1 }]
    );
    desk.wait(ms(49));
    desk.command(write_16(port::TAKE_OFF, 1));
    assert_eq!(desk.read_16(port::TAKE_OFF), 0);
    desk.wait(ms(1));
    assert_eq!(desk.read_16(port::TAKE_OFF), 1);
    desk.finish_take_off();
    desk.command(write_16(port::TAKE_OFF, 1));
    assert_eq!(desk.errors(), [30], "in flight, at once");

    let mut desk = odd(late).start_up();
    desk.command(write_16(port::TAKE_OFF, 1));
    let now = desk.now;
    desk.dsp.reboot(now, &mut desk.helicopter);
    desk.wait(ms(1_000));
    assert_eq!(desk.helicopter.phase(), Phase::OnGround);
}

#[test]
fn the_clock_begins_where_it_is_told_wraps_after_32_bits_and_a_reboot_sets_it_to_zero() {
    let mut desk = odd(Firmware {
        clock_start_ms: u32::MAX - 29,
        ..Firmware::default()
    })
    .start_up();
    let times = |desk: &mut Desk| -> Vec<Option<u32>> {
        let statuses = Desk::statuses(&desk.wait(ms(60)));
        statuses.iter().map(|(_, status)| status.time_ms).collect()
    };
    assert_eq!(times(&mut desk), [Some(u32::MAX - 9), Some(10), Some(30)]);
    let now = desk.now;
    desk.dsp.reboot(now, &mut desk.helicopter);
    let mut desk = desk.start_up();
    assert_eq!(times(&mut desk), [Some(20), Some(40), Some(60)]);
}

#[test]
fn a_port_that_the_firmware_lacks_is_an_unknown_port() {
    let mut desk = odd(Firmware {
        has_pc_timeout: false,
        has_waypoint_count: false,
        ..Firmware::default()
    });
    assert_eq!(desk.read_16(port::WAYPOINT_COUNT), 0);
    assert_eq!(desk.read_16(port::PC_TIMEOUT_MS), 0);
    desk.command(write_16(port::PC_TIMEOUT_MS, 1_000));
    assert_eq!(desk.read_16(port::PC_TIMEOUT_MS), 0);
    assert_eq!(desk.dsp.errors().len(), 4);
    let mut desk = desk.start_up().take_off();
    desk.waypoint(FAR);
    desk.wait(ms(5_000));
    assert_eq!(desk.helicopter.held_waypoints(), 1);
}

#[test]
fn a_status_may_lack_the_time_and_carry_more_than_was_asked() {
    let asked = StatusMask::NONE.with(Group::Time).with(Group::Supply);
    let barometer = StatusMask::NONE.with(Group::Barometer);
    let mut desk = odd(Firmware {
        has_time: false,
        extra_groups: barometer,
        ..Firmware::default()
    });
    desk.command(write_16(port::STATUS_MASK, asked.0));
    desk.command(Command::ActivateStatus);
    let statuses = Desk::statuses(&desk.wait(ms(20)));
    let sent = StatusMask::NONE.with(Group::Supply).with(Group::Barometer);
    assert_eq!(statuses[0].1.mask(), sent);
    assert_eq!(desk.read_16(port::STATUS_MASK), asked.0);
}

#[test]
fn a_mask_may_change_by_itself_and_the_clock_goes_on() {
    let mut desk = Desk::started();
    desk.wait(ms(20));
    desk.dsp.change_mask(StatusMask(0x0401));
    let statuses = Desk::statuses(&desk.wait(ms(20)));
    assert_eq!(statuses[0].1.mask(), StatusMask(0x0401));
    assert_eq!(statuses[0].1.time_ms, Some(40));
    assert_eq!(desk.read_16(port::STATUS_MASK), 0x0401);
}

#[test]
fn the_path_buffer_holds_what_is_not_yet_reached() {
    let mut desk = Desk::hovering();
    assert_eq!(desk.helicopter.held_waypoints(), 0);
    for (count, point) in [(1, (5.0, 0.0, 12.0)), (2, (10.0, 0.0, 12.0))] {
        desk.waypoint(point);
        assert_eq!(desk.helicopter.held_waypoints(), count);
    }
    while desk.helicopter.arrived() < 1 {
        desk.wait(ms(10));
        desk.helicopter.advance(desk.now);
    }
    assert_eq!(desk.helicopter.held_waypoints(), 1);
    desk.fly_until(Phase::Hovering);
    assert_eq!(desk.helicopter.held_waypoints(), 0, "it hovers at the last");
}
