//! An allocator that counts, for each thread.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

/// The system's allocator, counting. A program that wants its figures makes it the global one.
pub struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
    static LIVE_BYTES: Cell<i64> = const { Cell::new(0) };
    static WATCHED: Cell<Option<&'static Watched>> = const { Cell::new(None) };
}

// SAFETY: everything is handed on to the system's allocator as it came; the counts have no destructor and are const, so
// that they allocate nothing themselves.
#[allow(unsafe_code)]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        LIVE_BYTES.set(LIVE_BYTES.get() + layout.size() as i64);
        if let Some(watched) = WATCHED.get() {
            watched.allocations.fetch_add(1, Ordering::Relaxed);
            watched.longest.fetch_max(layout.size(), Ordering::Relaxed);
        }
        // SAFETY: as the caller's.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        LIVE_BYTES.set(LIVE_BYTES.get() - layout.size() as i64);
        // SAFETY: as the caller's.
        unsafe { System.dealloc(pointer, layout) }
    }
}

/// What this thread has taken so far.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heap {
    /// How often it asked for memory.
    pub allocations: u64,
    /// Bytes that it has and has not given back.
    pub live_bytes: i64,
}

impl Heap {
    /// The figures of this thread, now.
    pub fn now() -> Heap {
        Heap {
            allocations: ALLOCATIONS.get(),
            live_bytes: LIVE_BYTES.get(),
        }
    }

    /// What was taken since.
    pub fn since(self) -> Heap {
        let now = Heap::now();
        Heap {
            allocations: now.allocations - self.allocations,
            live_bytes: now.live_bytes - self.live_bytes,
        }
    }
}

/// What a thread allocates, for another thread to look at.
pub struct Watched {
    /// How often it asked for memory.
    pub allocations: AtomicU64,
    /// For how much at most.
    pub longest: AtomicUsize,
}

impl Watched {
    /// Of a thread that does not run yet.
    pub const fn new() -> Watched {
        Watched {
            allocations: AtomicU64::new(0),
            longest: AtomicUsize::new(0),
        }
    }

    /// Counts what this thread allocates from now on.
    pub fn watch(&'static self) {
        WATCHED.set(Some(self));
    }
}
