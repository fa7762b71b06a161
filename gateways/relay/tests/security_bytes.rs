//! Bytes of any kind against the decoder and the pure parts of both sides, as `workbench/fuzz/fuzz_targets/relay.rs`
//! tries them for longer.

use proptest::prelude::*;

#[path = "security/script.rs"]
mod script;

/// What the fuzzer has found interesting: one input for each edge of the code.
const CORPUS: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../workbench/fuzz/corpus/relay"
);

#[test]
fn what_the_fuzzer_has_found_harms_nobody() {
    for entry in std::fs::read_dir(CORPUS).expect("the corpus") {
        let data = std::fs::read(entry.expect("a file").path()).expect("its bytes");
        script::play(&data);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_bytes_are_a_message_or_an_error(data in prop::collection::vec(any::<u8>(), 0..300)) {
        script::messages(&data);
    }

    #[test]
    fn any_script_of_strangers_leaves_the_robot_s_side_bounded(data in prop::collection::vec(any::<u8>(), 0..2000)) {
        script::robot_side(&data);
    }

    #[test]
    fn any_script_of_strangers_leaves_the_station_s_side_bounded(data in prop::collection::vec(any::<u8>(), 0..2000)) {
        script::station_side(&data);
    }
}

/// A schema as long as can be, of as many definitions, fields and levels as fit, is read or refused in a time that its
/// length bounds.
#[test]
fn the_worst_schemas_are_read_or_refused_within_their_bounds() {
    for schema in script::worst_schemas() {
        let began = std::time::Instant::now();
        let result = ipc_types::Schema::parse(&schema);
        println!(
            "{} bytes: {:?} in {:?}",
            schema.len(),
            result.map(|_| ()).map_err(|error| error.to_string()),
            began.elapsed()
        );
    }
}
