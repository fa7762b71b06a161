//! [`Owned`]: what only the process that made it uses and drops.
//!
//! A child that is forked without `exec` has a copy of every handle of its parent, and shares the parent's locks,
//! sockets and segments. If it dropped one, it would delete files that the parent uses, or give back the parent's
//! locks; and what it published would go astray. So the copies do nothing there: each call is the error [`Forked`], and
//! dropping one leaks it.

use std::mem::ManuallyDrop;
use std::ops::{Deref, DerefMut};
use std::sync::Once;
use std::sync::atomic::{AtomicU32, Ordering};

/// A handle was used in a child process that was forked from the one that made it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "this process was forked from the one that joined the robot, and may not use what that one made: join anew in the child, or start the child by exec (in Python the start method `spawn`)"
)]
pub struct Forked;

/// Forks between the start of the program and this process.
static FORKS: AtomicU32 = AtomicU32::new(0);

extern "C" fn count_fork() {
    FORKS.fetch_add(1, Ordering::Relaxed);
}

/// The process that made something. Asking for it costs a load from memory, no system call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Maker(u32);

impl Maker {
    pub(crate) fn this_process() -> Maker {
        static WATCH: Once = Once::new();
        WATCH.call_once(|| {
            // SAFETY: the handler runs in a new child, where it only counts.
            #[allow(unsafe_code)]
            let result = unsafe { libc::pthread_atfork(None, None, Some(count_fork)) };
            if result != 0 {
                tracing::warn!("forks of this process will not be noticed");
            }
        });
        Maker(FORKS.load(Ordering::Relaxed))
    }

    /// A number for this process that its parent by `fork` has not; never 0.
    pub(crate) fn number(self) -> u32 {
        self.0 + 1
    }

    pub(crate) fn check(self) -> Result<(), Forked> {
        match self.0 == FORKS.load(Ordering::Relaxed) {
            true => Ok(()),
            false => Err(Forked),
        }
    }
}

/// Something that is dropped by the process that made it, and by none that was forked from that.
#[derive(Debug)]
pub(crate) struct Owned<T> {
    maker: Maker,
    value: ManuallyDrop<T>,
}

impl<T> Owned<T> {
    pub(crate) fn new(value: T) -> Owned<T> {
        Owned {
            maker: Maker::this_process(),
            value: ManuallyDrop::new(value),
        }
    }
}

impl<T> Deref for Owned<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.value
    }
}

impl<T> DerefMut for Owned<T> {
    fn deref_mut(&mut self) -> &mut T {
        &mut self.value
    }
}

impl<T> Drop for Owned<T> {
    fn drop(&mut self) {
        if self.maker.check().is_ok() {
            // SAFETY: it is not used afterwards.
            #[allow(unsafe_code)]
            unsafe {
                ManuallyDrop::drop(&mut self.value);
            }
        }
    }
}
