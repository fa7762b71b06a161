//! The short form of the attacks of the program `endurance`: clients that die in groups, floods of requests, a full memory,
//! foreign files, starts that are stopped, and containers.

use std::time::Duration;

use endurance::full::Lack;
use endurance::plan::Plan;
use endurance::site::Site;
use endurance::{clients, flood, foreign_files, full, joiners, memory, namespaces};

/// Longer than that of other tests: some of these wait for a group of processes at a time.
const LIMIT: Duration = Duration::from_secs(240);

fn site(name: &str) -> Site {
    super::site(name, &Plan::short(0), LIMIT)
}

/// Runs `body` in a `/dev/shm` of its own: this test program again, with nothing but the test `name`.
fn in_own_memory(name: &str, mount_options: &str, body: impl FnOnce()) {
    if memory::is_own() {
        return body();
    }
    let args = [format!("endurance::attacks::{name}"), "--exact".to_owned()];
    let status = memory::run_again(mount_options, &args).expect("it can be started");
    // What it has to say it has printed, as this test does.
    assert!(status.is_none_or(|status| status.success()), "{status:?}");
}

#[test]
fn clients_that_end_in_groups_cost_the_bridge_nothing() {
    let outcome = clients::run(&site("clients"), &Plan::short(150), &|| true);
    assert!(outcome.is_good(), "{outcome}");
    assert!(outcome.count("killed") > 0, "{outcome}");
    assert!(outcome.count("ended in order") > 0, "{outcome}");
}

#[test]
fn when_no_byte_is_left_telemetry_goes_on_and_the_helicopter_can_be_landed() {
    let name = "when_no_byte_is_left_telemetry_goes_on_and_the_helicopter_can_be_landed";
    in_own_memory(name, Lack::Bytes.mount_options(), || {
        let outcome = full::run(&site(name), Lack::Bytes);
        assert!(outcome.is_good(), "{outcome}");
    });
}

#[test]
fn when_no_file_can_be_made_telemetry_goes_on_and_the_helicopter_can_be_landed() {
    let name = "when_no_file_can_be_made_telemetry_goes_on_and_the_helicopter_can_be_landed";
    in_own_memory(name, Lack::Inodes.mount_options(), || {
        let outcome = full::run(&site(name), Lack::Inodes);
        assert!(outcome.is_good(), "{outcome}");
    });
}

#[test]
fn foreign_files_keep_no_process_from_anything() {
    let name = "foreign_files_keep_no_process_from_anything";
    in_own_memory(name, foreign_files::MOUNT_OPTIONS, || {
        println!("{}", foreign_files::run(&site(name), &Plan::short(20_000)));
    });
}

#[test]
fn a_process_that_is_stopped_while_it_starts_keeps_no_other_waiting() {
    let outcome = joiners::run(&site("joiners"), &Plan::short(20), &|| true);
    for (heading, count) in [
        ("stopped", 20),
        ("commands done meanwhile", 60),
        ("ended at a signal meanwhile", 40),
    ] {
        assert_eq!(outcome.count(heading), count, "{heading}");
    }
}

#[test]
fn an_operator_gets_through_a_flood_of_requests() {
    let outcome = flood::run(&site("flood"), &Plan::short(1), &|| true);
    assert!(outcome.is_good(), "{outcome}");
    assert!(outcome.count("requests of the flood") > 0, "{outcome}");
}

#[test]
fn processes_of_the_same_number_in_other_namespaces_all_start() {
    let site = site("namespaces");
    if let Some(outcome) = namespaces::same_numbers(&site, &Plan::short(30), &|| true) {
        assert!(outcome.is_good(), "{outcome}");
    }
}

#[test]
fn a_consumer_with_another_clock_gets_samples() {
    if let Some(outcome) = namespaces::other_clocks(&site("clocks")) {
        assert!(outcome.is_good(), "{outcome}");
    }
}

#[test]
fn containers_take_part_when_they_share_the_memory_and_else_disturb_nobody() {
    if let Some(outcome) = namespaces::other_mounts(&site("mounts")) {
        assert!(outcome.is_good(), "{outcome}");
    }
}

#[test]
fn a_command_of_another_user_names_the_domains_that_there_are() {
    let name = "a_command_of_another_user_names_the_domains_that_there_are";
    in_own_memory(name, foreign_files::MOUNT_OPTIONS, || {
        if let Some(outcome) = namespaces::other_users(&site("users")) {
            assert!(outcome.is_good(), "{outcome}");
        }
    });
}
