//! [`Watchdog`]: ends a test that hangs, and everything that it started, with a word about which one it was.
//!
//! It is the only upper limit of time in these tests: a machine that stalls must not fail them, a test that hangs must
//! not hold up everything for ever.

use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::thread;
use std::time::Duration;

use crate::process;

/// How long a test may take before it counts as hanging: far longer than any test takes, stalls of the machine
/// included.
pub const DEFAULT_LIMIT: Duration = Duration::from_secs(300);

/// While it lives, the test must end within its limit.
///
/// Otherwise the registered children ([`Process`](crate::process::Process)) are killed with their process groups, and
/// the test process is aborted: a thread that hangs cannot be ended any other way.
#[derive(Debug)]
pub struct Watchdog {
    /// Dropping it tells the thread that all is well.
    _alive: Sender<()>,
}

impl Watchdog {
    /// Watches over the test of the present thread for [`DEFAULT_LIMIT`].
    pub fn start() -> Watchdog {
        let name = thread::current().name().unwrap_or("a test").to_owned();
        Watchdog::with_limit(&name, DEFAULT_LIMIT)
    }

    /// Watches over `name` for `limit`.
    pub fn with_limit(name: &str, limit: Duration) -> Watchdog {
        Watchdog::with_action(name, limit, |message| {
            eprintln!("{message}");
            process::kill_all();
            std::process::abort();
        })
    }

    fn with_action(
        name: &str,
        limit: Duration,
        action: impl FnOnce(&str) + Send + 'static,
    ) -> Watchdog {
        let (alive, watch) = mpsc::channel::<()>();
        let name = name.to_owned();
        thread::spawn(move || {
            if watch.recv_timeout(limit) == Err(RecvTimeoutError::Timeout) {
                let children = process::list();
                action(&format!(
                    "watchdog: `{name}` hangs, it did not end within {limit:?}; its children are killed: {children:?}"
                ));
            }
        });
        Watchdog { _alive: alive }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_says_which_test_hangs() {
        let (sender, receiver) = mpsc::channel();
        let watchdog = Watchdog::with_action("a slow test", Duration::ZERO, move |message| {
            sender.send(message.to_owned()).expect("the test listens");
        });
        let message = receiver.recv().expect("a message");
        assert!(message.contains("`a slow test` hangs"), "{message}");
        drop(watchdog);
    }

    #[test]
    fn a_test_that_ends_in_time_is_left_alone() {
        let (sender, receiver) = mpsc::channel::<String>();
        let watchdog = Watchdog::with_action("a quick test", DEFAULT_LIMIT, move |message| {
            sender.send(message.to_owned()).expect("the test listens");
        });
        drop(watchdog);
        // The thread ends and drops the action without having said anything.
        assert!(receiver.recv().is_err());
    }
}
