//! Who sends, as the kernel knows it, and the end of the one who commands and of the one who ordered the path: a
//! descriptor of its process, which wakes the bridge.
//!
//! Numbers of processes mean something in one PID namespace only. A process in another one, whose number may be
//! another's here, is not known: it is a sender by itself, silence ends its control, and the end of its path's client
//! is noticed within two seconds.

use std::os::fd::{AsFd, BorrowedFd, OwnedFd};

use ipc_types::Ipc;
use runtime::session::session_of;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use rustix::process::{Pid, PidfdFlags, pidfd_open, test_kill_process};

use crate::flight::control::{Sender, SenderClock};

/// Says what is known of senders.
pub struct Senders {
    ipc: Ipc,
    /// The last one. To look whether a number is that of a process of the robot takes some 30 system calls.
    last: Watched,
    clock: SenderClock,
}

impl Senders {
    /// Of these processes.
    pub fn of(ipc: &Ipc) -> Senders {
        Senders {
            ipc: ipc.clone(),
            last: Watched::default(),
            clock: SenderClock::Unknown,
        }
    }

    /// What is known of the process with this number.
    pub fn sender_of(&mut self, process: Option<u32>) -> Sender {
        let lives = self.last.descriptor().is_some() && self.last.ended().is_none();
        if self.last.process != process || !lives {
            self.last = Watched::default();
            self.last.follow(process);
            self.clock = match process.and_then(|process| self.ipc.shares_clock_with(process)) {
                Some(true) => SenderClock::Own,
                Some(false) => SenderClock::Other,
                None => SenderClock::Unknown,
            };
        }
        Sender {
            process,
            session: session(process),
            clock: self.clock,
        }
    }
}

fn session(process: Option<u32>) -> Option<u32> {
    let leader = process
        .and_then(pid)
        .and_then(|pid| session_of(Some(pid)))
        .filter(|leader| test_kill_process(*leader) != Err(Errno::SRCH));
    leader.map(|leader| leader.as_raw_nonzero().get() as u32)
}

fn pid(process: u32) -> Option<Pid> {
    i32::try_from(process).ok().and_then(Pid::from_raw)
}

/// A process whose end the bridge must know.
#[derive(Debug, Default)]
pub struct Watched {
    process: Option<u32>,
    /// `None` if its end cannot be seen.
    watched: Option<OwnedFd>,
}

impl Watched {
    /// What wakes the bridge.
    pub fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        self.watched.as_ref().map(AsFd::as_fd)
    }

    /// Watches this process from now on. Says which process has ended, if it is that one.
    pub fn follow(&mut self, process: Option<u32>) -> Option<u32> {
        if self.process == process {
            return None;
        }
        self.process = process;
        let opened = process
            .and_then(pid)
            .map(|pid| pidfd_open(pid, PidfdFlags::empty()));
        let is_gone = matches!(opened, Some(Err(Errno::SRCH)));
        self.watched = opened.and_then(Result::ok);
        process.filter(|_| is_gone)
    }

    /// Which process has ended, if the watched one has.
    pub fn ended(&self) -> Option<u32> {
        let watched = self.watched.as_ref()?;
        let mut ready = [PollFd::new(watched, PollFlags::IN)];
        let count = poll(&mut ready, Some(&Timespec::default()));
        self.process.filter(|_| matches!(count, Ok(1)))
    }
}

#[cfg(test)]
mod tests {
    use std::process::{Command, Stdio};

    use super::*;

    #[test]
    fn the_end_of_the_one_who_commands_is_seen_whenever_it_comes() {
        let mut child = Command::new("cat")
            .stdin(Stdio::piped())
            .spawn()
            .expect("cat");
        let process = Some(child.id());
        let mut controller = Watched::default();
        assert_eq!(controller.follow(process), None);
        assert!(controller.descriptor().is_some());
        assert_eq!(controller.ended(), None);
        drop(child.stdin.take());
        child.wait().expect("its end");
        assert_eq!(controller.ended(), process);
        assert_eq!(controller.follow(None), None);
        assert!(controller.descriptor().is_none() && controller.ended().is_none());
        assert_eq!(controller.follow(process), process, "gone before");
    }

    #[test]
    fn processes_of_one_session_have_one_leader() {
        let own = session(Some(std::process::id()));
        let mut child = Command::new("cat")
            .stdin(Stdio::piped())
            .spawn()
            .expect("cat");
        assert_eq!(session(Some(child.id())), own);
        drop(child.stdin.take());
        child.wait().expect("its end");
        assert_eq!(session(Some(child.id())), None);
        assert_eq!(session(None), None);
    }
}
