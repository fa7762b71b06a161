//! Nothing but its one wait holds a process up. Each process is watched in flight, while clients come and go, by
//! strace: its loop calls nothing that is not on the [list](calls::LIST). And each other kind of call is held up by
//! three seconds: telemetry, `hold`, `land` and the end of the process do not wait for it.

mod calls;
mod disks;
mod held_up;

use std::collections::BTreeMap;
use std::fs;
use std::iter;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant, SystemTime};

use endurance::mavlink::mission::{mission, upload};
use endurance::mavlink::station::{Received, Station};
use mavlink_gateway::message::{ATTITUDE, MISSION_ACK};
use ril_tests::languages::skip;
use ril_tests::pace::NextSample;
use ril_tests::process::Signal;
use ril_tests::relayed::{STATION, await_link, free_endpoint};
use ril_tests::sandbox::free_port;
use ril_tests::{Process, Sandbox};

use crate::common::{has_relay, place, sandbox};
use crate::view::{page::Page, token};
use calls::Trace;

/// Whether strace is there. A line on standard error says when it is not, also when tests that pass print nothing.
pub fn has_strace(what: &str) -> bool {
    let mut command = Command::new("strace");
    command.args(["-qq", "-e", "trace=none", "true"]);
    let works = command.stdout(Stdio::null()).stderr(Stdio::null()).status();
    let works = works.is_ok_and(|status| status.success());
    if !works {
        skip(what, "this machine has no strace, or does not let it trace");
    }
    works
}

/// Waits for the next telemetry that a station gets.
pub fn of_station(station: &mut Station) -> NextSample<'_> {
    Box::new(|| {
        let give_up = Instant::now() + Duration::from_secs(5);
        let is_telemetry = |message: Received| message.is(ATTITUDE.id);
        iter::from_fn(|| (Instant::now() < give_up).then(|| station.next_message()))
            .any(|message| message.is_some_and(is_telemetry))
    })
}

/// Waits for the next telemetry that a page gets.
pub fn of_page(page: &mut Page) -> NextSample<'_> {
    Box::new(|| page.until_type("now")["type"] == "now")
}

/// The time as strace writes it.
fn now() -> Duration {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    now.expect("a clock after 1970")
}

/// A process whose system calls are written down.
struct Traced {
    name: &'static str,
    process: Process,
    file: PathBuf,
    ready: Duration,
}

impl Traced {
    fn start(rig: &Sandbox, name: &'static str, args: &str, ready: &str) -> Traced {
        let file = rig.path(&format!("{name}.calls"));
        // strace is no parent of it, and its page's token lies in the folder.
        let line = format!(
            "XDG_RUNTIME_DIR=. exec strace -D -f -qq -ttt -y -o {} \"$0\" {args}",
            file.display()
        );
        let mut process = Process::spawn(&rig.domain, rig.shell(&line));
        process.wait_for_text(ready);
        Traced {
            name,
            process,
            file,
            ready: now(),
        }
    }

    /// Ends the process, and says what its loop called until then.
    fn end(self) -> (&'static str, Trace) {
        let (id, asked) = (self.process.id(), now());
        let maps = fs::read_to_string(format!("/proc/{id}/maps")).expect("a process");
        self.process.end();
        let text = fs::read(&self.file).expect("a file of strace");
        let text = String::from_utf8_lossy(&text);
        (
            self.name,
            Trace::read(&text, &maps, self.name, id, [self.ready, asked]),
        )
    }
}

/// Ends the processes, and asserts that their loops called only what is on the list.
#[track_caller]
fn assert_nothing_else(traced: impl IntoIterator<Item = Traced, IntoIter: DoubleEndedIterator>) {
    let mut others = BTreeMap::new();
    // A process ends before what it listens to.
    for (name, trace) in traced.into_iter().rev().map(Traced::end) {
        assert!(trace.seen.len() > 3, "{name}: {:?}", trace.seen);
        others.extend(
            trace
                .others
                .into_iter()
                .map(|(what, example)| ((name, what), example)),
        );
    }
    let rows = others
        .iter()
        .map(|((name, (call, about)), (example, count))| {
            format!("{name}: {count} calls of {call} ({about:?}), such as\n    {example}\n")
        });
    let rows: String = rows.collect();
    assert!(rows.is_empty(), "not on the list:\n{rows}");
}

