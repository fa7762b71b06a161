//! [`PortSlot`]: the port, or when to try again. A thread opens and closes it, and looks through `/proc` for who uses
//! it: a device, and a machine with many processes, may take their time for that. The bridge's loop reads and writes
//! without waiting, and nothing else.
//!
//! | the slot | an attempt is due | the thread has opened it | it has failed | the device is gone | the bridge ends |
//! |---|---|---|---|---|---|
//! | waits | asks, is under way | | | | is done |
//! | is under way | | is open | waits | | gives up after [`CLOSES_WITHIN`] |
//! | is open | | | | closes, waits for nothing | closes, for at most [`CLOSES_WITHIN`] |

use std::io;
use std::os::fd::{AsFd, BorrowedFd};
use std::time::Duration;

use ipc_types::MonotonicNs;
use runtime::helper::{Helper, HelperGone};
use rustix::time::{ClockId, clock_gettime};

use super::serial::{Gone, OpenError, SerialPort};
use crate::config::SerialConfig;
use crate::link::line::Line;

/// How long a pseudo-terminal that has just appeared is left alone. A program that makes one for a login, such as sshd,
/// takes a few milliseconds until it is the login's controlling terminal. Before that, it looks as one of a simulator
/// does.
const PTY_SETTLING: Duration = Duration::from_millis(50);

/// An attempt to open the port looks at all processes, unless there is no device: 2 ms of a processor for 90 processes
/// and 100 ms for 1600 in a debug build. The pause after an attempt is at least this many times as long as what it took
/// of a processor, so that attempts take 5 % of one; a stall and a slow device lengthen nothing.
const REST_AFTER_ATTEMPT: u32 = 20;

/// Longest of these pauses: with so many processes that they would be longer, attempts take more.
const LONGEST_REST: Duration = Duration::from_secs(1);

/// How long the bridge waits for its first attempt before it says that it is ready: a port that can never be one ends
/// it before.
const FIRST_ATTEMPT: Duration = Duration::from_millis(500);

/// How long the bridge waits at its end until the port has its settings back.
const CLOSES_WITHIN: Duration = Duration::from_millis(500);

/// What can wait for the thread: a port that is gone, and the next attempt.
const MAX_JOBS: usize = 2;

/// Why the bridge cannot go on with its port.
#[derive(Debug, thiserror::Error)]
pub enum PortError {
    /// The port is something that can never be one.
    #[error(transparent)]
    NotAPort(OpenError),
    /// The thread has failed.
    #[error(transparent)]
    ThreadGone(#[from] HelperGone),
}

/// What the thread does.
enum PortJob {
    Open,
    Close(SerialPort),
}

/// What came of it.
struct PortResult {
    outcome: Outcome,
    /// What it took of a processor.
    spent: Duration,
}

enum Outcome {
    Opened(SerialPort),
    /// It has just appeared, and is left alone for [`PTY_SETTLING`].
    Settles,
    Failed(OpenError),
    Closed,
}

/// The serial port while it is open, and when the next attempt to open it is due while it is not.
pub(super) struct PortSlot {
    config: SerialConfig,
    thread: Helper<PortJob, PortResult>,
    open: Option<SerialPort>,
    /// `None` while it is open, and while an attempt is under way.
    next_try: Option<MonotonicNs>,
    failures: u32,
    /// The last failure that was logged.
    reported: String,
    ever_open: bool,
}

impl PortSlot {
    /// Starts the thread.
    ///
    /// # Errors
    /// The system grants none.
    pub fn start(config: &SerialConfig) -> io::Result<PortSlot> {
        let mut opener = Opener {
            config: config.clone(),
            was_missing: false,
        };
        PortSlot::with(config, move |job| opener.work(job))
    }

    fn with(
        config: &SerialConfig,
        work: impl FnMut(PortJob) -> PortResult + Send + 'static,
    ) -> io::Result<PortSlot> {
        Ok(PortSlot {
            config: config.clone(),
            thread: Helper::start("port", MAX_JOBS, work)?,
            open: None,
            next_try: Some(MonotonicNs(0)),
            failures: 0,
            reported: String::new(),
            ever_open: false,
        })
    }

    /// The port, if it is open.
    pub fn get(&self) -> Option<&SerialPort> {
        self.open.as_ref()
    }

