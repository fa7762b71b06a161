//! [`Disk`]: the thread that carries out the recorder's actions, and may wait for its disk as long as that takes. It decides nothing:
//! one action leads in, and how it went comes out.

mod worker;

use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, sync_channel};
use std::thread;

use ipc_types::{SchedulingRole, request_slice};
use recording::FileAction;
use rustix::event::{EventfdFlags, eventfd};
use status::log::store::FileStore;

use worker::Worker;
pub(super) use worker::{ActionResult, ClosedFile, Note, RecordFolder, ViewerLayout};

/// The thread, as the rest of the process sees it.
pub(super) struct Disk {
    /// Room for the one action that can be outstanding, so that handing it over never waits.
    actions: SyncSender<FileAction>,
    outcomes: Receiver<ActionResult>,
    is_busy: bool,
    woken: Arc<OwnedFd>,
}

/// The thread of the disk has ended by itself: it panicked.
#[derive(Debug, thiserror::Error)]
#[error("the thread that writes to the disk has failed")]
pub(super) struct DiskGone;

impl Disk {
    /// Starts the thread.
    ///
    /// # Errors
    ///
    /// When the system grants no thread or no descriptor.
    pub fn start(place: RecordFolder) -> io::Result<Disk> {
        let (actions, orders) = sync_channel::<FileAction>(1);
        let (ended, outcomes) = sync_channel(1);
        let flags = EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK;
        let woken = Arc::new(eventfd(0, flags)?);
        let waker = Arc::clone(&woken);
        let mut worker = Worker::new(place, FileStore);
        let body = move || {
            request_slice(SchedulingRole::Background);
            for action in orders {
                let outcome = worker.perform(action);
                if ended.send(outcome).is_err() {
                    return;
                }
                // It only fails when the count is at its end: then the process is awake.
                let _ = rustix::io::write(&waker, &1_u64.to_ne_bytes());
            }
        };
        thread::Builder::new().name("disk".to_owned()).spawn(body)?;
        Ok(Disk {
            actions,
            outcomes,
            is_busy: false,
            woken,
        })
    }

    /// Whether an action is outstanding.
    pub fn is_busy(&self) -> bool {
        self.is_busy
    }

    /// Hands an action over; must not be called while one is outstanding.
    ///
    /// # Errors
    ///
    /// The thread is gone.
    pub fn perform(&mut self, action: FileAction) -> Result<(), DiskGone> {
        self.is_busy = true;
        self.actions.send(action).map_err(|_| DiskGone)
    }

    /// How the outstanding action went, once it is done. Never waits.
    ///
    /// # Errors
    ///
    /// The thread is gone.
    pub fn outcome(&mut self) -> Result<Option<ActionResult>, DiskGone> {
        let mut count = [0; 8];
        // It has nothing most of the time, and that is no error.
        let _ = rustix::io::read(&self.woken, &mut count);
        match self.outcomes.try_recv() {
            Ok(outcome) => {
                self.is_busy = false;
                Ok(Some(outcome))
            }
            Err(TryRecvError::Empty) => Ok(None),
            Err(TryRecvError::Disconnected) => Err(DiskGone),
        }
    }
}

/// Readable when an action is done.
impl AsFd for Disk {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.woken.as_fd()
    }
}

#[cfg(test)]
mod tests;
