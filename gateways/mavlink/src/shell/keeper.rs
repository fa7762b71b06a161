//! [`Keeper`]: the thread that writes what the gateway keeps, and the fence of a station, and may wait for the disk as
//! long as that takes. The loop hands it one job after the other, and hears how each went; it never waits for it.
//!
//! | a job comes | the thread is idle | it is busy |
//! |---|---|---|
//! | a mission, a fence, its restoration, the timestamp, home, the progress | it begins | waits, in place of an older one of its kind that waits |
//!
//! So at most one job is being done and one of each kind waits. A disk that does not come back keeps them there: what a
//! station waits for the gateway gives up by itself ([`Gateway`](crate::Gateway)), and the process ends without them
//! after [`END_LIMIT`].

use std::io;
use std::os::fd::{AsFd, BorrowedFd};
use std::time::Duration;

use operator::fence_file::FenceChange;
use plans::model::FenceArea;
use runtime::helper::{Helper, HelperGone};

use super::fence;
use super::ports::BridgeFile;
use super::state::{StateError, StateFile, warn_of_timestamp, write_timestamp};
use crate::Mission;
use crate::number::MissionRefusal;

/// How long the end of the process waits for what is not on the disk yet: some hundred times as long as a disk needs
/// that works.
pub(crate) const END_LIMIT: Duration = Duration::from_millis(500);

/// What is to be written.
#[derive(Debug)]
pub(crate) enum Job {
    Mission(Mission),
    Timestamp(u64),
    /// Empty if none is to be kept.
    Home(String),
    Progress(String),
    /// These areas into the bridge's file.
    PutFence(BridgeFile, Vec<FenceArea>),
    RestoreFence(FenceChange),
}

impl Job {
    /// The number of the job's kind: jobs of one kind replace each other; the lowest goes first.
    fn kind(&self) -> usize {
        match self {
            Job::Mission(_) => 0,
            Job::RestoreFence(_) => 1,
            Job::PutFence(..) => 2,
            Job::Timestamp(_) => 3,
            Job::Home(_) => 4,
            Job::Progress(_) => 5,
        }
    }
}

const KINDS: usize = 6;

/// How a job went of which the gateway wants to know it.
#[derive(Debug)]
pub(crate) enum Written {
    Mission(Mission, Result<(), String>),
    Fence(Result<FenceChange, MissionRefusal>),
    RestoredFence(Result<(), String>),
    Other,
}

/// The files.
pub(crate) struct KeptFiles {
    pub mission: StateFile,
    pub home: StateFile,
    pub progress: StateFile,
    pub timestamp: StateFile,
}

/// The thread that writes what the gateway keeps, and the jobs that wait for it.
pub(crate) struct Keeper {
    thread: Helper<Job, Written>,
    is_busy: bool,
    waiting: [Option<Job>; KINDS],
}

impl Keeper {
    /// Starts the thread.
    ///
    /// # Errors
    ///
    /// When the system grants no thread or no descriptor.
    pub fn start(files: KeptFiles) -> io::Result<Keeper> {
        // Room for the one job that is being done, so that handing it over never fails.
        let thread = Helper::start("state", 1, move |job| files.write(job))?;
        Ok(Keeper {
            thread,
            is_busy: false,
            waiting: [const { None }; KINDS],
        })
    }

    /// Has a job done.
    pub fn keep(&mut self, job: Job) {
        let kind = job.kind();
        self.waiting[kind] = Some(job);
        self.go_on();
    }

    fn go_on(&mut self) {
        if !self.is_busy
            && let Some(job) = self.waiting.iter_mut().find_map(Option::take)
        {
            self.is_busy = self.thread.give(job).is_ok();
        }
    }

    /// Whether nothing is being written or waits for it.
    pub fn is_idle(&self) -> bool {
        !self.is_busy && self.waiting.iter().all(Option::is_none)
    }

    /// How the job went that was being done, once it is over. Never waits.
    ///
    /// # Errors
    ///
    /// The thread is gone.
    pub fn written(&mut self) -> Result<Option<Written>, HelperGone> {
        let written = self.thread.take()?;
        if written.is_some() {
            self.is_busy = false;
            self.go_on();
        }
        Ok(written)
    }
}

