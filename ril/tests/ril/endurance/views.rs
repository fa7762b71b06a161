//! The short form of the measurement of viewers: pages, a slow client of Foxglove, and an attack, two seconds each.

use std::time::Duration;

use endurance::plan::Plan;
use endurance::views;

use super::site;

#[test]
fn no_viewer_is_lost_and_an_order_is_given_once_whatever_others_do() {
    let plan = Plan {
        duration_s: Some(2),
        ..Plan::short(1)
    };
    let site = site("views", &plan, Duration::from_secs(300));
    let mut rows = 0;
    views::run(&site, &plan, &|| true, &mut |outcome| {
        assert!(outcome.is_good(), "{outcome}");
        rows += 1;
    });
    assert_eq!(rows, 7);
}
