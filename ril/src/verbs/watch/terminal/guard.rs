//! [`Guard`]: the terminal's settings and its other screen, and how it was before.

use std::io;
use std::os::fd::BorrowedFd;
use std::panic;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use rustix::stdio::{stdin, stdout};
use rustix::termios::{OptionalActions, QueueSelector, Termios, tcflush, tcgetattr, tcsetattr};

use crate::verbs::watch::paint;

/// Gives the terminal back when it is dropped, and before a panic is reported.
pub(super) struct Guard {
    raw: Termios,
    saved: Arc<SavedTerminal>,
}

/// How the terminal was.
struct SavedTerminal {
    settings: Termios,
    is_taken: AtomicBool,
}

impl Guard {
    pub fn enter() -> io::Result<Guard> {
        let settings = tcgetattr(stdin())?;
        let mut raw = settings.clone();
        raw.make_raw();
        let saved = Arc::new(SavedTerminal {
            settings,
            is_taken: AtomicBool::new(true),
        });
        let guard = Guard {
            raw,
            saved: Arc::clone(&saved),
        };
        guard.set_raw()?;
        let before = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            // What is printed on the other screen goes with it.
            saved.give_back();
            before(info);
        }));
        Ok(guard)
    }

    pub fn set_raw(&self) -> io::Result<()> {
        Ok(tcsetattr(stdin(), OptionalActions::Now, &self.raw)?)
    }
}

impl Drop for Guard {
    fn drop(&mut self) {
        self.saved.give_back();
    }
}

impl SavedTerminal {
    /// Once.
    fn give_back(&self) {
        if !self.is_taken.swap(false, Ordering::AcqRel) {
            return;
        }
        // Best effort: a terminal that is gone needs nothing. What was typed and not read is not the shell's: it may be the rest of a
        // word that confirms an order.
        let _ = tcflush(stdin(), QueueSelector::IFlush);
        let _ = write_without_waiting(stdout(), paint::LEAVE);
        let _ = tcsetattr(stdin(), OptionalActions::Now, &self.settings);
    }
}

/// Writes `bytes` if the terminal takes them at once, or after what it has not taken was thrown away.
fn write_without_waiting(to: BorrowedFd<'_>, bytes: &[u8]) -> io::Result<()> {
    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    let takes = || {
        let mut polled = [PollFd::from_borrowed_fd(to, PollFlags::OUT)];
        let now = Timespec {
            tv_sec: 0,
            tv_nsec: 0,
        };
        poll(&mut polled, Some(&now)).is_ok_and(|ready| ready > 0)
    };
    if !takes() {
        tcflush(to, QueueSelector::OFlush)?;
    }
    if takes() {
        rustix::io::write(to, bytes)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::io::Read;
    use std::process::{Command, Stdio};

    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

    use super::*;

    /// Set in the process that is to panic.
    const IN_CHILD: &str = "RIL_TEST_PANICS_ON_A_TERMINAL";

    #[test]
    fn a_panic_gives_the_terminal_back_before_it_is_reported() {
        if std::env::var_os(IN_CHILD).is_some() {
            let _guard = Guard::enter().unwrap();
            rustix::io::write(stdout(), paint::ENTER).unwrap();
            panic!("tested on purpose");
        }
        let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
        let master = openpt(flags).unwrap();
        grantpt(&master).unwrap();
        unlockpt(&master).unwrap();
        let name = ptsname(&master, Vec::new()).unwrap();
        let name = name.to_str().unwrap();
        let slave = || File::options().read(true).write(true).open(name).unwrap();
        let terminal = slave();
        let before = format!("{:?}", tcgetattr(&terminal).unwrap());
        // This test alone, in a process whose terminal it is.
        let (_, module) = module_path!().split_once("::").unwrap();
        let test = format!("{module}::a_panic_gives_the_terminal_back_before_it_is_reported");
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", &test, "--nocapture", "--test-threads=1"])
            .env(IN_CHILD, "1")
            .env("RUST_BACKTRACE", "0")
            .stdin(Stdio::from(slave()))
            .stdout(Stdio::from(slave()))
            .stderr(Stdio::from(slave()))
            .spawn()
            .unwrap();
        assert!(!child.wait().unwrap().success());
        assert_eq!(format!("{:?}", tcgetattr(&terminal).unwrap()), before);
        drop(terminal);
        let mut bytes = Vec::new();
        // Without a slave the end of what was written is an error.
        let _ = File::from(master).read_to_end(&mut bytes);
        let text = String::from_utf8_lossy(&bytes).into_owned();
        let place = |what: &str| {
            text.find(what)
                .unwrap_or_else(|| panic!("{what:?} is not in {text:?}"))
        };
        let [enter, leave] =
            [paint::ENTER, paint::LEAVE].map(|bytes| std::str::from_utf8(bytes).unwrap());
        assert!(place(enter) < place(leave) && place(leave) < place("tested on purpose"));
    }
}
