//! [`Publishing`]: a publisher that goes on, as long as a test wants it to.

use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// A thread that publishes in a steady rhythm until this value is dropped.
#[derive(Debug)]
pub struct Publishing {
    /// `None` only while dropping.
    stop: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Publishing {
    /// Calls what `begin` makes: once before this returns, and then each time that `period` has passed. Both run on the
    /// thread, so ports may be opened in `begin`.
    ///
    /// # Panics
    ///
    /// When `begin` or the first call fails.
    pub fn start<F: FnMut()>(
        period: Duration,
        begin: impl FnOnce() -> F + Send + 'static,
    ) -> Publishing {
        let (stop, stopped) = mpsc::channel();
        let (begun, has_begun) = mpsc::channel();
        let thread = thread::spawn(move || {
            let mut publish = begin();
            publish();
            let _ = begun.send(());
            while stopped.recv_timeout(period) == Err(RecvTimeoutError::Timeout) {
                publish();
            }
        });
        has_begun.recv().expect("a publisher that begins");
        Publishing {
            stop: Some(stop),
            thread: Some(thread),
        }
    }
}

impl Drop for Publishing {
    fn drop(&mut self) {
        self.stop = None;
        let ended = self.thread.take().map(JoinHandle::join);
        assert!(thread::panicking() || ended.is_none_or(|ended| ended.is_ok()));
    }
}
