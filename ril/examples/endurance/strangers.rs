//! Very many files of somebody else in `/dev/shm`, made in flight: what lists that folder takes longer with each of them.
//!
//! Runs in a `/dev/shm` of its own, see [`crate::memory`].

use std::fmt;
use std::fs::{self, File};
use std::os::unix::fs::chown;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::{Duration, Instant};

use ril_tests::process::{Signal, Stream, WAIT_LIMIT};

use crate::crew::{Site, ask, end, start_chain};
use crate::memory;
use crate::spread::Spread;

/// Options of the file system.
pub const MOUNT_OPTIONS: &str = "size=512m,nr_inodes=1m";

/// Somebody else: `nobody`.
const OTHER_USER: u32 = 65534;

/// Samples that are heard before the files are made, and after: 4 s, in which the processes clean up several times. One
/// comes every 5 ms, because the simulated clock is four times as fast.
const SAMPLES: usize = 800;

/// What to do.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    /// How many files.
    pub files: u32,
}

/// What came of it.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// How many files.
    pub files: u32,
    /// Between two samples, as they came to a consumer: before.
    pub before: Spread,
    /// While the files were made, and after.
    pub among: Spread,
    /// From the start of another bridge until it was ready.
    pub restart: Duration,
    /// From the start of `ril status` until it had answered.
    pub state: Duration,
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ms = |time: Duration| time.as_secs_f64() * 1e3;
        write!(
            f,
            "| {} files | {} | {} | restart {:.0} ms, state {:.0} ms |",
            self.files,
            self.before,
            self.among,
            ms(self.restart),
            ms(self.state)
        )
    }
}

/// Makes the files while the chain flies.
///
/// # Panics
///
/// When this is not in a `/dev/shm` of its own, when telemetry ends, when a process does not start, or when something is
/// left.
pub fn run(site: &Site, plan: &Plan) -> Outcome {
    assert!(memory::is_own(), "everybody would have to live with them");
    let [sim, bridge, status] = start_chain(site);
    ask(site, "start");
    ask(site, "takeoff --altitude 5");
    let consumer = Consumer::start(site);
    let before = consumer.hear(SAMPLES);
    let making = thread::spawn({
        let files = plan.files;
        move || make(files)
    });
    let mut among = Vec::new();
    while !making.is_finished() {
        among.extend(consumer.hear(1));
    }
    making.join().expect("the files can be made");
    among.extend(consumer.hear(SAMPLES));

    let started = Instant::now();
    ask(site, "status");
    let state = started.elapsed();
    ask(site, "land");
    ask(site, "stop");
    bridge.signal(Signal::KILL);
    drop(bridge);
    let started = Instant::now();
    let mut bridge = site.start("run bridge --port dsp");
    bridge.wait_for_text("ready");
    let restart = started.elapsed();
    consumer.hear(SAMPLES);
    consumer.end();
    [status, bridge, sim].into_iter().for_each(end);
    remove(plan.files);
    site.domain.assert_empty();
    Outcome {
        files: plan.files,
        before: before.into_iter().collect(),
        among: among.into_iter().collect(),
        restart,
        state,
    }
}

/// `ril echo`, on a thread of its own that notes when each line came.
struct Consumer {
    process: u32,
    times: mpsc::Receiver<Instant>,
    thread: thread::JoinHandle<()>,
}

impl Consumer {
    fn start(site: &Site) -> Consumer {
        let mut process = site.start("echo hero --json --field sequence --timeout 80s");
        process.wait_for_line(|line| line.stream == Stream::Stdout);
        let id = process.id();
        let (sender, times) = mpsc::channel();
        let thread = thread::spawn(move || {
            // The summary on standard error is its last word.
            while process.wait_for_line(|_| true).stream == Stream::Stdout {
                // At the end nobody listens any more.
                let _ = sender.send(Instant::now());
            }
            let finished = process.wait_exit();
            assert_eq!(finished.code(), Some(0), "{finished:#?}");
        });
        Consumer {
            process: id,
            times,
            thread,
        }
    }

    /// Waits for so many samples, and says how far apart they came.
    #[track_caller]
    fn hear(&self, samples: usize) -> Vec<Duration> {
        let mut last = self.next();
        let mut gaps = Vec::new();
        for _ in 0..samples {
            let next = self.next();
            gaps.push(next - last);
            last = next;
        }
        gaps
    }

    #[track_caller]
    fn next(&self) -> Instant {
        match self.times.recv_timeout(WAIT_LIMIT) {
            Ok(time) => time,
            Err(RecvTimeoutError::Timeout) => panic!("no telemetry for {WAIT_LIMIT:?}"),
            Err(RecvTimeoutError::Disconnected) => panic!("the consumer has ended"),
        }
    }

    fn end(self) {
        let process = rustix::process::Pid::from_raw(self.process as i32).expect("a process");
        rustix::process::kill_process(process, Signal::INT).expect("it runs");
        self.thread.join().expect("it ends in order");
    }
}

fn path(number: u32) -> String {
    format!("/dev/shm/stranger-{number}")
}

fn make(files: u32) {
    let is_root = rustix::process::geteuid().is_root();
    for number in 0..files {
        let path = path(number);
        File::create_new(&path).expect("a file");
        if is_root {
            // Root of a user namespace has nobody to give them to.
            let _ = chown(&path, Some(OTHER_USER), None);
        }
    }
}

fn remove(files: u32) {
    for number in 0..files {
        fs::remove_file(path(number)).expect("it is still there");
    }
}