/// Readable when a job is over.
impl AsFd for Keeper {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.thread.as_fd()
    }
}

impl KeptFiles {
    /// Does a job.
    fn write(&self, job: Job) -> Written {
        let kept = |what, without, written: Result<(), StateError>| {
            if let Err(error) = written {
                tracing::warn!(%error, "{what} was not kept: {without}");
            }
        };
        match job {
            Job::Mission(mission) => {
                let written = self.mission.write(&mission.encode());
                return Written::Mission(mission, written.map_err(|why| why.to_string()));
            }
            Job::PutFence(file, areas) => {
                return Written::Fence(file.find().and_then(|file| fence::put(&file, &areas)));
            }
            Job::RestoreFence(change) => {
                let restored = change.take_back().map_err(|error| error.to_string());
                return Written::RestoredFence(restored);
            }
            Job::Timestamp(timestamp) => {
                if let Err(error) = write_timestamp(&self.timestamp, timestamp) {
                    warn_of_timestamp(&error);
                }
            }
            Job::Home(text) => {
                let written = self.home.write(text.as_bytes());
                kept("home", "a restart in flight forgets it", written);
            }
            Job::Progress(text) => {
                let written = self.progress.write(text.as_bytes());
                kept(
                    "the progress of the mission",
                    "a restart forgets it",
                    written,
                );
            }
        }
        Written::Other
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;
    use std::process::Command;

    use ipc_types::RobotId;
    use rustix::event::{PollFd, PollFlags, poll};

    use super::*;

    fn keeper(folder: &Path) -> Keeper {
        let robot = RobotId::new(1).unwrap();
        let file = |what| StateFile::new(Some(folder), robot, what);
        Keeper::start(KeptFiles {
            mission: file("mission"),
            home: file("home"),
            progress: file("progress"),
            timestamp: file("timestamp"),
        })
        .unwrap()
    }

    fn next(keeper: &mut Keeper) -> Written {
        loop {
            if let Some(written) = keeper.written().unwrap() {
                return written;
            }
            let mut woken = [PollFd::new(&*keeper, PollFlags::IN)];
            poll(&mut woken, None).unwrap();
        }
    }

    #[test]
    fn a_disk_that_does_not_answer_holds_up_nobody_and_of_what_waits_the_newest_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let read = |what: &str| fs::read_to_string(folder.path().join(format!("robot-1.{what}")));
        // Opening it for writing waits until a reader opens it.
        let disk = folder.path().join(".robot-1.home.new");
        let made = Command::new("mkfifo").arg(&disk).status().unwrap();
        assert!(made.success());
        let mut keeper = keeper(folder.path());
        keeper.keep(Job::Home("first".to_owned()));
        for number in 1..=3 {
            keeper.keep(Job::Progress(number.to_string()));
            keeper.keep(Job::Timestamp(number));
            assert!(keeper.written().unwrap().is_none() && !keeper.is_idle());
        }
        keeper.keep(Job::Mission(Mission::default()));
        assert!(read("mission").is_err());
        // The disk is back: as another one than it was, so that home is not kept.
        drop(fs::File::open(&disk).unwrap());
        assert!(matches!(next(&mut keeper), Written::Other));
        let Written::Mission(mission, result) = next(&mut keeper) else {
            panic!("a station waits for the mission");
        };
        assert_eq!((mission, result), (Mission::default(), Ok(())));
        // The gateway hears of it once the file is there.
        let kept = fs::read(folder.path().join("robot-1.mission")).unwrap();
        assert_eq!(Mission::decode(&kept), Ok(Mission::default()));
        assert!(matches!(next(&mut keeper), Written::Other));
        assert!(matches!(next(&mut keeper), Written::Other));
        assert!(keeper.is_idle());
        assert_eq!(read("timestamp").unwrap(), "3\n");
        assert_eq!(read("progress").unwrap(), "3");
        assert!(read("home").is_err());
    }
}
