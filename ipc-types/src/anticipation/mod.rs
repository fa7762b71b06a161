//! [`Anticipation`]: a wait that is awake shortly before the next sample of a periodic topic is due, and looks out for it.
//!
//! Being woken takes microseconds; who looks already sees a sample a tenth of a microsecond after it was published. Looking out
//! keeps a processor busy, so it has a budget, and it is done only where it pays: see [`predictor`]. A sample before the window
//! wakes the sleeper as ever, and so does one after it.
//!
//! Who looks out on the processor of the publisher keeps it from publishing. So the waiting thread leaves that processor, and where
//! it may not, it sleeps as ever.

mod predictor;

use std::hint;
use std::num::NonZeroU64;
use std::sync::Arc;
use std::thread::{self, ThreadId};
use std::time::Duration;

use predictor::{Predictor, Window};
use rustix::thread::{
    CpuSet, sched_getaffinity, sched_getcpu, sched_setaffinity, set_current_timer_slack,
};
use rustix::time::{ClockId, clock_gettime};

use crate::doorbell::{LONGEST_SPIN, Place};
use crate::session::Session;
use crate::time::MonotonicNs;
use crate::waiter::{Ready, Source, WaitError, Waiter, Wake};

/// The largest budget: half of a processor.
const MOST: f64 = 0.5;

/// How often to look for samples before looking at clock and processor, which takes about as long as a look.
const SPINS_PER_LOOK: u32 = 16;

/// What anticipation has brought, and cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Anticipated {
    /// Samples that were seen without being woken for them.
    pub caught: u64,
    /// Samples that a wait was ended by in another way.
    pub others: u64,
    /// Processor time of looking out.
    pub spun: Duration,
}

/// See the file's first lines.
pub(crate) struct Anticipation {
    predictor: Predictor,
    /// What ended the last wait.
    seen: Option<Seen>,
    anticipated: Anticipated,
    /// The thread that waits.
    thread: Option<WaitingThread>,
    place: Place,
    session: Arc<Session>,
}

/// The moment at which a wait saw that there was something.
struct Seen {
    at: MonotonicNs,
    /// Whether looking out saw it.
    is_caught: bool,
    /// Whether it was a sample, which the port has handed on.
    is_taken: bool,
}

impl Seen {
    fn new(at: MonotonicNs, is_caught: bool) -> Seen {
        Seen {
            at,
            is_caught,
            is_taken: false,
        }
    }
}

/// What was changed of a thread: its timers are exact, and it may be kept off a processor.
struct WaitingThread {
    id: ThreadId,
    /// The processors that it might run on before.
    processors: Option<CpuSet>,
    /// Whether it is kept off one of them.
    is_away: bool,
}

impl Anticipation {
    /// `budget` is a share of one processor.
    pub(crate) fn new(budget: f64, place: Place, session: &Arc<Session>) -> Anticipation {
        Anticipation {
            predictor: Predictor::new(budget.clamp(0.0, MOST)),
            seen: None,
            anticipated: Anticipated::default(),
            thread: None,
            place,
            session: Arc::clone(session),
        }
    }

    pub(crate) fn anticipated(&self) -> Anticipated {
        self.anticipated
    }

    /// A sample was taken. The predictor learns of it in the next wait, when the sample's consumer has had it.
    pub(crate) fn taken(&mut self) {
        if let Some(seen) = &mut self.seen {
            seen.is_taken = true;
        }
    }

