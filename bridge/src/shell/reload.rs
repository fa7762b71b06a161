//! [`FenceReader`]: requests to reload the geofence, whose file a thread reads. The bridge's loop opens no file of a
//! disk.
//!
//! Requests wait in the order of their arrival, as many as [`MAX_WAITING`]; each is answered from a reading that began
//! after it came, or after [`ANSWERED_WITHIN`] by the reason that the file was not read. The core gets it with its
//! answer, as one input.

use std::collections::VecDeque;
use std::io;
use std::os::fd::{AsFd, BorrowedFd};
use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::Reason;
use ipc_types::configuration::ConfigurationText;
use ipc_types::payload::ModuleControl;
use runtime::helper::{Helper, HelperGone};

use crate::core::Input;
use crate::flight::control::Sender;
use crate::outputs::RequestKey;
use crate::safety::fence::Fence;

/// How long a request waits for its file. Reading the largest fence takes 10 ms.
pub const ANSWERED_WITHIN: Duration = Duration::from_secs(1);

/// Requests that wait. A further one is refused, as too many are.
const MAX_WAITING: usize = 8;

/// A geofence that was read again.
#[derive(Clone, Debug, Default)]
pub struct FenceOfFile {
    /// The geofence.
    pub fence: Fence,
    /// What the bridge runs with once it is in force.
    pub configuration: ConfigurationText,
}

/// What the configuration says, or what is wrong with it.
pub type ReadFence = Result<FenceOfFile, String>;

/// A request with its answer, and what was read for it.
pub type AnsweredReload = (Input<'static>, Option<FenceOfFile>);

/// A request that waits.
struct Waiting {
    number: u64,
    key: RequestKey,
    sender: Sender,
    request: ModuleControl,
    by: MonotonicNs,
    /// The thread reads for it.
    is_asked: bool,
}

impl Waiting {
    fn answered(self, fence: Result<Fence, Reason>) -> Input<'static> {
        Input::NewFence {
            key: self.key,
            sender: self.sender,
            request: self.request,
            fence,
        }
    }
}

/// Reads the geofence's file in a thread, and holds the requests that wait for a reading.
pub(super) struct FenceReader {
    thread: Helper<u64, (u64, ReadFence)>,
    waiting: VecDeque<Waiting>,
    newest: u64,
}

impl FenceReader {
    /// Starts the thread, which reads with `read`.
    pub fn start(read: impl Fn() -> ReadFence + Send + 'static) -> io::Result<FenceReader> {
        Ok(FenceReader {
            thread: Helper::start("fence", 1, move |number| (number, read()))?,
            waiting: VecDeque::with_capacity(MAX_WAITING),
            newest: 0,
        })
    }