    /// What is known of the line of the open port.
    pub fn line(&self) -> Line {
        let latency_ms = self.open.as_ref().map_or(0, SerialPort::latency_ms);
        Line {
            byte: self.config.byte_time(),
            adapter: Duration::from_millis(latency_ms.into()),
        }
    }

    /// What wakes the bridge when the thread has done something.
    pub fn thread(&self) -> BorrowedFd<'_> {
        self.thread.as_fd()
    }

    /// When [`PortSlot::step`] has something to do.
    pub fn next_try(&self) -> Option<MonotonicNs> {
        self.next_try
    }

    /// Makes the first attempt, and waits a little for what comes of it. Says whether the port is open.
    ///
    /// # Errors
    /// See [`PortError`].
    pub fn begin(&mut self) -> Result<bool, PortError> {
        self.try_open(MonotonicNs::now());
        match self.thread.wait(FIRST_ATTEMPT) {
            Some(result) => self.ended(MonotonicNs::now(), result),
            None => Ok(false),
        }
    }

    /// Takes what the thread has done, if it has done something, and lets it try again if it is time to. Says whether
    /// the port was opened.
    ///
    /// # Errors
    /// See [`PortError`].
    pub fn step(&mut self, now: MonotonicNs, is_done: bool) -> Result<bool, PortError> {
        let mut is_opened = false;
        while is_done && let Some(result) = self.thread.take()? {
            is_opened |= self.ended(now, result)?;
        }
        self.try_open(now);
        Ok(is_opened)
    }

    fn try_open(&mut self, now: MonotonicNs) {
        if self.next_try.is_some_and(|due| now >= due) {
            let taken = self.thread.give(PortJob::Open);
            self.next_try = taken.err().map(|_full| now + self.config.reopen_pause(1));
        }
    }

    /// A failure is logged when it differs from the one before; repetitions are counted.
    fn ended(&mut self, now: MonotonicNs, result: PortResult) -> Result<bool, PortError> {
        match result.outcome {
            Outcome::Opened(port) => {
                tracing::info!(port = %self.config.port.display(), tries = self.failures + 1, latency_ms = port.latency_ms(), "port open");
                self.open = Some(port);
                self.failures = 0;
                self.reported.clear();
                self.ever_open = true;
                return Ok(true);
            }
            Outcome::Closed => {}
            Outcome::Settles => self.next_try = Some(now + PTY_SETTLING),
            Outcome::Failed(error @ OpenError::NotATerminal(_)) if !self.ever_open => {
                return Err(PortError::NotAPort(error));
            }
            Outcome::Failed(error) => self.failed(now, &error, result.spent),
        }
        Ok(false)
    }

    fn failed(&mut self, now: MonotonicNs, error: &OpenError, spent: Duration) {
        self.failures = self.failures.saturating_add(1);
        let text = error.to_string();
        if self.reported == text {
            tracing::debug!(tries = self.failures, "still not open");
        } else {
            tracing::error!("{text}; trying again");
            self.reported = text;
        }
        let rest = LONGEST_REST.min(REST_AFTER_ATTEMPT * spent);
        self.next_try = Some(now + rest.max(self.config.reopen_pause(self.failures)));
    }

    /// The device is gone: the thread closes it, and may try again at once.
    pub fn close(&mut self, gone: &Gone) {
        tracing::warn!(port = %self.config.port.display(), "{gone}; opening it again");
        self.give_back();
        self.next_try = Some(MonotonicNs(0));
    }

    fn give_back(&mut self) {
        if let Some(port) = self.open.take() {
            // There is room: nothing was asked since this port was opened. Else it is closed here.
            let _ = self.thread.give(PortJob::Close(port));
        }
    }

    /// The bridge ends: the port gets its settings back.
    pub fn finish(mut self) {
        let was_open = self.open.is_some();
        self.give_back();
        if !self.thread.finish(CLOSES_WITHIN) && was_open {
            tracing::warn!(port = %self.config.port.display(), "the port does not answer, and may not have its settings back");
        }
    }
}

/// What the thread has.
struct Opener {
    config: SerialConfig,
    /// Whether there was no device at the last attempt.
    was_missing: bool,
}

impl Opener {
    fn work(&mut self, job: PortJob) -> PortResult {
        let begun = processor_time();
        let outcome = match job {
            PortJob::Open => self.open(),
            PortJob::Close(port) => {
                drop(port);
                Outcome::Closed
            }
        };
        PortResult {
            outcome,
            spent: processor_time().saturating_sub(begun),
        }
    }

