//! Processes that are killed, disturbed and cut off at random moments.

use endurance::plan::Kind;
use endurance::{crowds, kills, port, records, senders};

use super::{counts, row};

/// Limit of a test, s: that of other tests.
const LIMIT_S: u64 = ril_tests::watchdog::DEFAULT_LIMIT.as_secs();

fn kill(victim: Kind) {
    if !victim.is_possible() {
        return;
    }
    let options = format!("--count 12 --victim {}", victim.name());
    let row = row(victim.name(), LIMIT_S, kills::run, &options);
    assert_eq!(row.count("kills"), 12);
    let in_start_up = row.count("of them while it started");
    assert!((1..12).contains(&in_start_up), "{row}");
}

#[test]
fn a_simulator_can_be_killed_at_any_moment() {
    kill(Kind::Sim);
}

#[test]
fn a_bridge_can_be_killed_at_any_moment() {
    kill(Kind::Bridge);
}

#[test]
fn a_status_can_be_killed_at_any_moment() {
    kill(Kind::Status);
}

#[test]
fn a_consumer_can_be_killed_at_any_moment() {
    kill(Kind::Consumer);
}

#[test]
fn a_consumer_in_c_can_be_killed_at_any_moment() {
    kill(Kind::CConsumer);
}

#[test]
fn a_consumer_in_python_can_be_killed_at_any_moment() {
    kill(Kind::PythonConsumer);
}

#[test]
fn a_recorder_that_is_killed_leaves_a_file_without_a_hole() {
    let row = row("records", LIMIT_S, records::run, "--count 12");
    assert_eq!(row.count("kills"), 12);
    counts(&row, &["messages"]);
}

#[test]
fn a_sender_can_be_lost_at_any_moment_of_its_path_in_every_language() {
    Kind::possible();
    let row = row("senders", LIMIT_S, senders::run, "--count 12");
    assert_eq!(row.count("senders lost"), 12);
    counts(&row, &["in flight", "paths that must go on"]);
}

#[test]
fn whatever_is_killed_the_next_start_is_ready_also_when_that_was_everything_at_once() {
    Kind::possible();
    let row = row("starts", LIMIT_S, kills::starts, "--count 30");
    assert_eq!(row.count("times all at once"), 1, "{row}");
    counts(&row, &["killed while they started"]);
}

#[test]
fn processes_that_crash_in_a_loop_cost_healthy_consumers_nothing() {
    Kind::possible();
    row("crashes", LIMIT_S, crowds::crashes, "--duration-s 5");
}

#[test]
fn a_consumer_hears_the_next_bridge_each_time() {
    let row = row("gap", LIMIT_S, kills::gap, "--count 5");
    assert_eq!(row.count("kills"), 5);
}

#[test]
fn a_port_that_goes_and_comes_back_as_another_device_is_found_each_time() {
    let row = row("port", LIMIT_S, port::run, "--count 6");
    assert_eq!(row.count("port gone and back"), 6);
    assert_eq!(row.count("of them as another device"), 3);
    assert!(row.count("openings") > 1, "{row}");
}

#[test]
fn subscribers_that_misbehave_cost_nobody_anything() {
    let row = row(
        "subscribers",
        LIMIT_S,
        crowds::subscribers,
        "--duration-s 3",
    );
    counts(&row, &["killed"]);
}
