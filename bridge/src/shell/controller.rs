//! The end of the process with which control ends, and of the one that ordered the path: a descriptor of it, which
//! wakes the bridge.

use std::os::fd::{AsFd, BorrowedFd, OwnedFd};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use rustix::process::{Pid, PidfdFlags, pidfd_open};

/// The number of a process here.
pub(super) fn pid(process: u32) -> Option<Pid> {
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

    /// Whether the process is watched, and has not ended.
    pub fn lives(&self) -> bool {
        self.watched.is_some() && self.ended().is_none()
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
}
