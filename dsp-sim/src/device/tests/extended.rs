//! The extended profile (`docs/protocol.md` section 11): numbers, copies, and a PC that speaks the other profile.

use super::*;

fn extended() -> Harness {
    Harness::in_profile(Profile::Extended, &[])
}

fn sequence(number: u8) -> Sequence {
    Sequence::new(number)
}

/// The state of the ports, the helicopter and the errors.
fn state(harness: &Harness) -> (Ports, Phase, usize) {
    let dsp = &harness.dsp;
    (
        dsp.ports().clone(),
        harness.helicopter.phase(),
        dsp.errors().len(),
    )
}

#[test]
fn every_answer_names_its_command_and_the_dsps_own_numbers_have_no_gap() {
    let mut harness = extended().start_up();
    let mut expected = None;
    for (number, command) in [
        (9, Command::Read16 { port: 10_000 }),
        (127, Command::Read32 { port: 20_000 }),
        (0, Command::ClearErrors),
        (5, Command::ClearErrors),
    ] {
        let frame = Uplink::Command(command).encode_in(Profile::Extended, sequence(number));
        let now = harness.now;
        harness
            .dsp
            .receive(now, frame.as_bytes(), &mut harness.helicopter);
        let messages = harness.drain_received();
        let [received] = messages[..] else {
            panic!("{messages:?}");
        };
        assert_eq!(received.acknowledges, Some(sequence(number)), "{command:?}");
        let own = received.sequence.unwrap();
        assert_eq!(own, expected.unwrap_or(own), "{command:?}");
        expected = Some(own.next());
    }
}

#[test]
fn a_whole_flight_is_as_in_the_classic_profile() {
    let fly = |profile| {
        let mut harness = Harness::in_profile(profile, &[18]).start_up().take_off();
        harness.waypoint((20.0, 0.0, 10.0));
        harness.waypoint((20.0, 5.0, 12.0));
        let mut messages = harness.wait(ms(20_000));
        harness.command(write_16(port::LAND, 1));
        messages.extend(harness.wait(ms(20_000)));
        assert_eq!(harness.helicopter.arrived(), 2);
        assert_eq!(harness.helicopter.phase(), Phase::OnGround);
        messages
    };
    assert_eq!(fly(Profile::Extended), fly(Profile::Classic));
}

#[test]
fn a_copy_of_a_command_is_acknowledged_and_not_executed() {
    for command in [
        Command::Read16 { port: 9 },
        Command::Read32 {
            port: port::YAW_GAIN,
        },
        write_16(port::TAKE_OFF, 2),
        write_32(port::YAW_GAIN, f32::NAN),
        Command::InvalidatePath,
    ] {
        let mut harness = extended().start_up();
        let message = Uplink::Command(command);
        let first = harness.numbered(sequence(77), message);
        let once = state(&harness);
        for _ in 0..3 {
            assert_eq!(
                harness.numbered(sequence(77), message),
                first,
                "{command:?}"
            );
        }
        assert_eq!(state(&harness), once, "{command:?}");
        assert_eq!(harness.dsp.counters().command_copies, 3);
        // Under a number of its own it is another command.
        assert_eq!(
            harness.numbered(sequence(78), message),
            first,
            "{command:?}"
        );
        assert_eq!(harness.dsp.counters().command_copies, 3);
    }
}

#[test]
fn the_same_number_with_other_bytes_is_another_command() {
    let mut harness = extended().start_up();
    for period_ms in [50, 60] {
        let command = Uplink::Command(write_16(port::STATUS_PERIOD_MS, period_ms));
        harness.numbered(sequence(1), command);
        let read = harness.dsp.ports().read_16(port::STATUS_PERIOD_MS);
        assert_eq!(read, Some(period_ms));
    }
}

