//! The short form of the attacks of the program `endurance`: clients that die in groups, floods of requests, a full memory,
//! strangers' files, starts that are stopped, and containers.

#[path = "../examples/endurance/clients.rs"]
mod clients;
// Some of it is for the endurance tests.
#[path = "../examples/endurance/crew.rs"]
#[allow(dead_code)]
mod crew;
#[path = "../examples/endurance/flood.rs"]
mod flood;
#[path = "../examples/endurance/full.rs"]
mod full;
#[path = "../examples/endurance/joiners.rs"]
mod joiners;
#[path = "../examples/endurance/memory.rs"]
mod memory;
#[path = "../examples/endurance/namespaces.rs"]
mod namespaces;
#[path = "../examples/endurance/spread.rs"]
#[allow(dead_code)]
mod spread;
#[path = "../examples/endurance/strangers.rs"]
mod strangers;

use std::time::Duration;

use crew::{Program, Site};
use full::Lack;

const SEED: u64 = 7;

/// Longer than that of other tests: some of these wait for a group of processes at a time.
const LIMIT: Duration = Duration::from_secs(240);

fn site(name: &str) -> Site {
    let program = Program::at(env!("CARGO_BIN_EXE_ril"));
    Site::new(&program, name, LIMIT)
}

/// Runs `body` in a `/dev/shm` of its own: this test program again, with nothing but the test `name`.
fn in_own_memory(name: &str, mount_options: &str, body: impl FnOnce()) {
    if memory::is_own() {
        return body();
    }
    let args = [name, "--exact"].map(str::to_owned);
    let status = memory::run_again(mount_options, &args).expect("it can be started");
    // What it has to say it has printed, as this test does.
    assert!(status.is_none_or(|status| status.success()), "{status:?}");
}

#[test]
fn clients_that_end_in_groups_cost_the_bridge_nothing() {
    let plan = clients::Plan {
        clients: 150,
        seed: SEED,
    };
    let outcome = clients::run(&site("clients"), &plan, &|| true);
    assert!(outcome.is_clean(), "{outcome}");
    assert!(
        outcome.killed > 0 && outcome.ended_in_order > 0,
        "{outcome}"
    );
}

#[test]
fn when_no_byte_is_left_telemetry_goes_on() {
    let name = "when_no_byte_is_left_telemetry_goes_on";
    in_own_memory(name, Lack::Bytes.mount_options(), || {
        let outcome = full::run(&site(name), Lack::Bytes);
        assert!(outcome.flies_on(), "{outcome}");
    });
}

#[test]
fn when_no_byte_is_left_the_helicopter_can_be_landed() {
    let name = "when_no_byte_is_left_the_helicopter_can_be_landed";
    in_own_memory(name, Lack::Bytes.mount_options(), || {
        let outcome = full::run(&site(name), Lack::Bytes);
        assert!(outcome.is_landed(), "{outcome}");
    });
}

#[test]
fn when_no_file_can_be_made_telemetry_goes_on() {
    let name = "when_no_file_can_be_made_telemetry_goes_on";
    in_own_memory(name, Lack::Inodes.mount_options(), || {
        let outcome = full::run(&site(name), Lack::Inodes);
        assert!(outcome.flies_on(), "{outcome}");
    });
}

#[test]
fn when_no_file_can_be_made_the_helicopter_can_be_landed() {
    let name = "when_no_file_can_be_made_the_helicopter_can_be_landed";
    in_own_memory(name, Lack::Inodes.mount_options(), || {
        let outcome = full::run(&site(name), Lack::Inodes);
        assert!(outcome.is_landed(), "{outcome}");
    });
}

#[test]
fn strangers_files_keep_nobody_from_anything() {
    let name = "strangers_files_keep_nobody_from_anything";
    in_own_memory(name, strangers::MOUNT_OPTIONS, || {
        let plan = strangers::Plan { files: 20_000 };
        println!("{}", strangers::run(&site(name), &plan));
    });
}

#[test]
fn whoever_is_stopped_while_it_starts_keeps_nobody_waiting() {
    let plan = joiners::Plan {
        joiners: 20,
        seed: SEED,
    };
    let outcome = joiners::run(&site("joiners"), &plan, &|| true);
    assert_eq!(
        (outcome.joiners, outcome.done, outcome.interrupted),
        (20, 60, 40)
    );
}

#[test]
fn an_operator_gets_through_a_flood_of_requests() {
    let plan = flood::Plan { rounds: 1 };
    let outcome = flood::run(&site("flood"), &plan, &|| true);
    assert!(outcome.failures.is_empty(), "{outcome}");
    assert!(outcome.flood > 0, "{outcome}");
}

#[test]
fn processes_of_the_same_number_in_other_namespaces_all_start() {
    let plan = namespaces::Plan { starts: 30 };
    let outcome = namespaces::same_numbers(&site("namespaces"), &plan, &|| true);
    if let Some(outcome) = outcome {
        assert!(outcome.failures.is_empty(), "{outcome}");
    }
}

#[test]
fn a_consumer_with_another_clock_gets_samples() {
    if let Some(outcome) = namespaces::other_clocks(&site("clocks")) {
        assert!(outcome.failures.is_empty(), "{outcome}");
    }
}

#[test]
fn containers_take_part_when_they_share_the_memory_and_else_disturb_nobody() {
    if let Some(outcome) = namespaces::other_mounts(&site("mounts")) {
        assert!(outcome.failures.is_empty(), "{outcome}");
    }
}

#[test]
fn a_command_of_another_user_names_the_domains_that_there_are() {
    let name = "a_command_of_another_user_names_the_domains_that_there_are";
    in_own_memory(name, strangers::MOUNT_OPTIONS, || {
        if let Some(outcome) = namespaces::other_users(&site("users")) {
            assert!(outcome.failures.is_empty(), "{outcome}");
        }
    });
}
