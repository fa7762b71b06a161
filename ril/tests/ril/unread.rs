//! A log that nobody reads stops no process: standard error is a full pipe from the beginning, or its reader stops in
//! flight, that of a pipe, of a socket or of a terminal. Orders are done, the telemetry of the robot, of a station and
//! of a page goes on, and each process ends at a signal.

use std::time::{Duration, Instant};

use endurance::mavlink::station::Station;
use ipc_types::code::Stage;
use ipc_types::payload::MovementData;
use ipc_types::{Client, fresh_request_id};
use ril_tests::pace::{self, ACKNOWLEDGED, ENDED, GAP, Pace, gaps, judge};
use ril_tests::process::{Signal, WAIT_LIMIT};
use ril_tests::sandbox::free_port;
use ril_tests::{OutputKind, UnreadOutput};

use crate::common::{FOR_SLOW_MACHINES, place, sandbox};
use crate::view::page::Page;
use crate::view::{order, token};
use crate::waits::{of_page, of_station};

/// Sends an order, waits until it is accepted, and says how long that took; then waits for its end.
fn ask(client: &mut Client<MovementData>, request: &MovementData) -> Duration {
    let begin = Instant::now();
    client.send(request).unwrap();
    let (mut accepted, mut end) = (None, None);
    while end.is_none() {
        client.wait(WAIT_LIMIT).unwrap();
        client.drain(|report| {
            let stage = report
                .stage()
                .filter(|_| report.request_id == request.request_id);
            match stage {
                Some(Stage::Accepted) => accepted = Some(begin.elapsed()),
                Some(stage) if stage.is_final() => end = Some(stage),
                _ => {}
            }
        });
    }
    assert_eq!(end, Some(Stage::Done));
    accepted.expect("it was accepted")
}

/// Waypoints of the paths: as many as one can have. The bridge writes lines about each.
const WAYPOINTS: u32 = 1024;

/// Flies, and gives the longest gap of the robot's telemetry, of a station's and of a page's, time until an order was
/// acknowledged, and time until a process had ended. The log is full from the beginning, or its reader of this kind
/// stops.
fn a_flight(stops: Option<OutputKind>, pace: &Pace) -> [Duration; 5] {
    let rig = sandbox();
    let mut log = match stops {
        None => UnreadOutput::full(&rig),
        Some(kind) => UnreadOutput::read(&rig, kind),
    };
    let (port, mut station, mut listening) = (free_port(), Station::new(), Station::new());
    let stations = [&station, &listening].map(|station| format!("127.0.0.1:{}", station.port()));
    rig.write(
        "mavlink.toml",
        &format!(
            "port = 0\nstations = {stations:?}\nlost_s = 60.0\nanswer_s = 60.0\nstate = 'state'\n"
        ),
    );
    rig.write("bridge.toml", FOR_SLOW_MACHINES);
    let processes = [
        log.start(&rig, "run sim --link dsp-1 --seed 1 --speed 10"),
        log.start(&rig, "run bridge --port dsp-1"),
        log.start(&rig, "run status"),
        log.start(&rig, "record --json >&2"),
        log.start(&rig, &format!("run view --port {port}")),
        log.start(&rig, "run mavlink"),
    ];
    pace.of_line(&processes[1]);
    station.connect();
    listening.connect();
    rig.watch(1).until_ready();
    let token = token(&rig, port);
    let mut listening_page = Page::open(port, Some(&token));
    let listeners = [
        pace::telemetry(&rig.domain),
        of_station(&mut listening),
        of_page(&mut listening_page),
    ];
    let mut answers = Vec::new();
    let [robot, at_station, at_page] = gaps(listeners, || {
        rig.run("start", 0);
        rig.run("takeoff 5m", 0);
        if stops.is_some() {
            log.stop_reading();
        }
        let (latitude, longitude, altitude) = place(&rig, 1);
        let fly = || {
            let point = |number: u32| {
                let north = latitude + 0.045 * f64::from(number) / f64::from(WAYPOINTS);
                format!(" {north},{longitude},{}", altitude + 5.0)
            };
            let points: String = (1..=WAYPOINTS).map(point).collect();
            let mut path = rig.start(&format!("goto{points}"));
            path.wait_for_text("goto: progress");
            path
        };
        let mut path = fly();
        let begin = Instant::now();
        assert_eq!(station.command(193, [0.0; 7]), 0, "hold");
        answers.push(begin.elapsed());
        path.wait_exit();
        let mut path = fly();
        // One that has drawn nothing old.
        let mut page = Page::open(port, Some(&token));
        page.until_type("robot");
        let begin = Instant::now();
        let report = page.order(&order("a1", "hold"));
        answers.push(begin.elapsed());
        assert_eq!(report["stage"], "done", "{report}");
        path.wait_exit();
        let ipc = rig.domain.join("operator");
        let mut client = ipc.client::<MovementData>().unwrap();
        let mut path = fly();
        let hold = MovementData::hold(fresh_request_id());
        answers.push(ask(&mut client, &hold));
        path.wait_exit();
        let land = MovementData::land(fresh_request_id());
        answers.push(ask(&mut client, &land));
        drop((client, ipc));
        rig.run("stop", 0);
    });
    let ends = processes.into_iter().rev().map(|mut process| {
        let begin = Instant::now();
        process.signal(Signal::TERM);
        process.exits(0);
        begin.elapsed()
    });
    let ended = ends.max().unwrap();
    rig.run("log check", 0);
    let acknowledged = answers.into_iter().max().unwrap();
    [robot, at_station, at_page, acknowledged, ended]
}

const LIMITS: [Duration; 5] = [GAP, GAP, GAP, ACKNOWLEDGED, ENDED];

#[test]
fn a_log_that_nobody_has_ever_read_stops_no_process() {
    judge("a log that was never read", LIMITS, |pace| {
        a_flight(None, pace)
    });
}

#[test]
fn a_log_whose_reader_stops_in_flight_stops_no_process() {
    for kind in [OutputKind::Pipe, OutputKind::Socket, OutputKind::Terminal] {
        let what = format!("a log whose reader stops, {kind:?}");
        judge(&what, LIMITS, |pace| a_flight(Some(kind), pace));
    }
}
