//! A station that stands still, while another one works.

use std::path::Path;
use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::payload::HeroTelemetry;
use ril_tests::chain::beside_or_skip;
use ril_tests::process::Signal;

use crate::machine::{Machine, end};
use crate::rig::{RELAY, Rig};

/// How long samples are watched after the robot's relay has given up the station that stands still: beyond the lease of its link,
/// when the link is closed.
const WATCHED: Duration = Duration::from_secs(6);

/// A link whose closing waits until everything is sent holds up Zenoh's thread for ten seconds. A machine that is busy or stalls
/// holds up everything, but not for so long.
const HELD_UP: Duration = Duration::from_secs(8);

#[test]
fn a_station_that_stands_still_does_not_hold_up_another_one() {
    let Some(mut rig) = Rig::start("stall", "") else {
        return;
    };
    let ril = beside_or_skip(Path::new(RELAY)).expect("it was there");
    let other = Machine::new(&ril, "stall");
    let relay = other.start(&format!(
        "relay station --name watcher --connect {}",
        rig.endpoint()
    ));
    other.await_link(1);
    relay.signal(Signal::STOP);
    let robot_relay = rig.robot_relay.as_mut().expect("it runs");
    robot_relay.wait_for_text("a station is heard no more");

    let mut telemetry = rig.station.subscribe::<HeroTelemetry>(1);
    telemetry.next();
    let begin = MonotonicNs::now();
    let mut before = begin;
    let mut longest = Duration::ZERO;
    while before.since(begin) < WATCHED {
        telemetry.next();
        let now = MonotonicNs::now();
        longest = longest.max(now.since(before));
        before = now;
    }
    assert!(longest < HELD_UP, "nothing came for {longest:?}");
    relay.signal(Signal::CONT);
    end(relay);
    rig.end();
}
