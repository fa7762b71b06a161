//! [`wake_promptly`]: what a thread that waits for data can ask of the Linux scheduler without any privilege.
//!
//! Who is woken on a processor where another thread runs, such as the publisher that has just woken him, waits until that
//! one has had its slice or sleeps. Which of the two happens is a matter of chance: both have slices of the same length.
//! A thread that has asked for a short slice goes first. It gets as much of the processor as before, only in smaller
//! pieces, and so it suits every thread that has little to do each time it is woken.

use std::io;

/// The shortest slice that Linux gives, ns.
const SLICE_NS: u64 = 100_000;

/// Asks the scheduler to let the calling thread run as soon as it is woken. Threads that it starts later inherit that.
///
/// It holds for ordinary threads on Linux 6.12 and later; before that, and for real-time threads, which are woken at once
/// in any case, it changes nothing. Never needed, only faster: `docs/performance.md` says by how much.
pub fn wake_promptly() {
    if let Err(error) = set_slice(SLICE_NS) {
        tracing::debug!(%error, "the scheduler grants no short slice");
    }
}

fn set_slice(slice_ns: u64) -> io::Result<()> {
    let mut attributes = attributes()?;
    if attributes.sched_policy != libc::SCHED_OTHER as u32 {
        return Ok(());
    }
    attributes.sched_runtime = slice_ns;
    // SAFETY: the kernel reads the struct, which says how long it is. 0 is the calling thread; there are no flags.
    #[allow(unsafe_code)]
    let result = unsafe { libc::syscall(libc::SYS_sched_setattr, 0, &raw const attributes, 0) };
    outcome(result)
}

/// Those of the calling thread.
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
    fn only_the_slice_of_the_calling_thread_changes() {
        let before = attributes().unwrap();
        std::thread::scope(|scope| {
            scope.spawn(|| {
                set_slice(SLICE_NS).unwrap();
                let now = attributes().unwrap();
                assert_eq!(now.sched_policy, before.sched_policy);
                assert_eq!(now.sched_nice, before.sched_nice);
                // A kernel that knows nothing of slices reports none.
                assert!([0, SLICE_NS].contains(&now.sched_runtime));
            });
        });
        assert_eq!(attributes().unwrap().sched_runtime, before.sched_runtime);
    }
}
