//! Dialogues that are played again.

use std::fs;
use std::path::Path;

use conform::permitted::MotionWatch;
use conform::replay::{Dialogue, Replay, ReplayError};
use conform::report::{Ended, Line, Side, Verdict};
use conform::run::Player;
use dsp_protocol::Profile;

use crate::dsp::Dsp;
use crate::fault::Fault;
use crate::harness::{Peer, everything, in_a_climb, play, serve};

fn replayed(text: &str, fault: Fault, may_move: bool) -> (Vec<Line>, Vec<u8>, bool) {
    let dialogue = Dialogue::parse(text).expect("a dialogue");
    let profile = dialogue.profile;
    let setup = everything(profile, 115_200).setup;
    let mut replay = Replay::new(dialogue, setup, may_move);
    let mut peer = Dsp::new(profile, 115_200, fault);
    let (sent, _) = serve(&mut replay, &mut peer, |_, _, _| {});
    assert!(replay.is_finished());
    (replay.lines(), sent, replay.was_refused())
}

#[test]
fn the_dialogue_of_a_broken_sentence_shows_the_fault_again_and_its_mending() {
    for profile in Profile::ALL {
        let fault = Fault::TakesBeyond(10_002);
        let mut settings = everything(profile, 115_200);
        settings.only = vec!["6-port-10002".to_owned()];
        let mut peer = Dsp::new(profile, 115_200, fault);
        let report = play(&mut peer, settings).report;
        let check = report.checks.first().expect("one check");
        assert!(matches!(check.verdict, Verdict::Broken { .. }));
        let vector = check.vector(profile);
        let errors = |fault| {
            let (lines, _, refused) = replayed(&vector, fault, false);
            assert!(!refused);
            let is_error = |line: &&Line| line.text.starts_with("DSP error 30");
            lines.iter().filter(is_error).count()
        };
        // The DSP has just booted: the dialogue brings it to where the check began.
        assert_eq!(errors(fault), 0);
        assert_eq!(errors(Fault::None), 1);
    }
}

#[test]
fn the_dialogues_of_the_protocol_can_be_played_and_move_nothing_without_the_proof() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../dsp-protocol/vectors/dialogues");
    let mut played = 0;
    for file in fs::read_dir(folder).expect("the folder") {
        let text = fs::read_to_string(file.expect("a file").path()).expect("a text");
        let (lines, sent, _) = replayed(&text, Fault::None, true);
        assert!(!sent.is_empty());
        assert!(lines.iter().any(|line| line.side == Side::Dsp));
        let (_, sent, refused) = replayed(&text, Fault::None, false);
        assert!(!MotionWatch::default().is_moved_by(&sent));
        played += usize::from(refused);
    }
    assert!(played >= 10, "all that switch following on are refused");
}

/// Replays a line of the PC that writes a port.
fn after_a_look(
    peer: &mut impl Peer,
    profile: Profile,
    may_move: bool,
) -> (Option<Ended>, Vec<u8>) {
    let text = match profile {
        Profile::Classic => "pc profile = classic\n0 > F0 01 00 4E 12 00 00 09 5A",
        Profile::Extended => "pc profile = extended\n0 > B3 07 70 04 00 00 00 00 00",
    };
    let dialogue = Dialogue::parse(text).expect("a dialogue");
    let setup = everything(profile, 115_200).setup;
    let mut replay = Replay::new(dialogue, setup, may_move);
    let (sent, _) = serve(&mut replay, peer, |_, _, _| {});
    (replay.ended_early().cloned(), sent)
}

fn holds(sent: &[u8], part: &[u8]) -> bool {
    sent.windows(part.len()).any(|bytes| bytes == part)
}

#[test]
fn a_replay_leaves_a_helicopter_alone_that_flies_or_of_which_it_does_not_know() {
    for profile in Profile::ALL {
        let first: &[u8] = match profile {
            Profile::Classic => &[0xF0, 0x01],
            Profile::Extended => &[0xB3, 0x07, 0x70],
        };
        for may_move in [false, true] {
            let (ended, sent) = after_a_look(&mut in_a_climb(profile), profile, may_move);
            assert_eq!(ended, Some(Ended::Flies));
            assert!(!holds(&sent, first), "{sent:02X?}");
        }
        let without_status = || Dsp::new(profile, 115_200, Fault::SendsNoStatus);
        let (ended, sent) = after_a_look(&mut without_status(), profile, false);
        assert_eq!(ended, Some(Ended::NoStatus));
        assert!(!holds(&sent, first), "{sent:02X?}");
        // Its rotor is disconnected.
        let (ended, sent) = after_a_look(&mut without_status(), profile, true);
        assert_eq!(ended, None);
        assert!(holds(&sent, first), "{sent:02X?}");
    }
}

#[test]
fn what_is_no_dialogue_is_named_with_its_line() {
    for (text, line, what) in [
        (
            "",
            0,
            "a line `pc profile = classic`, or `extended`, is missing",
        ),
        (
            "pc profile = other",
            1,
            "the profile is `classic` or `extended`",
        ),
        ("\nx > F0", 2, "a line begins with its time in ms"),
        ("1 > F0 XY", 1, "bytes are written as `F0 05 75`"),
    ] {
        assert_eq!(
            Dialogue::parse(text),
            Err(ReplayError { line, what }),
            "{text}"
        );
    }
    let dialogue =
        Dialogue::parse("pc profile = extended\n5 < AA\n7 >x F0\n9 ! open\n12 > F0 05 ; x");
    assert_eq!(dialogue.map(|one| one.profile), Ok(Profile::Extended));
}