    /// As [`Waiter::wait`] for `port`, which must be a subscriber.
    pub(crate) fn wait(
        &mut self,
        waiter: &Waiter,
        port: &mut dyn Source,
        timeout: Duration,
    ) -> Result<Wake, WaitError> {
        if let Some(seen) = self.seen.take_if(|seen| seen.is_taken) {
            self.predictor.arrived(seen.at, seen.is_caught);
        }
        self.seen = None;
        if port.has_something() {
            // When it came is not known.
            return Ok(Wake::Ready(Ready::one()));
        }
        self.enter_thread();
        let mut now = MonotonicNs::now();
        let deadline = now + timeout;
        if !self.predictor.pays(now) {
            self.return_to_processor();
        }
        let mut after = now;
        while let Some(window) = self.predictor.window(after) {
            if window.begin > now {
                let until = window.begin.min(deadline);
                let wake = waiter.wait_for_one(port, until.since(now))?;
                now = MonotonicNs::now();
                if wake != Wake::TimedOut || now >= deadline {
                    return Ok(self.ended(wake, now));
                }
                self.predictor.woke_late(now.since(window.begin));
            }
            if self.look_out(port, window, deadline) {
                return Ok(Wake::Ready(Ready::one()));
            }
            now = MonotonicNs::now();
            // Of a window that may not be used, the rest is slept through.
            after = now.max(window.end);
            if after >= deadline {
                break;
            }
        }
        let left = deadline.since(MonotonicNs::now());
        let wake = waiter.wait_for_one(port, left)?;
        Ok(self.ended(wake, MonotonicNs::now()))
    }

    /// The wait was ended by something else than looking out.
    fn ended(&mut self, wake: Wake, now: MonotonicNs) -> Wake {
        if wake.is_ready() {
            self.seen = Some(Seen::new(now, false));
            self.anticipated.others += 1;
        }
        wake
    }

    /// Looks out for a sample until the window is over, and says whether there is something.
    fn look_out(&mut self, port: &dyn Source, window: Window, deadline: MonotonicNs) -> bool {
        let begin = MonotonicNs::now();
        let until = window.end.min(deadline);
        if until <= begin || until.since(begin) > LONGEST_SPIN {
            return false;
        }
        if self.session.doorbell().publisher(self.place) == Some(current_processor())
            && !self.leave_processor()
        {
            return false;
        }
        let processor = current_processor();
        let Some(_claim) = self.session.doorbell().claim_processor(processor, until) else {
            return false;
        };
        let used = processor_time();
        let mut is_there = false;
        let mut now = begin;
        // Moved to another processor, it might meet one there that looks out as well.
        while !is_there && now < until && processor == current_processor() {
            for _ in 0..SPINS_PER_LOOK {
                if port.has_something() {
                    is_there = true;
                    break;
                }
                hint::spin_loop();
            }
            now = MonotonicNs::now();
        }
        let used = processor_time().saturating_sub(used);
        self.predictor.spent(used);
        self.anticipated.spun += used;
        if is_there {
            self.seen = Some(Seen::new(now, true));
            self.anticipated.caught += 1;
        }
        is_there
    }

    /// Linux lets timers of ordinary threads be 50 µs late, so that some wakes are shared.
    fn enter_thread(&mut self) {
        let id = thread::current().id();
        if self.thread.as_ref().is_some_and(|thread| thread.id == id) {
            return;
        }
        if let Err(error) = set_current_timer_slack(NonZeroU64::new(1)) {
            tracing::debug!(%error, "timers stay inexact");
        }
        let processors = sched_getaffinity(None).ok();
        self.thread = Some(WaitingThread {
            id,
            processors,
            is_away: false,
        });
    }

    /// Goes to a processor other than the present one, and says whether there is one.
    fn leave_processor(&mut self) -> bool {
        let Some(thread) = &mut self.thread else {
            return false;
        };
        let Some(mut processors) = thread.processors else {
            return false;
        };
        processors.unset(current_processor());
        if processors.count() == 0 || sched_setaffinity(None, &processors).is_err() {
            return false;
        }
        thread.is_away = true;
        true
    }

    /// The thread may run where it might before: where it is woken, on the processor of its publisher, is faster than elsewhere.
    fn return_to_processor(&mut self) {
        if let Some(thread) = &mut self.thread
            && thread.is_away
            && thread.id == thread::current().id()
            && let Some(processors) = thread.processors
        {
            thread.is_away = false;
            if let Err(error) = sched_setaffinity(None, &processors) {
                tracing::debug!(%error, "the thread is kept off a processor");
            }
        }
    }
}

impl Drop for Anticipation {
    fn drop(&mut self) {
        self.return_to_processor();
    }
}

/// What the thread has used of processors.
fn processor_time() -> Duration {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
}

/// The processor that the thread runs on.
fn current_processor() -> usize {
    sched_getcpu()
}
