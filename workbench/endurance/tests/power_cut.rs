//! The short form of the power cuts: some hundred of all states in which one leaves records, logs and what is kept.

use std::path::Path;
use std::time::Duration;

use endurance::plan::Plan;
use endurance::power_cut;
use endurance::site::Site;
use ril_tests::Sandbox;
use ril_tests::languages::skip;
use ril_tests::sandbox::beside_or_skip;

#[test]
fn what_was_forced_onto_the_disk_survives_a_power_cut_at_any_moment() {
    let Some(ril) = beside_or_skip(Path::new(env!("CARGO_BIN_EXE_endurance"))) else {
        return;
    };
    let plan = Plan::short(600);
    let sandbox = Sandbox::new([&ril], "power-cut", Duration::from_secs(300));
    match power_cut::run(&Site::new(sandbox, &plan), &plan, &|| true) {
        Err(reason) => skip("power cuts", &reason),
        Ok(outcome) => {
            println!("{}\n{outcome}", outcome.head());
            assert!(outcome.is_good(), "{outcome}");
            for kind in [
                "of records",
                "of logs",
                "of replaced files",
                "messages forced",
                "rows forced",
            ] {
                assert!(outcome.count(kind) > 0, "{kind}: {outcome}");
            }
        }
    }
}