    fn open(&mut self) -> Outcome {
        if std::mem::take(&mut self.was_missing) && SerialPort::is_pty(&self.config) {
            return Outcome::Settles;
        }
        match SerialPort::open(&self.config) {
            Ok(port) => Outcome::Opened(port),
            Err(error) => {
                self.was_missing = matches!(error, OpenError::Missing(_));
                Outcome::Failed(error)
            }
        }
    }
}

/// What this thread took of a processor so far.
fn processor_time() -> Duration {
    // The kernel gives no negative time.
    Duration::try_from(clock_gettime(ClockId::ThreadCPUTime)).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    use std::os::unix::fs::symlink;
    use std::path::PathBuf;
    use std::sync::mpsc::{Sender, channel};

    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

    const LONG: Duration = Duration::from_secs(60);

    fn at(port: PathBuf) -> SerialConfig {
        SerialConfig {
            port,
            ..SerialConfig::default()
        }
    }

    /// Makes the attempt that is due at `now`, and waits for what comes of it.
    fn attempt(slot: &mut PortSlot, now: MonotonicNs) -> bool {
        assert!(!slot.step(now, true).unwrap());
        let result = slot.thread.wait(LONG).expect("an attempt");
        slot.ended(now, result).unwrap()
    }

    #[test]
    fn a_pseudo_terminal_that_appears_is_left_alone_until_a_login_would_have_taken_it() {
        let link = std::env::temp_dir().join(format!("ril-port-{}", std::process::id()));
        let mut slot = PortSlot::start(&at(link.clone())).unwrap();
        assert!(!attempt(&mut slot, MonotonicNs::now()), "there is none");
        let now = slot.next_try.unwrap();

        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC);
        let master = master.unwrap();
        grantpt(&master).unwrap();
        unlockpt(&master).unwrap();
        let slave = ptsname(&master, Vec::new()).unwrap();
        symlink(slave.to_str().unwrap(), &link).unwrap();
        assert!(!attempt(&mut slot, now), "it has just appeared");
        assert_eq!(slot.next_try, Some(now + PTY_SETTLING));
        assert!(attempt(&mut slot, now + PTY_SETTLING));
        slot.finish();
        std::fs::remove_file(link).unwrap();
    }

    /// A slot whose attempts all fail, each when it is told what it took of a processor.
    fn failing() -> (PortSlot, Sender<Duration>) {
        let (takes, took) = channel();
        let config = at(PathBuf::from("/dev/no-such-port"));
        let work = move |_job| PortResult {
            outcome: Outcome::Failed(OpenError::Missing(PathBuf::new())),
            spent: took.recv().unwrap_or_default(),
        };
        (PortSlot::with(&config, work).unwrap(), takes)
    }

    #[test]
    fn an_attempt_that_is_held_up_holds_up_nothing_and_only_its_processor_time_lengthens_the_pause()
    {
        let (mut slot, takes) = failing();
        let mut now = MonotonicNs(1_000_000_000);
        let ms = Duration::from_millis;
        let table = [
            // What the attempt took of a processor; the pause after it.
            (ms(0), ms(20)),
            (ms(0), ms(40)),
            (ms(1), ms(80)),
            (ms(1), ms(100)),
            (ms(10), ms(200)),
            (ms(100), LONGEST_REST),
            (LONG, LONGEST_REST),
            (ms(0), ms(100)),
        ];
        for (spent, pause) in table {
            // It is under way, for longer than any pause: nothing is due, nothing waits for it.
            assert!(!slot.step(now, true).unwrap());
            assert_eq!(slot.next_try(), None);
            now = now + LONG;
            assert!(!slot.step(now, true).unwrap());
            takes.send(spent).unwrap();
            let result = slot.thread.wait(LONG).unwrap();
            assert!(!slot.ended(now, result).unwrap());
            assert_eq!(slot.next_try(), Some(now + pause), "{spent:?}");
            now = now + pause;
        }
        assert!(!slot.step(now, true).unwrap());
        slot.finish();
    }

    #[test]
    fn a_thread_spends_what_it_works_and_not_what_it_waits() {
        let (_never, nothing) = channel::<()>();
        let begun = processor_time();
        let _ = nothing.recv_timeout(Duration::from_millis(200));
        let spent = processor_time() - begun;
        assert!(spent < Duration::from_millis(100), "{spent:?}");
    }
}
