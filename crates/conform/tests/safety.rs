//! Nothing that can move a rotor is sent unless its proof is given.

use conform::permitted::{MotionWatch, moves};
use conform::report::Ended;
use dsp_protocol::{Command, DecodeError, Decoded, Decoder, Profile, Uplink};
use dsp_sim::simulator::{Setup, Simulator};

use crate::dsp::Dsp;
use crate::fault::{Fault, mutants};
use crate::harness::{everything, in_a_climb, play};

/// What moves a rotor, as a right decoder of the profile sees it.
fn moving(profile: Profile, sent: &[u8]) -> Vec<Uplink> {
    let is_moving = |message: &Uplink| match message {
        Uplink::Waypoint(_) => true,
        Uplink::Command(Command::Following { on }) => *on,
        Uplink::Command(Command::Write16 { port, .. } | Command::Write32 { port, .. }) => {
            moves(*port)
        }
        Uplink::Command(_) => false,
    };
    let mut found = decoded(profile, sent);
    found.retain(is_moving);
    found
}

/// What a right decoder of the profile sees.
fn decoded(profile: Profile, sent: &[u8]) -> Vec<Uplink> {
    let mut decoder = Decoder::<Uplink>::with_profile(profile);
    let (mut rest, mut found) = (sent, Vec::new());
    while !rest.is_empty() {
        let (taken, decoded) = decoder.receive(rest);
        rest = &rest[taken..];
        if let Decoded::Message(got) = decoded {
            found.push(got.message);
        }
    }
    found
}

#[test]
fn without_the_proof_no_frame_of_a_whole_run_moves_a_rotor() {
    for profile in Profile::ALL {
        let mut settings = everything(profile, 115_200);
        settings.proof = None;
        let mut peer = Simulator::new(Setup {
            profile,
            ..Setup::default()
        });
        let played = play(&mut peer, settings);
        assert!(played.report.totals().kept > 80);
        assert!(played.sent.len() > 5_000);
        // In neither profile, whatever the check fields.
        for profile in Profile::ALL {
            assert_eq!(moving(profile, &played.sent), []);
        }
        assert!(!MotionWatch::default().is_moved_by(&played.sent));
        assert!(!peer.dsp().is_following() && !peer.dsp().was_started_up());
    }
}

#[test]
fn without_the_proof_no_wrong_dsp_is_sent_what_moves_a_rotor() {
    for mutant in mutants() {
        let mut settings = everything(mutant.profile, 115_200);
        settings.proof = None;
        let mut peer = Dsp::new(mutant.profile, 115_200, mutant.fault);
        let sent = play(&mut peer, settings).sent;
        assert!(
            !MotionWatch::default().is_moved_by(&sent),
            "{:?}",
            mutant.fault
        );
    }
}

#[test]
fn with_the_proof_a_run_takes_off() {
    let mut peer = Dsp::new(Profile::Classic, 115_200, Fault::None);
    let played = play(&mut peer, everything(Profile::Classic, 115_200));
    assert!(!moving(Profile::Classic, &played.sent).is_empty());
}

#[test]
fn a_dsp_without_status_is_left_alone_unless_its_rotor_is_disconnected() {
    for profile in Profile::ALL {
        let mut peer = Dsp::new(profile, 115_200, Fault::SendsNoStatus);
        let mut settings = everything(profile, 115_200);
        settings.only = vec!["5.1-read-16".to_owned()];
        settings.proof = None;
        let played = play(&mut peer, settings.clone());
        assert_eq!(played.report.ended_early, Some(Ended::NoStatus));
        settings.proof = everything(profile, 115_200).proof;
        let mut peer = Dsp::new(profile, 115_200, Fault::SendsNoStatus);
        let played = play(&mut peer, settings);
        assert_eq!(played.report.ended_early, None);
    }
}

#[test]
fn a_dsp_that_sends_nothing_right_is_named_by_its_bytes() {
    for profile in Profile::ALL {
        let run = |kit: Profile, fault| {
            let mut peer = Dsp::new(profile, 115_200, fault);
            play(&mut peer, everything(kit, 115_200)).report.ended_early
        };
        let Some(Ended::Garbled(rejected)) = run(profile, Fault::AlwaysSendsWrongCheckField) else {
            panic!("{profile:?}");
        };
        assert_eq!(rejected.error, DecodeError::Checksum);
        let (sent, expected) = match profile {
            Profile::Classic => ("checksum: 0x", "was sent, the sum of the bytes is 0x"),
            Profile::Extended => ("checksum: 0x", "was sent, the CRC of the bytes is 0x"),
        };
        let text = rejected.describe(profile);
        assert!(text.starts_with(sent) && text.contains(expected), "{text}");
        let other = match profile {
            Profile::Classic => Profile::Extended,
            Profile::Extended => Profile::Classic,
        };
        let Some(Ended::Garbled(rejected)) = run(other, Fault::None) else {
            panic!("{profile:?}");
        };
        assert_eq!(rejected.error, DecodeError::OtherProfile);
    }
}

#[test]
fn a_helicopter_that_flies_is_left_alone() {
    for profile in Profile::ALL {
        let mut peer = in_a_climb(profile);
        let mut proof = everything(profile, 115_200);
        proof.only = vec!["8.4-taken".to_owned()];
        let played = play(&mut peer, proof);
        assert_eq!(played.report.ended_early, Some(Ended::Flies));
        assert!(!played.report.conforms());
        assert_eq!(moving(profile, &played.sent), []);
        assert!(played.sent.len() < 400, "{}", played.sent.len());
        let is_write = |message: &Uplink| {
            let write = |command: &Command| matches!(command, Command::Write16 { .. });
            matches!(message, Uplink::Command(command) if write(command))
        };
        let mut sent = decoded(profile, &played.sent);
        sent.retain(is_write);
        assert_eq!(sent, [], "its status period is another PC's");
    }
}
