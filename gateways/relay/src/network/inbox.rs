//! [`Inbox`]: what arrives, until the relay's one thread takes it.

use std::cell::Cell;
use std::os::fd::OwnedFd;
use std::sync::Arc;

use ipc_types::MonotonicNs;
use zenoh::Wait;
use zenoh::bytes::ZBytes;
use zenoh::sample::Sample;

use crate::failure::NetworkError;
use crate::queue::{Queue, Room};

/// What arrives under a key expression.
pub struct Inbox {
    queues: Arc<Queues>,
    key: String,
    /// At how many dropped messages the next line is logged.
    next_line: Cell<u64>,
    _subscriber: zenoh::pubsub::Subscriber<()>,
}

/// A sample, and when it came.
type TimedSample = (MonotonicNs, Sample);

/// A message that has come.
pub struct ReceivedMessage<'a> {
    /// Where it was sent to.
    pub key: &'a str,
    /// When it came.
    pub at: MonotonicNs,
    /// Its bytes.
    pub payload: &'a [u8],
    /// What was attached; empty when nothing was.
    pub attachment: &'a [u8],
}

/// What has arrived: under keys that were named, and under others.
struct Queues {
    own_keys: Vec<String>,
    own: Queue<TimedSample>,
    others: Queue<TimedSample>,
}

impl Queues {
    fn push(&self, sample: Sample) -> bool {
        let bytes = sample.payload().len() + sample.attachment().map_or(0, ZBytes::len);
        let key = sample.key_expr().as_str();
        let queue = match self.own_keys.iter().any(|own| own == key) {
            true => &self.own,
            false => &self.others,
        };
        queue.push(bytes, (MonotonicNs::now(), sample))
    }
}

impl Inbox {
    /// See [`Network::receive`](super::Network::receive). `arrivals` can be read when something has come.
    pub(super) fn open(
        session: &zenoh::Session,
        arrivals: &Arc<OwnedFd>,
        key: &str,
        own: Vec<String>,
        room: Room,
    ) -> Result<Inbox, NetworkError> {
        let queues = Arc::new(Queues {
            own_keys: own,
            own: Queue::new(room),
            others: Queue::new(room),
        });
        let (arriving, arrivals) = (Arc::clone(&queues), Arc::clone(arrivals));
        let callback = move |sample: Sample| {
            if arriving.push(sample) {
                // It fails when it has been written 2⁶⁴ − 2 times, and can be read then.
                let _ = rustix::io::write(&*arrivals, &1_u64.to_ne_bytes());
            }
        };
        let subscriber = session
            .declare_subscriber(key.to_owned())
            .callback(callback)
            .wait()
            .map_err(|error| {
                NetworkError::new(format!("nothing can be received at {key}"), error)
            })?;
        Ok(Inbox {
            queues,
            key: key.to_owned(),
            next_line: Cell::new(1),
            _subscriber: subscriber,
        })
    }

    /// Hands on every message that is there, those under named keys first, each kind in the order of arrival, and none that comes
    /// meanwhile.
    pub fn drain(&self, mut take: impl FnMut(&ReceivedMessage<'_>)) {
        for (at, sample) in self.queues.own.take().chain(self.queues.others.take()) {
            let payload = sample.payload().to_bytes();
            let attachment = sample.attachment().map(|bytes| bytes.to_bytes());
            take(&ReceivedMessage {
                key: sample.key_expr().as_str(),
                at,
                payload: &payload,
                attachment: attachment.as_deref().unwrap_or_default(),
            });
        }
        self.note_dropped();
    }

    /// Said once, and then each time that their number has doubled: what the relay did not take in time is no loss of the link.
    fn note_dropped(&self) {
        let count = self.queues.own.dropped() + self.queues.others.dropped();
        if count >= self.next_line.get() {
            self.next_line.set(count.saturating_mul(2));
            tracing::warn!(
                key = self.key,
                count,
                "messages were dropped because this relay did not take them in time"
            );
        }
    }
}
