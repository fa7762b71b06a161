//! `[realtime]`: what the thread of a loop asks of the system so that other programs of the machine hold it up less.
//! By default it asks for nothing, and the robot flies without: the process logs once what is refused, and goes on.
//!
//! [`lack`] judges what was granted, for the process and for `ril doctor` alike; [`latency`] keeps the processors awake
//! in flight.

mod config;
pub mod lack;
pub mod latency;

use std::fs;
use std::hint::black_box;
use std::io;
use std::path::Path;

use rustix::mm::{MlockAllFlags, mlock, mlockall, munlock};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use rustix::thread::{CpuSet, sched_setaffinity};

pub use config::RealtimeConfig;
use lack::{Granted, Lack};

/// The loop's stack that is in memory before the first frame, bytes: more than the loops of bridge and status use, in
/// which no page fault is counted.
const STACK_LEN: usize = 256 << 10;

/// Asks for what is configured, for the calling thread, which is about to run its loop: after its ports are open and
/// its other threads have started. These stay ordinary threads on any processor. A thread that the calling one starts
/// later is an ordinary one as well, but on the loop's processors. What is refused is logged with what to do about it.
pub fn begin(asked: &RealtimeConfig) {
    if !asked.is_of_loop() {
        return;
    }
    match ask(asked, true) {
        Ok(lacking) if lacking.is_empty() => tracing::info!(
            lock_memory = asked.lock_memory,
            priority = asked.priority,
            processors = ?asked.processors,
            "real time as asked"
        ),
        Ok(lacking) => {
            for lack in lacking {
                tracing::warn!("real time: {lack}; {}", lack.next_step());
            }
        }
        Err(error) => tracing::warn!(%error, "real time: what was granted is not known"),
    }
}

/// What the calling thread would lack. It gets all but the locked memory, so it should be one that ends.
///
/// # Errors
/// `/proc` cannot be read.
pub fn rehearse(asked: &RealtimeConfig) -> io::Result<Vec<Lack>> {
    ask(asked, false)
}

/// What a live process lacks.
///
/// # Errors
/// It has ended, or `/proc` cannot be read.
pub fn look(asked: &RealtimeConfig, process: u32) -> io::Result<Vec<Lack>> {
    Ok(asked.lacking(&granted(Path::new(&format!("/proc/{process}")))?))
}

fn ask(asked: &RealtimeConfig, is_in_earnest: bool) -> io::Result<Vec<Lack>> {
    let may_lock = asked.lock_memory && has_no_memory_limit();
    if may_lock && is_in_earnest {
        // What comes later, such as the memory of a consumer's connection, is in RAM before it is used as well.
        let _ = mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE);
        let limit = getrlimit(Resource::Stack).current.unwrap_or(u64::MAX);
        // A short stack is left to what it is needed for.
        touch_stack(STACK_LEN.min(usize::try_from(limit / 4).unwrap_or(usize::MAX)));
    }
    if !asked.processors.is_empty() {
        let mut set = CpuSet::new();
        for number in &asked.processors {
            set.set(usize::from(*number));
        }
        let _ = sched_setaffinity(None, &set);
    }
    if asked.priority > 0 {
        set_priority(asked.priority);
    }
    // Whatever the calls said: what counts is what the thread has.
    let mut granted = granted(Path::new("/proc/thread-self"))?;
    granted.is_locked |= may_lock && !is_in_earnest;
    Ok(asked.lacking(&granted))
}

fn granted(folder: &Path) -> io::Result<Granted> {
    let [stat, status, limits] =
        ["stat", "status", "limits"].map(|name| fs::read_to_string(folder.join(name)));
    Granted::read(&stat?, &status?, &limits?)
        .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidData, "/proc has another form"))
}

/// Whether memory can be locked without a limit, after an attempt to lift it. Under a limit nothing is locked: once the
/// limit is reached, every further thread and every further piece of memory would be refused, and the process end.
fn has_no_memory_limit() -> bool {
    let limit = getrlimit(Resource::Memlock);
    let lifted = |maximum| Rlimit {
        current: maximum,
        maximum,
    };
    if setrlimit(Resource::Memlock, lifted(None)).is_err() {
        let _ = setrlimit(Resource::Memlock, lifted(limit.maximum));
    }
    let limit = getrlimit(Resource::Memlock);
    limit.current.is_none() || is_above_limits(limit)
}

