//! A log that nobody reads stops no process: standard error is a full pipe from the beginning, or its reader stops in flight. Orders are
//! done, telemetry goes on, and each process ends at a signal.

use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::os::unix::net::UnixDatagram;
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
use ril_tests::{Process, Sandbox};
use rustix::event::{PollFd, PollFlags, poll};
use rustix::fs::{CWD, Mode, OFlags, mkfifoat};

use crate::common::{place, sandbox};
use crate::view::page::Page;
use crate::view::{order, token};

/// The name of the pipe that is standard error of all processes.
const PIPE: &str = "unread";

/// Longest gap of telemetry.
const GAP_LIMIT: Duration = Duration::from_millis(300);

/// Longest time until an order is acknowledged.
const ANSWER_LIMIT: Duration = Duration::from_secs(1);

/// Longest time until a process has ended after SIGTERM.
const END_LIMIT: Duration = Duration::from_secs(3);

/// How often the pace of this machine is looked at.
const LOOK: Duration = Duration::from_millis(20);

/// What a machine that stalls costs a chain of processes: several of its stalls.
const STALLS: u32 = 8;

/// Standard error of all processes, a named pipe in the folder.
struct Log(File);

impl Log {
    fn new(rig: &Sandbox) -> Log {
        let path = rig.path(PIPE);
        mkfifoat(CWD, &path, Mode::RUSR | Mode::WUSR).unwrap();
        let mut options = OpenOptions::new();
        options.read(true).write(true);
        options.custom_flags(OFlags::NONBLOCK.bits() as i32);
        Log(options.open(path).unwrap())
    }

    /// Nobody reads it any more.
    fn fill(&self) {
        for size in [4096, 1] {
            while (&self.0).write(&vec![b'x'; size]).is_ok() {}
        }
    }

    /// Reads it until the returned flag is set, by a thread.
    fn read(&self) -> (Arc<AtomicBool>, JoinHandle<usize>) {
        let mut pipe = self.0.try_clone().unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        let is_over = Arc::clone(&stop);
        let reader = thread::spawn(move || {
            let (mut bytes, mut count) = (vec![0; 1 << 16], 0);
            while !is_over.load(Ordering::Relaxed) {
                // Every process logs its wakes with `-vv`, so that something always comes.
                poll(&mut [PollFd::new(&pipe, PollFlags::IN)], None).unwrap();
                count += pipe.read(&mut bytes).unwrap();
            }
            count
        });
        (stop, reader)
    }
}

/// Starts `ril` with the log as its standard error, and returns when it tells its supervisor that it is ready.
fn start(rig: &Sandbox, args: &str) -> Process {
    let supervisor = rig.path("supervisor");
    let socket = UnixDatagram::bind(&supervisor).unwrap();
    socket.set_read_timeout(Some(WAIT_LIMIT)).unwrap();
    let mut command = rig.shell(&format!("exec \"$0\" -vv {args} 2>{PIPE}"));
    command.env("NOTIFY_SOCKET", &supervisor);
    command.env("XDG_RUNTIME_DIR", rig.folder());
    let process = rig.spawn(command);
    let mut message = [0; 64];
    let count = socket.recv(&mut message);
    let count = count.unwrap_or_else(|error| panic!("`{args}` is not ready: {error}"));
    assert_eq!(&message[..count], b"READY=1", "{args}");
    std::fs::remove_file(supervisor).unwrap();
    process
}

/// Looks at the robot's telemetry, and at the pace of the machine.
struct Watcher {
    stop: Arc<AtomicBool>,
    thread: JoinHandle<(Duration, Duration)>,
}

impl Watcher {
    fn start(rig: &Sandbox) -> Watcher {
        let domain = (*rig.domain).clone();
        let stop = Arc::new(AtomicBool::new(false));
        let is_over = Arc::clone(&stop);
        let thread = thread::spawn(move || {
            let ipc = Ipc::join(&domain, RobotId::DEFAULT, "watcher").unwrap();
            let mut telemetry = ipc.subscriber::<HeroTelemetry>().unwrap();
            let (mut last, mut gap, mut stall) = (None, 0, Duration::ZERO);
            while !is_over.load(Ordering::Relaxed) {
                let begin = Instant::now();
                telemetry.wait(LOOK).unwrap();
                stall = stall.max(begin.elapsed().saturating_sub(LOOK));
                let _ = telemetry.drain(|sample| {
                    let before = last.replace(sample.published_ns);
                    gap = gap.max(sample.published_ns - before.unwrap_or(sample.published_ns));
                });
            }
            (Duration::from_nanos(gap), stall)
        });
        Watcher { stop, thread }
    }

