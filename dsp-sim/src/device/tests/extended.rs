//! The extended profile (`docs/protocol.md` section 11).

use super::*;

fn extended() -> Harness {
    Harness::in_profile(Profile::Extended, &[])
}

fn sequence(number: u8) -> Sequence {
    Sequence::new(number)
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
