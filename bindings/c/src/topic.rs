//! Receiving samples one at a time.

use std::time::{Duration, Instant};

use ipc_types::{DynamicSubscriber, Wake};

use crate::error::Error;

/// Longest wait: what a wait without a limit means.
pub const FOREVER: Duration = Duration::from_secs(u32::MAX as u64);

/// What came of waiting for a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SampleWait {
    /// A sample was handed on.
    Sample,
    /// The time is over.
    Nothing,
    /// A signal came first.
    Interrupted,
}

/// Hands on the oldest sample that was not handed on yet, waiting for it as long as `timeout`. It is read where it lies
/// in shared memory, and nothing is done between its arrival and `take` that can be done afterwards.
///
/// # Errors
///
/// When the publisher cannot be reached; the next call tries again.
pub fn receive(
    subscriber: &mut DynamicSubscriber,
    timeout: Duration,
    mut take: impl FnMut(&[u8]),
) -> Result<SampleWait, Error> {
    if timeout.is_zero() {
        return Ok(match subscriber.try_borrow()? {
            Some(sample) => {
                take(&sample);
                SampleWait::Sample
            }
            None => SampleWait::Nothing,
        });
    }
    let deadline = Instant::now() + timeout;
    let mut left = timeout;
    loop {
        // Before it sleeps it looks for samples, which is cheaper than receiving.
        let wake = subscriber.wait(left)?;
        if let Some(sample) = subscriber.try_borrow()? {
            take(&sample);
            return Ok(SampleWait::Sample);
        }
        left = deadline.saturating_duration_since(Instant::now());
        match wake {
            // What came with the signal is not lost: the next call reads it.
            Wake::Interrupted => return Ok(SampleWait::Interrupted),
            _ if left.is_zero() => return Ok(SampleWait::Nothing),
            _ => {}
        }
    }
}
