//! The DSP's queue of errors (`docs/protocol.md` section 8.6).

use std::collections::VecDeque;

use dsp_protocol::DspErrorCode;

/// Places of the queue, see section 8.6. An error that finds it full is dropped: the first ones show the cause.
const PLACES: usize = 16;

/// Errors that wait to be sent, oldest first.
#[derive(Clone, Debug, Default)]
pub struct ErrorQueue {
    errors: VecDeque<DspErrorCode>,
    dropped: u64,
}

impl ErrorQueue {
    /// Appends an error, or drops it when the queue is full.
    pub fn push(&mut self, error: DspErrorCode) {
        if self.errors.len() < PLACES {
            self.errors.push_back(error);
        } else {
            self.dropped += 1;
        }
    }

    /// Takes out the oldest error.
    pub fn pop(&mut self) -> Option<DspErrorCode> {
        self.errors.pop_front()
    }

    /// Forgets all errors.
    pub fn clear(&mut self) {
        self.errors.clear();
    }

    /// Errors that wait.
    pub fn len(&self) -> usize {
        self.errors.len()
    }

    /// Whether none waits.
    pub fn is_empty(&self) -> bool {
        self.errors.is_empty()
    }

    /// Errors that found the queue full.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sixteen_fit_and_the_newest_are_dropped() {
        let mut queue = ErrorQueue::default();
        for code in 1..=20 {
            queue.push(DspErrorCode(code));
        }
        assert_eq!((queue.len(), queue.dropped()), (16, 4));
        assert_eq!(queue.pop(), Some(DspErrorCode(1)));
        queue.push(DspErrorCode(99));
        let rest: Vec<u16> = std::iter::from_fn(|| queue.pop())
            .map(|code| code.0)
            .collect();
        assert_eq!(
            rest,
            [2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 99]
        );
    }
}
