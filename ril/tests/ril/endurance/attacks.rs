//! Clients that die in groups, floods of requests, a full memory, foreign files, starts that are stopped, and
//! containers.

use endurance::attacks;
use endurance::crowds;
use endurance::site::Measure;

use super::{counts, row, rows};

/// Longer than that of other tests: some of these wait for a group of processes at a time.
const LIMIT_S: u64 = 240;

/// Measures in a `/dev/shm` of its own: this test program again, with nothing but the test `name`.
fn in_own_memory(name: &str, mount_options: &str, measure: Measure, options: &str) {
    if attacks::is_own_memory() {
        rows(name, LIMIT_S, measure, options);
        return;
    }
    let args = [format!("endurance::attacks::{name}"), "--exact".to_owned()];
    let status = attacks::run_again(mount_options, &args).expect("it can be started");
    // What it has to say it has printed, as this test does.
    assert!(status.is_none_or(|status| status.success()), "{status:?}");
}

#[test]
fn clients_that_end_in_groups_cost_the_bridge_nothing() {
    let row = row("clients", LIMIT_S, crowds::clients, "--count 150");
    counts(&row, &["killed", "ended in order"]);
}

#[test]
fn when_no_byte_is_left_telemetry_goes_on_and_the_helicopter_can_be_landed() {
    let name = "when_no_byte_is_left_telemetry_goes_on_and_the_helicopter_can_be_landed";
    in_own_memory(name, attacks::SMALL, attacks::no_bytes, "");
}

#[test]
fn when_no_file_can_be_made_telemetry_goes_on_and_the_helicopter_can_be_landed() {
    let name = "when_no_file_can_be_made_telemetry_goes_on_and_the_helicopter_can_be_landed";
    in_own_memory(name, attacks::SMALL, attacks::no_files, "");
}

#[test]
fn foreign_files_keep_no_process_from_anything() {
    let name = "foreign_files_keep_no_process_from_anything";
    in_own_memory(
        name,
        attacks::LARGE,
        attacks::foreign_files,
        "--count 20000",
    );
}

#[test]
fn a_process_that_is_stopped_while_it_starts_keeps_no_other_waiting() {
    let row = row("joiners", LIMIT_S, crowds::joiners, "--count 20");
    for (heading, count) in [
        ("stopped", 20),
        ("commands done meanwhile", 60),
        ("ended at a signal meanwhile", 40),
    ] {
        assert_eq!(row.count(heading), count, "{heading}");
    }
}

#[test]
fn an_operator_gets_through_a_flood_of_requests() {
    let row = row("flood", LIMIT_S, attacks::flood, "--count 1");
    counts(&row, &["requests of the flood"]);
}

#[test]
fn processes_of_the_same_number_in_other_namespaces_all_start() {
    rows("namespaces", LIMIT_S, attacks::same_numbers, "--count 30");
}

#[test]
fn a_consumer_with_another_clock_gets_samples() {
    rows("clocks", LIMIT_S, attacks::other_clocks, "");
}

#[test]
fn containers_take_part_when_they_share_the_memory_and_else_disturb_nobody() {
    rows("mounts", LIMIT_S, attacks::other_mounts, "");
}

#[test]
fn a_command_of_another_user_names_the_domains_that_there_are() {
    let name = "a_command_of_another_user_names_the_domains_that_there_are";
    in_own_memory(name, attacks::LARGE, attacks::other_users, "");
}
