//! [`TestDomain`]: shared memory of a test's own, and the proof that nothing of it is left.
//!
//! Tests run at the same time and on machines where a real RIL may run: a test never uses the user's own domain.

use std::fmt::Write;
use std::ops::Deref;
use std::path::PathBuf;

use ipc_types::{Domain, Ipc, Removal, RobotId};

use crate::watchdog::Watchdog;

/// An isolated [`Domain`] that asserts when it is dropped that nothing of it is left behind.
///
/// Make it first, so that it is dropped last: ports and processes that are still there then count as left behind. It
/// brings a [`Watchdog`] along. After a test that fails anyway it only tidies up.
///
/// It stands for its domain wherever one is asked for: `domain.environment()` is for children, which
/// [`Process`](crate::process::Process) sets by itself.
#[derive(Debug)]
pub struct TestDomain {
    domain: Domain,
    _watchdog: Watchdog,
}

impl TestDomain {
    /// A domain that nobody else has. Nothing of it exists before somebody joins.
    pub fn new() -> TestDomain {
        TestDomain::watched_by(Watchdog::start())
    }

    /// Like [`TestDomain::new`] with a watchdog of the caller's choice: for what lasts longer than a test.
    pub fn watched_by(watchdog: Watchdog) -> TestDomain {
        TestDomain {
            domain: Domain::isolated(),
            _watchdog: watchdog,
        }
    }

    /// Joins the domain for robot 1, on this thread. A test may join as often as it likes.
    ///
    /// # Panics
    ///
    /// When that is not possible, with the reason.
    pub fn join(&self, process_name: &str) -> Ipc {
        self.join_as(RobotId::DEFAULT, process_name)
    }

    /// Joins the domain for `robot`, on this thread.
    ///
    /// # Panics
    ///
    /// When that is not possible, with the reason.
    pub fn join_as(&self, robot: RobotId, process_name: &str) -> Ipc {
        match Ipc::join(&self.domain, robot, process_name) {
            Ok(ipc) => ipc,
            Err(error) => panic!("`{process_name}` cannot join the test's domain: {error}"),
        }
    }

    /// Asserts that nothing of the domain exists at this moment: for tests that go on after everybody left.
    ///
    /// # Panics
    ///
    /// When something exists, with a list.
    #[track_caller]
    pub fn assert_empty(&self) {
        let residue = self.domain.residue();
        assert!(residue.is_empty(), "{}", describe(&residue));
    }

    /// Removes what killed processes left, as the next start would do, and says what was done.
    ///
    /// A test that kills the last process of the domain calls this at its end.
    ///
    /// # Panics
    ///
    /// When it cannot be removed, with the reason.
    pub fn sweep(&self) -> Removal {
        match self.domain.remove_if_dead() {
            Ok(removal) => removal,
            Err(error) => panic!("the test's domain cannot be swept: {error}"),
        }
    }
}

impl Default for TestDomain {
    fn default() -> Self {
        TestDomain::new()
    }
}

impl Deref for TestDomain {
    type Target = Domain;

    fn deref(&self) -> &Domain {
        &self.domain
    }
}

impl Drop for TestDomain {
    fn drop(&mut self) {
        let residue = self.domain.residue();
        if residue.is_empty() {
            return;
        }
        // The next test must not find it, whatever becomes of this one.
        let removal = self.domain.remove_if_dead();
        if std::thread::panicking() {
            return;
        }
        let state = match removal {
            Ok(Removal::InUse) => "a process, or a port of this test, still uses it",
            Ok(_) => "nobody uses it any more, it was removed now",
            Err(_) => "it could not be removed",
        };
        panic!("{}({state})", describe(&residue));
    }
}

/// The list that a failing test shows.
fn describe(residue: &[PathBuf]) -> String {
    let mut text = format!("{} things are left of the test's domain:\n", residue.len());
    for path in residue {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "  {}", path.display());
    }
    text
}

#[cfg(test)]
mod tests {
    use std::panic::{AssertUnwindSafe, catch_unwind};

    use ipc_types::payload::HeroTelemetry;

    use super::*;

    #[test]
    fn what_is_closed_leaves_nothing() {
        let domain = TestDomain::new();
        domain.assert_empty();
        let ipc = domain.join("consumer");
        assert!(!domain.residue().is_empty());
        drop(ipc);
        domain.assert_empty();
        assert_eq!(domain.sweep(), Removal::Nothing);
    }

    #[test]
    fn what_is_left_fails_the_test_with_a_list() {
        let domain = TestDomain::new();
        let root = domain.root().to_owned();
        let ipc = domain.join("consumer");
        let subscriber = ipc.subscriber::<HeroTelemetry>().expect("a subscriber");
        let failure = catch_unwind(AssertUnwindSafe(|| drop(domain))).expect_err("it must fail");
        let text = failure.downcast_ref::<String>().expect("a text");
        assert!(text.contains(&root.display().to_string()), "{text}");
        assert!(text.contains("still uses it"), "{text}");
        drop((subscriber, ipc));
        assert!(!root.exists());
    }
}
