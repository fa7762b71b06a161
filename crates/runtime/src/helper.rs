//! [`Helper`]: a thread that does for a loop what may take as long as a disk or a device likes. Jobs lead in over a
//! bounded queue; what came of them comes out in the same order, and wakes the loop's one wait.
//!
//! The loop never waits for it: a job that finds no room comes back at once. A process that ends does not wait for the
//! thread either, unless it asks to, for a bounded time: the system ends a thread with its process.

use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::sync::Arc;
use std::sync::mpsc::{
    Receiver, RecvTimeoutError, SyncSender, TryRecvError, TrySendError, sync_channel,
};
use std::thread;
use std::time::{Duration, Instant};

use rustix::event::{EventfdFlags, eventfd};

use crate::signal;

/// What `work` gives, if it does so within `limit`. A thread of this name does it, which is left behind where it hangs:
/// the process ends without it.
pub fn within<D: Send + 'static>(
    name: &str,
    limit: Duration,
    work: impl FnOnce() -> D + Send + 'static,
) -> Option<D> {
    let mut work = Some(work);
    let helper = Helper::start(name, 1, move |()| work.take().map(|work| work())).ok()?;
    helper.give(()).ok()?;
    helper.wait(limit)?
}

/// The thread, as its loop sees it.
#[derive(Debug)]
pub struct Helper<J, D> {
    jobs: SyncSender<J>,
    done: Receiver<D>,
    woken: Arc<OwnedFd>,
}

/// The thread has ended by itself: it panicked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a thread of this process has failed")]
pub struct HelperGone;

impl<J: Send + 'static, D: Send + 'static> Helper<J, D> {
    /// Starts a thread of this name, which does `work` for one job after the other. `room` jobs can wait for it.
    ///
    /// # Errors
    /// The system grants no thread or no descriptor.
    pub fn start(
        name: &str,
        room: usize,
        mut work: impl FnMut(J) -> D + Send + 'static,
    ) -> io::Result<Helper<J, D>> {
        let (jobs, given) = sync_channel(room);
        // Room for all that can be under way: the thread never waits for its loop.
        let (ended, done) = sync_channel(room + 1);
        let woken = Arc::new(eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK)?);
        let waker = Arc::clone(&woken);
        let body = move || {
            for job in given {
                if ended.send(work(job)).is_err() {
                    return;
                }
                // It only fails when the count is at its end: then the process is awake.
                let _ = rustix::io::write(&waker, &1_u64.to_ne_bytes());
            }
        };
        // Signals are for the thread that waits for them.
        let _for_the_thread = signal::block_all();
        thread::Builder::new().name(name.to_owned()).spawn(body)?;
        Ok(Helper { jobs, done, woken })
    }

    /// Hands a job over; it comes back if as many wait already as may, or the thread is gone. Never waits.
    ///
    /// # Errors
    /// The job.
    pub fn give(&self, job: J) -> Result<(), J> {
        self.jobs
            .try_send(job)
            .map_err(|(TrySendError::Full(job) | TrySendError::Disconnected(job))| job)
    }

    /// What came of the oldest job that is done and was not taken yet. Never waits.
    ///
    /// # Errors
    /// The thread is gone.
    pub fn take(&self) -> Result<Option<D>, HelperGone> {
        // It has nothing most of the time, and that is no error.
        let _ = rustix::io::read(&self.woken, &mut [0; 8]);
        match self.done.try_recv() {
            Ok(done) => Ok(Some(done)),
            Err(TryRecvError::Empty) => Ok(None),
            Err(TryRecvError::Disconnected) => Err(HelperGone),
        }
    }

    /// What came of the oldest job, as soon as it is done, if that is within `limit`: for a process that begins.
    pub fn wait(&self, limit: Duration) -> Option<D> {
        self.done.recv_timeout(limit).ok()
    }

    /// Waits for at most `limit` until all jobs are done: for a process that ends. Says whether they are.
    pub fn finish(self, limit: Duration) -> bool {
        let until = Instant::now() + limit;
        drop(self.jobs);
        loop {
            let left = until.saturating_duration_since(Instant::now());
            match self.done.recv_timeout(left) {
                Ok(done) => drop(done),
                Err(error) => return error == RecvTimeoutError::Disconnected,
            }
        }
    }
}

/// Readable when something is done.
impl<J, D> AsFd for Helper<J, D> {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.woken.as_fd()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use std::sync::mpsc::channel;

    use rustix::event::{PollFd, PollFlags, poll};

    const LONG: Duration = Duration::from_secs(60);

    #[test]
    fn a_loop_is_woken_for_what_is_done_and_never_waits_for_a_thread_that_is_held_up() {
        let (release, held_up) = channel::<()>();
        let double = move |job: u32| {
            held_up.recv().expect("a word");
            2 * job
        };
        let helper = Helper::start("test", 1, double).expect("a thread");
        assert_eq!(helper.give(1), Ok(()));
        // The first is under way as soon as the thread runs; then one more finds room, and no third.
        while helper.give(2).is_err() {
            thread::yield_now();
        }
        assert_eq!(helper.give(3), Err(3));
        assert_eq!(helper.take(), Ok(None));
        release.send(()).expect("a thread");
        let mut sources = [PollFd::new(&helper, PollFlags::IN)];
        assert_eq!(poll(&mut sources, None), Ok(1));
        assert_eq!(helper.take(), Ok(Some(2)));
        assert_eq!(helper.take(), Ok(None));
        release.send(()).expect("a thread");
        assert_eq!(helper.wait(LONG), Some(4));
        assert_eq!(helper.give(4), Ok(()));
        assert!(!helper.finish(Duration::from_millis(1)), "it is held up");
    }

    #[test]
    fn work_that_hangs_keeps_nobody_longer_than_the_limit() {
        let (_held, hangs) = channel::<()>();
        let (begun, has_begun) = channel();
        let never = move || {
            begun.send(()).expect("a test");
            let _ = hangs.recv();
        };
        assert_eq!(within("test", Duration::from_millis(10), never), None);
        has_begun.recv().expect("a thread");
        assert_eq!(within("test", LONG, || 7), Some(7));
    }

    #[test]
    fn an_end_waits_for_what_is_under_way_and_a_failure_is_told() {
        let half = |job: u32| 12 / job;
        let helper = Helper::start("test", 2, half).expect("a thread");
        assert_eq!((helper.give(3), helper.give(4)), (Ok(()), Ok(())));
        assert!(helper.finish(LONG));
        let helper = Helper::start("test", 2, half).expect("a thread");
        assert_eq!(helper.give(0), Ok(()));
        assert_eq!(helper.wait(LONG), None);
        assert_eq!(helper.take(), Err(HelperGone));
    }
}
