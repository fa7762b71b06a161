//! [`Output`]: texts for standard error, or for standard output, that no caller waits for: a bounded queue, and one
//! thread that alone writes. A pipe whose reader does not read, a terminal with Ctrl+S and a journal that hangs so
//! stop this thread and nothing else.
//!
//! A text without room is lost and counted; the next one that finds room comes after a line that says how many are
//! missing. Texts of [`Output::put_passing`] leave half of the room to others. At the end of a process
//! [`Output::finish`] writes what waits, for at most [`END_LIMIT`]; of standard output, for as long as a program reads
//! it. A caller that must not wait uses [`Output::put`] alone: the lock in here is for callers that wait for the
//! thread. A stream whose reader has gone is known by [`Output::is_closed`], and wakes a wait by [`Output::closed`].

use std::backtrace::{Backtrace, BacktraceStatus};
use std::io::{self, Write};
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::panic;
use std::sync::atomic::{AtomicBool, AtomicI32, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, Once, OnceLock, PoisonError};
use std::thread::{self, Thread};
use std::time::{Duration, Instant};

use rustix::event::{EventfdFlags, PollFd, PollFlags, eventfd, poll};
use rustix::io::Errno;
use rustix::stdio;
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::time::{FormatTime, SystemTime};

use crate::{realtime, signal};

/// Texts that wait until they are written; a further one is lost, and counted. A burst, such as a trace of a path of
/// 1,024 waypoints, fits while the thread waits for a processor.
pub const MAX_WAITING: usize = 2048;

/// How long the end of a process, and a text for people, wait until it is written.
pub const END_LIMIT: Duration = Duration::from_millis(200);

/// How long the end of a process waits for a reader of standard output that takes nothing; not beyond [`END_LIMIT`]
/// after a signal.
pub const READER_LIMIT: Duration = Duration::from_secs(1);

/// Stack of the thread, bytes: it writes and waits.
const STACK_BYTES: usize = 64 << 10;

/// A bounded queue whose sender never waits. Its reader must not sleep in it: then a sender would take the lock with
/// which std wakes it.
#[derive(Debug)]
pub(crate) struct LossyQueue<T> {
    sender: SyncSender<T>,
    lost: AtomicU64,
}

impl<T> LossyQueue<T> {
    pub fn new(most: usize) -> (LossyQueue<T>, Receiver<T>) {
        let (sender, receiver) = sync_channel(most);
        let lost = AtomicU64::new(0);
        (LossyQueue { sender, lost }, receiver)
    }

    /// Gives the item back when there is no room.
    pub fn offer(&self, item: T) -> Result<(), T> {
        self.sender.try_send(item).map_err(|error| match error {
            TrySendError::Full(item) | TrySendError::Disconnected(item) => item,
        })
    }

    pub fn lose(&self, count: u64) {
        self.lost.fetch_add(count, Ordering::Relaxed);
    }

    /// How many were lost since the last call.
    pub fn take_lost(&self) -> u64 {
        self.lost.swap(0, Ordering::Relaxed)
    }
}

/// A text, and how many are missing before it.
#[derive(Debug)]
struct Text {
    missing: u64,
    text: String,
}

/// What the thread has not written yet.
#[derive(Debug, Default)]
struct Progress {
    waiting: AtomicUsize,
    lock: Mutex<()>,
    written: Condvar,
    /// A text could not be written: the reader has gone.
    is_closed: AtomicBool,
    /// Number of the error with which a text could not be written; 0 without one.
    error: AtomicI32,
    /// Readable from then on; `None` where the system gives none.
    closed: Option<OwnedFd>,
}

impl Progress {
    fn lock(&self) -> MutexGuard<'_, ()> {
        self.lock.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn finished_one(&self) {
        self.waiting.fetch_sub(1, Ordering::AcqRel);
        // Whoever waits has seen the old number, and sleeps by now, or sees the new one.
        drop(self.lock());
        self.written.notify_all();
    }