/// Whether no limit binds this process (`CAP_IPC_LOCK`): it can lock a page below a limit of 0.
fn is_above_limits(limit: Rlimit) -> bool {
    let none = Rlimit {
        current: Some(0),
        ..limit
    };
    let _ = setrlimit(Resource::Memlock, none);
    let page = (&raw const limit).cast_mut().cast();
    let is_closed = getrlimit(Resource::Memlock).current == Some(0);
    // SAFETY: the page is of this thread's stack; to lock it and let it go changes nothing in it.
    #[allow(unsafe_code)]
    let is_above = is_closed && unsafe { mlock(page, 1).and_then(|()| munlock(page, 1)) }.is_ok();
    let _ = setrlimit(Resource::Memlock, limit);
    is_above
}

/// Makes the calling thread a real-time one; threads that it starts are ordinary ones.
fn set_priority(priority: u8) {
    const RESET_ON_FORK: u64 = libc::SCHED_FLAG_RESET_ON_FORK as u64;
    let mut attributes = no_attributes();
    attributes.size = size_of::<libc::sched_attr>() as u32;
    attributes.sched_policy = libc::SCHED_FIFO as u32;
    attributes.sched_priority = u32::from(priority);
    attributes.sched_flags = RESET_ON_FORK;
    set_attributes(&attributes);
}

/// Lets the wake of the calling thread put no other thread aside: others wait for what the one does that wakes it. Who
/// runs the process in another class knows why.
pub(crate) fn run_in_background() {
    let mut attributes = no_attributes();
    let len = size_of::<libc::sched_attr>();
    // SAFETY: the kernel writes at most `len` bytes into the struct, which has so many. 0 is the calling thread; there
    // are no flags.
    #[allow(unsafe_code)]
    let result = unsafe { libc::syscall(libc::SYS_sched_getattr, 0, &raw mut attributes, len, 0) };
    if result == 0 && attributes.sched_policy == libc::SCHED_OTHER as u32 {
        attributes.sched_policy = libc::SCHED_BATCH as u32;
        set_attributes(&attributes);
    }
}

fn no_attributes() -> libc::sched_attr {
    // SAFETY: numbers, for which all bits zero is a value.
    #[allow(unsafe_code)]
    unsafe {
        std::mem::zeroed()
    }
}

/// Of the calling thread. By `sched_setattr`, because our units' filter of system calls lets no other one through.
fn set_attributes(attributes: &libc::sched_attr) {
    // SAFETY: the kernel reads the struct, which says how long it is. 0 is the calling thread; there are no flags.
    #[allow(unsafe_code)]
    let _ = unsafe { libc::syscall(libc::SYS_sched_setattr, 0, attributes, 0) };
}

/// Uses so much of the stack once, so that the kernel has given it.
#[inline(never)]
fn touch_stack(len: usize) {
    const PART: usize = 4096;
    let part = black_box([1_u8; PART]);
    if len > PART {
        touch_stack(len - PART);
    }
    // Keeps the parts apart: without it the call above might use this part again.
    black_box(&part);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thread_in_the_background_keeps_its_nice_value() {
        // SAFETY: no arguments to get wrong; 0 is the calling thread.
        #[allow(unsafe_code)]
        let class = || unsafe { (libc::sched_getscheduler(0), libc::getpriority(0, 0)) };
        let before = class();
        let after = std::thread::spawn(move || {
            run_in_background();
            class()
        });
        // Who runs a test in another class knows why.
        let expected = match before.0 == libc::SCHED_OTHER {
            true => libc::SCHED_BATCH,
            false => before.0,
        };
        assert_eq!(after.join().unwrap(), (expected, before.1));
        assert_eq!(class(), before);
    }

    #[test]
    fn a_processor_that_is_not_there_is_lacking_and_the_thread_runs_on_the_others() {
        let asked = RealtimeConfig {
            processors: vec![1023],
            ..RealtimeConfig::default()
        };
        std::thread::scope(|scope| {
            scope.spawn(|| {
                let before = granted(Path::new("/proc/thread-self")).unwrap();
                let lacking = rehearse(&asked).unwrap();
                let Lack::Processors { missing, left } = &lacking[0] else {
                    panic!("{lacking:?}");
                };
                assert_eq!(
                    (missing.as_slice(), left),
                    (&[1023][..], &before.processors)
                );
                // One that is there, beside one that is not.
                let first = before.processors[0];
                let asked = RealtimeConfig {
                    processors: vec![first, 1023],
                    ..asked.clone()
                };
                let expected = Lack::Processors {
                    missing: vec![1023],
                    left: vec![first],
                };
                assert_eq!(rehearse(&asked).unwrap(), [expected]);
            });
        });
    }
}
