//! [`Inbox`]: the requests that a stand-in has received.

use std::sync::mpsc::{self, Receiver, Sender};

use crate::process::WAIT_LIMIT;

/// The reading end, in the order in which the requests came.
pub(super) struct Inbox<T>(Receiver<T>);

impl<T> Inbox<T> {
    /// Both ends.
    pub fn new() -> (Sender<T>, Inbox<T>) {
        let (sender, receiver) = mpsc::channel();
        (sender, Inbox(receiver))
    }

    /// Waits for the next request.
    ///
    /// # Panics
    ///
    /// When none comes for [`WAIT_LIMIT`], or the stand-in has died.
    #[track_caller]
    pub fn next(&self) -> T {
        match self.0.recv_timeout(WAIT_LIMIT) {
            Ok(request) => request,
            Err(error) => panic!("no request came within {WAIT_LIMIT:?} ({error})"),
        }
    }
}
