//! Right DSPs: the simulator of this repository, and the small one of these tests.

use std::num::NonZeroU32;

use dsp_protocol::Profile;
use dsp_sim::device::firmware::Firmware;
use dsp_sim::simulator::{Setup, Simulator};

use crate::dsp::Dsp;
use crate::fault::Fault;
use crate::harness::{Played, broken, everything, not_judged, play};

fn simulator(profile: Profile, baud: u32, firmware: Firmware) -> Simulator {
    Simulator::new(Setup {
        profile,
        firmware,
        baud: NonZeroU32::new(baud),
        ..Setup::default()
    })
}

#[track_caller]
fn conforms(played: &Played, may_be_open: &[&str]) {
    let broken = broken(&played.report);
    assert!(broken.is_empty(), "broken:\n{}", broken.join("\n"));
    assert_eq!(played.report.ended_early, None);
    let open = not_judged(&played.report);
    let open: Vec<&String> = open
        .iter()
        .filter(|one| !may_be_open.iter().any(|id| one.starts_with(id)))
        .collect();
    assert!(open.is_empty(), "not judged: {open:#?}");
    assert!(played.report.conforms());
}

#[test]
fn the_simulator_conforms_in_both_profiles_at_9600_and_115200_baud() {
    for profile in Profile::ALL {
        for baud in [9_600, 115_200] {
            let mut peer = simulator(profile, baud, Firmware::default());
            let played = play(&mut peer, everything(profile, baud));
            conforms(&played, &["8.3-clock-wraps"]);
            assert!(played.report.totals().kept > 120, "{profile:?} {baud}");
        }
    }
}

#[test]
fn the_small_dsp_conforms_in_both_profiles_at_9600_and_115200_baud() {
    for profile in Profile::ALL {
        for baud in [9_600, 115_200] {
            let mut peer = Dsp::new(profile, baud, Fault::None);
            let played = play(&mut peer, everything(profile, baud));
            conforms(&played, &["8.3-clock-wraps"]);
        }
    }
}

#[test]
fn the_wrap_of_a_clock_that_is_near_its_end_is_judged() {
    for profile in Profile::ALL {
        let firmware = Firmware {
            clock_start_ms: u32::MAX - 15_000,
            ..Firmware::default()
        };
        let mut peer = simulator(profile, 115_200, firmware);
        let mut settings = everything(profile, 115_200);
        settings.only = vec!["8.3-clock-wraps".to_owned()];
        conforms(&play(&mut peer, settings), &[]);
    }
}

#[test]
fn a_classic_dsp_conforms_without_the_ports_that_it_may_lack() {
    let firmware = Firmware {
        has_pc_timeout: false,
        has_waypoint_count: false,
        ..Firmware::default()
    };
    let mut peer = simulator(Profile::Classic, 115_200, firmware);
    let played = play(&mut peer, everything(Profile::Classic, 115_200));
    // Whether a waypoint is taken cannot be seen without port 10003.
    let open = [
        "8.4",
        "8.8",
        "9-",
        "6-read-only",
        "6-port-10004",
        "8.3-clock-wraps",
        "8.5-landing",
    ];
    let broken = broken(&played.report);
    assert!(broken.is_empty(), "broken:\n{}", broken.join("\n"));
    for one in not_judged(&played.report) {
        assert!(open.iter().any(|id| one.starts_with(id)), "{one}");
    }
}

#[test]
fn the_ports_are_as_they_were_found() {
    let mut peer = simulator(Profile::Classic, 115_200, Firmware::default());
    let before = peer.dsp().ports().clone();
    let mut settings = everything(Profile::Classic, 115_200);
    settings.can_reset = false;
    play(&mut peer, settings);
    assert_eq!(*peer.dsp().ports(), before);
    assert!(!peer.dsp().is_following());
    assert_eq!(
        peer.helicopter().phase(),
        dsp_sim::helicopter::Phase::OnGround
    );
}
