//! A log that nobody reads stops no process: standard error is a full pipe from the beginning, or its reader stops in
//! flight. Orders are done, telemetry goes on, and each process ends at a signal.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use endurance::mavlink::station::Station;
use ipc_types::code::Stage;
use ipc_types::payload::{HeroTelemetry, MovementData};
use ipc_types::{Client, Ipc, RobotId, fresh_request_id};
use ril_tests::process::{Signal, WAIT_LIMIT};
use ril_tests::sandbox::free_port;
use ril_tests::{Sandbox, UnreadPipe};

use crate::common::{FOR_SLOW_MACHINES, Pace, place, sandbox};
use crate::view::page::Page;
use crate::view::{order, token};
use crate::waits::held_up::{ACKNOWLEDGED, ENDED, GAP, judge};

/// Looks at the robot's telemetry.
struct Watcher {
    stop: Arc<AtomicBool>,
    thread: JoinHandle<Duration>,
}

impl Watcher {
    fn start(rig: &Sandbox) -> Watcher {
        let domain = (*rig.domain).clone();
        let stop = Arc::new(AtomicBool::new(false));
        let is_over = Arc::clone(&stop);
        let thread = thread::spawn(move || {
            let ipc = Ipc::join(&domain, RobotId::DEFAULT, "watcher").unwrap();
            let mut telemetry = ipc.subscriber::<HeroTelemetry>().unwrap();
            let (mut last, mut gap) = (None, 0);
            while !is_over.load(Ordering::Relaxed) {
                telemetry.wait(GAP).unwrap();
                let _ = telemetry.drain(|sample| {
                    let before = last.replace(sample.published_ns);
                    gap = gap.max(sample.published_ns - before.unwrap_or(sample.published_ns));
                });
            }
            Duration::from_nanos(gap)
        });
        Watcher { stop, thread }
    }

    /// The longest gap of telemetry.
    fn end(self) -> Duration {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.join().unwrap()
    }
}

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

/// Flies, and gives the longest gap of telemetry, time until an order was acknowledged, and time until a process had
/// ended.
fn a_flight(is_full_from_the_beginning: bool, pace: &Pace) -> [Duration; 3] {
    let rig = sandbox();
    let mut log = match is_full_from_the_beginning {
        true => UnreadPipe::full(&rig),
        false => UnreadPipe::read(&rig),
    };
    let (port, mut station) = (free_port(), Station::new());
    rig.write(
        "mavlink.toml",
        &format!(
            "port = 0\nstations = ['127.0.0.1:{}']\nlost_s = 60.0\nanswer_s = 60.0\nstate = 'state'\n",
            station.port()
        ),
    );
    rig.write("bridge.toml", FOR_SLOW_MACHINES);
    let processes = [
        log.start(&rig, "run sim --link dsp-1 --seed 1 --speed 10"),
        log.start(&rig, "run bridge --port dsp-1"),
        log.start(&rig, "run status"),
        log.start(&rig, &format!("record --json >{}", UnreadPipe::NAME)),
        log.start(&rig, &format!("run view --port {port}")),
        log.start(&rig, "run mavlink"),
    ];
    pace.of_line(&processes[1]);
    station.connect();
    rig.watch(1).until_ready();
    let watcher = Watcher::start(&rig);
    rig.run("start", 0);
    rig.run("takeoff 5m", 0);
    if !is_full_from_the_beginning {
        log.stop_reading();
    }
    let (latitude, longitude, altitude) = place(&rig, 1);
    let fly = || {
        let (north, up) = (latitude + 0.045, altitude + 5.0);
        let mut path = rig.start(&format!("goto {north},{longitude},{up}"));
        path.wait_for_text("goto: progress");
        path
    };
    let mut answers = Vec::new();
    let mut path = fly();
    let begin = Instant::now();
    assert_eq!(station.command(193, [0.0; 7]), 0, "hold");
    answers.push(begin.elapsed());
    path.wait_exit();
    let mut path = fly();
    // One that has drawn nothing old.
    let mut page = Page::open(port, Some(&token(&rig, port)));
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

    let gap = watcher.end();
    let ends = processes.into_iter().rev().map(|mut process| {
        let begin = Instant::now();
        process.signal(Signal::TERM);
        process.exits(0);
        begin.elapsed()
    });
    let ended = ends.max().unwrap();
    rig.run("log check", 0);
    [gap, answers.into_iter().max().unwrap(), ended]
}

#[test]
fn a_log_that_nobody_has_ever_read_stops_no_process() {
    judge(
        "a log that was never read",
        [GAP, ACKNOWLEDGED, ENDED],
        |pace| a_flight(true, pace),
    );
}

#[test]
fn a_log_whose_reader_stops_in_flight_stops_no_process() {
    judge(
        "a log whose reader stops",
        [GAP, ACKNOWLEDGED, ENDED],
        |pace| a_flight(false, pace),
    );
}
