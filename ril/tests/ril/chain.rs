//! The fixtures' chain of real processes, with the binary of this crate.

use std::path::Path;

use ril_tests::process::Signal;
use ril_tests::{Chain, TestDomain};

#[test]
fn the_chain_starts_bears_a_kill_of_each_and_ends_in_order() {
    let domain = TestDomain::new();
    let mut chain = Chain::start(&domain, Path::new(env!("CARGO_BIN_EXE_ril")));
    chain.bridge.signal(Signal::KILL);
    chain.bridge.wait_exit();
    chain.restart_bridge(&domain);
    chain.status.signal(Signal::KILL);
    chain.status.wait_exit();
    chain.restart_status(&domain);
    let rate = chain.run(&domain, &["hz", "hero", "--count", "3"]);
    assert_eq!(rate.code(), Some(0), "{rate:#?}");
    let unknown = chain.run(&domain, &["hz", "gps"]);
    assert_eq!(unknown.code(), Some(2), "{unknown:#?}");
    chain.end();
}
