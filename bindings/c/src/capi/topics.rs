//! Subscribing to topics, and publishing.

use std::ffi::{c_int, c_void};
use std::os::fd::AsRawFd;

use ipc_types::{DynamicPublisher, DynamicSubscriber, Losses, Patience};

use super::robot::Robot;
use super::{
    INTERRUPTED, NOTHING, OK, Topic, clear, closing, give, guard, handle, null, service_name,
    timeout, write,
};
use crate::error::Error;
use crate::topic::{self, SampleWait};

/// `hero_ril_losses`
#[repr(C)]
pub struct LossCounts {
    received: u64,
    lost: u64,
    joined_late: u64,
    repeated: u64,
    publisher_restarts: u64,
}

/// `hero_ril_sample_callback`
pub type SampleCallback = Option<unsafe extern "C" fn(*const c_void, usize, *mut c_void)>;

/// Where a caller wants its samples.
#[derive(Clone, Copy)]
struct Buffer {
    to: *mut u8,
    size: usize,
}

impl Buffer {
    /// The caller's buffer, of as many bytes as the samples of `subscriber` have.
    fn of(subscriber: &DynamicSubscriber, to: *mut c_void, size: usize) -> Result<Buffer, Error> {
        let wanted = subscriber.schema().size();
        match (to.is_null(), size == wanted) {
            (true, _) => Err(null("sample")),
            (false, true) => Ok(Buffer {
                to: to.cast(),
                size,
            }),
            (false, false) => Err(Error::Layout(format!(
                "a sample has {wanted} bytes, the buffer has {size}"
            ))),
        }
    }

    fn fill(self, sample: &[u8]) {
        debug_assert_eq!(sample.len(), self.size);
        // SAFETY: a subscriber hands on samples of its schema's size alone, and the caller has as many bytes there.
        unsafe { sample.as_ptr().copy_to_nonoverlapping(self.to, self.size) };
    }
}

/// Subscribes to a topic. The publisher need not be there yet, unless the schema is to come from it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_subscribe(
    robot: *mut Robot,
    topic: *const Topic,
    out: *mut *mut DynamicSubscriber,
) -> c_int {
    guard(|| unsafe {
        clear(out)?;
        let topic = service_name(topic, "topic")?;
        give(out, topic.subscriber(&handle(robot, "robot")?.ipc)?)
    })
}

closing! { extern "C" fn hero_ril_unsubscribe(subscriber: *mut DynamicSubscriber); }

/// Copies the oldest sample that was not received yet; waits for one as long as `timeout_ms`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_receive(
    subscriber: *mut DynamicSubscriber,
    sample: *mut c_void,
    size: usize,
    timeout_ms: i32,
) -> c_int {
    guard(|| unsafe {
        let subscriber = handle(subscriber, "subscriber")?;
        let to = Buffer::of(subscriber, sample, size)?;
        Ok(
            match topic::receive(subscriber, timeout(timeout_ms), |sample| to.fill(sample))? {
                SampleWait::Sample => OK,
                SampleWait::Nothing => NOTHING,
                SampleWait::Interrupted => INTERRUPTED,
            },
        )
    })
}

/// Copies the newest sample that was not received yet, and drops older ones.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_latest(
    subscriber: *mut DynamicSubscriber,
    sample: *mut c_void,
    size: usize,
) -> c_int {
    guard(|| unsafe {
        let subscriber = handle(subscriber, "subscriber")?;
        let to = Buffer::of(subscriber, sample, size)?;
        // The last one stays.
        let drained = subscriber.drain(|sample| to.fill(sample))?;
        Ok(if drained > 0 { OK } else { NOTHING })
    })
}

/// Calls `callback` for each sample that is there, without a copy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_drain(
    subscriber: *mut DynamicSubscriber,
    callback: SampleCallback,
    context: *mut c_void,
) -> c_int {
    guard(|| unsafe {
        let callback = callback.ok_or_else(|| null("callback"))?;
        let taken = handle(subscriber, "subscriber")?
            .drain(|sample| callback(sample.as_ptr().cast(), sample.len(), context))?;
        Ok(if taken > 0 { OK } else { NOTHING })
    })
}

/// Size of a sample in bytes, for a topic whose struct the program does not know.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_sample_size(subscriber: *const DynamicSubscriber) -> usize {
    // SAFETY: the caller got it from `hero_ril_subscribe`.
    unsafe { subscriber.as_ref() }.map_or(0, |subscriber| subscriber.schema().size())
}

/// What the subscriber received, lost, came too late for and got twice, and how often the publisher restarted.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_count(
    subscriber: *mut DynamicSubscriber,
    losses: *mut LossCounts,
) -> c_int {
    guard(|| unsafe {
        let Losses {
            received,
            lost,
            joined_late,
            repeated,
            publisher_restarts,
        } = handle(subscriber, "subscriber")?.losses();
        let counts = LossCounts {
            received,
            lost,
            joined_late,
            repeated,
            publisher_restarts,
        };
        write(losses, counts, "losses")?;
        Ok(OK)
    })
}

/// A descriptor for an event loop: readable when there may be samples, and every 250 ms in any case.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_descriptor(
    subscriber: *mut DynamicSubscriber,
    descriptor: *mut c_int,
) -> c_int {
    guard(|| unsafe {
        let number = handle(subscriber, "subscriber")?.descriptor()?.as_raw_fd();
        write(descriptor, number, "descriptor")?;
        Ok(OK)
    })
}

/// Becomes the one publisher of a topic; a module's topic needs its schema.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_advertise(
    robot: *mut Robot,
    topic: *const Topic,
    out: *mut *mut DynamicPublisher,
) -> c_int {
    guard(|| unsafe {
        clear(out)?;
        let ipc = &handle(robot, "robot")?.ipc;
        give(out, service_name(topic, "topic")?.publisher(ipc, None)?)
    })
}

/// For a test: becomes a publisher of which each sample waits up to `wait_ms` for the subscribers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_advertise_patient(
    robot: *mut Robot,
    topic: *const Topic,
    wait_ms: i32,
    out: *mut *mut DynamicPublisher,
) -> c_int {
    guard(|| unsafe {
        clear(out)?;
        let ipc = &handle(robot, "robot")?.ipc;
        let patience = Some(Patience::up_to(timeout(wait_ms)));
        give(out, service_name(topic, "topic")?.publisher(ipc, patience)?)
    })
}

/// Publishes a copy of the struct and never blocks; `sequence` gets its number, from 1.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_publish(
    publisher: *mut DynamicPublisher,
    sample: *const c_void,
    size: usize,
    sequence: *mut u64,
) -> c_int {
    guard(|| unsafe {
        let publisher = handle(publisher, "publisher")?;
        if sample.is_null() {
            return Err(null("sample"));
        }
        if size != publisher.schema().size() {
            return Err(Error::Layout(format!(
                "a sample has {} bytes, {size} were given",
                publisher.schema().size()
            )));
        }
        publisher.service();
        let number = publisher.publish(|bytes| {
            // SAFETY: the caller has `size` bytes there, which are as many as `bytes` has.
            bytes.copy_from_slice(std::slice::from_raw_parts(sample.cast(), size));
        })?;
        if !sequence.is_null() {
            sequence.write(number);
        }
        Ok(OK)
    })
}

/// Gives the latest sample to subscribers that have joined since.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_tend(publisher: *mut DynamicPublisher) -> c_int {
    guard(|| unsafe {
        handle(publisher, "publisher")?.service();
        Ok(OK)
    })
}

closing! { extern "C" fn hero_ril_withdraw(publisher: *mut DynamicPublisher); }
