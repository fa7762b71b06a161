//! Wrong DSPs: each breaks one sentence, and the kit names it.

use std::time::Duration;

use dsp_protocol::Profile;

use crate::dsp::Dsp;
use crate::fault::{Fault, Mutant, mutants};
use crate::harness::{Peer, broken, everything, play};

fn dsp(mutant: &Mutant) -> Dsp {
    let dsp = Dsp::new(mutant.profile, 115_200, mutant.fault);
    match mutant.fault {
        Fault::ClockStops | Fault::WrapResets => dsp.near_wrap(),
        _ => dsp,
    }
}

/// Why the kit does not name the sentence that the mutant breaks; `None` if it does.
fn escapes(mutant: &Mutant, peer: &mut impl Peer, only: Vec<String>) -> Option<String> {
    let mut settings = everything(mutant.profile, 115_200);
    // The default of `ril conform`: it must not hide what a wrong DSP does.
    settings.setup.slack = Duration::from_millis(25);
    settings.only = only;
    let report = play(peer, settings).report;
    let check = report.checks.iter().find(|check| check.id == mutant.check);
    match check.map(|check| check.verdict.name()) {
        Some("broken") if !report.conforms() => None,
        other => Some(format!(
            "{:?} {:?}: {} is {other:?} {:?}; broken: {:?}; ended {:?}",
            mutant.profile,
            mutant.fault,
            mutant.check,
            check.and_then(|check| check.verdict.text()),
            broken(&report),
            report.ended_early
        )),
    }
}

#[test]
fn every_wrong_dsp_is_caught_by_the_check_of_its_sentence() {
    let all = mutants();
    assert!(all.len() >= 60);
    let escaped: Vec<String> = all
        .iter()
        .filter_map(|mutant| {
            // The wrap is near: it would pass before the check that waits for it.
            let only = match mutant.fault {
                Fault::ClockStops | Fault::WrapResets => vec![mutant.check.clone()],
                _ => Vec::new(),
            };
            escapes(mutant, &mut dsp(mutant), only)
        })
        .collect();
    assert!(
        escaped.is_empty(),
        "{} of {} escape:\n{}",
        escaped.len(),
        all.len(),
        escaped.join("\n")
    );
}

#[test]
fn a_right_dsp_is_not_accused_by_any_check_that_a_mutant_names() {
    // Otherwise a mutant would be caught by what is no fault.
    for profile in Profile::ALL {
        let mut right = Dsp::new(profile, 115_200, Fault::None).near_wrap();
        let report = play(&mut right, everything(profile, 115_200)).report;
        assert_eq!(broken(&report), Vec::<String>::new());
    }
}
