//! How long a process is held up, told from how long the machine itself stands still: [`judge`] tries a few times what
//! may take no longer than its limits, [`gaps`] measures what comes again and again, [`OrderWatch`] what orders take,
//! and [`Pace`] what is the machine's.

use std::fs;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, mpsc};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use ipc_types::payload::{HeroTelemetry, MovementData, RequestReport};
use ipc_types::{Client, MonotonicNs, Request};

use crate::domain::TestDomain;
use crate::languages::skip;
use crate::process::{Process, WAIT_LIMIT};

/// Longest time between two samples of telemetry.
pub const GAP: Duration = Duration::from_millis(300);

/// Longest time until an order is acknowledged.
pub const ACKNOWLEDGED: Duration = Duration::from_secs(1);

/// Longest time until a process has ended.
pub const ENDED: Duration = Duration::from_secs(3);

/// For how long a call is held up.
pub const HELD_UP: Duration = Duration::from_secs(3);

/// For how long orders are given and telemetry is watched meanwhile.
const WATCHED: Duration = Duration::from_secs(4);

/// A sample or an answer passes at most so many processes, each of which has to wait for a processor.
const HOPS: u32 = 4;

/// How often a row is tried, of which the best counts: what waits for a call that is held up does so each time. The
/// machine's own stalls, and those of its terminals, which are measured beside it, are taken off; an attempt in which
/// it stood still for so long that a call that is held up would not be seen says nothing.
const ATTEMPTS: usize = 5;

/// One attempt at most may take so many times its limit.
const FAR: u32 = 2;

/// The pace of this machine: a thread that wants to run every few milliseconds, and measures for how long it could not.
#[derive(Debug)]
pub struct Pace {
    is_over: Arc<AtomicBool>,
    reader: Arc<AtomicU32>,
    thread: JoinHandle<(Duration, Duration)>,
}

impl Pace {
    /// How often it wants to run.
    const LOOK: Duration = Duration::from_millis(5);

    /// Starts the thread.
    pub fn start() -> Pace {
        let is_over = Arc::new(AtomicBool::new(false));
        let reader = Arc::new(AtomicU32::new(0));
        let (stop, of) = (Arc::clone(&is_over), Arc::clone(&reader));
        let thread = thread::spawn(move || {
            let (mut stall, mut line) = (Duration::ZERO, Duration::ZERO);
            while !stop.load(Ordering::Relaxed) {
                let begin = Instant::now();
                thread::sleep(Pace::LOOK);
                stall = stall.max(begin.elapsed() - Pace::LOOK);
                let reader = of.load(Ordering::Relaxed);
                let waits = || {
                    let at = fs::read_to_string(format!("/proc/{reader}/wchan"));
                    at.is_ok_and(|at| at.contains("flush_work"))
                };
                if reader != 0 && waits() {
                    line += begin.elapsed();
                }
            }
            (stall, line)
        });
        Pace {
            is_over,
            reader,
            thread,
        }
    }

    /// From now on it measures, too, for how long the kernel kept this process, which reads a terminal, because its own
    /// worker that brings the bytes had no processor: whoever reads a terminal, or waits for it, waits for that one.
    pub fn of_line(&self, reader: &Process) {
        self.reader.store(reader.id(), Ordering::Relaxed);
    }

    /// Ends it: the longest stall of the machine, and how long the reader waited for the kernel in all.
    pub fn end(self) -> (Duration, Duration) {
        self.is_over.store(true, Ordering::Relaxed);
        self.thread.join().expect("a thread that measures")
    }
}

