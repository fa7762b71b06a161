//! The short form of the program `endurance`: loops of kills and of starts, attacks, floods, full memories and power
//! cuts, bad links, stations and viewers. Each is a measurement and the options of its short form; every row that it
//! shows must be good.

use std::time::Duration;

use endurance::plan::Plan;
use endurance::site::{Measure, Site};
use measure::Outcome;

mod attacks;
mod field;
mod loops;
mod power_cut;

/// Measures, which takes no longer than `limit_s`. Gives the rows; none if this machine cannot.
#[track_caller]
fn rows(name: &str, limit_s: u64, measure: Measure, options: &str) -> Vec<Outcome> {
    let ril = env!("CARGO_BIN_EXE_ril").as_ref();
    let limit = Duration::from_secs(limit_s);
    let site = Site::new(ril, name, Plan::short(options), limit);
    measure(&site);
    let rows = site.rows();
    for row in &rows {
        assert!(row.is_good(), "{row}");
    }
    rows
}

/// Runs a measurement that shows one row on every machine, and gives that row.
#[track_caller]
fn row(name: &str, limit_s: u64, measure: Measure, options: &str) -> Outcome {
    let mut rows = rows(name, limit_s, measure, options);
    assert_eq!(rows.len(), 1, "{name}");
    rows.remove(0)
}

/// Asserts that none of these counts is zero.
#[track_caller]
fn counts(row: &Outcome, headings: &[&str]) {
    for heading in headings {
        assert!(row.count(heading) > 0, "{heading}: {row}");
    }
}

#[test]
fn stations_get_telemetry_missions_are_whole_and_a_hold_is_done_once_in_a_flood() {
    let rows = rows(
        "mavlink",
        300,
        endurance::mavlink::run,
        "--count 5 --duration-s 2",
    );
    assert_eq!(rows.len(), 8);
}

#[test]
fn no_viewer_is_lost_and_an_order_is_given_once_whatever_others_do() {
    let rows = rows("views", 300, endurance::views::run, "--duration-s 2");
    assert_eq!(rows.len(), 7);
}
