//! Who sends, as the kernel knows it, and the end of the one who commands: a descriptor of its process, which wakes the bridge.
//!
//! Numbers of processes mean something in one PID namespace only. Of a process in another one the session is not known, and its end
//! may not be seen: then silence ends its control.

use std::os::fd::{AsFd, BorrowedFd, OwnedFd};

use runtime::session::session_of;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use rustix::process::{Pid, PidfdFlags, pidfd_open, test_kill_process};

use crate::flight::control::Sender;

/// What is known of the process with this number.
pub fn sender_of(process: Option<u32>) -> Sender {
    let leader = process
        .and_then(pid)
        .and_then(|pid| session_of(Some(pid)))
        .filter(|leader| test_kill_process(*leader) != Err(Errno::SRCH));
    Sender {
        process,
        session: leader.map(|leader| leader.as_raw_nonzero().get() as u32),
    }
}

fn pid(process: u32) -> Option<Pid> {
    i32::try_from(process).ok().and_then(Pid::from_raw)
}

/// The process with whose end control ends.
#[derive(Debug, Default)]
pub struct Controller {
    process: Option<u32>,
    /// `None` if its end cannot be seen.
    watched: Option<OwnedFd>,
}

impl Controller {
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
        let mut controller = Controller::default();
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
        let own = std::process::id();
        let sender = sender_of(Some(own));
        let mut child = Command::new("cat")
            .stdin(Stdio::piped())
            .spawn()
            .expect("cat");
        assert_eq!(sender_of(Some(child.id())).session, sender.session);
        drop(child.stdin.take());
        child.wait().expect("its end");
        let gone = sender_of(Some(child.id()));
        assert_eq!((gone.process, gone.session), (Some(child.id()), None));
        assert_eq!(sender_of(None), Sender::default());
    }
}
