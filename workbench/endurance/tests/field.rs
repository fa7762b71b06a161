//! The short form of the measurements of relays: a mission typed at the station flies over two networks with 10 % loss, orders
//! end over narrow links, and robots that are whole and played are told apart by a station with two relays.

use std::path::Path;
use std::time::Duration;

use endurance::field::fleet::{self, Fleet};
use endurance::field::narrow::{self, Narrow};
use endurance::field::site::Plan;
use endurance::field::{mission, outages};
use endurance::outcome::Outcome;
use ril_tests::air::Weather;
use ril_tests::languages::skip;
use ril_tests::sandbox::beside_or_skip;

/// Measures where there is `ril` and the machine allows it.
fn measure(name: &'static str, loss: f64, run: impl FnOnce(&Plan) -> Result<Outcome, String>) {
    let Some(ril) = beside_or_skip(Path::new(env!("CARGO_BIN_EXE_endurance"))) else {
        return;
    };
    let plan = Plan {
        name,
        ril,
        protocol: "tcp".to_owned(),
        weather: Weather::far(Duration::ZERO),
        loss,
        limit: Duration::from_secs(300),
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

fn orders_end_over_a_narrow_link(protocol: &str, (kbit_per_s, delay): (u32, Duration)) {
    let Some(ril) = beside_or_skip(Path::new(env!("CARGO_BIN_EXE_endurance"))) else {
        return;
    };
    let outcome = narrow::run(
        &Narrow {
            ril: &ril,
            protocol,
            kbit_per_s,
            delay,
            lost_of: None,
            orders: 4,
            limit: Duration::from_secs(300),
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

#[test]
fn telemetry_and_orders_of_several_robots_are_never_confused_with_peers_and_through_a_router() {
    let Some(ril) = beside_or_skip(Path::new(env!("CARGO_BIN_EXE_endurance"))) else {
        return;
    };
    for through in fleet::TOPOLOGIES {
        let outcome = fleet::run(&Fleet {
            ril: &ril,
            robots: 3,
            whole: 1,
            rate_hz: 10,
            through,
            stations: 1,
            per_relay: 2,
            duration: Duration::from_secs(2),
            limit: Duration::from_secs(300),
        });
        assert!(outcome.is_good(), "{outcome}");
        assert_eq!(outcome.count("relays of the station"), 2);
        let seen = outcome.count("orders") * outcome.count("samples");
        assert!(seen > 0, "{outcome}");
    }
}
