//! The short form of `figures undetected`: what a receiver takes for a message although the line damaged it.

// The program uses the rest of what it shares with these tests.
#[allow(dead_code)]
#[path = "../../../tests/examples/figures/undetected/mod.rs"]
mod figure;

use self::figure::damage::Damage;
use self::figure::measure::{Tally, measure};
use dsp_protocol::Profile;

const SEED: u64 = 7;
/// Damaged frames of each kind.
const FRAMES: u64 = 20_000;

fn all(profile: Profile) -> impl Iterator<Item = (Damage, Tally)> {
    Damage::ALL
        .into_iter()
        .map(move |damage| (damage, measure(profile, damage, FRAMES, SEED)))
}

/// Whether `count` is one in 128 of `of`, within four standard deviations.
fn is_one_in_128(count: u64, of: u64) -> bool {
    let expected = of as f64 / 128.0;
    (count as f64 - expected).abs() < 4.0 * expected.sqrt()
}

#[test]
fn the_extended_profile_takes_no_damaged_frame_for_good() {
    for (damage, tally) in all(Profile::Extended) {
        let name = damage.name();
        assert_eq!(tally.damaged, FRAMES, "{name}");
        assert_eq!((tally.passed, tally.accepted), (0, 0), "{name}");
        assert_eq!(tally.lost, 0, "{name}");
    }
}

#[test]
fn the_classic_profile_misses_one_in_128_of_what_its_sum_cannot_see() {
    for (damage, tally) in all(Profile::Classic) {
        let name = damage.name();
        assert_eq!(tally.damaged, FRAMES, "{name}");
        assert_eq!(tally.lost, 0, "{name}");
        assert!(tally.accepted <= tally.passed, "{name}: {tally:?}");
        assert!(tally.implausible <= tally.accepted, "{name}: {tally:?}");
        match damage {
            // A random frame is judged, and its sum is right by chance alone.
            Damage::RandomPayload => {
                assert_eq!(tally.judged, FRAMES);
                assert!(is_one_in_128(tally.passed, tally.judged), "{tally:?}");
            }
            // At a low rate nearly all errors are single bits, which a sum sees as long as the bounds stay.
            Damage::BitErrors(rate) if rate < 1e-4 => {
                assert!(tally.passed * 500 < tally.judged, "{tally:?}");
            }
            // What is left of a frame is seldom one; then its sum is no worse than chance, with room for few events.
            _ => assert!(
                tally.passed * 32 < tally.judged.max(1000),
                "{name}: {tally:?}"
            ),
        }
    }
}

#[test]
fn the_same_seed_gives_the_same_figures() {
    let figures = |seed| measure(Profile::Classic, Damage::BitErrors(1e-3), 2_000, seed);
    assert_eq!(figures(1), figures(1));
    assert_ne!(figures(1), figures(2));
}
