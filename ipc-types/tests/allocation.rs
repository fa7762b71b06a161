//! What a sample costs the allocator, once publisher and subscriber are under way: nothing on our part.
//!
//! iceoryx2 0.10 itself keeps a handle of 104 bytes on the heap from the loan of a sample to its sending.

mod support;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use ipc_types::payload::DspTelemetry;

use support::{in_domain, join};

/// Counts the allocations of each thread.
struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
    static BYTES: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: everything is handed on to the system's allocator as it came; the count has no destructor and is const, so
// that it allocates nothing itself.
#[allow(unsafe_code)]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        BYTES.set(BYTES.get() + layout.size());
        // SAFETY: as the caller's.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as the caller's.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Allocations and bytes of this thread while `work` runs.
fn allocated_by(work: impl FnOnce()) -> (u64, usize) {
    let before = (ALLOCATIONS.get(), BYTES.get());
    work();
    (ALLOCATIONS.get() - before.0, BYTES.get() - before.1)
}

#[test]
fn a_sample_costs_one_small_allocation_to_send_and_none_to_receive() {
    const SAMPLES: u32 = 1_000;
    in_domain(|domain| {
        let ipc = join(domain, "test");
        let mut publisher = ipc.publisher::<DspTelemetry>().unwrap();
        let mut subscriber = ipc.subscriber::<DspTelemetry>().unwrap();
        // The first samples connect the two.
        publisher.publish(|_| {}).unwrap();
        subscriber.drain(|_| {}).unwrap();
        let mut received = 0;
        for _ in 0..SAMPLES {
            let (count, bytes) = allocated_by(|| {
                publisher.publish(|sample| sample.rotor_rpm = 1).unwrap();
                publisher.service();
            });
            assert!(
                count <= 1 && bytes <= 104,
                "{count} allocations, {bytes} bytes"
            );
            let receiving = allocated_by(|| {
                subscriber
                    .drain(|sample| received += sample.rotor_rpm)
                    .unwrap();
            });
            assert_eq!(receiving, (0, 0));
        }
        assert_eq!(received, SAMPLES);
    });
}
