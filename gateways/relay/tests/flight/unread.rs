//! Relays whose log nobody reads: a station's telemetry and orders go on, and both relays end at a signal.

use ipc_types::payload::HeroTelemetry;
use ril_tests::UnreadPipe;
use ril_tests::process::Signal;
use ril_tests::relayed::{STATION, await_link, free_endpoint, machine};

use super::ril;

#[test]
fn a_log_that_nobody_reads_stops_no_relay() {
    let Some(ril) = ril() else { return };
    let name = "a_log_that_nobody_reads_stops_no_relay";
    let (robot, station) = (machine(&ril, name), machine(&ril, name));
    let processes = robot.start_robot(1, 10);
    let endpoint = free_endpoint();
    let logs = [UnreadPipe::full(&robot), UnreadPipe::full(&station)];
    let of_robot = format!("relay robot --listen {endpoint} --may-command {STATION}");
    let of_robot = logs[0].start(&robot, &of_robot);
    let of_station = format!("relay station --name {STATION} --connect {endpoint}");
    let of_station = logs[1].start(&station, &of_station);
    await_link(&station, 1);
    for order in ["start", "takeoff 5m", "hold", "land"] {
        station.run(order, 0);
    }
    station.subscribe::<HeroTelemetry>(1).next_sample();
    for mut relay in [of_station, of_robot] {
        relay.signal(Signal::TERM);
        relay.exits(0);
    }
    processes.end();
}
