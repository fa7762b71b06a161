//! The short form of the program `endurance`: processes that are killed, disturbed and cut off at random moments.

use endurance::plan::{Kind, Plan};
use endurance::site::Site;
use endurance::{crashes, gap, kills, port, records, starts, subscribers};
use ril_tests::readers::readers_or_skip;
use ril_tests::watchdog::DEFAULT_LIMIT;

fn site(name: &str, plan: &Plan) -> Site {
    super::site(name, plan, DEFAULT_LIMIT)
}

fn kill(victim: Kind) {
    let plan = Plan::short(12);
    if !victim.is_possible() {
        return;
    }
    let outcome = kills::run(&site(victim.name(), &plan), &plan, victim, &|| true);
    assert!(outcome.is_good(), "{outcome}");
    assert_eq!(outcome.count("kills"), 12);
    let in_start_up = outcome.count("of them while it started");
    assert!((1..12).contains(&in_start_up), "{outcome}");
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
    let plan = Plan::short(12);
    let readers = readers_or_skip("files of killed recorders");
    let outcome = records::run(&site("records", &plan), &plan, &readers, &|| true);
    assert!(outcome.is_good(), "{outcome}");
    assert_eq!(outcome.count("kills"), 12);
    assert!(outcome.count("messages") > 0, "{outcome}");
}

#[test]
fn whatever_is_killed_the_next_start_is_ready_also_when_that_was_everything_at_once() {
    let plan = Plan::short(30);
    let _ = Kind::ALL.map(Kind::is_possible);
    let outcome = starts::run(&site("starts", &plan), &plan, &|| true);
    assert_eq!(outcome.count("times all at once"), 1, "{outcome}");
    assert!(outcome.count("killed while they started") > 0, "{outcome}");
}

#[test]
fn processes_that_crash_in_a_loop_cost_healthy_consumers_nothing() {
    let plan = Plan {
        duration_s: Some(5),
        ..Plan::short(0)
    };
    let _ = Kind::ALL.map(Kind::is_possible);
    let outcome = crashes::run(&site("crashes", &plan), &plan, &|| true);
    assert!(outcome.is_good(), "{outcome}");
}

#[test]
fn a_consumer_hears_the_next_bridge_each_time() {
    let plan = Plan::short(5);
    let outcome = gap::run(&site("gap", &plan), &plan, &|| true);
    assert_eq!(outcome.count("kills"), 5);
}

#[test]
fn a_port_that_goes_and_comes_back_as_another_device_is_found_each_time() {
    let plan = Plan::short(6);
    let outcome = port::run(&site("port", &plan), &plan, &|| true);
    assert_eq!(outcome.count("port gone and back"), 6);
    assert_eq!(outcome.count("of them as another device"), 3);
    assert!(outcome.count("openings") > 1, "{outcome}");
}

#[test]
fn subscribers_that_misbehave_cost_nobody_anything() {
    let plan = Plan {
        duration_s: Some(3),
        ..Plan::short(0)
    };
    let outcome = subscribers::run(&site("subscribers", &plan), &plan, &|| true);
    assert!(outcome.is_good(), "{outcome}");
    assert!(outcome.count("killed") > 0, "{outcome}");
}
