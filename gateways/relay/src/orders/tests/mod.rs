//! Requests through a network in which everything goes wrong.

mod bridge;
mod cases;
mod world;

use cases::Counts;
use fastrand::Rng;
use world::{Faults, World};

const MS: u64 = 1_000_000;
const SECOND: u64 = 1_000 * MS;

/// Between half and one and a half of `mean`.
fn around(random: &mut Rng, mean: u64) -> u64 {
    mean / 2 + random.u64(..=mean)
}

/// 20 % loss, 10 s outages, restarts of everything.
const HARD: Faults = Faults {
    loss: 0.2,
    repetition: 0.1,
    delay: 50 * MS,
    straggler: 0.01,
    outage_every: 90 * SECOND,
    outage: 10 * SECOND,
    station_restart_every: 120 * SECOND,
    robot_restart_every: 60 * SECOND,
    bridge_restart_every: 70 * SECOND,
    give_up: 0.03,
    pause: SECOND,
};

fn random_faults(random: &mut Rng) -> Faults {
    let mut sometimes = |mean: u64| {
        let every = around(random, mean);
        if random.f64() < 0.5 { every } else { 0 }
    };
    let mut faults = Faults {
        outage_every: sometimes(200 * SECOND),
        station_restart_every: sometimes(60 * SECOND),
        robot_restart_every: sometimes(40 * SECOND),
        bridge_restart_every: sometimes(40 * SECOND),
        delay: sometimes(400 * MS),
        pause: SECOND,
        ..Faults::default()
    };
    faults.outage = random.choice([10, 60, 180]).unwrap() * SECOND;
    faults.loss = random.u64(..51) as f64 / 100.0;
    faults.repetition = random.u64(..31) as f64 / 100.0;
    faults.straggler = random.u64(..6) as f64 / 100.0;
    faults.give_up = random.u64(..11) as f64 / 100.0;
    faults
}

/// The number in this variable of the environment, for the long form of a test.
pub(super) fn count(variable: &str, short: u64) -> u64 {
    std::env::var(variable).map_or(short, |count| count.parse().expect("a number"))
}

#[test]
fn ten_thousand_requests_through_loss_outages_and_restarts_have_one_final_report_each() {
    let mut counts = Counts::default();
    for seed in 0..count("RELAY_ORDERS_RUNS", 5) {
        counts += World::new(seed, 3, HARD).run(2_000);
    }
    println!("{counts:?}");
    let requests = counts.requests;
    assert!(counts.done > requests / 2, "most are done: {counts:?}");
    assert!(counts.unknown < requests / 5, "few are unknown: {counts:?}");
}

#[test]
fn random_faults_of_all_kinds_break_no_rule() {
    let mut counts = Counts::default();
    for seed in 0..count("RELAY_ORDERS_WORLDS", 40) {
        let mut random = Rng::with_seed(1_000 + seed);
        let faults = random_faults(&mut random);
        let stations = 1 + random.u64(..5) as usize;
        counts += World::new(seed, stations, faults).run(200);
    }
    println!("{counts:?}");
    assert!(counts.done > counts.requests / 3, "{counts:?}");
}

#[test]
fn without_restarts_no_outage_shorter_than_a_minute_makes_an_outcome_unknown() {
    let mut counts = Counts::default();
    let mut links_lost = 0;
    for seed in 0..12 {
        let faults = Faults {
            station_restart_every: 0,
            robot_restart_every: 0,
            bridge_restart_every: 0,
            outage_every: 100 * SECOND,
            outage: 30 * SECOND,
            ..HARD
        };
        let mut world = World::new(seed, 3, faults);
        counts += world.run(600);
        links_lost += world.links_lost;
    }
    assert!(links_lost > 10, "outages were noticed: {links_lost}");
    println!("{counts:?}");
    assert_eq!(counts.unknown, 0, "{counts:?}");
}

#[test]
fn more_stations_than_sessions_break_no_rule() {
    let faults = Faults {
        station_restart_every: 20 * SECOND,
        ..HARD
    };
    let counts = World::new(7, 12, faults).run(1_000);
    println!("{counts:?}");
}

#[test]
fn on_a_good_link_nothing_is_unknown_and_the_relay_refuses_nothing() {
    let faults = Faults {
        delay: 20 * MS,
        pause: SECOND,
        ..Faults::default()
    };
    let counts = World::new(1, 2, faults).run(1_000);
    println!("{counts:?}");
    assert_eq!(counts.unknown, 0);
    assert_eq!(counts.client_gone, 0);
    assert_eq!(counts.executed, counts.done + counts.aborted);
}

#[test]
fn short_requests_go_on_while_movements_are_open_for_long() {
    let faults = Faults {
        loss: 0.2,
        repetition: 0.1,
        delay: 50 * MS,
        straggler: 0.01,
        pause: 50 * MS,
        ..Faults::default()
    };
    let mut world = World::new(3, 2, faults);
    let counts = world.run(2_000);
    println!(
        "{counts:?}, {} copies of orders that had moved",
        world.repetitions
    );
    assert_eq!(counts.unknown, 0, "{counts:?}");
    assert!(
        world.repetitions > 100,
        "{} copies of orders that had moved",
        world.repetitions
    );
}
