//! The short form of the measurements of relays: a mission typed at the station flies over two networks with 10 % loss, orders
//! end over narrow links, and robots that are whole and played are told apart by a station with two relays.
//!
//! What needs networks of its own is below `as_root`: `.ci/as-user` runs it as root, too.

use std::time::Duration;

use endurance::field::fleet::{self, Fleet};
use endurance::field::narrow::{self, Narrow};

use crate::common::has_relay;

/// Without the relay's program beside it nothing is measured.
const RIL: &str = env!("CARGO_BIN_EXE_ril");

/// Longer than that of other tests: these wait for links.
const LIMIT: Duration = Duration::from_secs(300);

mod as_root {
    use endurance::field::site::Plan;
    use endurance::field::{mission, outages};
    use endurance::outcome::Outcome;
    use ril_tests::air::Weather;
    use ril_tests::languages::skip;

    use super::*;

    /// Measures where the machine allows it.
    fn measure(name: &'static str, loss: f64, run: impl FnOnce(&Plan) -> Result<Outcome, String>) {
        if !has_relay(name) {
            return;
        }
        let plan = Plan {
            name,
            ril: RIL.into(),
            protocol: "tcp".to_owned(),
            weather: Weather::far(Duration::ZERO),
            loss,
            limit: LIMIT,
            seed: 1,
        };
        match run(&plan) {
            Ok(outcome) => assert!(outcome.is_good(), "{outcome}"),
            Err(reason) => skip(name, &reason),
        }
    }

    #[test]
    fn the_operator_s_verbs_fly_a_mission_over_two_networks_with_a_tenth_of_the_packets_lost() {
        measure("mission over two networks", 0.1, mission::run);
    }

    #[test]
    fn after_an_outage_fresh_samples_come_and_their_ages_are_true_with_a_clock_that_is_hours_off() {
        measure("outage", 0.0, |plan| {
            outages::run(plan, 1, Duration::from_secs(4), &|| true)
        });
    }
}

fn orders_end_over_a_narrow_link(protocol: &str, (kbit_per_s, delay): (u32, Duration)) {
    if !has_relay("a narrow link") {
        return;
    }
    let outcome = narrow::run(
        &Narrow {
            ril: RIL.as_ref(),
            protocol,
            kbit_per_s,
            delay,
            lost_of: None,
            orders: 4,
            limit: LIMIT,
        },
        &|| true,
    );
    assert!(outcome.is_good(), "{outcome}");
    assert!(outcome.count("left out") > 0, "the link is wide: {outcome}");
}

#[test]
fn over_64_kbit_per_s_orders_end_and_new_telemetry_comes_over_tcp() {
    orders_end_over_a_narrow_link("tcp", narrow::LINKS[0]);
}

#[test]
fn over_256_kbit_per_s_orders_end_and_new_telemetry_comes_over_quic() {
    orders_end_over_a_narrow_link("quic", narrow::LINKS[1]);
}

fn robots_are_never_confused(through: &str) {
    if !has_relay("several robots") {
        return;
    }
    let outcome = fleet::run(&Fleet {
        ril: RIL.as_ref(),
        robots: 3,
        whole: 1,
        rate_hz: 10,
        through,
        stations: 1,
        per_relay: 2,
        duration: Duration::from_secs(2),
        limit: LIMIT,
    });
    assert!(outcome.is_good(), "{outcome}");
    assert_eq!(outcome.count("relays of the station"), 2);
    let seen = outcome.count("orders") * outcome.count("samples");
    assert!(seen > 0, "{outcome}");
}

#[test]
fn telemetry_and_orders_of_several_robots_are_never_confused_with_peers() {
    robots_are_never_confused(fleet::TOPOLOGIES[0]);
}

#[test]
fn telemetry_and_orders_of_several_robots_are_never_confused_through_a_router() {
    robots_are_never_confused(fleet::TOPOLOGIES[1]);
}
