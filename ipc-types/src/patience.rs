//! [`Patience`]: for how long a publisher of a test waits for its subscribers.

use std::fmt::{self, Debug, Formatter};
use std::sync::Arc;
use std::thread;
use std::time::Duration;

/// How long a waiting publisher sleeps before it looks again: the transport does not say when a queue is read.
const LOOK: Duration = Duration::from_millis(1);

/// What a publisher of a test asks, again and again, while a sample has no room: whether to wait on.
///
/// It has none while the queue of a subscriber is full, which otherwise loses it, and while there is no subscriber and
/// [`HISTORY`](crate::service::HISTORY) samples wait for the first one.
#[derive(Clone)]
pub struct Patience(Arc<dyn Fn(Duration) -> bool + Send + Sync>);

impl Patience {
    /// `is_left` gets for how long the sample has waited. It is asked once a millisecond.
    pub fn new(is_left: impl Fn(Duration) -> bool + Send + Sync + 'static) -> Patience {
        Patience(Arc::new(is_left))
    }

    /// Each sample waits for so long at most.
    pub fn up_to(limit: Duration) -> Patience {
        Patience::new(move |waited| waited < limit)
    }

    /// Whether to look again, after a moment.
    pub(crate) fn is_left(&self, waited: Duration) -> bool {
        let is_left = (self.0)(waited);
        if is_left {
            thread::sleep(LOOK);
        }
        is_left
    }
}

impl Debug for Patience {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        formatter.write_str("Patience")
    }
}
