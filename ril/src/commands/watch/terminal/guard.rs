//! [`Guard`]: the terminal's settings and its other screen, and how it was before.

use std::io;
use std::os::fd::BorrowedFd;
use std::panic;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use rustix::stdio::{stdin, stdout};
use rustix::termios::{OptionalActions, QueueSelector, Termios, tcflush, tcgetattr, tcsetattr};

use crate::watch::paint;

/// Gives the terminal back when it is dropped, and before a panic is told.
pub(super) struct Guard {
    raw: Termios,
    saved: Arc<Saved>,
}

/// How the terminal was.
struct Saved {
    settings: Termios,
    is_taken: AtomicBool,
}

impl Guard {
    pub fn enter() -> io::Result<Guard> {
        let settings = tcgetattr(stdin())?;
        let mut raw = settings.clone();
        raw.make_raw();
        let saved = Arc::new(Saved {
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
            // What is told on the other screen goes with it.
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

impl Saved {
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
