//! The short form of the program `endurance`: processes that are killed, disturbed and cut off at random moments.

// The short form judges less.
#[path = "../examples/endurance/crashes.rs"]
#[allow(dead_code)]
mod crashes;
// Some of it is for the attacks.
#[path = "../examples/endurance/crew.rs"]
#[allow(dead_code)]
mod crew;
#[path = "../examples/endurance/gap.rs"]
mod gap;
#[path = "../examples/endurance/healthy.rs"]
mod healthy;
#[path = "../examples/endurance/kills.rs"]
mod kills;
#[path = "../examples/endurance/opened.rs"]
mod opened;
#[path = "../examples/endurance/port.rs"]
mod port;
// The short form does not judge times.
#[path = "../examples/endurance/records.rs"]
#[allow(dead_code)]
mod records;
#[path = "../examples/endurance/spread.rs"]
mod spread;
#[path = "../examples/endurance/starts.rs"]
mod starts;
#[path = "../examples/endurance/subscribers.rs"]
mod subscribers;

#[path = "stock_readers/environment.rs"]
mod environment;
#[path = "stock_readers/expected.rs"]
#[allow(dead_code)]
mod expected;
#[path = "stock_readers/readers.rs"]
#[allow(dead_code)]
mod readers;
#[path = "stock_readers/sums.rs"]
mod sums;

use std::time::Duration;

use crew::{Kind, Program, Site, has};
use environment::readers_or_skip;
use healthy::Heard;
use ril_tests::watchdog::DEFAULT_LIMIT;

const SEED: u64 = 7;

/// Less than a subscriber's buffer holds at the rate of the chain: 128 samples, 200 a second.
const BUFFERED: Duration = Duration::from_millis(500);

fn site(name: &str) -> Site {
    let program = Program::at(env!("CARGO_BIN_EXE_ril"));
    Site::new(&program, name, DEFAULT_LIMIT)
}

fn kill(victim: Kind) {
    let plan = kills::Plan {
        victim,
        kills: 12,
        seed: SEED,
    };
    if !has(victim) {
        return;
    }
    let outcome = kills::run(&site(victim.name()), &plan, &|| true);
    assert!(outcome.is_clean(), "{outcome}");
    assert_eq!(outcome.kills, 12);
    assert!((1..12).contains(&outcome.in_start_up), "{outcome}");
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
    kill(Kind::ConsumerInC);
}

#[test]
fn a_consumer_in_python_can_be_killed_at_any_moment() {
    kill(Kind::ConsumerInPython);
}

#[test]
fn a_recorder_that_is_killed_leaves_a_file_without_a_hole() {
    let plan = records::Plan {
        kills: 12,
        seed: SEED,
        speed: 4,
        readers: readers_or_skip("files of killed recorders"),
        keep: None,
    };
    let outcome = records::run(&site("records"), &plan, &|| true);
    assert!(outcome.is_whole(), "{outcome}");
    assert_eq!(outcome.kills, 12);
    assert!(outcome.messages > 0, "{outcome}");
}

#[test]
fn whatever_is_killed_the_next_start_is_ready_also_when_that_was_everything_at_once() {
    let plan = starts::Plan {
        starts: 30,
        together: 20,
        robots: 2,
        seed: SEED,
    };
    let _ = Kind::ALL.map(has);
    let outcome = starts::run(&site("starts"), &plan, &|| true);
    assert_eq!(outcome.together.0, 1, "{outcome}");
    assert!(outcome.in_start_up > 0, "{outcome}");
}

#[test]
fn processes_that_crash_in_a_loop_cost_healthy_consumers_nothing() {
    let plan = crashes::Plan {
        per_second: 20,
        duration: Duration::from_secs(5),
        seed: SEED,
    };
    let _ = Kind::ALL.map(has);
    let outcome = crashes::run(&site("crashes"), &plan, &|| true);
    // In so short a time the survivors do not come to hold all that they need.
    assert!(outcome.flies_on && outcome.link_losses == 0, "{outcome}");
    // A consumer that the machine has not let run may lose what its buffer cannot hold: that, no other process has cost it.
    let has_stalled = |heard: &Heard| heard.gaps.iter().any(|gap| gap > BUFFERED);
    let is_harmed = |heard: &Heard| heard.losses.lost > 0 && !has_stalled(heard);
    assert!(!outcome.heard.iter().any(is_harmed), "{outcome}");
    assert!(outcome.heard.iter().all(|heard| heard.losses.received > 0));
}

#[test]
fn a_consumer_hears_the_next_bridge_each_time() {
    let plan = gap::Plan {
        kills: 5,
        period_ms: 20,
        seed: SEED,
    };
    let outcome = gap::run(&site("gap"), &plan, &|| true);
    assert_eq!((outcome.gap.count(), outcome.from_start.count()), (5, 5));
}

#[test]
fn a_port_that_goes_and_comes_back_as_another_device_is_found_each_time() {
    let plan = port::Plan {
        times: 6,
        seed: SEED,
    };
    let outcome = port::run(&site("port"), &plan, &|| true);
    assert_eq!((outcome.again.count(), outcome.elsewhere), (6, 3));
    assert!(outcome.openings > 1, "{outcome}");
}

#[test]
fn subscribers_that_misbehave_cost_nobody_anything() {
    let plan = subscribers::Plan {
        duration: Duration::from_secs(3),
        period_ms: 20,
        seed: SEED,
    };
    let outcome = subscribers::run(&site("subscribers"), &plan, &|| true);
    assert_eq!((outcome.damaged(), outcome.lost()), (0, 0), "{outcome}");
    assert!(outcome.healthy.iter().all(|losses| losses.received > 0));
    assert!(outcome.disturbances.killed > 0, "{outcome}");
}
