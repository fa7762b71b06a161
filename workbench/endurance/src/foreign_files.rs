//! Very many files of another user in `/dev/shm`, made in flight: what lists that folder takes longer with each of them.
//!
//! Runs in a `/dev/shm` of its own, see [`crate::memory`].

use std::fs::{self, File};
use std::os::unix::fs::chown;
use std::thread;
use std::time::Instant;

use ipc_types::payload::HeroTelemetry;
use ril_tests::process::Signal;

use crate::listener::Listener;
use crate::memory;
use crate::outcome::{Outcome, Times};
use crate::plan::{Kind, Plan};
use crate::site::Site;

/// Options of the file system.
pub const MOUNT_OPTIONS: &str = "size=512m,nr_inodes=1m";

/// The other user: `nobody`.
const OTHER_USER: u32 = 65534;

/// Samples that are received before the files are made, and after: 4 s, in which the processes clean up several times. One
/// comes every 5 ms, because the simulated clock is four times as fast.
const SAMPLES: usize = 800;

/// Makes the files while the chain flies.
///
/// # Panics
///
/// When this is not in a `/dev/shm` of its own, when telemetry ends, when a process does not start, or when something is
/// left.
pub fn run(site: &Site, plan: &Plan) -> Outcome {
    assert!(memory::is_own(), "everybody would have to live with them");
    let files = plan.count.unwrap_or(200_000);
    let [sim, bridge, status] = site.start_flight();
    let listener = Listener::start(&site.domain, |sample: &HeroTelemetry| sample.epoch_ns);
    let mut outcome = Outcome::default();
    outcome.cell("files", files);
    outcome.cell("between samples, before", listener.gaps(SAMPLES));
    let making = thread::spawn(move || make(files));
    let mut among = Times::default();
    while !making.is_finished() {
        among.0.extend(listener.gaps(1).0);
    }
    making.join().expect("the files can be made");
    among.0.extend(listener.gaps(SAMPLES).0);
    outcome.cell("among them", among);

    let started = Instant::now();
    site.ask("status");
    outcome.cell("state, ms", started.elapsed().as_millis());
    site.ask("land");
    site.ask("stop");
    bridge.signal(Signal::KILL);
    drop(bridge);
    let started = Instant::now();
    let bridge = site.start_working(Kind::Bridge);
    outcome.cell("restart, ms", started.elapsed().as_millis());
    listener.gaps(SAMPLES);
    listener.end();
    remove(files);
    site.end([sim, bridge, status], false);
    outcome
}

fn path(number: u32) -> String {
    format!("/dev/shm/foreign-{number}")
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
