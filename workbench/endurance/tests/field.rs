//! The short form of `gateways/relay/examples/field`: a mission typed at the station flies over two networks with 10 % loss.

use std::io::Write;
use std::path::Path;
use std::time::Duration;

use ril_tests::chain::beside_or_skip;

use crate::site::Plan;
use crate::{mission, outages};

/// `None` if there is no `ril`.
fn plan(name: &'static str) -> Option<Plan> {
    Some(Plan {
        name,
        ril: beside_or_skip(Path::new(env!("CARGO_BIN_EXE_ril-relay")))?,
        protocol: "tcp".to_owned(),
        relay_toml: String::new(),
        limit: Duration::from_secs(300),
        seed: 1,
        log: None,
    })
}

/// Says also when tests that pass print nothing that this one did not run.
fn skip(reason: &str) {
    let _ = writeln!(std::io::stderr(), "SKIPPED: {reason}");
}

#[test]
fn the_operator_s_verbs_fly_a_mission_over_two_networks_with_a_tenth_of_the_packets_lost() {
    let Some(plan) = plan("mission over two networks") else {
        return;
    };
    match mission::run(&plan, 0.1) {
        Ok(outcome) => assert!(outcome.is_good(), "{outcome}"),
        Err(reason) => skip(&reason),
    }
}

#[test]
fn after_an_outage_fresh_samples_come_and_their_ages_are_true_with_a_clock_that_is_hours_off() {
    let Some(plan) = plan("outage") else {
        return;
    };
    match outages::run(&plan, 1, Duration::from_secs(4), 0.0, &|| true) {
        Ok(outcome) => assert!(outcome.is_good(), "{outcome}"),
        Err(reason) => skip(&reason),
    }
}