    /// What wakes the bridge when the file was read.
    pub fn thread(&self) -> BorrowedFd<'_> {
        self.thread.as_fd()
    }

    /// Takes a request; it comes back with its refusal if too many wait.
    pub fn ask(
        &mut self,
        key: RequestKey,
        sender: Sender,
        request: ModuleControl,
        now: MonotonicNs,
    ) -> Option<Input<'static>> {
        self.newest += 1;
        let waiting = Waiting {
            number: self.newest,
            key,
            sender,
            request,
            by: now + ANSWERED_WITHIN,
            is_asked: false,
        };
        if self.waiting.len() == MAX_WAITING {
            return Some(waiting.answered(Err(Reason::TooManyRequests)));
        }
        self.waiting.push_back(waiting);
        self.read_next();
        None
    }

    /// Lets the thread read for the oldest request. If it is held up by an earlier reading, this one begins after that.
    fn read_next(&mut self) {
        if let Some(oldest) = self.waiting.front_mut()
            && !oldest.is_asked
        {
            oldest.is_asked = self.thread.give(oldest.number).is_ok();
        }
    }

    /// The next request that has its answer by now; `is_done` if the thread has read.
    ///
    /// # Errors
    /// The thread is gone.
    pub fn next(
        &mut self,
        now: MonotonicNs,
        is_done: bool,
    ) -> Result<Option<AnsweredReload>, HelperGone> {
        let mut read = None;
        while is_done && let Some((number, fence)) = self.thread.take()? {
            // What comes after its request was answered is not used.
            if self.waiting.front().is_some_and(|it| it.number == number) {
                read = Some(fence.map_err(|error| {
                    tracing::error!("the geofence stays as it is: {error}");
                    Reason::InvalidFence
                }));
                break;
            }
        }
        let is_late = self.waiting.front().is_some_and(|oldest| now >= oldest.by);
        if read.is_none() && is_late {
            tracing::error!(
                "the geofence stays as it is: its file was not read within {ANSWERED_WITHIN:?}; is its disk there?"
            );
            read = Some(Err(Reason::FenceUnread));
        }
        let answered = read.and_then(|read| {
            let waiting = self.waiting.pop_front()?;
            let fence = read.as_ref().map(|read| read.fence.clone());
            Some((waiting.answered(fence.map_err(|reason| *reason)), read.ok()))
        });
        self.read_next();
        Ok(answered)
    }

    /// When [`FenceReader::next`] has something although the file was not read.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        self.waiting.front().map(|oldest| oldest.by)
    }

    /// The bridge ends: no request is answered from the file any more.
    pub fn give_up(&mut self) -> impl Iterator<Item = Input<'static>> + '_ {
        let unread = |waiting: Waiting| waiting.answered(Err(Reason::FenceUnread));
        self.waiting.drain(..).map(unread)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use std::sync::mpsc::{Sender as Feed, channel};
    use std::thread;

    /// A reader of a file that is there when the test says so.
    fn reader() -> (FenceReader, Feed<ReadFence>) {
        let (feed, file) = channel();
        let read = move || file.recv().unwrap_or_else(|_| Err("no file".to_owned()));
        (FenceReader::start(read).unwrap(), feed)
    }

    fn ask(
        reader: &mut FenceReader,
        id: u64,
        now: MonotonicNs,
    ) -> Option<(u64, Result<(), Reason>)> {
        let request = ModuleControl {
            request_id: id,
            ..ModuleControl::default()
        };
        reader
            .ask(RequestKey::Control(id), Sender::default(), request, now)
            .map(seen)
    }

    /// Which request was answered, and how.
    fn seen(input: Input<'_>) -> (u64, Result<(), Reason>) {
        match input {
            Input::NewFence { request, fence, .. } => (request.request_id, fence.map(drop)),
            other => panic!("{other:?}"),
        }
    }

    /// Waits until the thread has read.
    fn next(reader: &mut FenceReader, now: MonotonicNs) -> (u64, Result<(), Reason>) {
        loop {
            match reader.next(now, true).unwrap() {
                Some((input, _)) => return seen(input),
                None => thread::yield_now(),
            }
        }
    }

    #[test]
    fn each_request_is_answered_in_order_from_a_reading_of_its_own() {
        let (mut reader, feed) = reader();
        let now = MonotonicNs(5);
        for id in 1..=8 {
            assert_eq!(ask(&mut reader, id, now), None);
        }
        assert_eq!(
            ask(&mut reader, 9, now),
            Some((9, Err(Reason::TooManyRequests)))
        );
        assert!(
            reader.next(now, true).unwrap().is_none(),
            "nothing was read"
        );
        for id in 1..=8 {
            let (read, expected) = match id % 2 {
                0 => (Err("a mistake".to_owned()), Err(Reason::InvalidFence)),
                _ => (Ok(FenceOfFile::default()), Ok(())),
            };
            feed.send(read).unwrap();
            assert_eq!(next(&mut reader, now), (id, expected));
        }
        assert_eq!(reader.deadline(), None);
    }

    #[test]
    fn a_file_that_does_not_come_is_answered_in_time_and_what_comes_late_is_not_used() {
        let (mut reader, feed) = reader();
        let (now, later) = (MonotonicNs(5), MonotonicNs(5) + ANSWERED_WITHIN / 2);
        let due = now + ANSWERED_WITHIN;
        assert_eq!(
            (ask(&mut reader, 1, now), ask(&mut reader, 2, later)),
            (None, None)
        );
        assert_eq!(reader.deadline(), Some(due));
        let unread = |id| Some((id, Err(Reason::FenceUnread)));
        let (answered, _) = reader.next(due, true).unwrap().unwrap();
        assert_eq!(Some(seen(answered)), unread(1));
        assert!(reader.next(due, true).unwrap().is_none());
        // The first reading comes to its end after its request was answered; the second begins after that.
        feed.send(Err("late".to_owned())).unwrap();
        feed.send(Ok(FenceOfFile::default())).unwrap();
        assert_eq!(next(&mut reader, due), (2, Ok(())));
        assert_eq!(ask(&mut reader, 3, due), None);
        let given_up: Vec<_> = reader.give_up().map(seen).collect();
        assert_eq!(given_up, unread(3).into_iter().collect::<Vec<_>>());
    }
}
