//! A robot whose computer has no clock: TLS takes no certificate before its time.

use std::fs;
use std::path::Path;

use ril_tests::languages::skip;
use ril_tests::preload::SetClock;
use ril_tests::relayed::{await_link, free_endpoint, machine};
use runtime::wall_clock::WallClock;

use super::ril;

fn configure(folder: &Path, pki: &Path, side: &str, name: &str, place: &str) {
    let pki = pki.display();
    let text = format!(
        "[network]\nthrough = \"peers\"\n[security]\nauthority = \"{pki}/ca.pem\"\ncertificate = \"{pki}/{name}.pem\"\n\
         key = \"{pki}/{name}-key.pem\"\nrobots = {{ robot-1 = 1 }}\n[commands]\nstations = [\"gcs\"]\n[{side}]\n{place}\n"
    );
    fs::write(folder.join("relay.toml"), text).unwrap();
}

#[test]
fn a_robot_without_a_clock_is_there_over_tls_as_soon_as_its_clock_is_set() {
    const NAME: &str = "a robot without a clock";
    let Some(ril) = ril() else {
        return;
    };
    let clock = match SetClock::new() {
        Ok(clock) => clock,
        Err(reason) => return skip(NAME, &reason),
    };
    clock.set(30);
    let robot = clock.sandbox(&ril, NAME);
    let station = machine(&ril, NAME);
    let made = "relay certify pki robot-1=127.0.0.1 gcs=127.0.0.1";
    robot
        .run(made, 8)
        .err_says("the clock of this machine was never set");
    station.run(made, 0);
    let endpoint = free_endpoint().replace("tcp", "tls");
    let pki = station.path("pki");
    let listen = format!("listen = [{endpoint:?}]");
    configure(robot.folder(), &pki, "robot", "robot-1", &listen);
    let connect = format!("connect = [{endpoint:?}]\nname = \"gcs\"");
    configure(station.folder(), &pki, "station", "gcs", &connect);

    let processes = robot.start_robot(1, 2);
    let mut robot_relay = robot.start("relay robot");
    robot_relay.wait_for_text("no certificate is taken until it is");
    robot_relay.wait_for_text("ready");
    let station_relay = station.start_ready("relay station");
    // The robot goes on as with any clock.
    robot.run("start", 0);
    robot.run("takeoff 5m", 0);
    clock.set(WallClock::look().unix_s);
    await_link(&station, 1);
    station.run("land", 0);
    station_relay.end();
    let said = robot_relay.end();
    assert!(
        said.stderr.iter().any(|line| line.starts_with("1970-")),
        "{said:#?}"
    );
    processes.end();
}