    /// The longest gap of telemetry, and the longest stall of the machine.
    fn end(self) -> (Duration, Duration) {
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

fn a_flight(is_full_from_the_beginning: bool) {
    let rig = sandbox();
    let log = Log::new(&rig);
    let reader = match is_full_from_the_beginning {
        true => {
            log.fill();
            None
        }
        false => Some(log.read()),
    };
    let (port, mut station) = (free_port(), Station::new());
    rig.write(
        "mavlink.toml",
        &format!(
            "port = 0\nstations = ['127.0.0.1:{}']\nlost_s = 60.0\nanswer_s = 60.0\nstate = 'state'\n",
            station.port()
        ),
    );
    rig.write("bridge.toml", ril_tests::sandbox::FOR_SLOW_MACHINES);
    let processes = [
        start(&rig, "run sim --link dsp-1 --seed 1 --speed 10"),
        start(&rig, "run bridge --port dsp-1"),
        start(&rig, "run status"),
        start(&rig, &format!("record --json >{PIPE}")),
        start(&rig, &format!("run view --port {port}")),
        start(&rig, "run mavlink"),
    ];
    let mut page = Page::open(port, Some(&token(&rig, port)));
    station.connect();
    rig.watch(1).until_ready();
    let watcher = Watcher::start(&rig);
    rig.run("start", 0);
    rig.run("takeoff 5m", 0);
    if let Some((stop, reader)) = reader {
        stop.store(true, Ordering::Relaxed);
        assert!(reader.join().unwrap() > 0, "something was logged");
        log.fill();
    }
    let (latitude, longitude, altitude) = place(&rig, 1);
    let fly = || {
        let (north, up) = (latitude + 0.045, altitude + 5.0);
        let mut path = rig.start(&format!("goto {north},{longitude},{up}"));
        path.wait_for_text("goto: progress");
        path
    };
    let mut answers = Vec::new();
    let path = fly();
    let begin = Instant::now();
    assert_eq!(station.command(193, [0.0; 7]), 0, "hold");
    answers.push(("the station's hold", begin.elapsed()));
    drop(path);
    let path = fly();
    let begin = Instant::now();
    let report = page.order(&order("a1", "hold"));
    answers.push(("the page's hold", begin.elapsed()));
    assert_eq!(report["stage"], "done", "{report}");
    drop(path);
    let ipc = rig.domain.join("operator");
    let mut client = ipc.client::<MovementData>().unwrap();
    let path = fly();
    let hold = MovementData::hold(fresh_request_id());
    answers.push(("hold", ask(&mut client, &hold)));
    drop(path);
    let land = MovementData::land(fresh_request_id());
    answers.push(("land", ask(&mut client, &land)));
    drop((client, ipc));
    rig.run("stop", 0);

    let (gap, stall) = watcher.end();
    let slack = stall * STALLS;
    assert!(gap < GAP_LIMIT + slack, "telemetry: {gap:?}, {stall:?}");
    for (what, took) in answers {
        assert!(took < ANSWER_LIMIT + slack, "{what}: {took:?}, {stall:?}");
    }
    for mut process in processes.into_iter().rev() {
        let begin = Instant::now();
        process.signal(Signal::TERM);
        process.exits(0);
        let took = begin.elapsed();
        assert!(took < END_LIMIT + slack, "the end: {took:?}, {stall:?}");
    }
    rig.run("log check", 0);
}

#[test]
fn a_log_that_nobody_has_ever_read_stops_no_process() {
    a_flight(true);
}

#[test]
fn a_log_whose_reader_stops_in_flight_stops_no_process() {
    a_flight(false);
}