#[test]
fn a_loop_in_flight_calls_nothing_that_waits() {
    if !has_strace("the system calls of loops in flight") {
        return;
    }
    let rig = sandbox();
    let mut station = Station::new();
    rig.write("bridge.toml", crate::common::FOR_SLOW_MACHINES);
    rig.write(
        "mavlink.toml",
        &format!(
            "port = 0\nstations = ['127.0.0.1:{}']\nlost_s = 60.0\nanswer_s = 60.0\nstate = 'state'\n[fence]\naccept = true\n",
            station.port()
        ),
    );
    let port = free_port();
    let traced = [
        (
            "sim",
            "run sim --link dsp-1 --seed 1 --speed 4".to_owned(),
            "ready",
        ),
        ("bridge", "run bridge --port dsp-1".to_owned(), "ready"),
        // Before a process that it looks at when that comes.
        ("record", "record".to_owned(), "recording"),
        ("status", "run status".to_owned(), "ready"),
        ("mavlink", "run mavlink".to_owned(), "ready"),
        ("view", format!("run view --port {port}"), "ready"),
    ];
    let traced = traced.map(|(name, args, ready)| Traced::start(&rig, name, &args, ready));
    station.connect();
    rig.watch(1).until_ready();
    let mut page = Page::open(port, Some(&token(&rig, port)));
    page.until_type("hello");
    // What a station sends comes onto the disk, and into the bridge's file, which the bridge reads again.
    disks::send_fence(&mut station);
    let is_of_fence = |message: &Received| message.is(MISSION_ACK.id) && message.u8(3) == 1;
    assert_eq!(station.until("a fence", is_of_fence).u8(2), 0);
    assert_eq!(upload(&mut station, &mission(3, 15.0)), 0);
    rig.run("start", 0);
    rig.run("takeoff 5m", 0);
    let (latitude, longitude, altitude_m) = place(&rig, 1);
    rig.run(
        &format!(
            "goto {},{longitude},{altitude_m} --no-wait",
            latitude + 0.01
        ),
        0,
    );
    rig.run("fence reload", 0);
    rig.run("param list", 0);
    for topic in ["hero", "dsp", "state"] {
        rig.run(&format!("echo {topic} --count 3"), 0);
    }
    let mut killed = rig.start("echo hero --json");
    killed.wait_for_text("{");
    killed.signal(Signal::KILL);
    killed.wait_exit();
    // Hold, by the station.
    assert_eq!(station.command(193, [0.0; 7]), 0);
    drop(page);
    // Its hold may still be under way.
    rig.run("land --preempt", 0);

    assert_nothing_else(traced);
}

#[test]
fn a_relay_s_loop_calls_nothing_that_waits() {
    let what = "the system calls of relays";
    if !has_strace(what) || !has_relay(what) {
        return;
    }
    let (robot, station) = (sandbox(), sandbox());
    let processes = robot.start_robot(1, 4);
    let endpoint = free_endpoint();
    let mut traced = [
        Traced::start(
            &robot,
            "relay-robot",
            &format!("relay robot --listen {endpoint} --may-command {STATION}"),
            "ready",
        ),
        Traced::start(
            &station,
            "relay-station",
            &format!("relay station --name {STATION} --connect {endpoint}"),
            "ready",
        ),
    ];
    await_link(&station, 1);
    station.run("echo hero --count 1", 0);
    // The ports of a robot are made when it comes: a start of its own.
    traced.iter_mut().for_each(|relay| relay.ready = now());
    for order in ["start", "takeoff 5m", "hold", "param list"] {
        station.run(order, 0);
    }
    station.run("echo hero --count 3", 0);
    let mut killed = station.start("echo hero --json");
    killed.wait_for_text("{");
    killed.signal(Signal::KILL);
    killed.wait_exit();
    station.run("land", 0);
    assert_nothing_else(traced);
    processes.end();
}