    fn failed(&self, error: Errno) {
        self.error.store(error.raw_os_error(), Ordering::Release);
        let is_full = matches!(error, Errno::NOSPC | Errno::DQUOT | Errno::FBIG);
        if !is_full {
            self.close();
        }
    }

    fn close(&self) {
        self.is_closed.store(true, Ordering::Release);
        if let Some(closed) = &self.closed {
            // It can fail only when it is readable already.
            let _ = rustix::io::write(closed, &1_u64.to_ne_bytes());
        }
    }

    /// Waits until `is_done`, asked again after each text that was written; false if it was not by `deadline`.
    fn wait(&self, deadline: Instant, mut is_done: impl FnMut() -> bool) -> bool {
        let mut guard = self.lock();
        loop {
            if is_done() {
                return true;
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return false;
            }
            let waited = self.written.wait_timeout(guard, left);
            guard = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}

/// Where texts go that no caller waits for.
#[derive(Debug)]
pub struct Output {
    queue: LossyQueue<Text>,
    progress: Arc<Progress>,
    /// `None` if the system has given none: every text is lost then.
    thread: Option<Thread>,
    /// Somebody has waited for it in vain.
    is_stalled: AtomicBool,
}

/// Standard error. Its thread starts with the first call.
pub fn standard_error() -> &'static Output {
    STANDARD_ERROR.get_or_init(|| {
        Output::start(stdio::stderr(), |missing| {
            let mut line = String::new();
            // Writing into a text cannot fail.
            let _ = SystemTime.format_time(&mut Writer::new(&mut line));
            line + &format!(
                "  WARN {}: lines are missing here: standard error was not read in time missing={missing}\n",
                module_path!()
            )
        })
    })
}

static STANDARD_ERROR: OnceLock<Output> = OnceLock::new();

static STANDARD_OUTPUT: OnceLock<Output> = OnceLock::new();

/// Standard output, for processes that must go on when no program reads it. Its thread starts with the first call.
/// Nothing stands in the place of what is missing, because programs read it; a line on standard error says how many
/// texts are missing.
pub fn standard_output() -> &'static Output {
    STANDARD_OUTPUT.get_or_init(|| {
        Output::start(stdio::stdout(), |missing| {
            tracing::warn!(missing, "standard output was not read in time");
            String::new()
        })
    })
}

/// The end of what the process prints: writes what waits on standard output for as long as a program reads it, see
/// [`READER_LIMIT`]; and then `text` on standard error, the last words of the process or nothing, for at most
/// [`END_LIMIT`].
pub fn finish(text: impl Into<String>) {
    // The exit code is another one already, or nothing was to be printed.
    let _ = end_standard_output();
    end_standard_error(text);
}

/// The end of standard output, as in [`finish`].
///
/// # Errors
/// A text could not be written. When no program reads, that is no error.
pub fn end_standard_output() -> io::Result<()> {
    if let Some(output) = STANDARD_OUTPUT.get() {
        if !output.finish_while_read() {
            let missing = output.progress.waiting.load(Ordering::Acquire);
            tracing::warn!(missing, "nobody reads standard output: its end is missing");
        }
        match output.progress.error.load(Ordering::Acquire) {
            0 => {}
            error => return Err(io::Error::from_raw_os_error(error)),
        }
    }
    io::stdout().flush()
}

/// The end of standard error, as in [`finish`].
pub(crate) fn end_standard_error(text: impl Into<String>) {
    let text = text.into();
    if !text.is_empty() || STANDARD_ERROR.get().is_some() {
        standard_error().finish(text);
    }
}

