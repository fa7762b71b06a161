//! A line that damages bytes: the extended profile allows it, since its CRC sees all that these tests do.

use std::time::Duration;

use dsp_protocol::Profile;
use dsp_sim::simulator::{Setup, Simulator};

use crate::dsp::Dsp;
use crate::fault::Fault;
use crate::harness::{Damaged, broken, everything, not_judged, play};

fn damaged<P>(peer: P, seed: u64) -> Damaged<P> {
    Damaged {
        peer,
        random: fastrand::Rng::with_seed(seed),
        rate: 0.01,
    }
}

#[test]
fn the_simulator_conforms_though_one_byte_in_a_hundred_is_damaged() {
    let mut settings = everything(Profile::Extended, 115_200);
    settings.setup.is_lossy = true;
    let simulator = Simulator::new(Setup {
        profile: Profile::Extended,
        baud: std::num::NonZeroU32::new(115_200),
        ..Setup::default()
    });
    let played = play(&mut damaged(simulator, 7), settings);
    let broken = broken(&played.report);
    assert!(broken.is_empty(), "broken:\n{}", broken.join("\n"));
    assert!(played.report.conforms());
    assert!(
        played.report.totals().kept > 130,
        "{:#?}",
        not_judged(&played.report)
    );
    assert!(played.took > Duration::from_secs(60));
}

#[test]
fn a_wrong_dsp_is_caught_though_one_byte_in_a_hundred_is_damaged() {
    for (fault, check) in [
        (Fault::TakesAnyPadding, "5.1-padding"),
        (Fault::SilentAboutUnknownReads, "6-unknown-read"),
        (Fault::TakesBeyond(10_002), "6-port-10002"),
        (Fault::ExecutesCopies, "11-copy"),
    ] {
        let mut settings = everything(Profile::Extended, 115_200);
        settings.setup.is_lossy = true;
        settings.only = vec![check.to_owned()];
        let wrong = Dsp::new(Profile::Extended, 115_200, fault);
        let played = play(&mut damaged(wrong, 3), settings);
        let broken = broken(&played.report);
        assert!(
            broken.iter().any(|one| one.starts_with(check)),
            "{fault:?} {broken:?}"
        );
    }
}
