//! What the tests share: a domain of their own with a watchdog, and waiting with a limit.

use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::{Duration, Instant};

use ipc_types::{Domain, Ipc, RobotId};

/// Far longer than any test takes; only a test that hangs meets it.
pub const WATCHDOG: Duration = Duration::from_secs(60);

/// Runs a test in a domain of its own, on a thread of its own because ports stay on one, and checks that nothing is
/// left of the domain.
pub fn in_domain(test: impl FnOnce(&Domain) + Send + 'static) {
    let domain = Domain::isolated();
    let (sender, receiver) = mpsc::channel::<()>();
    let thread = {
        let domain = domain.clone();
        thread::spawn(move || {
            // Dropped when the test ends, also when it fails.
            let _sender = sender;
            test(&domain);
        })
    };
    if receiver.recv_timeout(WATCHDOG) == Err(RecvTimeoutError::Timeout) {
        // The thread cannot be ended: say so, and let the process end with an error.
        eprintln!("a test in {} hangs", domain.root().display());
        std::process::abort();
    }
    let result = thread.join();
    let residue = domain.residue();
    // A failed test leaves nothing either, unless somebody is still in there.
    let _ = domain.remove_if_dead();
    if let Err(failure) = result {
        std::panic::resume_unwind(failure);
    }
    assert!(residue.is_empty(), "left behind: {residue:?}");
}

/// A part in the domain for robot 1.
#[allow(dead_code)]
pub fn join(domain: &Domain, process: &str) -> Ipc {
    Ipc::join(domain, RobotId::DEFAULT, process).expect("join")
}

/// Repeats `step`, which waits for something, until it says true; fails after the watchdog's time.
#[allow(dead_code)]
pub fn until(what: &str, mut step: impl FnMut() -> bool) {
    let end = Instant::now() + WATCHDOG / 2;
    while !step() {
        assert!(Instant::now() < end, "never: {what}");
    }
}
