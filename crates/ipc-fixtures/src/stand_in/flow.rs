//! [`Flow`]: how far a stand-in is with what it was given to publish.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::process::WAIT_LIMIT;

/// Samples that wait at most: a script of an hour and more.
const MOST_WAITING: u64 = 1 << 16;

/// Between those who give samples and the thread that publishes them.
#[derive(Debug, Default)]
pub(super) struct Flow {
    state: Mutex<FlowState>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct FlowState {
    given: u64,
    published: u64,
    /// There is no room for the next sample.
    is_held_up: bool,
    /// Nobody has read for [`WAIT_LIMIT`], or the stand-in is to end: samples that find no room are lost.
    is_over: bool,
    /// The thread has ended.
    is_gone: bool,
}

impl Flow {
    /// Gives a sample, by `order`, and returns its number. Returns when it is published, or when it has to wait: then
    /// the thread publishes it as soon as there is room. Nothing when the thread has ended.
    pub(super) fn give(&self, order: impl FnOnce()) -> Option<u64> {
        let mut state = self.lock();
        while state.given - state.published >= MOST_WAITING && !state.is_gone && !state.is_over {
            state = self.wait(state);
        }
        state.given += 1;
        let number = state.given;
        // In here, so that the numbers are in the order of the samples.
        order();
        while state.published < number && !state.is_held_up && !state.is_gone {
            state = self.wait(state);
        }
        (!state.is_gone).then_some(number)
    }

    /// Waits until everything that was given is published. False when the thread has ended before.
    pub(super) fn settle(&self) -> bool {
        let mut state = self.lock();
        while state.published < state.given && !state.is_gone {
            state = self.wait(state);
        }
        state.published == state.given
    }

    /// Called by the thread when a sample has no room for so long: says whether to look again.
    pub(super) fn hold_up(&self, waited: Duration) -> bool {
        let mut state = self.lock();
        state.is_held_up = true;
        self.changed.notify_all();
        state.is_over |= waited > WAIT_LIMIT;
        !state.is_over
    }

    /// Called by the thread when a sample is published.
    pub(super) fn publish(&self) {
        let mut state = self.lock();
        state.published += 1;
        state.is_held_up = false;
        self.changed.notify_all();
    }

    /// Nothing waits for room any more.
    pub(super) fn end(&self) {
        self.lock().is_over = true;
        self.changed.notify_all();
    }

    /// Called by the thread when it ends.
    pub(super) fn gone(&self) {
        self.lock().is_gone = true;
        self.changed.notify_all();
    }

    fn lock(&self) -> MutexGuard<'_, FlowState> {
        // Whoever panicked has left whole numbers.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait<'a>(&self, state: MutexGuard<'a, FlowState>) -> MutexGuard<'a, FlowState> {
        self.changed
            .wait(state)
            .unwrap_or_else(PoisonError::into_inner)
    }
}
