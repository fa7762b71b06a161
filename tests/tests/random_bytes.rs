//! The short form of `figures bytes`: whatever comes over the line, decoders and core neither panic nor grow; and the
//! corpus of the fuzz targets.

use std::path::Path;

use dsp_protocol::Profile;

use crate::bytes::heap::Heap;
use crate::bytes::measure::{self, Tally};
use crate::bytes::script;

/// Bytes for each; the program feeds any number.
const BYTES: u64 = 1_000_000;
const SEED: u64 = 1;

fn check(tally: &Tally) {
    assert!(tally.bytes >= BYTES && tally.messages > 0 && tally.others > 0);
    let nothing = Heap {
        allocations: 0,
        live_bytes: 0,
    };
    assert_eq!(tally.heap, nothing, "it allocates: {tally:?}");
}

#[test]
fn the_decoders_take_any_bytes() {
    check(&measure::decoders(BYTES, SEED));
}

#[test]
fn the_core_takes_any_bytes() {
    for profile in Profile::ALL {
        check(&measure::core_in_noise(profile, BYTES, SEED));
    }
}

#[test]
fn the_core_takes_any_bytes_in_every_phase_of_a_flight() {
    for profile in Profile::ALL {
        let tally = measure::core_in_flight(profile, BYTES, SEED);
        check(&tally);
        assert!(tally.waypoints > 0, "it never flew a path");
    }
}

/// Plays every file of a corpus; there must be some.
fn play_corpus(target: &str, play: fn(&[u8])) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../workbench/fuzz/corpus");
    let files = std::fs::read_dir(folder.join(target)).expect("a corpus");
    let mut count = 0;
    for file in files {
        let path = file.expect("a file").path();
        // What has failed is the last one that is named here.
        println!("{}", path.display());
        play(&std::fs::read(&path).expect("readable"));
        count += 1;
    }
    assert!(count > 20, "{count} files are no corpus");
}

#[test]
fn the_corpus_of_the_fuzz_targets_passes() {
    play_corpus("decoder", script::decode);
    play_corpus("bridge", script::play);
}