#[test]
fn a_waypoint_is_taken_once_under_its_number_and_again_after_the_path_was_invalidated() {
    let mut harness = extended().start_up().take_off();
    let (here, there) = ((10.0, 0.0, 10.0), (10.0, 10.0, 10.0));
    for (number, point, taken) in [
        (0, here, 1),
        (0, here, 1),
        (0, there, 1),
        (1, there, 2),
        (0, here, 3),
    ] {
        harness.numbered_waypoint(sequence(number), point);
        assert_eq!(
            harness.dsp.counters().waypoints,
            taken,
            "{number}, {point:?}"
        );
    }
    assert_eq!(harness.dsp.counters().waypoint_copies, 2);
    harness.command(Command::InvalidatePath);
    harness.numbered_waypoint(sequence(0), here);
    assert_eq!(harness.dsp.counters().waypoints, 4);
    assert_eq!(harness.errors(), [0_u16; 0]);
}

#[test]
fn a_waypoint_that_was_discarded_may_be_sent_again_under_its_number() {
    let mut harness = extended().start_up();
    let point = (10.0, 0.0, 10.0);
    harness.numbered_waypoint(sequence(3), point);
    assert_eq!(harness.errors(), [30], "on the ground");
    let mut harness = harness.take_off();
    harness.numbered_waypoint(sequence(3), point);
    assert_eq!(harness.dsp.counters().waypoints, 1);
}

#[test]
fn a_dsp_that_has_booted_again_knows_no_copies() {
    let mut harness = extended().start_up();
    let command = Uplink::Command(write_16(port::STATUS_PERIOD_MS, 50));
    harness.numbered(sequence(4), command);
    harness.dsp.reboot(harness.now, &mut harness.helicopter);
    assert_eq!(harness.numbered(sequence(4), command).len(), 1);
    assert_eq!(harness.dsp.counters().command_copies, 0);
    let read = harness.dsp.ports().read_16(port::STATUS_PERIOD_MS);
    assert_eq!(read, Some(50));
}

/// A PC that speaks the profile which the DSP does not.
fn report_of_the_other_profile(profile: Profile) {
    let other = match profile {
        Profile::Classic => Profile::Extended,
        Profile::Extended => Profile::Classic,
    };
    let error = [Downlink::Error(DspErrorCode::UNKNOWN_HEADER)];
    let mut harness = Harness::in_profile(profile, &[]);
    let frame = Uplink::Command(Command::ActivateStatus).encode_in(other, sequence(8));
    assert_eq!(
        harness.bytes(frame.as_bytes()),
        error,
        "at once, without a status"
    );
    for _ in 0..9 {
        harness.wait(ms(100));
        assert_eq!(harness.bytes(frame.as_bytes()), [], "once a second");
    }
    harness.wait(ms(100));
    assert_eq!(harness.bytes(frame.as_bytes()), error);
    let rejections = harness.dsp.counters().rejections;
    assert_eq!(rejections[DecodeError::OtherProfile as usize], 11);
    assert_eq!(harness.dsp.errors().len(), 0, "it is not reported twice");
    assert_eq!(harness.command(Command::ActivateStatus).len(), 1);
}

#[test]
fn a_pc_with_the_other_profile_is_reported_so_at_once_and_once_a_second() {
    report_of_the_other_profile(Profile::Classic);
    report_of_the_other_profile(Profile::Extended);
}

#[test]
fn a_wrong_crc_is_reported_as_a_wrong_checksum_and_padding_as_an_invalid_command() {
    let mut harness = extended().start_up();
    let good = Uplink::Command(Command::ClearErrors).encode_in(Profile::Extended, sequence(60));
    let mut wrong = good.as_bytes().to_vec();
    wrong[1] ^= 1;
    assert_eq!(harness.bytes(&wrong), []);
    // A read with an unused bit of its port set.
    let mut padded = vec![0xB3, 61, 0x70, 0, 0x7F, 0, 0];
    let crc = dsp_protocol::crc32(&padded);
    padded.extend([28, 21, 14, 7, 0].map(|shift| (crc >> shift) as u8 & 0x7F));
    assert_eq!(harness.bytes(&padded), []);
    assert_eq!(harness.errors(), [102, 30]);
}
