//! [`Members`]: whether the number of a process is that of one of the robot, as `/proc` says: not for a loop, which it
//! may hold up.

use std::fs;
use std::os::fd::RawFd;
use std::path::PathBuf;

use crate::lock_file::is_one;
use crate::provider::namespace;

/// The processes that have the robot's doorbell open.
#[derive(Clone, Copy, Debug)]
pub struct Members {
    doorbell: RawFd,
}

impl Members {
    /// `doorbell` is the number of its file in this process.
    pub(crate) fn with(doorbell: RawFd) -> Members {
        Members { doorbell }
    }

    /// Whether the process of this number reads the monotonic clock that this one reads: in another time namespace it
    /// has another zero. `None` if the number is not seen to be that of a process of the robot: in another PID
    /// namespace it may be another's.
    pub fn shares_clock_with(&self, process: u32) -> Option<bool> {
        let clock = |process: &str| namespace(process, "time");
        self.has(process)
            .then(|| clock(&process.to_string()) == clock("self"))
    }

    /// Whether the process of this number has the doorbell open. False also when the kernel does not show what it has.
    fn has(&self, process: u32) -> bool {
        let own = PathBuf::from(format!("/proc/self/fd/{}", self.doorbell));
        let (Ok(name), Ok(open)) = (
            fs::read_link(&own),
            fs::read_dir(format!("/proc/{process}/fd")),
        ) else {
            return false;
        };
        // The names first: a look at another file of the process waits for its disk.
        open.flatten().map(|file| file.path()).any(|file| {
            fs::read_link(&file).is_ok_and(|other| other == name)
                && is_one(fs::metadata(&own), fs::metadata(&file))
        })
    }
}