impl Output {
    /// Starts the thread, with all signals blocked: they are for the thread that waits for them.
    fn start(to: BorrowedFd<'static>, explain: fn(u64) -> String) -> Output {
        let (queue, texts) = LossyQueue::new(MAX_WAITING);
        let closed = eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK);
        let progress = Arc::new(Progress {
            closed: closed.ok(),
            ..Progress::default()
        });
        let thread = {
            let progress = Arc::clone(&progress);
            let _for_the_thread = signal::block_all();
            let builder = thread::Builder::new().name("output".to_owned());
            builder
                .stack_size(STACK_BYTES)
                .spawn(move || write_all(to, &texts, &progress, explain))
        };
        Output {
            queue,
            progress,
            // The exit code says enough where there is no thread; to write without one would be to wait.
            thread: thread.ok().map(|thread| thread.thread().clone()),
            is_stalled: AtomicBool::new(false),
        }
    }

    /// Lets `text` be written, and never waits; false if it is lost, which is counted.
    pub fn put(&self, text: impl Into<String>) -> bool {
        let is_taken = self.offer(text.into()).is_ok();
        if !is_taken {
            self.queue.lose(1);
        }
        is_taken
    }

    /// Lets `text` be written as [`Output::put`] does, but only while half of the room is free: something that is of
    /// less use than what comes after it, such as progress before a result.
    pub fn put_passing(&self, text: impl Into<String>) -> bool {
        let has_room = self.progress.waiting.load(Ordering::Acquire) < MAX_WAITING / 2;
        if !has_room {
            self.queue.lose(1);
        }
        has_room && self.put(text)
    }

    /// Whether nothing waits: what is shown now is not shown too late.
    pub fn is_idle(&self) -> bool {
        self.progress.waiting.load(Ordering::Acquire) == 0
    }

    /// Whether a text could not be written, and none will be: the reader has gone, or the stream is broken. A disk that
    /// is full may take the next one.
    pub fn is_closed(&self) -> bool {
        self.progress.is_closed.load(Ordering::Acquire)
    }

    /// Readable as soon as [`Output::is_closed`], and from then on; `None` where the system gives no descriptor.
    pub fn closed(&self) -> Option<BorrowedFd<'_>> {
        self.progress.closed.as_ref().map(OwnedFd::as_fd)
    }

    fn offer(&self, text: String) -> Result<(), String> {
        let missing = self.queue.take_lost();
        self.progress.waiting.fetch_add(1, Ordering::AcqRel);
        if let Err(refused) = self.queue.offer(Text { missing, text }) {
            self.progress.waiting.fetch_sub(1, Ordering::AcqRel);
            self.queue.lose(missing);
            return Err(refused.text);
        }
        if let Some(thread) = &self.thread {
            thread.unpark();
        }
        Ok(())
    }

    /// Writes a text for people, which so stands before what the process does next, such as a line on the other stream.
    /// Waits for at most [`END_LIMIT`], and not again until what waits was written.
    pub fn print(&self, text: impl Into<String>) {
        let is_waiting = self.progress.waiting.load(Ordering::Acquire) > 0;
        if is_waiting && self.is_stalled.load(Ordering::Relaxed) {
            self.put(text);
        } else {
            self.finish(text);
        }
    }

    /// Writes what waits and then `text`, the last words of the process or nothing, for at most [`END_LIMIT`]; false if
    /// that was too short.
    pub fn finish(&self, text: impl Into<String>) -> bool {
        let deadline = Instant::now() + END_LIMIT;
        let mut text = Some(text.into()).filter(|text| !text.is_empty());
        let is_written = self.progress.wait(deadline, || {
            // What is missing is said also when nothing comes after it.
            if text.is_none() && self.queue.lost.load(Ordering::Relaxed) > 0 {
                text = Some(String::new());
            }
            if let Some(refused) = text.take() {
                text = self.offer(refused).err();
            }
            text.is_none() && self.progress.waiting.load(Ordering::Acquire) == 0
        });
        if text.is_some_and(|text| !text.is_empty()) {
            self.queue.lose(1);
        }
        self.is_stalled.store(!is_written, Ordering::Relaxed);
        is_written
    }
}