/// The best of what attempts measured, each by itself, must be within the limits, and no two may be far outside of
/// them: a fault that comes and goes is not the machine's.
///
/// # Panics
///
/// When they are not.
pub fn judge<const N: usize>(
    what: &str,
    limits: [Duration; N],
    mut attempt: impl FnMut(&Pace) -> [Duration; N],
) {
    let mut best = [Duration::MAX; N];
    let (mut attempts, mut far) = (Vec::new(), 0);
    for _ in 0..ATTEMPTS {
        let pace = Pace::start();
        let measured = attempt(&pace);
        let (stall, line) = pace.end();
        attempts.push((measured, stall, line));
        let stall = HOPS * stall + line;
        if stall + ACKNOWLEDGED >= HELD_UP {
            continue;
        }
        let own = measured.map(|it| it.saturating_sub(stall));
        best.iter_mut()
            .zip(own)
            .for_each(|(best, it)| *best = it.min(*best));
        let mut own = own.into_iter().zip(limits);
        far += u32::from(own.any(|(it, limit)| it >= FAR * limit));
        assert!(far < 2, "{what}: {attempts:?}, and not near {limits:?}");
        if best.iter().zip(limits).all(|(best, limit)| *best <= limit) {
            println!(
                "{what}: {measured:?}, of which {stall:?} are the machine's; attempts: {attempts:?}"
            );
            return;
        }
    }
    if best[0] == Duration::MAX {
        return skip(
            what,
            &format!("this machine stands still for too long: {attempts:?}"),
        );
    }
    panic!("{what}: {best:?}, and not within {limits:?}; each attempt and its stall: {attempts:?}");
}

/// An operator's client in this process, which asks how long orders take.
#[derive(Debug)]
pub struct OrderWatch<'a> {
    domain: &'a TestDomain,
    last: u64,
}

impl<'a> OrderWatch<'a> {
    /// Of the robot in this domain.
    pub fn new(domain: &'a TestDomain) -> OrderWatch<'a> {
        OrderWatch { domain, last: 0 }
    }

    /// Sends an order. How long until its first report, and which that is.
    ///
    /// # Panics
    ///
    /// When none comes.
    pub fn give<R: Request>(&mut self, order: impl FnOnce(u64) -> R) -> (Duration, RequestReport) {
        self.last += 1;
        let mut client: Client<R> = self.domain.join("operator").client().expect("a client");
        let sent = MonotonicNs::now();
        let mut request = client.request(&order(self.last)).expect("a bridge");
        let report = request.recv_timeout(WAIT_LIMIT).expect("a wait");
        (MonotonicNs::now().since(sent), report.expect("a report"))
    }

    /// The longest that a hold and a landing took until they were acknowledged, whatever the answer is, given again and
    /// again for a time in which at least one call is held up from its beginning to its end.
    pub fn hold_and_land(&mut self) -> Duration {
        let (begun, mut longest) = (Instant::now(), Duration::ZERO);
        while begun.elapsed() < WATCHED {
            let (hold, _) = self.give(MovementData::hold);
            let (land, _) = self.give(MovementData::land);
            longest = longest.max(hold).max(land);
        }
        longest
    }
}

/// Waits for the next of what comes again and again, for at most some seconds, and says whether it has come.
pub type NextSample<'a> = Box<dyn FnMut() -> bool + Send + 'a>;

/// Listens to the telemetry of robot 1.
///
/// # Panics
///
/// When there is no room for a subscriber.
pub fn telemetry<'a>(domain: &TestDomain) -> NextSample<'a> {
    let ipc = domain.join("listener");
    let mut samples = ipc.subscriber::<HeroTelemetry>().expect("a subscriber");
    Box::new(move || {
        samples.wait(Duration::from_secs(5)).expect("a wait");
        let mut has_come = false;
        samples.drain(|_| has_come = true).expect("samples");
        has_come
    })
}

/// The longest time for which nothing came of each of these while `work` was done, once something has come of all.
///
/// # Panics
///
/// When nothing ever comes of one.
pub fn gaps<const N: usize>(of: [NextSample<'_>; N], work: impl FnOnce()) -> [Duration; N] {
    let is_over = &AtomicBool::new(false);
    thread::scope(|scope| {
        let (heard, begins) = mpsc::channel();
        let threads = of.map(|mut next| {
            let heard = heard.clone();
            scope.spawn(move || {
                let limit = Instant::now() + WAIT_LIMIT;
                while !next() {
                    assert!(Instant::now() < limit, "nothing has come");
                }
                let (mut longest, mut last) = (Duration::ZERO, Instant::now());
                // The other end is gone when another one has failed.
                let _ = heard.send(());
                while !is_over.load(Ordering::Relaxed) {
                    let has_come = next();
                    longest = longest.max(last.elapsed());
                    last = if has_come { Instant::now() } else { last };
                }
                longest
            })
        });
        drop(heard);
        if begins.iter().take(N).count() == N {
            work();
        }
        is_over.store(true, Ordering::Relaxed);
        threads.map(|thread| thread.join().expect("samples that come"))
    })
}
