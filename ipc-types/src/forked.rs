//! [`Owned`]: what only the process that made it uses and drops.
//!
//! A child that is forked without `exec` has a copy of every handle of its parent, and shares the parent's locks,
//! sockets and segments. If it dropped one, it would delete files that the parent uses, or give back the parent's
//! locks; and what it published would go astray. So the copies do nothing there: each call is the error [`Forked`], and
//! dropping one leaks it.
//!
//! Nor may such a child join anew. It has the memory of its parent, but only the thread that forked: a lock that
//! another thread had at that moment, iceoryx2's and the allocator's among them, is locked there for ever. So it is
//! refused at once, whatever its parent did then, instead of standing still now and then.

use std::mem::ManuallyDrop;
use std::ops::{Deref, DerefMut};
use std::sync::Once;
use std::sync::atomic::{AtomicU32, Ordering};

/// A child process that was forked from one that had joined a robot would join, or use a handle of its parent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "this process was forked from one that had joined a robot, and can neither use what that one made nor join anew: start the child by exec (in Python with the start method `spawn`), or fork before anything joins"
)]
pub struct Forked;

/// Forks between the start of the program and this process.
static FORKS: AtomicU32 = AtomicU32::new(0);

extern "C" fn count_fork() {
    FORKS.fetch_add(1, Ordering::Relaxed);
}

/// Whether this process was forked from one that had joined.
pub(crate) fn is_forked() -> bool {
    FORKS.load(Ordering::Relaxed) > 0
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
                crate::log::warn!("forks of this process will not be noticed");
            }
        });
        Maker(FORKS.load(Ordering::Relaxed))
    }

    /// The process as one that joins.
    ///
    /// # Errors
    /// [`Forked`] when the process that it was forked from had joined.
    pub(crate) fn joining() -> Result<Maker, Forked> {
        let maker = Maker::this_process();
        match is_forked() {
            true => Err(Forked),
            false => Ok(maker),
        }
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
