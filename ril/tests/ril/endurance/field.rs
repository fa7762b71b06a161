//! Relays: a mission typed at the station flies over two networks with 10 % loss, orders end over narrow links, and
//! robots that are whole and played are told apart by a station with two relays. Without the relay's program beside
//! `ril` nothing is measured.
//!
//! What needs networks of its own is below `as_root`: `.ci/as-user` runs it as root, too.

use endurance::field::{fleet, narrow};
use endurance::site::Measure;

use super::{counts, row, rows};
use crate::common::has_relay;

/// Longer than that of other tests: these wait for links.
const LIMIT_S: u64 = 300;

mod as_root {
    use endurance::field::relays;

    use super::*;

    /// Measures where the machine allows it.
    fn measure(name: &str, measure: Measure, options: &str) {
        if has_relay(name) {
            rows(name, LIMIT_S, measure, options);
        }
    }

    #[test]
    fn the_operator_s_verbs_fly_a_mission_over_two_networks_with_a_tenth_of_the_packets_lost() {
        measure("mission over two networks", relays::mission, "--loss 10");
    }

    #[test]
    fn after_an_outage_fresh_samples_come_and_their_ages_are_true_with_a_clock_that_is_hours_off() {
        measure("outage", relays::outages, "--count 1 --outage-s 4");
    }
}

fn orders_end_over_a_narrow_link(options: &str) {
    if has_relay("a narrow link") {
        let row = row(
            "narrow",
            LIMIT_S,
            narrow::run,
            &format!("--count 4 {options}"),
        );
        // Else the link would be wide.
        counts(&row, &["left out"]);
    }
}

#[test]
fn over_64_kbit_per_s_orders_end_and_new_telemetry_comes_over_tcp() {
    orders_end_over_a_narrow_link("--over tcp --kbit-per-s 64 --round-trip-ms 200");
}

#[test]
fn over_256_kbit_per_s_orders_end_and_new_telemetry_comes_over_quic() {
    orders_end_over_a_narrow_link("--over quic --kbit-per-s 256 --round-trip-ms 100");
}

/// A change from Wi-Fi to a mobile network is no congestion.
fn telemetry_is_all_there_on_a_way_that_becomes_longer(protocol: &str) {
    if has_relay("a way that becomes longer") {
        row("roam", LIMIT_S, narrow::roam, &format!("--over {protocol}"));
    }
}

#[test]
fn after_round_trips_have_risen_by_400_ms_all_telemetry_comes_again_over_tcp() {
    telemetry_is_all_there_on_a_way_that_becomes_longer("tcp");
}

#[test]
fn after_round_trips_have_risen_by_400_ms_all_telemetry_comes_again_over_quic() {
    telemetry_is_all_there_on_a_way_that_becomes_longer("quic");
}

fn robots_are_never_confused(through: &str) {
    if has_relay("several robots") {
        let options = "--robots 3 --whole 1 --per-relay 2 --duration-s 2 --through";
        let row = row(
            "fleet",
            LIMIT_S,
            fleet::run,
            &format!("{options} {through}"),
        );
        assert_eq!(row.count("relays of the station"), 2);
        counts(&row, &["orders", "samples"]);
    }
}

#[test]
fn telemetry_and_orders_of_several_robots_are_never_confused_with_peers() {
    robots_are_never_confused("peers");
}

#[test]
fn telemetry_and_orders_of_several_robots_are_never_confused_through_a_router() {
    robots_are_never_confused("router");
}
