//! [`request_slice`]: what a thread that waits for data can ask of the Linux scheduler without any privilege.
//!
//! A thread that is woken on a processor where another one runs, such as the publisher that has just woken it, may have
//! to wait until that one sleeps: between slices of the same length it is a matter of chance. A thread with a shorter
//! slice than the one that runs goes first. It gets as much of the processor as before, only in smaller pieces, and so
//! this suits every thread that has little to do each time it is woken.
//!
//! A thread in the background asks for the opposite: it puts no other thread aside, and goes last when several wait.

use std::io;

/// Where a thread stands in the flow of telemetry. Providers and consumers have shorter slices than Linux gives unasked
/// (0.7 to 2.8 ms).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SchedulingRole {
    /// It publishes, as the bridge and status do. Those two have slices of the same length: if status put the bridge
    /// aside in the middle of its work, status' own consumers would be woken on another processor, which takes longer
    /// than the rest of that work.
    Provider,
    /// No other process waits for it: consumers of telemetry, senders of requests. It need not wait for the provider
    /// that woke it.
    Consumer,
    /// Samples may wait for it, as those of a recorder do, but it must get to them in the end: it has its full share of
    /// a processor. A wake of it puts no other thread aside (`SCHED_BATCH`), every other thread's wake puts it aside,
    /// and it goes last of all that wait, because its slice is the longest.
    Background,
}

impl SchedulingRole {
    /// The slice, ns. The consumers' is the shortest that Linux gives; the longest would be 100 ms.
    const fn slice_ns(self) -> u64 {
        match self {
            SchedulingRole::Provider => 400_000,
            SchedulingRole::Consumer => 100_000,
            SchedulingRole::Background => 10_000_000,
        }
    }

    const fn policy(self) -> i32 {
        match self {
            SchedulingRole::Provider | SchedulingRole::Consumer => libc::SCHED_OTHER,
            SchedulingRole::Background => libc::SCHED_BATCH,
        }
    }
}

/// Asks the scheduler for the slice of `role`: to let the calling thread run as soon as it is woken, or in the
/// background after all others. Threads that it starts later inherit that.
///
/// Slices hold for ordinary threads on Linux 6.12 and later; before that, and for real-time threads, which are woken at
/// once in any case, they change nothing. Never needed, only faster: `docs/performance.md` says by how much.
pub fn request_slice(role: SchedulingRole) {
    if let Err(error) = set_slice(role) {
        crate::log::debug!(%error, ?role, "the scheduler grants no slice of its own");
    }
}

fn set_slice(role: SchedulingRole) -> io::Result<()> {
    let mut attributes = attributes()?;
    if attributes.sched_policy != libc::SCHED_OTHER as u32 {
        return Ok(());
    }
    attributes.sched_policy = role.policy() as u32;
    attributes.sched_runtime = role.slice_ns();
    // SAFETY: the kernel reads the struct, which says how long it is. 0 is the calling thread; there are no flags.
    #[allow(unsafe_code)]
    let result = unsafe { libc::syscall(libc::SYS_sched_setattr, 0, &raw const attributes, 0) };
    outcome(result)
}

/// The scheduling attributes of the calling thread.
fn attributes() -> io::Result<libc::sched_attr> {
    // SAFETY: numbers, for which all bits zero is a value.
    #[allow(unsafe_code)]
    let mut attributes: libc::sched_attr = unsafe { std::mem::zeroed() };
    let len = size_of::<libc::sched_attr>();
    // SAFETY: the kernel writes at most `len` bytes into the struct, which has so many.
    #[allow(unsafe_code)]
    let result = unsafe { libc::syscall(libc::SYS_sched_getattr, 0, &raw mut attributes, len, 0) };
    outcome(result)?;
    Ok(attributes)
}

fn outcome(result: libc::c_long) -> io::Result<()> {
    match result {
        0 => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thread_in_the_background_keeps_its_priority_and_puts_no_other_aside() {
        // A sandbox may not know the call.
        let Ok(before) = attributes() else { return };
        std::thread::scope(|scope| {
            scope.spawn(|| {
                request_slice(SchedulingRole::Background);
                let now = attributes().unwrap();
                assert_eq!(now.sched_nice, before.sched_nice);
                match before.sched_policy == libc::SCHED_OTHER as u32 {
                    true => assert_eq!(now.sched_policy, libc::SCHED_BATCH as u32),
                    // Who runs a test in the idle class, or as real-time, knows why.
                    false => assert_eq!(now.sched_policy, before.sched_policy),
                }
            });
        });
        assert_eq!(attributes().unwrap().sched_policy, before.sched_policy);
    }

    #[test]
    fn only_the_slice_of_the_calling_thread_changes() {
        // A sandbox may not know the call.
        let Ok(before) = attributes() else { return };
        let slice_ns = SchedulingRole::Consumer.slice_ns();
        std::thread::scope(|scope| {
            scope.spawn(|| {
                request_slice(SchedulingRole::Consumer);
                let now = attributes().unwrap();
                assert_eq!(now.sched_policy, before.sched_policy);
                assert_eq!(now.sched_nice, before.sched_nice);
                // Older kernels have no slices, and other policies keep what they have.
                let is_ordinary = before.sched_policy == libc::SCHED_OTHER as u32;
                assert!(
                    now.sched_runtime == before.sched_runtime
                        || is_ordinary && now.sched_runtime == slice_ns
                );
            });
        });
        assert_eq!(attributes().unwrap().sched_runtime, before.sched_runtime);
    }
}