impl Output {
    /// Writes what waits for as long as the reader takes something every [`READER_LIMIT`], and after a signal for at
    /// most [`END_LIMIT`].
    fn finish_while_read(&self) -> bool {
        while !signal::has_come() {
            let waiting = self.progress.waiting.load(Ordering::Acquire);
            let is_taken = || self.progress.waiting.load(Ordering::Acquire) < waiting;
            if waiting == 0 || !self.progress.wait(Instant::now() + READER_LIMIT, is_taken) {
                break;
            }
        }
        self.finish("")
    }
}

/// Puts what is written by one call. Fails once the reader has gone.
impl Write for &Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.put(String::from_utf8_lossy(bytes));
        match self.is_closed() {
            true => Err(io::ErrorKind::BrokenPipe.into()),
            false => Ok(bytes.len()),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// The thread.
fn write_all(
    to: BorrowedFd<'_>,
    texts: &Receiver<Text>,
    progress: &Progress,
    explain: fn(u64) -> String,
) {
    realtime::run_in_background();
    loop {
        for Text { missing, text } in texts.try_iter() {
            let before = match missing {
                0 => String::new(),
                missing => explain(missing),
            };
            let mut texts = [before, text].into_iter();
            if let Err(error) = texts.try_for_each(|text| write(to, text.as_bytes())) {
                progress.failed(error);
            }
            progress.finished_one();
        }
        // A text that has come since then has left its mark, with which this returns at once.
        thread::park();
    }
}

/// Writes all of it, however long that takes; an error if the stream is closed, full or broken, and takes nothing.
fn write(to: BorrowedFd<'_>, mut bytes: &[u8]) -> Result<(), Errno> {
    while !bytes.is_empty() {
        match rustix::io::write(to, bytes) {
            Ok(0) => return Err(Errno::IO),
            Ok(count) => bytes = &bytes[count..],
            Err(Errno::INTR) => {}
            // Another process that shares the stream has made it so.
            Err(Errno::AGAIN) => {
                let _ = poll(&mut [PollFd::from_borrowed_fd(to, PollFlags::OUT)], None);
            }
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// Lets a panic be reported by [`standard_error`], after what waits there, so that it waits for at most [`END_LIMIT`].
/// The text is that of the standard library.
pub fn bound_panics() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        panic::set_hook(Box::new(|panic| {
            let thread = thread::current();
            let name = thread.name().unwrap_or("<unnamed>");
            let backtrace = Backtrace::capture();
            let more = match backtrace.status() {
                BacktraceStatus::Captured => format!("stack backtrace:\n{backtrace}"),
                _ => "note: run with `RUST_BACKTRACE=1` environment variable to display a backtrace\n".to_owned(),
            };
            standard_error().finish(format!("\nthread '{name}' {panic}\n{more}"));
        }));
    });
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::io::Read;
    use std::os::fd::AsFd;

    use rustix::pipe::{PipeFlags, fcntl_setpipe_size, pipe_with};

    use super::*;

    /// How often an end is tried.
    const ENDS: usize = 5;

    /// Standard error in small: a pipe of one page, which is not read yet.
    fn stalled() -> (File, Output) {
        let (reader, writer) = pipe_with(PipeFlags::CLOEXEC).unwrap();
        fcntl_setpipe_size(&writer, 4096).unwrap();
        rustix::io::write(&writer, &[b'x'; 4096]).unwrap();
        let writer: &'static File = Box::leak(Box::new(writer.into()));
        let explain = |missing| format!("{missing} are missing\n");
        (reader.into(), Output::start(writer.as_fd(), explain))
    }

    /// What comes until `last` is read, without what filled the pipe.
    fn read_until(reader: &mut File, last: &str) -> String {
        let (mut text, mut bytes) = (String::new(), [0; 4096]);
        while !text.ends_with(last) {
            let count = reader.read(&mut bytes).unwrap();
            text += std::str::from_utf8(&bytes[..count]).unwrap();
        }
        text.trim_start_matches('x').to_owned()
    }

    /// Fills the queue: the thread holds the first text, which it cannot write.
    fn fill(output: &Output) {
        output.put("first\n");
        while output.progress.waiting.load(Ordering::Acquire) <= MAX_WAITING {
            output.put("more\n");
            thread::yield_now();
        }
        output.queue.take_lost();
    }

    #[test]
    fn nothing_waits_for_a_reader_and_what_is_missing_is_said_where_it_is_missing() {
        let (mut reader, output) = stalled();
        fill(&output);
        for _ in 0..17 {
            assert!(!output.put("lost\n"));
        }
        let text = read_until(&mut reader, &("more\n".repeat(MAX_WAITING)));
        assert!(text.starts_with("first\nmore\n"), "{text}");
        assert!(output.put("next\n"));
        assert!(output.put("last\n"));
        assert_eq!(
            read_until(&mut reader, "last\n"),
            "17 are missing\nnext\nlast\n"
        );
    }

    #[test]
    fn the_end_waits_for_a_reader_who_is_late_but_not_for_ever() {
        let (mut reader, output) = stalled();
        fill(&output);
        output.put("lost\n");
        // The shortest of some: a machine that stalls makes one end longer, and a second wait all of them.
        let ends = (0..ENDS).map(|_| {
            let begin = Instant::now();
            assert!(!output.finish("never\n"));
            begin.elapsed()
        });
        let shortest = ends.min().unwrap();
        assert!(
            shortest >= END_LIMIT && shortest < 2 * END_LIMIT,
            "{shortest:?}"
        );
        // A text for people waits no second time.
        let prints = (0..ENDS).map(|_| {
            let begin = Instant::now();
            output.print("lost\n");
            begin.elapsed()
        });
        let shortest = prints.min().unwrap();
        assert!(shortest < END_LIMIT, "{shortest:?}");
        let late = thread::spawn(move || {
            let text = read_until(&mut reader, "last\n");
            (text, reader)
        });
        while !output.finish("last\n") {}
        let (text, _reader) = late.join().unwrap();
        assert!(text.ends_with(" are missing\nlast\n"), "{text}");
    }

    #[test]
    fn what_is_missing_at_the_end_is_said_at_the_end() {
        let (mut reader, output) = stalled();
        fill(&output);
        output.put("lost\n");
        let late = thread::spawn(move || (read_until(&mut reader, "1 are missing\n"), reader));
        while !output.finish("") {}
        assert!(late.join().unwrap().0.ends_with("more\n1 are missing\n"));
    }

    #[test]
    fn a_reader_that_has_gone_stops_nothing() {
        let (reader, output) = stalled();
        output.put("first\n");
        assert!(!output.is_closed());
        drop(reader);
        assert!(output.finish("last\n"));
        assert!(output.is_closed());
        let closed = output.closed().unwrap();
        let mut sources = [PollFd::from_borrowed_fd(closed, PollFlags::IN)];
        assert_eq!(poll(&mut sources, None), Ok(1));
        assert!((&output).write_all(b"more\n").is_err());
    }

    #[test]
    fn a_full_disk_is_an_error_at_the_end_and_no_reader_that_has_gone() {
        let full: &'static File = Box::leak(Box::new(File::create("/dev/full").unwrap()));
        let output = Output::start(full.as_fd(), |_| String::new());
        assert!(output.finish("first\n") && !output.is_closed());
        let error = output.progress.error.load(Ordering::Acquire);
        assert_eq!(error, Errno::NOSPC.raw_os_error());
    }

    #[test]
    fn what_passes_leaves_room_for_what_stays() {
        let (mut reader, output) = stalled();
        let progress = std::iter::repeat_with(|| output.put_passing("progress\n"));
        assert_eq!(
            progress
                .take(MAX_WAITING)
                .filter(|is_taken| *is_taken)
                .count(),
            MAX_WAITING / 2
        );
        assert!(!output.is_idle());
        assert!(output.put("result\n"));
        let text = read_until(&mut reader, "result\n");
        assert!(
            text.ends_with("progress\n1024 are missing\nresult\n"),
            "{text}"
        );
    }
}
