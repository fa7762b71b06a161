//! The table of [`crate::bytes::undetected`].
//!
//! | column | content |
//! |---|---|
//! | damaged | frames that were hit |
//! | judged | what had the bounds of a frame afterwards, so that its sum or CRC was judged |
//! | right check | those whose sum or CRC was right all the same |
//! | accepted | those that also had no wrong padding or field, and were taken for a message |
//! | one in | damaged frames for one that was accepted |
//! | implausible | accepted messages with a value that cannot be, which is not published |
//! | next lost | good frames right behind a damaged one that did not arrive |

use dsp_protocol::Profile;

use crate::bytes::undetected::damage::Damage;
use crate::bytes::undetected::measure::{self, Tally};

/// Measures and prints one profile; false when a frame of the extended profile was taken for good, or when a good frame
/// behind a damaged one was lost.
pub fn measure(profile: Profile, frames: u64, seed: u64) -> bool {
    println!("\n{} profile, seed {seed}\n", profile.name());
    println!(
        "| damage | damaged | judged | right check | accepted | one in | implausible | next lost |"
    );
    println!("|---|---:|---:|---:|---:|---:|---:|---:|");
    let mut total = Tally::default();
    let kinds = Damage::ALL.len() as u64;
    for (index, damage) in (0..).zip(Damage::ALL) {
        // What does not divide goes to the first kinds.
        let frames = frames / kinds + u64::from(index < frames % kinds);
        let tally = measure::measure(profile, damage, frames, seed.wrapping_add(index));
        total += tally;
        print_row(&damage.name(), &tally);
    }
    print_row("all", &total);
    total.lost == 0 && (profile == Profile::Classic || total.accepted == 0)
}

fn print_row(name: &str, tally: &Tally) {
    let Tally {
        damaged,
        judged,
        passed,
        accepted,
        implausible,
        lost,
    } = tally;
    let one_in = match accepted {
        0 => "-".to_owned(),
        _ => format!("{:.0}", *damaged as f64 / *accepted as f64),
    };
    println!(
        "| {name} | {damaged} | {judged} | {passed} | {accepted} | {one_in} | {implausible} | {lost} |"
    );
}
