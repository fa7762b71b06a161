//! Relays whose log nobody reads: a station's telemetry and orders go on, and both relays end at a signal.

use std::path::Path;
use std::time::{Duration, Instant};

use ril_tests::UnreadOutput;
use ril_tests::pace::{self, ACKNOWLEDGED, ENDED, GAP, OrderWatch, Pace, gaps, judge};
use ril_tests::process::Signal;
use ril_tests::relayed::{STATION, await_link, free_endpoint, machine};

use super::ril;

#[test]
fn a_log_that_nobody_reads_stops_no_relay() {
    let Some(ril) = ril() else { return };
    let what = "relays whose log is never read";
    judge(what, [GAP, ACKNOWLEDGED, ENDED], |pace| {
        a_flight(&ril, pace)
    });
}

/// The longest gap of telemetry at the station, time until an order of it was acknowledged, and until a relay had
/// ended.
fn a_flight(ril: &Path, pace: &Pace) -> [Duration; 3] {
    let name = "a_log_that_nobody_reads_stops_no_relay";
    let (robot, station) = (machine(ril, name), machine(ril, name));
    let processes = robot.start_robot(1, 10);
    pace.of_line(&processes.bridge);
    let endpoint = free_endpoint();
    let logs = [UnreadOutput::full(&robot), UnreadOutput::full(&station)];
    let of_robot = format!("relay robot --listen {endpoint} --may-command {STATION}");
    let of_robot = logs[0].start(&robot, &of_robot);
    let of_station = format!("relay station --name {STATION} --connect {endpoint}");
    let of_station = logs[1].start(&station, &of_station);
    await_link(&station, 1);
    let mut acknowledged = Duration::ZERO;
    let [gap] = gaps([pace::telemetry(&station.domain)], || {
        for order in ["start", "takeoff 5m"] {
            station.run(order, 0);
        }
        acknowledged = OrderWatch::new(&station.domain).hold_and_land();
    });
    let ends = [of_station, of_robot].map(|mut relay| {
        let begin = Instant::now();
        relay.signal(Signal::TERM);
        relay.exits(0);
        begin.elapsed()
    });
    processes.end();
    [gap, acknowledged, ends[0].max(ends[1])]
}
