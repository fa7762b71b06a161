//! The short form of the measurement of stations that speak MAVLink: who is there, missions over a bad line, commands, and a flood.

use std::time::Duration;

use endurance::mavlink;
use endurance::plan::Plan;

use super::site;

#[test]
fn stations_get_telemetry_missions_are_whole_and_a_hold_is_done_once_in_a_flood() {
    let plan = Plan {
        duration_s: Some(2),
        ..Plan::short(5)
    };
    let site = site("mavlink", &plan, Duration::from_secs(300));
    let mut rows = 0;
    mavlink::run(&site, &plan, &|| true, &mut |outcome| {
        assert!(outcome.is_good(), "{outcome}");
        rows += 1;
    });
    assert_eq!(rows, 8);
}
